"""SYSTEM.ssp COUNT RESULT: run a system with libcosimpy, as the .ssp says; record all real outputs after each step."""

from __future__ import annotations

import sys
from array import array
from pathlib import Path

from libcosimpy._internal import get_last_error_message
from libcosimpy.CosimEnums import CosimVariableCausality, CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver


def main(system: str, count: int, result: Path) -> None:
    log_output_level(CosimLogLevel.WARNING)
    try:
        execution = CosimExecution.from_ssp_file(system)
    except AssertionError as error:
        sys.exit(f"{error} {get_last_error_message()}")
    real, output = CosimVariableType.REAL.value, CosimVariableCausality.OUTPUT.value
    slaves = [
        (
            s.index,
            s.name.decode(),
            [v for v in execution.slave_variables(s.index) if (v.type, v.causality) == (real, output)],
        )
        for s in execution.slave_infos()
    ]
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    data = array("d")
    for _ in range(count):
        assert execution.step(1)
        data.append(execution.status().current_time / 1e9)
        for index, _, variables in slaves:
            data.extend(observer.last_real_values(index, [v.reference for v in variables]))
    names = ["time", *(f"{name}.{v.name.decode()}" for _, name, variables in slaves for v in variables)]
    result.write_bytes(" ".join(names).encode() + b"\n" + data.tobytes())


main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]))
