"""Gains by time to go, K(s): polynomials on intervals as short as the gain's change asks for."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..quantities import ParameterError

if TYPE_CHECKING:
    from .riccati import Array

Gain = tuple[float, ...]
"""K (m × n), row after row."""

DEGREE = 7  # as written out in `GainTable.gain`
ACCURACY = 1e-8  # of the largest gain
MOST_INTERVALS = 1000


@dataclass(frozen=True, slots=True)
class GainTable:
    """K(s) at times to go s [s]: on each interval eight coefficients for every entry; beyond the last, its end."""

    edges: tuple[float, ...]
    coefficients: tuple[tuple[Gain, ...], ...]
    settled: bool  # whether the last gain is that of all longer times to go

    @classmethod
    def of(cls, data: dict[str, Any]) -> GainTable:
        """The table from its plain data."""
        coefficients = tuple(tuple(map(tuple, interval)) for interval in data["coefficients"])
        return cls(tuple(data["edges"]), coefficients, data["settled"])

    def gain(self, s: float) -> list[float]:
        """K, row after row, at the time to go s; s is taken into the table's range."""
        edges = self.edges
        s = min(max(s, 0.0), edges[-1])
        i = min(bisect_right(edges, s), len(edges) - 1) - 1
        x = 2.0 * (s - edges[i]) / (edges[i + 1] - edges[i]) - 1.0
        return [
            a + x * (b + x * (c + x * (d + x * (e + x * (f + x * (g + x * h))))))
            for a, b, c, d, e, f, g, h in self.coefficients[i]
        ]


def tabulated(later: Callable[[Array, Array], Array], gains: Callable[[Array], Array], n: int, reach: float) -> Any:
    """Edges and coefficients of a table up to the time to go `reach` [s], from L = 0 (n × n) at 0.

    later : L (p, k, n, n) at times (k) after L (p, n, n).  gains : K (…, m, n) of L (…, n, n).
    All intervals of one length are tried at once; those that a polynomial does not meet are halved.
    """
    import numpy as np

    nodes = -np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
    between = np.cos(np.pi * np.arange(DEGREE + 2) / (DEGREE + 1))  # where the interpolant is farthest off
    fit = np.linalg.inv(np.vander(nodes, increasing=True))
    at = np.concatenate([[0.0], nodes, between])  # the first: where the second half begins
    width, begins, L, found, largest = reach, np.zeros(1), np.zeros((1, n, n)), dict[float, Any](), 0.0
    while len(begins):
        if len(begins) + len(found) > MOST_INTERVALS:
            what = f"the gain changes too often for {MOST_INTERVALS} intervals of a table up to {reach:g} s"
            raise ParameterError([f"{what}: wanted a shorter control, or one that settles sooner"])
        path = later(L, 0.5 * width * (1.0 + at))
        K = gains(path[:, 1:]).reshape(len(L), len(at) - 1, -1)
        largest = max(largest, float(np.abs(K).max()))
        coefficients = np.einsum("ij,pjk->pik", fit, K[:, : DEGREE + 1])
        expected = np.einsum("ij,pjk->pik", np.vander(between, DEGREE + 1, increasing=True), coefficients)
        error = np.abs(K[:, DEGREE + 1 :] - expected).max(axis=(1, 2))
        good = error <= ACCURACY * largest
        for begin, each in zip(begins[good].tolist(), coefficients[good], strict=True):
            found[begin] = tuple(map(tuple, each.T.tolist()))
        width *= 0.5
        begins = np.concatenate([begins[~good], begins[~good] + width])
        L = np.concatenate([L[~good], path[~good, 0]])
    edges = sorted(found)
    return (*edges, reach), tuple(found[edge] for edge in edges)
