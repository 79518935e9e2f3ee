"""Inputs whose heights u are known at rows only: polynomials near them, and how far those of a class may be off.

w = (u, u'): the first half of the inputs are heights, the second half their rates. Between two rows a height of class
`curv` has a rate that is Lipschitz, |u''| ≤ bound, so that its corners lie at rows; one of class `lip` is Lipschitz
itself, |u'| ≤ bound. What a class leaves open
lies around the chord from row to row. A polynomial near many chords is open by its distance to them too, but a motion
can be followed along it in steps of its own, however close the rows.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import numpy as np
from flint import arb, fmpq
from numpy.polynomial.chebyshev import poly2cheb

from .balls import Array, ExactSystem, Inputs, NotProvedError, decimal
from .open_inputs import Loose

DEGREE = 8  # of a window's polynomials
NEAR, BENT = 0.1, 1.1  # of what a class leaves open: how far a window's rows, and its bows, may be off
SCALE = 1e-9  # of the largest height: what is near where a class leaves nothing open
LONGEST = 0.25  # s
RANGE = 1e30  # of times, heights and bound, so that no float overflows
SLACK = 1.0 + 1e-9
EPS = 1e-13  # relative: covers the roundings of a polynomial's value, over the sum of its terms' sizes


@dataclass(frozen=True, slots=True)
class RowClass:
    """All heights with |u''| ≤ bound between rows (kind "curv"), or |u'| ≤ bound ("lip"); SI units."""

    kind: str
    bound: float

    def __str__(self) -> str:
        return f"{self.kind}:{self.bound!r}"

    def between(self, steps: Array, slopes: Array, loose: Array) -> tuple[Array, Array, Array]:
        """(N, k) each: how far heights may be off the chords of these steps [s] and slopes [m/s], at most and on the
        average of half a step, and how far rates may be; slopes are good to `loose`.
        """
        s, none = steps[:, None], np.zeros_like(slopes)
        if self.kind == "curv":
            return self.bound * s**2 / 8.0 + none, self.bound * s**2 / 12.0 + none, self.bound * s / 2.0 + loose
        most = max(self.bound, 1e-300)
        least, steepest = (np.clip((np.abs(slopes) + d) / most, 0.0, 1.0) for d in (-loose, loose))
        peak = self.bound * s / 2.0 * (1.0 - least**2)
        # it is off by at most (1 + slope/bound) bound times the time from the nearer row, and by the peak
        return peak, peak * (1.0 + steepest) / 2.0, self.bound + np.abs(slopes)

    def widest(self, steps: Array) -> Array:
        """What is open in the middle of these steps [s], where the chord is level."""
        return self.bound * (steps**2 / 8.0 if self.kind == "curv" else steps / 2.0)


@dataclass(frozen=True)
class InputRows:
    """Heights (N, k) at times (N,) [s] that rise from 0 on, exact as printed, and the class of all between them."""

    times: Array
    heights: Array
    between: RowClass

    def __post_init__(self) -> None:
        if len(self.times) < 2 or self.times[0] != 0.0 or not np.all(np.diff(self.times) > 0.0):
            raise ValueError("wanted at least two times, rising from 0 on")
        if self.heights.ndim != 2 or len(self.heights) != len(self.times):
            raise ValueError(f"wanted heights at {len(self.times)} times, got the shape {self.heights.shape}")
        largest = max(self.times[-1], np.abs(self.heights).max(), self.between.bound, 1.0 / self.steps.min())
        if not largest <= RANGE:
            raise ValueError(f"wanted times, heights, bound and 1/step up to {RANGE:g}, got {largest:g}")

    @cached_property
    def steps(self) -> Array:
        """From time to time (N − 1,) [s], of the exact times."""
        exact = [decimal(t) for t in self.times.tolist()]
        return np.array([float(b - a) for a, b in pairwise(exact)])

    @property
    def slopes(self) -> Array:
        """Of the chords (N − 1, k)."""
        return np.asarray(np.diff(self.heights, axis=0) / self.steps[:, None])

    def until(self, t: float) -> InputRows:
        """The rows up to the first one at t or later."""
        last = min(int(np.searchsorted(self.times, t)) + 1, len(self.times))
        return InputRows(self.times[:last], self.heights[:last], self.between)

    def refuse_steep(self) -> None:
        """Raise NotProvedError where no height of the class takes the rows' values."""
        if self.between.kind == "lip" and np.any(steep := np.abs(self.slopes) > self.between.bound * SLACK):
            row, column = np.argwhere(steep)[0].tolist()
            raise NotProvedError(
                f"no road of class {self.between} takes these heights: height {column} changes by "
                f"{abs(self.slopes[row, column]):.4g} m/s from t = {self.times[row]:g} s on"
            )


@dataclass(frozen=True, slots=True)
class Window:
    """Rows from `first` to `last`, and coefficients (k, degree + 1) of σᵏ near their heights, −1 ≤ σ ≤ 1 over them."""

    first: int
    last: int
    coefficients: Array


def windows(rows: InputRows) -> list[Window]:
    """Windows one after the other, each as long as polynomials of DEGREE stay near the heights' chords."""
    found, first, last = [], 0, len(rows.times) - 1
    while first < last:
        most = int(np.searchsorted(rows.times, rows.times[first] + LONGEST, side="right")) - 1
        longer = [partial(_fitted, rows, first, end) for end in range(first + 2, most + 1)]
        more = bisect_left(longer, True, key=lambda fitted: not _near(rows, fitted()))
        found.append(_fitted(rows, first, first + 1 + more))
        first = found[-1].last
    return found


def _fitted(rows: InputRows, first: int, last: int) -> Window:
    """The chord and (1 − σ²) times a polynomial, near the heights between: at its ends a window is off by rounding."""
    t, u = rows.times[first : last + 1], rows.heights[first : last + 1]
    sigma = (2.0 * t - t[0] - t[-1]) / (t[-1] - t[0])
    chord, bell = np.stack([u[0] + u[-1], u[-1] - u[0]]) / 2.0, np.array([1.0, 0.0, -1.0])
    found = np.zeros((min(DEGREE, last - first) + 1, u.shape[1]))
    found[:2] = chord
    if last - first > 1:
        inner = 1.0 - sigma[1:-1] ** 2
        rest = (u - chord[0] - sigma[:, None] * chord[1])[1:-1]
        powers = inner[:, None] * sigma[1:-1, None] ** np.arange(len(found) - 2)
        for column, more in zip(found.T, np.linalg.lstsq(powers, rest)[0].T, strict=True):
            column += np.convolve(bell, more)
    return Window(first, last, found.T.copy())


def _near(rows: InputRows, window: Window) -> bool:
    steps = rows.steps[window.first : window.last, None]
    room = np.maximum(rows.between.widest(steps), SCALE * np.abs(rows.heights).max())
    off, bend = _beside(rows, window)
    return bool(
        np.all(off[:-1] <= NEAR * room)
        and np.all(off[1:] <= NEAR * room)
        and np.all(bend * steps**2 / 8.0 <= BENT * room)
    )


def _beside(rows: InputRows, window: Window) -> tuple[Array, Array]:
    """How far the polynomials may be off the heights at their rows (rows, k), and bounds (k,) of their second
    derivatives [m/s²]."""
    t, c = rows.times[window.first : window.last + 1], window.coefficients
    half, k = (t[-1] - t[0]) / 2.0, np.arange(c.shape[1])
    sigma = (2.0 * t - t[0] - t[-1]) / (t[-1] - t[0])
    moved = EPS * (1.0 + t[-1] / half)  # of σ, whose times are rounded
    rounding = np.abs(c).sum(axis=1) * EPS + np.abs(c) @ k * moved
    off = np.abs(sigma[:, None] ** k @ c.T - rows.heights[window.first : window.last + 1]) + rounding
    second = c[:, 2:] * (k * (k - 1))[2:]
    curves = np.array([np.abs(poly2cheb(row)).sum() if row.size else 0.0 for row in second])
    return off, (curves + EPS * np.abs(second).sum(axis=1)) / half**2 * SLACK


def looseness(rows: InputRows, found: Sequence[Window]) -> Loose:
    """How far any w = (u, u') of the class may be off the windows' polynomials and their rates.

    On a step of length s the chord of the polynomial is as far off that of the heights as at the rows, and the
    polynomial leaves its chord by s²/8, on the average by s²/12, its rate by s/2 times its second derivative.
    """
    peaks, means, jumps = [], [], np.zeros(rows.heights.shape[1])
    for window in found:
        steps = rows.steps[window.first : window.last]
        peak, mean, rate = rows.between.between(steps, rows.slopes[window.first : window.last], np.zeros(1))
        off, bend = _beside(rows, window)
        chords, s = np.maximum(off[:-1], off[1:]), steps[:, None]
        rates = rate + (off[:-1] + off[1:]) / s + bend * s / 2.0
        peaks.append(np.hstack([peak + chords + bend * s**2 / 8.0, rates]).max(axis=0))
        means.append((mean + chords + bend * s**2 / 12.0).max(axis=0))
        jumps += off[0] + off[-1]
    return Loose(np.array(peaks) * SLACK, np.array(means) * SLACK, jumps * SLACK, float(rows.steps.max()) * SLACK)


def on_windows(system: ExactSystem, rows: InputRows, found: Sequence[Window]) -> ExactSystem:
    """The system under the windows' polynomials. Raises NotProvedError unless they cover the rows, one by one."""
    ends = [0, *(window.last for window in found)]
    if [w.first for w in found] != ends[:-1] or ends[-1] != len(rows.times) - 1 or min(np.diff(ends)) < 1:
        raise NotProvedError("the windows of the input do not cover its rows")
    pieces = tuple((decimal(rows.times[window.first]), _polynomials(rows, window)) for window in found)
    return replace(system, pieces=pieces, period=fmpq(0))


def _polynomials(rows: InputRows, window: Window) -> Inputs:
    begin, end = (decimal(t) for t in rows.times[[window.first, window.last]].tolist())
    middle, half = arb((begin + end) / 2), arb((end - begin) / 2)
    heights = [[arb(v) for v in row] for row in window.coefficients.tolist()]
    rates = [[v * k / half for k, v in enumerate(row)][1:] for row in heights]

    def w(t: Any) -> list[Any]:
        sigma = (t - middle) / half
        return [_horner(row, sigma) for row in (*heights, *rates)]

    return w


def _horner(row: Sequence[Any], sigma: Any) -> Any:
    value = arb(0)
    for each in reversed(row):
        value = value * sigma + each
    return value
