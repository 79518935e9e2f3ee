"""Φ of the standard form in modal coordinates and waves: what averaging and resonances look at, Eqs. (3.14), (3.17).

In ξ_k = u_k + Σ_μ g_kμ E_μ the free parts u_k = s_k exp(iβ_k t) and the waves E_μ = exp(iω_μ t) of the input are the
variables z = (u, E). There Φ is again a polynomial, and each of its monomials has one frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations_with_replacement, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .modes import Complex, Modes
from .polynomials import Array, Homogeneous
from .signals import Piece
from .standard_form import StandardForm

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Waves:
    """A periodic input w(t) = Σ_μ inputs[:, μ] exp(iω_μ t), and the linear motion ξ_kμ that it forces, Eq. (3.17).

    frequencies (M,) [rad/s]; inputs (m, M); forced (n, M), in modal coordinates.
    direct (n, M) : K⁻¹ B inputs where a wave is in resonance with mode k and is left to the amplitudes; `forced` is 0
                    there.
    """

    frequencies: Array
    inputs: Complex
    forced: Complex
    direct: Complex

    def at(self, t: Any) -> Complex:
        """E (M, …) at the times t (…)."""
        return np.exp(1j * np.multiply.outer(self.frequencies, np.asarray(t)))


def waves(form: StandardForm, modes: Modes, piece: Piece | None = None, *, detuning: float = 0.0) -> Waves:
    """The waves of an input for ever; none without a piece.

    detuning : a wave iω no further than this [1/s] from λ_k is left to the amplitude of mode k if detuning > 0.
               A mode that decays faster forgets its start sooner than the phase turns, and has a forced motion.

    Raises InputError if the input is no sum of waves that last.
    """
    if piece is None:
        piece = Piece(0.0, np.zeros(0, complex), np.zeros((form.B.shape[1], 0), complex))
    if np.any(piece.exponents.real != 0.0):
        raise InputError(f"averaging: wanted an input of waves that last, got the exponents {piece.exponents} 1/s")
    omega = piece.exponents.imag
    inputs = piece.amplitudes * np.exp(-1j * omega * piece.begin)  # phases at t = 0
    force = modes.K_inverse @ form.B @ inputs
    divisors = 1j * omega - modes.eigenvalues[:, None]
    near = (np.abs(divisors) <= detuning) & (detuning > 0.0)
    divisors = np.where(near, 1.0, divisors)
    return Waves(
        frequencies=omega,
        inputs=inputs,
        forced=np.where(near, 0.0, force / divisors),
        direct=np.where(near, force, 0.0),
    )


def linear_map(modes: Modes, w: Waves) -> Complex:
    """T (n + m, n + M) with (x, w) = T (u, E)."""
    n, m = len(modes.K), len(w.inputs)
    return np.block([[modes.K, modes.K @ w.forced], [np.zeros((m, n)), w.inputs]])


def exponents(modes: Modes, w: Waves) -> Complex:
    """Of z = (u, E): (λ, iω), (n + M,) [1/s]."""
    return np.concatenate([modes.eigenvalues, 1j * w.frequencies])


def all_monomials(variables: int, degree: int) -> Indices:
    """Every monomial as a sorted row of indices, (R, degree)."""
    found = list(combinations_with_replacement(range(variables), degree))
    return np.array(found, dtype=np.intp).reshape(len(found), degree)


def substituted(part: Homogeneous, T: Complex, monomials: Indices) -> Complex:
    """Coefficients (n, R) of part(T z) at chosen monomials (R, d) in z.

    The coefficient of z_a z_b … in Π_p (T z)_p is the sum over all orders of (a, b, …), each distinct one once.
    """
    total = np.zeros((len(part.monomials), len(monomials)), complex)
    for order in permutations(range(part.degree)):
        product = np.ones((1, 1), complex)
        for place, position in enumerate(order):
            product = product * T[part.monomials[:, place]][:, monomials[:, position]]
        total += product
    repeats = [math.prod(math.factorial(row.count(i)) for i in set(row)) for row in monomials.tolist()]
    return np.asarray(part.coefficients @ (total / np.array(repeats, float)))


def modal_parts(form: StandardForm, modes: Modes, w: Waves, power: int) -> list[Homogeneous]:
    """K⁻¹ Φ_power in z = (u, E), all monomials: n functions of n + M variables for each degree."""
    T = linear_map(modes, w)
    found = []
    for part in form.terms.get(power, ()):
        monomials = all_monomials(T.shape[1], part.degree)
        found.append(Homogeneous(monomials, modes.K_inverse @ substituted(part, T, monomials)))
    return found
