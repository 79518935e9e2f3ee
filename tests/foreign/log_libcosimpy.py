"""SYSTEM.ssp COUNT FOLDER: run a system with libcosimpy, whose own observer writes a CSV for each FMU there."""

from __future__ import annotations

import sys

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver

log_output_level(CosimLogLevel.WARNING)
execution = CosimExecution.from_ssp_file(sys.argv[1])
assert execution.add_observer(CosimObserver.create_to_dir(sys.argv[3]))
assert execution.step(int(sys.argv[2]))
