"""The discrepancy between a run and its linear approximation x_lin, Eq. (2.3): §2's question, on exported trajectories.

The car's equations are odd in (x, h, u): if start, road and forces shrink by one factor, x − x_lin shrinks by its cube.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fmu_src.quantities import FORCES, POSITIONS, STATES
from fmu_src.road.profiles import HARMONICS

from .car import actuators, car_form, road_signal
from .findings import Finding
from .methods.linear_response import held_response, linear_response
from .reference import car_of, integrate, road_parameters
from .trajectory import Array, Run

Forces = Callable[[float, list[float]], Sequence[float]]
SMALL = 0.02  # m or rad: the largest coordinate at which the order is measured
SIZES = (0.25, 0.5, 1.0)  # of that: A, 2A, 4A
RESOLVED = 1e-9  # of a state: a discrepancy that stands out of the direct integrations' own error, which is linear in
# the amplitude: measured up to 1e-10, on bumps, steps and sines (a test asserts a fifth of this) …
LEAST = 1e-3  # … and of the largest of all states for one that is as small, as the error comes from the others too


def linear_states(run: Run) -> Array:
    """x_lin (n, 14) at the run's times, from its first row, over its road, under its exported forces.

    The forces are those of the run, held from each row to the next: the linear plant is compared, not another loop.
    """
    t, u = run.trajectory.time, run.trajectory.columns([q.name for q in FORCES])
    x0 = run.trajectory.columns([q.name for q in STATES])[0]
    car, road = car_of(run.parameters), road_signal(road_parameters(run.parameters), t[0])
    form = car_form(car, order=1)
    passive = linear_response(form.A, form.B, x0, road, t)
    return (passive + held_response(form.A, actuators(car), u.T, t)).T


def scales(x: Array) -> Array:
    """Largest absolute value of each state; of states that (nearly) rest, a millionth of the largest of all."""
    largest = np.abs(x).max(axis=0)
    return np.maximum(largest, max(1e-6 * largest.max(), 1e-12))


def findings(run: Run, expected: Array, forces: Forces, switches: Sequence[float], tolerance: float) -> list[Finding]:
    """The run's discrepancy is that of the car, also in each state; and of order 3, unless the motion is a linear one.

    expected  : the motion by direct integration (n, 14).  forces, switches : as `integrate` takes them.
    tolerance : of the run's states over their maxima.
    """
    t, linear = run.trajectory.time, linear_states(run)
    x = run.trajectory.columns([q.name for q in STATES])
    scale_of = scales(expected)
    relative, exact = (np.abs(y - linear) / scale_of for y in (x, expected))
    row, state = (int(i) for i in np.unravel_index(np.argmax(exact), exact.shape))
    place = f"column {STATES[state].name} at t = {t[row]:.4g} s"
    size = Finding(
        claim="the run differs from the linear approximation x_lin as the car does: largest discrepancy, over each "
        "state's maximum",
        equation="(2.3)",
        measured=float(relative.max()),
        expected=float(exact.max()),
        tolerance=tolerance,
        unit="1",
        source=f"trajectory.csv; {place}"
        + ("; less than the run's own error may be" if exact.max() < tolerance else ""),
    )
    each = _of_each_state(t, relative * scale_of, exact * scale_of, tolerance * scale_of)
    last = int(exact.argmax(axis=0).max())
    order = _order(_slopes(run, forces, switches, linear[: last + 1]), t[last]) if last else []
    return [size, *order, *each]


def _slopes(run: Run, forces: Forces, switches: Sequence[float], linear: Array) -> Array:
    """Order in the amplitude (14) of each state's largest |x − x_lin| over the rows of x_lin (n, 14); nan: unresolved.

    By direct integrations of the same motion at SIZES, of which the largest has coordinates up to SMALL.
    """
    scale = SMALL / max(float(np.abs(linear[:, : len(POSITIONS)]).max()), 1e-12)
    t, x0 = run.trajectory.time[: len(linear)], linear[0]
    factors = scale * np.array(SIZES)
    motions = (_motion(run, forces, switches, x0, t, factor) - factor * linear for factor in factors)
    largest = np.array([np.abs(off).max(axis=0) for off in motions])
    states = np.abs(linear).max(axis=0)
    resolved = largest[0] > RESOLVED * factors[0] * np.maximum(states, LEAST * states.max())
    slopes = np.polyfit(np.log(SIZES), np.log(np.where(resolved, largest, 1.0)), 1)[0]
    return np.where(resolved, slopes, np.nan)


def _order(slopes: Array, end: float) -> list[Finding]:
    """The order of the state that is furthest from 3; nothing of a motion that is a linear one, to what is resolved."""
    resolved = np.flatnonzero(np.isfinite(slopes))
    if not len(resolved):
        return []
    worst = int(resolved[np.argmax(np.abs(slopes[resolved] - 3.0))])
    sizes = ", ".join(f"{1e3 * SMALL * size:g}" for size in SIZES)
    return [
        Finding(
            claim="that discrepancy is of order 3 in the amplitude of start, road and forces: slope of each state's "
            f"largest |x − x_lin| over direct integrations with coordinates up to {sizes} mm or mrad, worst state",
            equation="(2.3)",
            measured=float(slopes[worst]),
            expected=3.0,
            tolerance=0.1,
            unit="1",
            source=f"column {STATES[worst].name}; {len(resolved)} of {len(slopes)} states are told from the "
            f"integrations' error, to t = {end:.4g} s",
        )
    ]


def _of_each_state(t: Array, away: Array, exact: Array, tolerances: Array) -> list[Finding]:
    """Each state's largest discrepancy in its unit, and when; away, exact (n, 14): |x − x_lin| of the run, the car."""
    return [
        Finding(
            claim=f"discrepancy of {q.name}: largest |x − x_lin| [{q.unit}]",
            equation="(2.3)",
            measured=float(away[:, k].max()),
            expected=float(exact[:, k].max()),
            tolerance=float(tolerances[k]),
            unit=q.unit,
            source=f"trajectory.csv, column {q.name} at t = {t[away[:, k].argmax()]:.4g} s",
        )
        for k, q in enumerate(STATES)
    ]


def _motion(run: Run, forces: Forces, switches: Sequence[float], x0: Array, times: Array, factor: float) -> Array:
    """The motion at the times, by direct integration, with start, road and forces so many times as large."""
    heights = {name: factor * float(run.parameters[name]) for name in ("A", *HARMONICS) if name in run.parameters}

    def scaled(time: float, state: list[float]) -> list[float]:
        return [factor * u for u in forces(time, state)]

    return integrate({**run.parameters, **heights}, scaled, switches, factor * x0, times)
