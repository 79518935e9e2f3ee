"""How a run rides: settling, peaks, weighted acceleration, strut travel, tyre loads, energy of the actuators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import signal
from scipy.interpolate import CubicSpline

from fmu_src.quantities import ACCELERATIONS, FORCES, POSITIONS, STRUT_TRAVELS, TYRE_FORCES
from fmu_src.vehicle.parameters import Car

from .errors import InputError
from .reference import car_of
from .trajectory import Array, Run
from .tyres import static_loads, time_below_zero, tyre_loads

BODY = POSITIONS[:3]  # heave, roll, pitch
BAND = 0.05  # of its largest value: a motion within it from then on has settled
RUNNING = 1.0  # s; time of the running root mean square
FINE = 1e-3  # s; the weighting's filter is bent at high frequencies by samples further apart
COARSE = 0.01  # s; rows further apart hold too little of the acceleration up to 16 Hz
NEEDED = (*BODY, ACCELERATIONS[0], *STRUT_TRAVELS, *TYRE_FORCES, *FORCES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ride:
    """Numbers of one run, SI units; those of the body for heave, roll, pitch (3). nan: not settled in this run."""

    settled: Array
    peaks: Array
    weighted: float
    transient: float
    travel: float
    load_variation: float
    contact_lost: float
    energy_spent: float
    energy_taken: float


def ride(run: Run) -> Ride:
    """The numbers of a run. Raises InputError for columns that were not recorded."""
    if missing := lacking(run):
        raise InputError(f"the ride cannot be judged: the run lacks the columns {', '.join(missing)}")
    time, trajectory = run.trajectory.time, run.trajectory
    body = trajectory.columns([q.name for q in BODY])
    weighted, transient = weighted_acceleration(time, trajectory[ACCELERATIONS[0].name])
    travels, loads = trajectory.columns([q.name for q in STRUT_TRAVELS]), tyre_loads(run)
    work = trajectory.columns([q.name for q in FORCES])[:-1] * np.diff(travels, axis=0)  # forces are held
    duration = time[-1] - time[0]
    steps = np.diff(time)[:, None]
    deviations = np.sqrt(np.sum(steps * (loads[1:] - static_loads(run)) ** 2, axis=0) / duration)
    rest = body_period(car_of(run.parameters))
    return Ride(
        settled=np.array([settling_time(time, column, rest) for column in body.T]),
        peaks=np.abs(body).max(axis=0),
        weighted=weighted,
        transient=transient,
        travel=float(np.abs(travels).max()),
        load_variation=float((deviations / static_loads(run)).max()),
        contact_lost=sum(time_below_zero(time, load) for load in loads.T),
        energy_spent=float(work[work > 0.0].sum()),
        energy_taken=float(abs(work[work < 0.0].sum())),
    )


def lacking(run: Run) -> list[str]:
    """Columns that the numbers need and that were not recorded."""
    return [q.name for q in NEEDED if q.name not in run.trajectory.names]


def body_period(car: Car) -> float:
    """Of the body's heave on its struts [s]; infinite without struts."""
    stiffness = 2.0 * (car.c1 + car.c2)
    return float(2.0 * np.pi * np.sqrt(car.m / stiffness)) if stiffness else float("inf")


def settling_time(time: Array, x: Array, rest: float) -> float:
    """When [s] |x| is for the last time beyond `BAND` of its largest value; nan if the time `rest` [s] does not follow.

    Without that a motion that happens to cross zero at the end would have settled.
    """
    beyond = np.flatnonzero(np.abs(x) > BAND * np.abs(x).max())
    if not beyond.size:
        return float(time[0])
    after = time[beyond[-1] + 1 :]
    return float(after[0]) if after.size and after[-1] - after[0] >= rest else float("nan")


# ------------------------------------------------------------------ ISO 2631-1, vertical: Wk
def wk() -> tuple[Array, Array, float]:
    """Zeros, poles [rad/s] and gain of Wk in the form of ISO 8041: band limits, acceleration-velocity, upward step."""
    f1, f2, f3, f4, Q4, f5, Q5, f6, Q6 = 0.4, 100.0, 12.5, 12.5, 0.63, 2.37, 0.91, 3.35, 0.91
    w1, w2, w3, w4, w5, w6 = (2.0 * np.pi * f for f in (f1, f2, f3, f4, f5, f6))
    root = np.sqrt(2.0)  # 1/Q1 and 1/Q2
    numerators = ([1.0, 0.0, 0.0], [w2**2], [1.0 / w3, 1.0], [1.0 / w5**2, 1.0 / (Q5 * w5), 1.0])
    denominators = (
        [1.0, root * w1, w1**2],
        [1.0, root * w2, w2**2],
        [1.0 / w4**2, 1.0 / (Q4 * w4), 1.0],
        [1.0 / w6**2, 1.0 / (Q6 * w6), 1.0],
    )
    systems = [signal.tf2zpk(b, a) for b, a in zip(numerators, denominators, strict=True)]
    gain = float(np.prod([k for _, _, k in systems])) * (w5 / w6) ** 2  # the step's own gain, in its form with ratios
    return np.concatenate([z for z, _, _ in systems]), np.concatenate([p for _, p, _ in systems]), gain


def wk_filter(step: float) -> Array:
    """Wk for samples `step` [s] apart, as second-order sections (bilinear transform)."""
    zeros, poles, gain = signal.bilinear_zpk(*wk(), fs=1.0 / step)
    return np.asarray(signal.zpk2sos(zeros, poles, gain))


def weighted_acceleration(time: Array, a: Array) -> tuple[float, float]:
    """Root mean square [m/s²] of the acceleration a weighted by Wk, and the largest of those over a running second.

    Between rows further apart than `FINE` the acceleration is taken from a cubic spline, which keeps a vibration of
    16 Hz within 1 % up to `COARSE`. The last row of a run whose stop time is no multiple of its step is left out.
    """
    if len(time) < 3:
        return float("nan"), float("nan")
    step = time[1] - time[0]
    even = len(time) if abs(time[-1] - time[-2] - step) < 1e-6 * step else len(time) - 1
    parts = int(np.ceil(step / FINE - 1e-6))
    fine, step = a[:even], step / parts
    if parts > 1:
        fine = CubicSpline(time[:even], fine)(time[0] + step * np.arange((even - 1) * parts + 1))
    squares = np.asarray(signal.sosfilt(wk_filter(step), fine)) ** 2
    mean = np.concatenate([[0.0], np.cumsum(squares)])
    n = min(max(1, round(RUNNING / step)), len(squares))
    return float(np.sqrt(squares.mean())), float(np.sqrt(((mean[n:] - mean[:-n]) / n).max()))


def notes(runs: list[Run]) -> list[str]:
    """What the numbers of these runs, side by side, do not say."""
    times = [run.trajectory.time for run in runs]
    durations = [f"{t[-1] - t[0]:g}" for t in times]
    found = []
    if len(set(durations)) > 1:
        found.append(f"The runs last {', '.join(durations)} s: r.m.s. values are over each one's own time.")
    if coarse := [f"{t[1] - t[0]:g}" for t in times if t[1] - t[0] > COARSE * (1 + 1e-6)]:
        found.append(
            f"Rows {', '.join(coarse)} s apart: the weighted acceleration lacks what they do not hold; wanted steps of "
            f"at most {COARSE:g} s."
        )
    return found


# ------------------------------------------------------------------ the table
ROWS: tuple[tuple[str, str, float, Any], ...] = (
    ("heave z settled at", "s", 1.0, lambda r: r.settled[0]),
    ("roll ψ settled at", "s", 1.0, lambda r: r.settled[1]),
    ("pitch φ settled at", "s", 1.0, lambda r: r.settled[2]),
    ("largest heave z", "mm", 1e3, lambda r: r.peaks[0]),
    ("largest roll ψ", "mrad", 1e3, lambda r: r.peaks[1]),
    ("largest pitch φ", "mrad", 1e3, lambda r: r.peaks[2]),
    ("heave acceleration, weighted by Wk, r.m.s.", "m/s²", 1.0, lambda r: r.weighted),
    ("the same, largest over a running second", "m/s²", 1.0, lambda r: r.transient),
    ("largest strut travel", "mm", 1e3, lambda r: r.travel),
    ("largest r.m.s. of a tyre's load over its static load", "%", 1e2, lambda r: r.load_variation),
    ("contact lost, all tyres together", "ms", 1e3, lambda r: r.contact_lost),
    ("energy given by the actuators", "J", 1.0, lambda r: r.energy_spent),
    ("energy taken by the actuators", "J", 1.0, lambda r: r.energy_taken),
)


def table(rides: list[Ride]) -> list[tuple[str, str, list[float]]]:
    """Rows of words, unit and one number for each ride."""
    return [(words, unit, [factor * float(get(each)) for each in rides]) for words, unit, factor, get in ROWS]
