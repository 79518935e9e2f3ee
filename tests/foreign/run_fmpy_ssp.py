"""SYSTEM.ssp STOP STEP RESULT [SET.ssv]: run a system with fmpy.ssp.simulation; record all outputs as it has them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd, read_ssv


def main(system: str, stop: float, step: float, result: Path, parameter_set: str | None) -> None:
    parameters = read_ssv(parameter_set) if parameter_set else None
    found = simulate_ssp(system, stop_time=stop, step_size=step, parameter_set=parameters)
    elements = read_ssd(system).system.elements
    names = ["time", *(f"{e.name}.{c.name}" for e in elements for c in e.connectors if c.kind == "output")]
    rows = np.column_stack([found[name] for name in names])
    result.write_bytes(" ".join(names).encode() + b"\n" + rows.tobytes())


main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), Path(sys.argv[4]), sys.argv[5] if len(sys.argv) > 5 else None)
