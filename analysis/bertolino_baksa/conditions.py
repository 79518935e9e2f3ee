"""Conditions 1 and 2 after (2.11), as printed and in three forms that can hold.

In modal coordinates X⁻¹(t) S[t, X(t) v] is a sum of monomials in v and in the waves of the input, each times exp(σt)
with σ = Σρ − λ_k, ρ the exponents of its factors. So S_1 and w of (2.12) are known monomial by monomial.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..methods.amplitudes import Stability, decided
from ..methods.averaging import average, slow
from ..methods.modal_polynomials import exponents, modal_parts, waves
from ..methods.modes import Complex, modes
from ..methods.signals import Piece
from ..methods.standard_form import StandardForm
from .balls import NotProvedError
from .proof import Proof, rest_growth

ROUND_OFF = 1e-9  # of the largest exponent, or of the largest coefficient in z_k' of its degree: as good as 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Growth:
    """σ (M,) [1/s] of the monomials z_a z_b … of the equations of v_k, those with a coefficient ≠ 0; indices from 0.

    In z = (u, E) the free motions u of the n modes come first, the waves E of the input after them.
    """

    modes: int
    equation: tuple[int, ...]
    monomials: tuple[tuple[int, ...], ...]
    sigma: Complex

    @property
    def growing(self) -> int:
        """Number of monomials with Re σ > 0: S_1 and w diverge."""
        return int(np.count_nonzero(self.sigma.real > 0.0))

    @property
    def dying(self) -> int:
        """Number of monomials with Re σ < 0: they leave nothing in S_1."""
        return int(np.count_nonzero(self.sigma.real < 0.0))

    @property
    def lasting(self) -> int:
        """Number of monomials with Re σ = 0."""
        return len(self.sigma) - self.growing - self.dying

    @property
    def fastest(self) -> float:
        """Largest Re σ [1/s]; −inf if there is no monomial."""
        return float(self.sigma.real.max(initial=-np.inf))

    @property
    def resonant(self) -> NDArray[np.bool_]:
        """Whether σ = 0, which no change of variables takes out (M,)."""
        return self.sigma == 0.0

    @property
    def nearest(self) -> float:
        """Smallest |σ| ≠ 0 [1/s], what (2.12) is divided by; inf if there is none."""
        return float(np.abs(self.sigma[~self.resonant]).min(initial=np.inf))

    @property
    def coupled(self) -> list[int]:
        """Monomials with σ = 0 that hold one v_j, j ≠ k: they change the linear part by more than A_k + B_k."""
        free = [[i for i in m if i < self.modes] for m in self.monomials]
        return [
            i for i in np.flatnonzero(self.resonant).tolist() if len(free[i]) == 1 and free[i][0] != self.equation[i]
        ]

    def named(self, which: int) -> str:
        """A monomial and its equation, as `v1 v1 E2 in v3'`."""
        factors = [f"v{i + 1}" if i < self.modes else f"E{i - self.modes + 1}" for i in self.monomials[which]]
        return f"{' '.join(factors)} in v{self.equation[which] + 1}'"


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A condition's name, whether it holds, its number [1/s] (C3: 1; nan: not decided) and what the number says."""

    name: str
    holds: bool
    number: float
    reason: str


def growth_of(form: StandardForm, piece: Piece | None = None) -> Growth:
    """Growth of all monomials of Φ_1 under an input that lasts for ever, or none.

    Raises InputError for an input that is no sum of lasting waves.
    """
    found = modes(form.A)
    w = waves(form, found, piece)
    rho, n = exponents(found, w), len(form.A)
    equation: list[int] = []
    monomials: list[tuple[int, ...]] = []
    for part in modal_parts(form, found, w, 1):
        sizes = np.abs(part.coefficients)
        for k, column in zip(*np.nonzero(sizes > ROUND_OFF * sizes.max(axis=1, keepdims=True)), strict=True):
            equation.append(int(k))
            monomials.append(tuple(part.monomials[column].tolist()))
    sigma = np.array([rho[list(m)].sum() - found.eigenvalues[k] for k, m in zip(equation, monomials, strict=True)])
    least = ROUND_OFF * np.abs(rho).max()
    real, imaginary = (np.where(np.abs(part) > least, part, 0.0) for part in (sigma.real, sigma.imag))
    return Growth(modes=n, equation=tuple(equation), monomials=tuple(monomials), sigma=real + 1j * imaginary)


def conditions(form: StandardForm, piece: Piece | None, prove: Callable[[], Proof]) -> tuple[Verdict, ...]:
    """C0, as printed; C1, by averaging; C2, by Poincaré and Dulac; C3, proved by `prove`: the verdict of record.

    piece : the input's last piece, None where it ends.  prove : of a motion under the whole input, see `Proof`.
    """
    found = modes(form.A)
    growth, equations = growth_of(form, piece), average(form, piece, found=found, detuning=slow(found))
    try:
        averaged: Stability | InputError = decided(equations)
    except InputError as error:  # C0 and C3 do not need it
        averaged = error
    linear = float(equations.linear.real.max())
    return as_printed(growth, linear), by_averaging(averaged), by_normal_form(growth, averaged), by_proof(prove)


def as_printed(growth: Growth, linear: float) -> Verdict:
    """v' = ε S_1(v) with an asymptotically stable v = 0, and a bounded w of (2.12).

    linear : largest growth rate [1/s] of S_1's linear part, where S_1 exists.
    """
    counts = (
        f"of {len(growth.sigma)} monomials of X^-1 S {growth.growing} grow, {growth.dying} die out, "
        f"{growth.lasting} last"
    )
    if growth.growing:
        which = growth.named(int(np.argmax(growth.sigma.real)))
        reason = f"{counts}; S_1 and w diverge: {which} as exp({growth.fastest:.4g} t)"
        return Verdict(name="C0", holds=False, number=growth.fastest, reason=reason)
    neutral = set(range(growth.modes)) - {
        k for k, resonant in zip(growth.equation, growth.resonant.tolist(), strict=True) if resonant
    }
    if neutral:
        rows = ", ".join(f"v{k + 1}" for k in sorted(neutral))
        reason = f"{counts}; S_1 = 0 in the equations of {rows}: v = 0 is but neutral"
        return Verdict(name="C0", holds=False, number=0.0, reason=reason)
    said = "stable" if linear < 0.0 else "not stable to first order"
    return Verdict(name="C0", holds=linear < 0.0, number=linear, reason=f"{counts}; v = 0 of v' = S_1(v) is {said}")


def by_averaging(averaged: Stability | InputError) -> Verdict:
    """Only exp(iβt) is taken out: Re(α_k + A_k + B_k) < 0, the Floquet exponents' real parts to the order of A²."""
    if isinstance(averaged, InputError):
        return Verdict(name="C1", holds=False, number=np.nan, reason=f"not decided: {averaged}")
    most = -averaged.margin
    words = f", its margin {averaged.words}" if averaged.words else ""
    reason = f"largest Re(alpha_k + A_k + B_k){words}, {averaged.lost}"
    return Verdict(name="C1", holds=most < 0.0, number=most, reason=reason)


def by_normal_form(growth: Growth, averaged: Stability | InputError) -> Verdict:
    """All with σ ≠ 0 is taken out, integrated from 0 where Re σ < 0, from infinity where Re σ > 0: no small damping.

    What is left has the linear part λ_k + A_k + B_k, unless modes are coupled by monomials linear in v with σ = 0.
    """
    stay, coupled = int(np.count_nonzero(growth.resonant)), growth.coupled
    reason = f"smallest |sigma| != 0, so w is bounded; {stay} monomials have sigma = 0 and stay"
    reason += f", {len(coupled)} of them couple modes, as {growth.named(coupled[0])}" if coupled else ""
    if isinstance(averaged, InputError):
        reason += "; decay of what stays not decided, as in C1"
        return Verdict(name="C2", holds=False, number=growth.nearest, reason=reason)
    words = f", {averaged.words}" if averaged.words else ""
    reason += f"; decay of what stays {averaged.margin:.4g} 1/s{words}"
    return Verdict(name="C2", holds=averaged.margin > 0.0 and not coupled, number=growth.nearest, reason=reason)


def by_proof(prove: Callable[[], Proof]) -> Verdict:
    """Two motions of the proved tube approach each other: by m < 1 over a period, or with α − L > 0 at rest."""
    try:
        proof = prove()
    except NotProvedError as error:
        return Verdict(name="C3", holds=False, number=np.inf, reason=f"not proved: {error}")
    if proof.repetition is not None:
        m, period = proof.repetition.multiplier
        reason = f"multiplier of differences in the tube over {period:.4g} s, proved: they die out if it is < 1"
        return Verdict(name="C3", holds=m < 1.0, number=m, reason=reason)
    L, alpha = rest_growth(proof.system, proof.metric, proof.ends[0]), proof.metric.alpha
    reason = f"L/alpha after the input's end, proved: L = {L:.3g} 1/s, alpha = {alpha:.4g} 1/s; x -> 0 if it is < 1"
    return Verdict(name="C3", holds=alpha > L, number=L / alpha, reason=reason)
