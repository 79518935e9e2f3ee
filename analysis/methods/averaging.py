"""Averaging after Krylov and Bogoliubov, Eqs. (3.18)–(3.20): equations for the slow amplitudes s_k of the modes.

ξ_k = s_k exp(iβ_k t) + forced part, and s_k' = α_k s_k + ε exp(−iβ_k t) Φ_k; of the right-hand side only what does not
oscillate is kept. Which terms those are is a matter of frequencies alone: s_k s_j s_(j + n/2) always (the sum in
(3.20)), pairs of opposite waves times s_k (A_k and B_k), and whatever else comes as close as a chosen detuning.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ..errors import InputError
from .modal_polynomials import Indices, Waves, all_monomials, exponents, linear_map, modal_parts, substituted, waves
from .modes import Complex, Modes, modes
from .polynomials import Array, Homogeneous
from .signals import Piece
from .standard_form import StandardForm

ROUND_OFF = 1e-9  # of the largest frequency: combinations this small are zero
LEAST = 1e-100  # m or rad: smaller amplitudes are integrated no more accurately, lest tolerances underflow


@dataclass(frozen=True, slots=True, kw_only=True)
class AmplitudeEquations:
    """s_k' = α_k s_k + Σ N_k(s) exp(iδt), and x = K (u + W(u, E)) + forced part with u_k = s_k exp(iβ_k t).

    resonant   : N, polynomials in (s, E) with E = 1, ε included; detunings δ (n, R) [rad/s] of each, 0 if exact.
    correction : W, what the averaging took out, by the power of ε; used from order 2 on.
    """

    modes: Modes
    waves: Waves
    order: int
    resonant: tuple[Homogeneous, ...]
    detunings: tuple[Array, ...]
    correction: tuple[Homogeneous, ...]

    @property
    def n(self) -> int:
        """Number of modes, 14 for the paper's car."""
        return len(self.modes.eigenvalues)

    def rate(self, t: float, s: Complex) -> Complex:
        """s' (n,) at amplitudes s (n,)."""
        z = np.concatenate([s, np.ones(len(self.waves.frequencies))])
        rate = self.modes.alpha * s
        for part, delta in zip(self.resonant, self.detunings, strict=True):
            turned = part.coefficients * np.exp(1j * delta * t) if delta.any() else part.coefficients
            rate = rate + turned @ np.prod(z[part.monomials], axis=1)
        return rate

    def amplitudes(self, x: Array, t: Any = 0.0, *, exact: bool | None = None) -> Complex:
        """s (n, …) of the states x (n, …) at the times t (…).

        exact : whether W is taken off, by iteration; by default from order 2 on.
        """
        whole = self.modes.K_inverse @ x - self.waves.forced @ self.waves.at(t)
        u = whole
        for _ in range(50 if (self.order > 1 if exact is None else exact) else 0):
            before, u = u, whole - self._correction(u, t)
            if np.abs(u - before).max() <= 1e-15 * np.abs(whole).max():
                break
        return u * np.exp(-1j * np.multiply.outer(self.modes.beta, t))

    def states(self, s: Complex, t: Array) -> Array:
        """x (n, len(t)) of amplitudes s (n, len(t)) at the times t."""
        u = s * np.exp(1j * np.multiply.outer(self.modes.beta, t))
        if self.order > 1:
            u = u + self._correction(u, t)
        return (self.modes.K @ (u + self.waves.forced @ self.waves.at(t))).real

    def _correction(self, u: Complex, t: Any) -> Complex:
        z = np.concatenate([u, self.waves.at(t)])
        return sum((part(z) for part in self.correction), np.zeros_like(u))

    def solve(self, s0: Complex, t: Array, *, rtol: float = 1e-10) -> Complex:
        """s (n, len(t)) at the times t (increasing) from s0 at t[0]."""
        size = max(float(np.abs(s0).max()), LEAST)
        solution = solve_ivp(
            self.rate, (t[0], t[-1]), np.asarray(s0, complex), "DOP853", t, rtol=rtol, atol=rtol * 1e-2 * size
        )
        if not solution.success:
            raise InputError(f"averaging: the amplitude equations cannot be integrated: {solution.message}")
        return solution.y

    def coefficient(self, k: int, monomial: Sequence[int]) -> complex:
        """Of s_a s_b … in s_k', waves paired off, exact resonances only; indices from 0. () is a constant."""
        wanted, total = tuple(sorted(monomial)), 0j
        for part, delta in zip(self.resonant, self.detunings, strict=True):
            for column, row in enumerate(part.monomials.tolist()):
                if delta[k, column] == 0.0 and tuple(i for i in row if i < self.n) == wanted:
                    total += part.coefficients[k, column]
        return total

    @property
    def linear(self) -> Complex:
        """ε (A_k + B_k) (n,) [1/s]."""
        return np.array([self.coefficient(k, (k,)) for k in range(self.n)])

    @property
    def cubic(self) -> Complex:
        """ε ᾱ_kkjj+n/2 (n, n/2) [1/s]: coefficients of s_k s_j s_(j + n/2) in s_k', halved where j = k mod n/2."""
        half = self.n // 2
        return np.array([[self.coefficient(k, (k, j, j + half)) for j in range(half)] for k in range(self.n)])


def average(
    form: StandardForm,
    piece: Piece | None = None,
    *,
    found: Modes | None = None,
    order: int = 1,
    epsilon: float = 1.0,
    detuning: float = 0.0,
) -> AmplitudeEquations:
    """The amplitude equations of x' = A x + B w + Σ εᵖ Φ_p, with w of this piece for ever.

    order    : 1, as (3.20), or 2, the second approximation.
    detuning : terms no further than this [rad/s] from resonance are kept as resonant (with their slow phase); see
               `slow`.

    The damping need not be small: what is taken out is divided by Σλ − λ_k, not by its imaginary part alone.
    Raises InputError for an input that is no sum of lasting waves, and for other orders.
    """
    if order not in (1, 2):
        raise InputError(f"averaging: wanted order 1 or 2, got {order}")
    m = found or modes(form.A)
    w = waves(form, m, piece, detuning=detuning)
    rho = exponents(m, w)
    kept, taken = [], []
    for part in modal_parts(form, m, w, 1):
        scaled = replace(part, coefficients=epsilon * part.coefficients)
        resonant = _resonant(part.monomials, m, rho, detuning)
        kept.append(replace(scaled, coefficients=np.where(resonant, scaled.coefficients, 0.0)))
        divisors = np.sum(rho[part.monomials], axis=1) - m.eigenvalues[:, None]
        quotient = np.where(resonant, 0.0, scaled.coefficients) / np.where(resonant, 1.0, divisors)
        taken.append(replace(scaled, coefficients=quotient))
    if w.direct.any():
        kept.append(Homogeneous(np.arange(len(m.K), len(rho), dtype=np.intp)[:, None], w.direct))
    if order == 2:
        kept += _second(form, m, w, kept, taken, epsilon, detuning)
    kept = [compact for part in kept if (compact := _compact(part)).monomials.size]
    return AmplitudeEquations(
        modes=m,
        waves=w,
        order=order,
        resonant=tuple(kept),
        detunings=tuple(_detunings(part.monomials, m, rho) for part in kept),
        correction=tuple(map(_compact, taken)),
    )


def _detunings(monomials: Indices, m: Modes, rho: Complex) -> Array:
    """Frequency of each monomial less that of each mode (n, R) [rad/s], zero if it is round-off."""
    delta = np.sum(rho.imag[monomials], axis=1) - m.beta[:, None]
    return np.where(np.abs(delta) <= ROUND_OFF * np.abs(rho.imag).max(initial=0.0), 0.0, delta)


def slow(m: Modes) -> float:
    """A detuning [rad/s] to keep terms by: below it a phase turns more slowly than any mode decays; 0 undamped."""
    return 0.5 * float(np.abs(m.alpha).min())


def _resonant(monomials: Indices, m: Modes, rho: Complex, detuning: float) -> Any:
    """Of each mode and monomial (n, R), whether it is kept; of waves alone as in `waves`: by iΣω − λ, with damping."""
    least = max(detuning, ROUND_OFF * np.abs(rho.imag).max(initial=0.0))
    distances = np.abs(np.sum(rho[monomials], axis=1) - m.eigenvalues[:, None])
    near = np.abs(_detunings(monomials, m, rho)) <= detuning
    return near & (np.any(monomials < len(m.K), axis=1) | (distances <= least))


def _compact(part: Homogeneous) -> Homogeneous:
    """Without the monomials that have only zeros."""
    used = np.any(part.coefficients != 0.0, axis=0)
    return Homogeneous(part.monomials[used], part.coefficients[:, used])


def _second(
    form: StandardForm,
    m: Modes,
    w: Waves,
    kept: Sequence[Homogeneous],
    taken: Sequence[Homogeneous],
    epsilon: float,
    detuning: float,
) -> list[Homogeneous]:
    """⟨ε² Φ_2 + ε DΦ_1 W − DW N⟩; the last has an average only among terms that were kept with a detuning."""
    rho, T, result = exponents(m, w), linear_map(m, w), []
    for part in form.terms.get(2, ()):
        monomials = all_monomials(len(rho), part.degree)
        chosen = monomials[_resonant(monomials, m, rho, detuning).any(axis=0)]
        values = epsilon**2 * m.K_inverse @ substituted(part, T, chosen)
        result.append(Homogeneous(chosen, np.where(_resonant(chosen, m, rho, detuning), values, 0.0)))
    for shift in taken:
        for part in modal_parts(form, m, w, 1):
            scaled = replace(part, coefficients=epsilon * part.coefficients)
            result.append(_product(scaled, shift, m, rho, detuning))
        if detuning > 0.0:
            result += [_product(replace(shift, coefficients=-shift.coefficients), N, m, rho, detuning) for N in kept]
    return result


def _product(part: Homogeneous, shift: Homogeneous, m: Modes, rho: Complex, detuning: float) -> Homogeneous:
    """Resonant part of Σ_j ∂part/∂u_j shift_j."""
    part, shift = _compact(part), _compact(shift)
    n, found = len(m.K), dict[tuple[int, ...], Complex]()
    limit = detuning + ROUND_OFF * np.abs(rho.imag).max(initial=0.0)
    shift_exponent, shift_free = np.sum(rho[shift.monomials], axis=1), np.any(shift.monomials < n, axis=1)
    for place in range(part.degree):
        rest = np.delete(part.monomials, place, axis=1)
        rest_exponent, rest_free = np.sum(rho[rest], axis=1), np.any(rest < n, axis=1)
        for column, j in enumerate(part.monomials[:, place].tolist()):
            for k in np.flatnonzero(part.coefficients[:, column]) if j < n else ():
                gap = rest_exponent[column] + shift_exponent - m.eigenvalues[k]
                near = np.where(rest_free[column] | shift_free, np.abs(gap.imag), np.abs(gap)) <= limit
                for other in np.flatnonzero(near & (shift.coefficients[j] != 0.0)):
                    monomial = tuple(sorted((*rest[column].tolist(), *shift.monomials[other].tolist())))
                    value = part.coefficients[k, column] * shift.coefficients[j, other]
                    found.setdefault(monomial, np.zeros(n, complex))[k] += value
    rows = sorted(found)
    monomials = np.array(rows, dtype=np.intp).reshape(len(rows), part.degree - 1 + shift.degree)
    return Homogeneous(monomials, np.array([found[row] for row in rows]).reshape(len(rows), n).T)
