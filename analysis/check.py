"""What is claimed of every run, and checked on its exported trajectory."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fmu_src.quantities import FORCES, STATES

from .energy import balance
from .errors import InputError
from .findings import Finding
from .reference import car_of, integrate
from .trajectory import Array, Run

# Largest deviation and energy residual of a run at H = 1 ms, rounded up, and their orders in H (tests measure all
# four): the road is interpolated over the step ("end") or carried on from its start ("start").
DEVIATION = {"end": (1e-6, 3), "start": (2e-3, 2)}
ENERGY = {"end": (1e-7, 4), "start": (2e-3, 2)}
MILLISECOND = 1e-3


def check(run: Run) -> list[Finding]:
    """Findings on a run: it is a motion of (3.1)–(3.7), and its energy balances.

    Raises InputError where a column that is needed was not recorded.
    """
    return [_is_a_motion(run), _energy_balances(run)]


def _is_a_motion(run: Run) -> Finding:
    """The exported states against DOP853 on the full equations, with the exact road and the exported, held forces."""
    names = [q.name for q in STATES]
    x, t = run.trajectory.columns(names), run.trajectory.time
    forces, switches = _held(run)
    expected = integrate(run.parameters, forces, switches, x[0], t)
    deviation = np.abs(x - expected).max(axis=0) / _scales(expected)
    worst = int(np.argmax(deviation))
    return Finding(
        claim="the run is a motion of the car on this road under these forces: deviation from a direct integration, "
        "over each state's maximum",
        equation="(3.1)–(3.7)",
        measured=float(deviation[worst]),
        expected=0.0,
        tolerance=_tolerance(DEVIATION, run),
        unit="1",
        source=f"trajectory.csv, column {names[worst]}",
    )


def _held(run: Run) -> tuple[Callable[[float, object], list[float]], list[float]]:
    """The exported forces as a function of time, held from each row to the next, and the times at which they change."""
    t, u = run.trajectory.time, run.trajectory.columns([q.name for q in FORCES])
    switches = t[1:][np.any(np.diff(u, axis=0) != 0.0, axis=1)]
    table = u.tolist()

    def forces(time: float, _: object) -> list[float]:
        return table[max(0, int(np.searchsorted(t, time, side="right")) - 1)]

    return forces, switches.tolist()


def _scales(x: Array) -> Array:
    """Largest absolute value of each state; of states that (nearly) rest, a millionth of the largest of all."""
    largest = np.abs(x).max(axis=0)
    return np.maximum(largest, max(1e-6 * largest.max(), 1e-12))


def _energy_balances(run: Run) -> Finding:
    parts = balance(car_of(run.parameters), run.trajectory)
    turnover = max(abs(parts.road) + abs(parts.actuators), parts.dissipated, abs(parts.stored), 1e-12)
    return Finding(
        claim="energy stored = work of road and actuators − loss in dampers: residual over the turnover",
        equation="d(T + V)/dt",
        measured=parts.residual / turnover,
        expected=0.0,
        tolerance=_tolerance(ENERGY, run),
        unit="1",
        source=f"trajectory.csv; turnover {turnover:.4g} J",
    )


def _tolerance(levels: dict[str, tuple[float, int]], run: Run) -> float:
    step, sampling = run.record["scenario"].get("step"), run.parameters.get("road_sampling")
    if not isinstance(step, float) or not step > 0.0 or sampling not in levels:
        raise InputError(f"run.json: wanted scenario.step in s and road_sampling, got {step!r} and {sampling!r}")
    level, order = levels[str(sampling)]
    return level * max(1.0, step / MILLISECOND) ** order
