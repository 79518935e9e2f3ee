"""Eigenvalues and the modal matrix of the linear part, Eqs. (3.11)–(3.12), and what they make of (3.14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import comb, inf, nextafter
from string import ascii_letters
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .polynomials import Array, Homogeneous

Complex = NDArray[np.complex128]
WORST_CONDITION = 1e7  # of K; beyond it A is taken for defective
ROUNDING = 1e-15  # more than the relative round-off of a distance or a sum
PRECISIONS = (128, 256, 512)  # bits that are tried to tell eigenvalues apart


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

    def input(self, B: Array) -> Complex:
        """d̂ = K⁻¹ B (n, m), so that f(t) = K⁻¹ Q(t) = d̂ w(t) in (3.13)."""
        return self.K_inverse @ B


@dataclass(frozen=True, slots=True)
class Enclosures:
    """Discs, each with exactly one eigenvalue: |λ_k − centres[k]| ≤ radii[k], proved in ball arithmetic; (n,) [1/s]."""

    centres: Complex
    radii: Array

    @property
    def abscissa(self) -> float:
        """A number that no eigenvalue's real part exceeds [1/s]."""
        return max(nextafter(c.real + r, inf) for c, r in zip(self.centres.tolist(), self.radii.tolist(), strict=True))

    @property
    def gap(self) -> float:
        """A number that no two eigenvalues' distance falls below [1/s]; negative if two discs touch."""
        return float(np.min(self._gaps, initial=inf))

    @property
    def touching(self) -> int:
        """Number of pairs of discs that touch."""
        return int(np.count_nonzero(self._gaps <= 0.0))

    @property
    def _gaps(self) -> Array:
        """Between the discs of each pair, rounded down."""
        i, j = np.triu_indices(len(self.radii), 1)
        distance = np.abs(self.centres[i] - self.centres[j])
        return distance * (1.0 - ROUNDING) - (self.radii[i] + self.radii[j]) * (1.0 + ROUNDING)


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


def enclosures(A: Sequence[Sequence[Any]] | Array, near: Complex) -> Enclosures:
    """Proved discs for the eigenvalues of A (n, n), in the order of the approximations `near` (n,).

    The entries are taken as they stand: fractions, or doubles as the fractions that they are. Raises InputError if
    eigenvalues cannot be told apart.
    """
    import flint

    exact = [[flint.fmpq(*Fraction(a).as_integer_ratio()) for a in row] for row in A]
    for bits in PRECISIONS:
        with flint.ctx.workprec(bits):
            try:
                balls = flint.acb_mat(exact).eig()
            except ValueError:  # of flint, where discs overlap
                continue
            # of a real A the discs that meet the real axis are centred on it, and so hold a real eigenvalue
            middles = np.array([complex((ball.real if ball.imag.contains(0) else ball).mid()) for ball in balls])
            found = [int(np.argmin(np.abs(middles - value))) for value in near]
            if len(set(found)) < len(found):
                continue
            # the radius counts the rounding of the centre to doubles
            upper = [float((balls[i] - flint.acb(complex(middles[i]))).abs_upper()) for i in found]
            return Enclosures(middles[found], np.array([nextafter(r, inf) for r in upper]))
    raise InputError(f"A has eigenvalues that {PRECISIONS[-1]} bits do not tell apart; change a parameter by a little")


def modal(part: Homogeneous, found: Modes, inputs: int) -> list[Complex]:
    """Tensors a_r of K⁻¹ Φ(K ξ, w) = Σ_r a_r[i, j, k, …] ξ_j ξ_k … w …, by the number r = 0 … d of inputs w (inputs,).

    Φ is homogeneous of degree d in y = (x, w); a_r has the axes i, d − r of ξ, r of w, and is symmetric in those of ξ
    and in those of w. For the cubic part, (3.14): a_0 = α_i(jkl), and ψ_ijk(t) = Σ_l a_1[i, j, k, l] w_l(t). The print
    builds α from a tensor r_ijkl that is not symmetric; in products with ξ_j ξ_k ξ_l only its symmetric part, this one,
    counts, and ᾱ_ijkl of (3.20) is 6 a_0.
    """
    n = len(found.eigenvalues)
    full = part.tensor(n + inputs)
    return [_transformed(full, found, n, part.degree, r) for r in range(part.degree + 1)]


def _transformed(full: NDArray[Any], found: Modes, n: int, degree: int, r: int) -> Complex:
    """The block of a symmetric tensor with r inputs, in modal coordinates."""
    block = full[(slice(None), *[slice(n)] * (degree - r), *[slice(n, None)] * r)]
    old, new = ascii_letters[: degree + 1], ascii_letters[26 : 27 + degree - r]
    matrices = ",".join([new[0] + old[0], *(o + m for o, m in zip(old[1:], new[1:], strict=False))])
    result = new + old[degree - r + 1 :]
    factors = [found.K_inverse, *[found.K] * (degree - r)]
    return comb(degree, r) * np.einsum(f"{old},{matrices}->{result}", block, *factors, optimize=True)


def _order(values: Complex) -> list[int]:
    """Indices in the paper's order; real eigenvalues are paired with each other, after the oscillating ones."""
    upper = sorted((i for i, v in enumerate(values) if v.imag > 0), key=lambda i: (values[i].imag, values[i].real))
    lower = [i + 1 for i in upper]  # LAPACK puts conjugates behind each other; repeated pairs keep their own vectors
    real = sorted((i for i, v in enumerate(values) if v.imag == 0), key=lambda i: values[i].real)
    return [*upper, *real[: len(real) // 2], *lower, *real[len(real) // 2 :]]
