"""A small run without FMUs: waves of known size, for the tests of figures and report."""

from __future__ import annotations

import numpy as np

from analysis.trajectory import Run, Trajectory
from fmu_src.quantities import ACCELERATIONS, FORCES, PARAMETERS, ROAD, STATES, STRUT_TRAVELS, TABLE, TYRE_FORCES

CAR = ("m", "m11", "m12", "m21", "m22", "m2", "a", "b")
ROAD_NAMES = ("A", "Lambda", "v0", "tau0")
EVERYTHING = tuple(q.name for q in (*ROAD, *STATES, *ACCELERATIONS, *STRUT_TRAVELS, *TYRE_FORCES, *FORCES))


def made_up_run(
    names: tuple[str, ...] = EVERYTHING, *, enabled: bool = False, title: str = "A bump", n: int = 201
) -> Run:
    """Decaying waves of 10 mm or mrad for the states, half-sine bumps for the road, forces if enabled; 0 to 2 s."""
    time = np.linspace(0.0, 2.0, n)
    columns = {}
    for number, name in enumerate(names):
        wave = np.sin(20.0 * time + number) * np.exp(-5.0 * time)
        columns[name] = {"N": 1000.0}.get(TABLE[name].unit, 0.01) * wave
    for name, delay in zip(("h_fl", "h_fr", "h_rl", "h_rr"), (0.0, 0.02, 0.25, 0.27), strict=True):
        s = time - delay
        columns[name] = np.where((s > 1e-9) & (s < 0.05 - 1e-9), 0.01 * np.sin(np.pi * s / 0.05), 0.0)
    for q in FORCES:
        columns[q.name] = 100.0 * np.exp(-time) if enabled else 0.0 * time
    trajectory = Trajectory(time=time, names=names, values=np.column_stack([columns[name] for name in names]))
    parameters = {
        "road": {"profile": "bump", **{name: PARAMETERS[name].start for name in ROAD_NAMES}, "excite_fl": True},
        "vehicle": {name: PARAMETERS[name].start for name in CAR},
        "controller": {
            "design": "half-car",
            "lambda": 1e10,
            "H1": 1.0,
            "T": 2.3,
            "horizon": "finite",
            "activation": "come-down",
            "enabled": enabled,
        },
    }
    record = {
        "format": 1,
        "scenario": {"name": "bump", "title": title, "step": 0.01, "coupling": "gauss-seidel"},
        "parameters": parameters,
        "fmus": {"vehicle": {"file": "Vehicle7DOF.fmu", "sha256": "5ha256", "guid": "9u1d"}},
        "versions": {"numpy": "2.4.6"},
    }
    return Run(trajectory=trajectory, record=record)
