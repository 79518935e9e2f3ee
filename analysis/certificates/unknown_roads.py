"""Motions on every road of a class whose heights are known at the rows only: what holds for all, at all times.

Between rows a road of class `curv` has |h''| ≤ H2 (corners only at rows), of class `lip` |h'| ≤ H1. The straight line
from height to height is in the middle of what a class leaves open. x_lin is as far off that of the straight lines as
∫|e^(At) B| dt makes of it; x − x_lin is known much better, as it feels the road only through x, which the rows show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import arb_mat
from scipy.linalg import expm

from fmu_src.quantities import ROAD_HEIGHTS

from ..bertolino_baksa.balls import Array, ExactSystem, matrix, rounded
from ..bertolino_baksa.input_rows import RowClass
from ..bertolino_baksa.norms import Metric
from ..bertolino_baksa.sampled import EPS, Between, Samples, between
from ..bertolino_baksa.tube import input_matrix
from ..errors import InputError
from .falsification import Rows, judged

TURN = 0.1  # rad that the fastest mode turns over a step of ∫|e^(At) B| dt
TILTED = 6  # ψ2: heights enter (3.2)–(3.4) linearly, and (3.7) times cos ψ2
SLACK = 1.0 + 1e-9  # for the roundings of times and heights


def road_class(text: str) -> RowClass:
    """curv:H2 or lip:H1. Raises InputError for anything else."""
    kind, _, number = text.partition(":")
    try:
        bound = float(number)
    except ValueError:
        bound = np.nan
    if kind not in ("curv", "lip") or not 0.0 <= bound < np.inf:
        raise InputError(f"--road-class {text}: wanted exact, curv:H2 [m/s^2] or lip:H1 [m/s]")
    return RowClass(kind, bound)


def samples(times: Array, x: Array, allowed: Array, heights: Array, rounding: Array, roads: RowClass) -> Samples:
    """Rows and what the class leaves open between them.

    x, allowed : (N, 14), the rows' states and how far a motion may be off them.
    heights, rounding : (N, 4) [m].  Raises InputError where the heights contradict the class.
    """
    steps = np.diff(times)
    slopes, digits = np.diff(heights, axis=0) / steps[:, None], np.maximum(rounding[1:], rounding[:-1])
    loose = 2.0 * digits / steps[:, None]
    if roads.kind == "lip" and np.any(steep := np.abs(slopes) - loose > roads.bound * SLACK):
        row, wheel = np.argwhere(steep)[0].tolist()
        raise InputError(
            f"the heights rise faster than {roads.bound:g} m/s: by {abs(slopes[row, wheel]):.4g} m/s from row "
            f"{row + 2} on, column {ROAD_HEIGHTS[wheel].name}"
        )
    peak, mean, rate = roads.between(steps * SLACK, slopes, loose)
    inputs = np.stack([np.hstack([h, slopes]) for h in (heights[:-1], heights[1:])], axis=1)
    off = (np.hstack([height + digits, rate]) * SLACK for height in (peak, mean))
    return Samples(times, x, allowed, inputs, *off)


@dataclass(frozen=True, slots=True)
class AllRoads:
    """What holds for all motions that fit the rows, on all roads of the class."""

    found: Between
    spread: Array  # (N, n) bounds, at the rows, of how far x_lin may be off that of the straight lines

    def rows(self, x: Array, allowed: Array) -> Rows:
        """Judge rows x (N, n) of which the motion may be off by `allowed` (N, n)."""
        expected, e, off = self.found.rows()
        return judged(x, expected, off + self.spread + allowed, e)


def on_all_roads(system: ExactSystem, metric: Metric, rows: Samples) -> AllRoads:
    """Raises NotProvedError if the rows leave too much open."""
    since = rows.times - rows.times[0]
    return AllRoads(
        between(system, metric, rows, TILTED), _spread(metric, input_matrix(system), since, rows.peak.max(axis=0))
    )


def _spread(metric: Metric, B: arb_mat, times: Array, peak: Array) -> Array:
    """Bounds (N, n) of |∫ e^(As) B η(s) ds| from 0 to each time, for |η| ≤ peak (m,).

    Over a step by its two ends and what their chord may miss: ‖e^(As) y‖_S ≤ ‖y‖_S.
    """
    A, moved = (rounded(matrix(metric.S) * m)[0] for m in (metric.A * metric.inverse, B))
    back, fastest = rounded(metric.inverse)[0], float(np.abs(np.linalg.eigvals(A)).max())
    count = int(times[-1] * fastest / TURN) + 1
    step = times[-1] / count
    over, ends = expm(A * step), [moved]
    for _ in range(count):
        ends.append(over @ ends[-1])
    y = np.array(ends)
    sizes, bends = np.abs(back @ y), np.sqrt(((A @ A @ y[:-1]) ** 2).sum(axis=1)) * step**2 / 8.0
    rounding = EPS * np.sqrt((moved**2).sum(axis=0)) * count
    steps = (sizes[:-1] + sizes[1:]) / 2.0 + metric.reach[:, None] * (bends + rounding)[:, None, :]
    whole = np.concatenate([np.zeros((1, len(A))), np.cumsum(steps @ peak, axis=0) * step])
    return np.asarray(whole[np.minimum(np.ceil(times / step * SLACK).astype(int), count)] * SLACK)
