"""Motions on every road of a class whose heights are known at the rows only: what holds for all, at all times.

Between rows a road of class `curv` has |h''| ≤ H2 (corners only at rows), of class `lip` |h'| ≤ H1. Polynomials near
the heights make a road of their own, with a proved tube. Any other road of the class is off it by η, its x_lin by at
most ∫|e^(At) B| dt η, and x − x_lin by what that changes in the nonlinear terms alone (`growth.perturbed`).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, arb_mat, fmpq
from numpy.polynomial import chebyshev, polynomial

from ..bertolino_baksa.balls import Array, decimal, rounded
from ..bertolino_baksa.cells import Decay, counts, decay, errors, inputs, ranges, widths
from ..bertolino_baksa.growth import perturbed
from ..bertolino_baksa.majorant import majorant
from ..bertolino_baksa.norms import Norm
from ..bertolino_baksa.tube import input_matrix
from ..errors import InputError
from .falsification import Motions

LONGEST, DEGREE = 0.02, 5  # s, of a polynomial, and its degree
FIT = 0.25  # of what the class leaves open between rows: what a polynomial may be off at them
SLACK = 1.0 + 1e-9  # for the roundings of the bounds of polynomials
ROOM, ROOM_INPUT = 1.5, 10.0  # of the box on which the equations are bounded, over the largest motion and input


@dataclass(frozen=True, slots=True)
class RoadClass:
    """All roads with |h''| ≤ bound [m/s²] between rows (kind "curv"), or |h'| ≤ bound [m/s] ("lip")."""

    kind: str
    bound: float

    def __str__(self) -> str:
        return f"{self.kind}:{self.bound:g}"

    def between(
        self, polynomials: Array, width: float, step: float, at_rows: Array, jumps: Array
    ) -> tuple[Array, Array]:
        """(4,), (4,): how far heights and rates may be off polynomials (4, k) in τ over this width [s].

        at_rows, jumps : bounds (4,) of what these are off at rows, and of its change from row to row.
        """
        if self.kind == "curv":
            open_ = self.bound + _largest_derivative(polynomials, 2) / width**2
            return at_rows + open_ * step**2 / 8.0, jumps / step + open_ * step / 2.0
        open_ = self.bound + _largest_derivative(polynomials, 1) / width
        return at_rows + open_ * step / 2.0, open_


def road_class(text: str) -> RoadClass:
    """curv:H2 or lip:H1. Raises InputError for anything else."""
    kind, _, number = text.partition(":")
    try:
        bound = float(number)
    except ValueError:
        bound = np.nan
    if kind not in ("curv", "lip") or not 0.0 <= bound < np.inf:
        raise InputError(f"--road-class {text}: wanted exact, curv:H2 [m/s^2] or lip:H1 [m/s]")
    return RoadClass(kind, bound)


@dataclass(frozen=True, slots=True)
class FittedRoad:
    """Polynomials near the heights, as the pieces of an exact system, and η of the class, for each window."""

    pieces: tuple[tuple[fmpq, Callable[[Any], list[Any]]], ...]
    eta: Array  # (windows, 8): of heights and rates


def fitted_road(times: Array, heights: Array, rounding: Array, roads: RoadClass) -> FittedRoad:
    """Windows of at most LONGEST, as long as polynomials fit: they end at the rows where the road has corners.

    heights, rounding : (N, 4) [m].  Raises InputError where the heights contradict the class.
    """
    exact = [decimal(t) for t in times.tolist()]
    pieces, eta, i = [], [], 0
    while i < len(times) - 1:
        j = i + max(1, int(np.searchsorted(times[i + 1 :], times[i] + LONGEST, side="right")))
        while True:
            rows = slice(i, j + 1)
            polynomials, off, fits = _fit(times[rows], heights[rows], rounding[rows], roads)
            if fits or j == i + 1:
                break
            j = i + (j - i) // 2 if j - i > 4 else j - 1
        pieces.append((exact[i], _inputs(polynomials, exact[i], exact[j] - exact[i])))
        eta.append(off)
        i = j
    return FittedRoad(tuple(pieces), np.array(eta))


def _fit(t: Array, h: Array, rounding: Array, roads: RoadClass) -> tuple[Array, Array, bool]:
    """Polynomials (4, k) in τ, η (8,) and whether they fit at the rows."""
    width, steps = t[-1] - t[0], np.diff(t)
    tau = (t - t[0]) / width
    found = polynomial.polyfit(tau, h, min(DEGREE, len(t) - 1)).T
    off = np.abs(polynomial.polyval(tau, found.T).T - h) + rounding + 1e-14 * np.abs(found).sum(axis=1)
    step = float(steps.max()) * SLACK
    jumps = 2.0 * off.max(axis=0) * step / float(steps.min())
    zero = np.zeros(4)
    height, rate = roads.between(found, width, step, off.max(axis=0), jumps)
    least, _ = roads.between(found, width, step, zero, zero)
    slopes = np.abs(np.diff(h, axis=0)) - rounding[1:] - rounding[:-1]
    if roads.kind == "lip" and np.any(slopes > roads.bound * steps[:, None] * SLACK):
        raise InputError(f"the heights between t = {t[0]:g} s and {t[-1]:g} s rise faster than {roads.bound:g} m/s")
    return found, np.append(height, rate) * SLACK, bool(np.all(off.max(axis=0) <= FIT * least))


def _largest_derivative(polynomials: Array, order: int) -> Array:
    """Bounds (4,) of the derivatives over 0 ≤ τ ≤ 1: Chebyshev polynomials stay within 1."""
    found = []
    for p in polynomials:
        shifted: Any = polynomial.Polynomial(p)(polynomial.Polynomial([0.5, 0.5]))
        there = shifted.deriv(order).coef * 2.0**order
        found.append(float(np.abs(chebyshev.poly2cheb(there)).sum()) * SLACK)
    return np.array(found)


def _inputs(polynomials: Array, begin: fmpq, width: fmpq) -> Callable[[Any], list[Any]]:
    rows: Sequence[Sequence[float]] = polynomials.tolist()

    def w(t: Any) -> list[Any]:
        tau = (t - arb(begin)) / arb(width)
        heights, rates = [], []
        for row in rows:
            height, rate = arb(0), arb(0)
            for c in reversed(row):  # Horner's scheme, for value and slope
                rate, height = rate * tau + height, height * tau + arb(c)
            heights.append(height)
            rates.append(rate / arb(width))
        return heights + rates

    return w


@dataclass(frozen=True, slots=True)
class AllRoads:
    """What holds on all roads of the class, for motions of one start: q bounds ‖(x − x_lin) − (x̂ − x̂_lin)‖_S."""

    motions: Motions
    q: Array  # (cells,)
    spread: Array  # (n,) bounds of |x_lin − x̂_lin|

    @property
    def off(self) -> Array:
        """Bounds (n,) of |x − x̂|."""
        return self.spread + self.motions.metric.reach * float(self.q.max())

    def largest_error(self, norm: Norm) -> float:
        """sup N(x − x_lin) over all times and all roads of the class."""
        found = errors(self.motions.tube, self.motions.metric, norm) + self.motions.metric.of(norm) * self.q
        return float(found.max()) * SLACK


def on_all_roads(found: Motions, road: FittedRoad) -> AllRoads:
    """Widen the tube on the fitted road to all roads of its class."""
    system, metric, pieces = found.system, found.metric, found.tube.pieces
    begins = [begin for begin, _ in system.pieces]
    window = [bisect_right(begins, p.begin) - 1 for p in pieces]
    eta = np.repeat(road.eta[window], counts(pieces, metric), axis=0)
    spread = _gains(decay(metric, pieces), input_matrix(system)) @ eta.max(axis=0) * SLACK
    X = np.hstack([ranges(pieces, found.tube.full, metric), inputs(system, metric, pieces)])
    widening = np.hstack([np.tile(spread, (len(eta), 1)), eta])
    room = np.concatenate([np.full(system.n, ROOM), np.full(system.m, ROOM_INPUT)])
    bound = majorant(system, room * (X + widening).max(axis=0) + 1e-9)
    top, _ = perturbed(metric, bound, widths(pieces, metric), X, widening[:, :, None], np.zeros(1))
    return AllRoads(found, top[:, 0], spread)


def _gains(found: Decay, B: arb_mat) -> Array:
    """∫|e^(At) B| dt (n, m) from 0 to the end of the cells, bounded."""
    centre, rest = rounded(B)
    sizes = np.abs(found.ends @ centre)
    most = np.maximum(sizes[:-1], sizes[1:]) + found.curve @ np.abs(centre)
    more = (found.off + 1e-13 * np.abs(found.ends).max()) * (np.abs(centre).sum() + rest) * len(centre)
    more += rest * np.abs(found.ends).max() * len(centre)
    return np.asarray((most + more).transpose(1, 2, 0) @ found.width * SLACK)
