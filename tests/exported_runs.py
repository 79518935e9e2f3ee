"""Runs as other tools export them, honest and tampered with, for the tests of what is proved of exports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from analysis.cosimulation import simulate
from analysis.scenario import read_scenario
from analysis.trajectory import Run
from fmu_src.quantities import STATES

NAMES = [q.name for q in STATES]
STOP = 0.45


def run_of(name: str, **changes: Any) -> Run:
    """A built-in scenario, run until STOP with these changes."""
    scenario = read_scenario(name)
    parameters = {**scenario.parameters, **changes.pop("parameters", {})}
    return simulate(replace(scenario, **{"stop_time": STOP, "parameters": parameters, **changes}))


def tampered(run: Run, change: Callable[[np.ndarray[Any, Any]], None]) -> Run:
    """The run with its states (N, 14) changed in place."""
    where = [run.trajectory.names.index(name) for name in NAMES]
    values, states = run.trajectory.values.copy(), run.trajectory.columns(NAMES)
    change(states)
    values[:, where] = states
    return replace(run, trajectory=replace(run.trajectory, values=values))


def shifted(states: np.ndarray[Any, Any]) -> None:
    """By 2e-4 rad from a row on."""
    states[300:, NAMES.index("axle_r.roll")] += 2e-4


def halved(states: np.ndarray[Any, Any]) -> None:
    """All of them."""
    states *= 0.5
