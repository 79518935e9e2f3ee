"""Quintics through rows of a motion: from row to row the polynomials that have its x = (q, q̇) and q̈ at both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from .balls import Array

NODES = np.cos(np.pi * (np.arange(7) + 0.5) / 7.0)  # of Chebyshev; u from −1 at one row to 1 at the next
_K = np.arange(7)
CHEBYSHEV = np.cos(np.outer(_K, np.arccos(NODES))) * np.where(_K, 2.0, 1.0)[:, None] / 7.0  # values → coefficients


@dataclass(frozen=True, slots=True)
class Quintics:
    """Coefficients (cells, n, 6) of uᵏ of x = (q, q̇), on cells of half a width `half` (cells,) [s]."""

    half: Array
    coefficients: Array

    @property
    def values(self) -> Array:
        """x (cells, n, 7) at the nodes."""
        return np.asarray(self.coefficients @ (NODES[None, :] ** np.arange(6)[:, None]))

    @property
    def slopes(self) -> Array:
        """x' (cells, n, 7) at the nodes [1/s]."""
        powers = np.arange(1, 6)[:, None] * NODES[None, :] ** np.arange(5)[:, None]
        return np.asarray(self.coefficients[:, :, 1:] @ powers / self.half[:, None, None])

    def size(self, radius: float = 1.0) -> Array:
        """Bounds (cells, n) of |x| for all complex |u| ≤ radius."""
        return np.asarray(np.abs(self.coefficients) @ radius ** np.arange(6))


def quintics(times: Array, x: Array, accelerations: Array) -> Quintics:
    """Through rows x (N, n) at times (N,) [s], with q̈ (N − 1, 2, n/2) at both rows of each cell."""
    half, n = np.diff(times) / 2.0, x.shape[1] // 2
    h = half[:, None]
    first, last = ((x[k, :n], h * x[k, n:]) for k in (slice(None, -1), slice(1, None)))
    ends = [*first, h**2 * accelerations[:, 0], *last, h**2 * accelerations[:, 1]]
    q = np.einsum("kj,jci->cik", _FROM_ENDS, np.stack(ends))
    v = np.zeros_like(q)
    v[:, :, :5] = q[:, :, 1:] * np.arange(1, 6) / half[:, None, None]
    return Quintics(half, np.concatenate([q, v], axis=1))


def responses(order: int) -> Array:
    """Derivatives (7, 6) in u at the nodes of the quintics with value, slope or curvature 1 (in u) at −1, then at 1."""
    rows = [polynomial.polyval(NODES, polynomial.polyder(one, order)) for one in np.eye(6)]
    return np.asarray(np.array(rows).T @ _FROM_ENDS)


def _at_ends() -> Array:
    """Value, slope and curvature of u⁰ … u⁵ at −1 and at 1 (6, 6)."""
    rows = []
    for u in (-1.0, 1.0):
        rows += [[polynomial.polyval(u, polynomial.polyder(one, order)) for one in np.eye(6)] for order in range(3)]
    return np.array(rows)


_FROM_ENDS = np.linalg.inv(_at_ends())
