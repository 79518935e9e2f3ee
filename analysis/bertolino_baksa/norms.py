"""The norm N of a statement on almost stability, and the metric S in which the linear part contracts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from flint import arb, arb_mat

from ..methods.modes import modes
from .balls import Array, ExactSystem, NotProvedError, below, jacobian, length, magnitudes, matrix, rounded, two_norm

RANGE = 1e30  # of the largest entry of a matrix and of its inverse


@dataclass(frozen=True, slots=True)
class Norm:
    """N(x) = ‖T x‖₂ or, if `largest`, max_i |(T x)_i|; T (n, n) is exact. States in SI units."""

    name: str
    T: Array
    largest: bool = False

    def __call__(self, x: Array) -> Array:
        """N of each column of x (n, …)."""
        y = np.tensordot(self.T, x, axes=1)
        return np.abs(y).max(axis=0) if self.largest else np.sqrt((y**2).sum(axis=0))


def euclid(n: int) -> Norm:
    """√(Σ x_i²), SI units as they are."""
    return Norm("Euclid", np.eye(n))


def weighted_sup(weights: Array) -> Norm:
    """max_i |x_i|/weight_i."""
    return Norm("weighted sup", np.diag(1.0 / np.asarray(weights)), largest=True)


@dataclass(frozen=True)
class Metric:
    """‖x‖_S = ‖S x‖₂, in which x' = A x shrinks: d‖x‖_S/dt ≤ −alpha ‖x‖_S, proved for the exact A."""

    S: Array
    inverse: arb_mat  # balls around S⁻¹
    A: arb_mat  # balls around the exact A
    alpha: float

    @cached_property
    def fastest(self) -> float:
        """Size of the largest eigenvalue [1/s], about."""
        return float(np.abs(np.linalg.eigvals(rounded(self.A)[0])).max())

    @cached_property
    def reach(self) -> Array:
        """n_j ≥ |x_j|/‖x‖_S (n,)."""
        return np.sqrt((magnitudes(self.inverse) ** 2).sum(axis=1)) * (1.0 + 1e-14)

    @cached_property
    def balls(self) -> arb_mat:
        """S, exactly."""
        return matrix(self.S)

    def rows(self, T: Array) -> Array:
        """c_i ≥ |(T x)_i|/‖x‖_S (p,); T (p, n) exact."""
        return np.sqrt((magnitudes(matrix(T) * self.inverse) ** 2).sum(axis=1)) * (1.0 + 1e-14)

    @property
    def norm(self) -> Norm:
        """‖·‖_S."""
        return Norm("a metric's", self.S)

    def of(self, norm: Norm) -> float:
        """c ≥ N(x)/‖x‖_S."""
        if norm.largest:
            return float(self.rows(norm.T).max())
        centre, radius = rounded(matrix(norm.T) * self.inverse)
        return float(two_norm(centre)) + radius

    def size(self, m: arb_mat) -> float:
        """Bound of ‖m‖_S as an operator, by Frobenius."""
        return length((self.balls * m * self.inverse).entries())

    def length(self, x: arb_mat) -> float:
        """Bound of ‖x‖_S of a column of balls."""
        return length((self.balls * x).entries())

    def longest(self, bounds: Array) -> float:
        """Bound of ‖x‖_S for |x_j| ≤ bounds_j (n,)."""
        return float(np.sqrt(((np.abs(self.S) @ bounds) ** 2).sum()) * (1.0 + 1e-13))


def usable_inverse(m: Array, what: str) -> arb_mat:
    """Balls around m⁻¹ of a matrix of exact doubles (n, n).

    Raises NotProvedError if m is singular, or if the largest entry of m or of m⁻¹ is not within 1/RANGE and RANGE:
    bounds are computed with squares of floats, which would underflow to 0 or overflow.
    """
    try:
        inverse = matrix(m).inv()
    except ZeroDivisionError as error:
        raise NotProvedError(f"{what} is singular") from error
    for values, of in ((np.abs(m), ""), (magnitudes(inverse), "inverse of ")):
        if not 1.0 / RANGE <= (largest := float(values.max())) <= RANGE:
            wanted = f"wanted {1.0 / RANGE:g} to {RANGE:g}"
            raise NotProvedError(f"the {of}{what}: the largest entry is {largest:g}, {wanted}; choose other units")
    return inverse


def modal_metric(A: Array, scale: Array) -> Array:
    """S (n, n) such that ‖S x‖₂ contracts as fast as the slowest mode of A; each mode weighs as in ‖scale x‖₂.

    The rows are those of K⁻¹, in real form: √2 Re and √2 Im of a pair. Raises InputError for a defective A.
    """
    found = modes(A)
    sizes = np.linalg.norm(scale @ found.K, axis=0)
    rows, half = found.K_inverse * sizes[:, None], len(A) // 2
    S = np.empty((len(A), len(A)))
    for k in range(len(A)):
        oscillating = found.eigenvalues[k].imag != 0
        if not oscillating:
            S[k] = rows[k].real
        elif found.eigenvalues[k].imag > 0:
            S[k], S[k + half] = np.sqrt(2.0) * rows[k].real, np.sqrt(2.0) * rows[k].imag
    return S


def proved_metric(system: ExactSystem, S: Array) -> Metric:
    """The metric with a proved alpha > 0 (Gershgorin's rows of the symmetric part of S A S⁻¹).

    Raises NotProvedError if the linear part does not contract in it, or for entries too large or small for floats.
    """
    zero = [arb(0)]
    return contracting(jacobian(system, zero * system.n, zero * system.m), S)


def contracting(A: arb_mat, S: Array) -> Metric:
    """The metric in which x' = A x contracts; raises NotProvedError as `proved_metric`."""
    if S.shape != (A.nrows(), A.ncols()):
        raise NotProvedError(f"another system: wanted {A.nrows()} states, got {len(S)}")
    inverse = usable_inverse(S, "metric")
    alpha = decay_rate(matrix(S) * A * inverse)
    if not alpha > 0.0:
        raise NotProvedError(f"the linear part does not contract: growth rate up to {-alpha:g} 1/s; wanted < 0")
    return Metric(S, inverse, A, alpha)


def decay_rate(turned: arb_mat) -> float:
    """A rate at which ‖x‖₂ decays at least under x' = turned x, by Gershgorin's rows of the symmetric part."""
    symmetric = (turned + turned.transpose()) / 2
    alpha = np.inf
    for i in range(symmetric.nrows()):
        others: Any = sum((abs(symmetric[i, j]) for j in range(symmetric.nrows()) if j != i), arb(0))
        alpha = min(alpha, below(-symmetric[i, i] - others))
    return float(alpha)
