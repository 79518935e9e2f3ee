"""Eigenvalues and the modal matrix of the linear part, Eqs. (3.11)–(3.12)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .polynomials import Array

Complex = NDArray[np.complex128]
WORST_CONDITION = 1e7  # of K; beyond it A is taken for defective


@dataclass(frozen=True, slots=True)
class Modes:
    """A = K diag(λ) K⁻¹ in the paper's order: λ_(k + n/2) = λ_k*, λ_1 … λ_(n/2) by rising β = Im λ ≥ 0.

    Each column of K is scaled so that its largest entry is 1; in a system of coordinates and their rates (n even,
    rates = A's identity block) the largest coordinate, so that a column reads as a motion of size 1 [m or rad].
    """

    eigenvalues: Complex  # (n,) [1/s]
    K: Complex  # (n, n)
    K_inverse: Complex  # (n, n)

    @property
    def alpha(self) -> Array:
        """Growth rates α = Re λ (n,) [1/s]."""
        return self.eigenvalues.real

    @property
    def beta(self) -> Array:
        """Damped angular frequencies β = Im λ (n,) [rad/s]."""
        return self.eigenvalues.imag

    @property
    def damping_ratios(self) -> Array:
        """ζ = −α/|λ| (n,)."""
        return -self.alpha / np.abs(self.eigenvalues)


def modes(A: Array) -> Modes:
    """Modes of A (n, n). Raises InputError if A has no full set of eigenvectors, to the precision of doubles."""
    values, vectors = np.linalg.eig(A)  # of a real matrix: pairs are exact
    values, vectors = values.astype(complex), vectors.astype(complex)
    order = _order(values)
    values, K = values[order], vectors[:, order]
    half = len(A) // 2
    coordinates = half if len(A) == 2 * half and np.array_equal(A[:half], np.eye(len(A))[half:]) else len(A)
    largest = np.argmax(np.abs(K[:coordinates]), axis=0)
    K = K / K[largest, np.arange(len(A))]
    condition = np.linalg.cond(K / np.linalg.norm(K, axis=0))
    if not condition < WORST_CONDITION:
        raise InputError(
            f"A has no full set of eigenvectors: condition of K {condition:.3g}, wanted < {WORST_CONDITION:g}; "
            "change a parameter by a little"
        )
    return Modes(values, K, np.linalg.inv(K))


def _order(values: Complex) -> list[int]:
    """Indices in the paper's order; real eigenvalues are paired with each other, after the oscillating ones."""
    upper = sorted((i for i, v in enumerate(values) if v.imag > 0), key=lambda i: (values[i].imag, values[i].real))
    lower = [int(np.argmin(np.abs(values - values[i].conj()))) for i in upper]
    real = sorted((i for i, v in enumerate(values) if v.imag == 0), key=lambda i: values[i].real)
    return [*upper, *real[: len(real) // 2], *lower, *real[len(real) // 2 :]]
