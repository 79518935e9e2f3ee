"""Bounds of ∫₀ᵗ |left e^(A(t − s))| f(s) ds, row by row: what any forcing within f makes of a linear part at rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .balls import Array
from .cells import Decay

LEAST, WIDTH = 500, 0.008  # windows of equal width over all time; as many as make them no wider [s]
SLACK = 1.0 + 1e-9


@dataclass(frozen=True, slots=True)
class Convolution:
    """|left e^(At)| over windows of `width` [s], as (p, windows · n); `ends` (N + 1,) of the cells [s]."""

    ends: Array
    width: float
    kernel: Array
    n: int

    @property
    def edges(self) -> Array:
        """Of the windows [s]."""
        return self.width * np.arange(self.kernel.shape[1] // self.n + 1)

    def __call__(self, forced: Array, rows: int | None = None) -> Array:
        """Bounds (windows, p) of the integral, for f within forced (N, n) over the cells; or of its first rows only."""
        edges, n, kernel = self.edges, self.n, self.kernel[:rows]
        f = largest_over(self.ends, forced, edges[:-1], edges[1:])
        back, count = f[::-1].ravel(), len(f)
        found = [kernel[:, : (k + 1) * n] @ back[(count - 1 - k) * n :] for k in range(count)]
        return np.stack(found) * (self.width * SLACK)

    def by_cells(self, found: Array) -> Array:
        """Bounds (N, …) over the cells from bounds (windows, …)."""
        return largest_over(self.edges, found, self.ends[:-1], self.ends[1:])


def convolution(flow: Decay, left: Array) -> Convolution:
    """That of left (p, n), exact, over the cells of the flow."""
    ends = np.concatenate([[0.0], np.cumsum(flow.width)])
    count = max(LEAST, int(ends[-1] / WIDTH) + 1)
    h = float(ends[-1]) / count * SLACK
    edges = h * np.arange(count + 1)
    kernel = largest_over(ends, flow.sizes(left), edges[:-1] - h, edges[1:])  # of t − s, t and s in windows
    return Convolution(ends, h, np.ascontiguousarray(kernel.transpose(1, 0, 2)).reshape(len(left), -1), left.shape[1])


def largest_over(ends: Any, values: Array, begins: Any, stops: Any) -> Array:
    """Largest of the cells' values (N, …) over each span from begins to stops (K,); cells end at ends (N + 1,)."""
    room = (SLACK - 1.0) * ends[-1]
    first = np.searchsorted(ends[1:], begins - room).clip(max=len(values) - 1)
    after = np.searchsorted(ends[:-1], stops + room, side="right")
    return np.array([values[i:j].max(axis=0) for i, j in zip(first.tolist(), after.tolist(), strict=True)])
