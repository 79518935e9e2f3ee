"""Where two modes come to the same frequency, β_j = β_k, as a parameter changes.

Modes are numbered by rising β, so that β_k − β_j never changes its sign: what tells a meeting is that modes, followed
by their shapes, have changed places. Where shapes turn into each other while the frequencies stay apart (veering) they
seem to do so over a wide step; over ever smaller ones they do not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment

from ..methods.modes import Modes
from ..methods.polynomials import Array

HALVINGS = 20  # of a step in which two modes seem to change places

Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Meeting:
    """The value at which β_j = β_k, in step i of the values; both modes by their places (from 0) at its two ends."""

    step: int
    value: float
    before: Pair
    after: Pair


def meetings(modes_at: Callable[[float], Modes], values: Array) -> list[Meeting]:
    """Meetings of oscillating modes between neighbours of the values (V,)."""
    found = []
    at = [modes_at(value) for value in values.tolist()]
    for i in range(len(values) - 1):
        for before, after in _swaps(at[i], at[i + 1]):
            value = _meeting(modes_at, (float(values[i]), float(values[i + 1])), (at[i], at[i + 1]), before)
            if value is not None:
                found.append(Meeting(step=i, value=value, before=before, after=after))
    return found


def _followed(before: Modes, after: Modes) -> list[int]:
    """For each mode of the first half its place afterwards: that of the shape most like its own."""
    half = len(before.K) // 2
    likeness = np.abs(before.K_inverse[:half] @ after.K[:, :half])
    return [int(place) for place in linear_sum_assignment(likeness, maximize=True)[1]]


def _swaps(before: Modes, after: Modes) -> list[tuple[Pair, Pair]]:
    """Pairs of oscillating modes of which the slower has become the faster: places before, and afterwards."""
    places = _followed(before, after)
    return [
        ((j, k), (places[j], places[k]))
        for j, k in combinations(range(len(places)), 2)
        if places[j] > places[k] and before.beta[j] > 0.0 and after.beta[places[k]] > 0.0
    ]


def _meeting(
    modes_at: Callable[[float], Modes], ends: tuple[float, float], found: tuple[Modes, Modes], pair: Pair
) -> float | None:
    """The value at which a pair meets that changes places between the ends; None if it does not, looked at closely."""
    (begin, end), (first, last) = ends, found
    for _ in range(HALVINGS):
        middle = 0.5 * (begin + end)
        between = modes_at(middle)
        places = _followed(first, between)
        if places[pair[0]] > places[pair[1]]:
            end, last = middle, between
        else:
            begin, first, pair = middle, between, (places[pair[0]], places[pair[1]])
    places = _followed(first, last)
    if not places[pair[0]] > places[pair[1]]:
        return None
    gaps = (first.beta[pair[1]] - first.beta[pair[0]], last.beta[places[pair[1]]] - last.beta[places[pair[0]]])
    return float(begin + (end - begin) * gaps[0] / (gaps[0] - gaps[1])) if gaps[0] != gaps[1] else begin
