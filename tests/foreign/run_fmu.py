"""FMU STOP RESULT: simulate one FMU with fmpy, step 1 ms; record all its real variables but the time."""

from __future__ import annotations

import sys
from pathlib import Path

import fmpy
import numpy as np


def main(fmu: str, stop: float, result: Path) -> None:
    variables = fmpy.read_model_description(fmu, validate=False).modelVariables
    names = [v.name for v in variables if v.type == "Real" and v.causality in ("output", "local")]
    found = fmpy.simulate_fmu(fmu, stop_time=stop, output_interval=1e-3, output=names, validate=False)
    rows = np.column_stack([found[name] for name in ("time", *names)])
    result.write_bytes(" ".join(("time", *names)).encode() + b"\n" + rows.tobytes())


main(sys.argv[1], float(sys.argv[2]), Path(sys.argv[3]))
