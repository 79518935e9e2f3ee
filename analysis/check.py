"""What is claimed of every run, and checked on its exported trajectory."""

from __future__ import annotations

import numpy as np

from fmu_src.quantities import FORCES, ROAD_BOWS, ROAD_HEIGHTS, ROAD_RATES, STATES, STRUT_TRAVELS
from fmu_src.road.profiles import SNAP

from . import discrepancy
from .discrepancy import Forces, scales
from .energy import balance
from .errors import InputError
from .findings import Finding
from .reference import car_of, integrate, road_of
from .trajectory import Array, Run

# Largest deviation and energy residual of a run at H = 1 ms, rounded up, and their orders in H (tests measure them).
# The road is interpolated over the step ("end"; with all its corners on communication points, or with corners within
# steps), or carried on from its start ("start"; order 1 where tyres have dampers, whose road rate is held).
DEVIATION = {"end": (1e-6, 3), "end, corners within steps": (1e-3, 2), "start": (2e-3, 2), "start, damped": (1e-2, 1)}
ENERGY = {"end": (1e-7, 4), "end, corners within steps": (1e-5, 2), "start": (2e-3, 2), "start, damped": (1e-2, 1)}
LOOSEST = 1e-2  # a run that is further off is no motion of this car, however long its steps
MILLISECOND = 1e-3
LASTS = 0.1  # s from rest; honest runs that end earlier may fail (tests measure from when on they hold)
NEEDED = (*STATES, *ROAD_HEIGHTS, *ROAD_RATES, *ROAD_BOWS, *FORCES, *STRUT_TRAVELS)


def check(run: Run) -> list[Finding]:
    """Findings on a run: it is a motion of (3.1)–(3.7), its energy balances, and how far it is from x_lin of (2.3).

    Raises InputError for `lacking`.
    """
    if missing := lacking(run):
        raise InputError(f"the run cannot be checked: it lacks the columns {', '.join(missing)}")
    if len(run.trajectory.time) < 2:
        raise InputError("trajectory.csv: wanted at least two rows to check a motion, got one")
    forces, switches = _held(run)
    x, t = run.trajectory.columns([q.name for q in STATES]), run.trajectory.time
    expected = integrate(run.parameters, forces, switches, x[0], t)
    tolerance = own_error(run)
    return [
        _is_a_motion(x, expected, tolerance),
        _energy_balances(run),
        *discrepancy.findings(run, expected, forces, switches, tolerance),
    ]


def lacking(run: Run) -> list[str]:
    """Columns that the checks need and that were not recorded."""
    return [q.name for q in NEEDED if q.name not in run.trajectory.names]


def too_short(run: Run) -> str:
    """Why an honest run may fail, as it ends within LASTS of rest; "" if it does not.

    States that a road or a start has just begun to reach grow by high powers of time: of their maxima, as they are
    after a few steps, the error of a single step is more than any tolerance.
    """
    t, moves = run.trajectory.time, run.trajectory.columns([q.name for q in STATES]).any(axis=1)
    lasted = float(t[-1] - t[max(0, int(moves.argmax()) - 1)])
    if not moves.any() or lasted >= LASTS - SNAP:
        return ""
    return f"the run ends {lasted:.3g} s after rest; of honest runs that end before {LASTS:g} s some findings may fail"


def own_error(run: Run) -> float:
    """What a run may deviate from the motion of the full equations, over each state's maximum."""
    return _tolerance(DEVIATION, run)


def _is_a_motion(x: Array, expected: Array, tolerance: float) -> Finding:
    """The exported states against DOP853 on the full equations, with the exact road and the exported, held forces."""
    deviation = np.abs(x - expected).max(axis=0) / scales(expected)
    worst = int(np.argmax(deviation))
    return Finding(
        claim="the run is a motion of the car on this road under these forces: deviation from a direct integration, "
        "over each state's maximum",
        equation="(3.1)–(3.7)",
        measured=float(deviation[worst]),
        expected=0.0,
        tolerance=tolerance,
        unit="1",
        source=f"trajectory.csv, column {STATES[worst].name}",
    )


def _held(run: Run) -> tuple[Forces, list[float]]:
    """The exported forces as a function of time, held from each row to the next, and the times at which they change."""
    t, u = run.trajectory.time, run.trajectory.columns([q.name for q in FORCES])
    switches = t[1:][np.any(np.diff(u, axis=0) != 0.0, axis=1)]
    table = u.tolist()

    def forces(time: float, _: object) -> list[float]:
        return table[max(0, int(np.searchsorted(t, time, side="right")) - 1)]

    return forces, switches.tolist()


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
    """The step is that of the rows, the longest of them, whatever the record says."""
    step = float(np.diff(run.trajectory.time).max(initial=0.0))
    level, order = levels[_coupling(run)]
    return min(LOOSEST, level * max(1.0, step / MILLISECOND) ** order)


def _coupling(run: Run) -> str:
    """Which of the levels above is this run's."""
    if run.parameters.get("road_sampling") != "end":
        return "start, damped" if any(run.reals("bp1", "bp2")) else "start"
    t = run.trajectory.time
    corners = np.array([c for c in road_of(run.parameters).corners(t[-1]) if c > t[0]])
    nearest = t[np.clip(np.searchsorted(t, corners - SNAP), 0, len(t) - 1)]
    return "end, corners within steps" if np.any(np.abs(nearest - corners) > SNAP) else "end"
