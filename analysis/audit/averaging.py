"""§3.3: the averages (3.20) as printed, and evidence on textbook systems whose means are exact by quadrature.

A textbook system has n/2 damped oscillators, any cubic coupling ε R(x) that is real, and one sine road. Its frequencies
are integers, so that the mean over 2π of every product that occurs is exact to round-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from ..methods import modes
from ..methods.modes import Complex
from . import modal
from .rows import Evidence, Row

SAMPLES = 256
T = np.linspace(0.0, 2.0 * np.pi, SAMPLES, endpoint=False)
QUIET = ((5, 17), 9)  # β, Ω without any resonance of a cubic system


def rows() -> list[Row]:
    """(3.20) in the order of the paper."""
    return [_limit(), _pairs(), _A(), _B()]


def over_orders(alpha: Complex) -> Complex:
    """ᾱ_ijkl of (3.20), the sum of α over the six orders of j, k, l."""
    return np.sum([alpha.transpose(0, *order) for order in permutations((1, 2, 3))], axis=0)


@dataclass(frozen=True, slots=True)
class Textbook:
    """ξ_k' − λ_k ξ_k = f_k + ε R_k(ξ) + ε P_k(t, ξ), modes ordered λ_1 … λ_n/2 and then their conjugates.

    beta (n), W: frequencies of the modes and of the road.   alpha (n, n, n, n): R_i = α_ijkl ξ_j ξ_k ξ_l.
    P, psi (n): of (3.17).   B2 (n, n), B3 (n, n, n): of P_i below it.   s (n): the slow amplitudes.
    """

    beta: NDArray[np.float64]
    W: float
    alpha: Complex
    P: Complex
    psi: Complex
    B2: Complex
    B3: Complex
    s: Complex

    @property
    def alpha_bar(self) -> Complex:
        """ᾱ_ijkl."""
        return over_orders(self.alpha)

    def xi(self, t: NDArray[np.float64] = T) -> Complex:
        """s_k exp(iβ_k t) + P_k sin(Ωt + ψ_k), (n, len(t))."""
        forced = self.P[:, None] * np.sin(self.W * t + self.psi[:, None])
        return self.s[:, None] * np.exp(1j * self.beta[:, None] * t) + forced

    def mean(self, values: Complex) -> Complex:
        """(1/T)∫ exp(−iβ_k t) values_k dt, (n); values (n, SAMPLES)."""
        return np.mean(np.exp(-1j * self.beta[:, None] * T) * values, axis=1)

    def R_mean(self) -> Complex:
        x = self.xi()
        return self.mean(np.einsum("ijkl,jt,kt,lt->it", self.alpha, x, x, x, optimize=True))

    def P_mean(self) -> Complex:
        x, wave = self.xi(), np.sin(self.W * T)
        linear = np.einsum("ij,jt,t->it", self.B2, x, wave)
        return self.mean(linear + np.einsum("ijk,jt,kt,t->it", self.B3, x, x, wave, optimize=True))


def eigenvalues(beta: NDArray[np.float64]) -> Complex:
    """λ (n) of the textbook system with the frequencies beta (n)."""
    return -0.3 * (1.0 + np.arange(len(beta)) % (len(beta) // 2)) + 1j * beta


def textbook(beta: Sequence[int], W: int, seed: int = 2026) -> Textbook:
    """A system with these frequencies, its couplings drawn at random."""
    rng = np.random.default_rng(seed)
    m, n = len(beta), 2 * len(beta)
    both = np.array([*beta, *(-b for b in beta)], dtype=float)
    half = rng.normal(size=(n, m)) + 1j * rng.normal(size=(n, m))
    K = np.concatenate([half, half.conj()], axis=1)  # of a real system: modes in conjugate pairs
    inverse = np.linalg.inv(K)
    r, b2, b3 = (rng.normal(size=(n,) * k) for k in (4, 2, 3))
    P, psi = modal.printed_amplitude(eigenvalues(both), inverse @ rng.normal(size=n).astype(complex), W)
    s = rng.normal(size=m) + 1j * rng.normal(size=m)
    return Textbook(
        beta=both,
        W=W,
        alpha=np.einsum("ai,ijkl,jb,kc,ld->abcd", inverse, r, K, K, K, optimize=True),
        P=P,
        psi=psi,
        B2=np.einsum("ai,ij,jb->ab", inverse, b2, K),
        B3=np.einsum("ai,ijk,jb,kc->abc", inverse, b3, K, K),
        s=np.concatenate([s, s.conj()]),
    )


# ------------------------------------------------------------------ (3.20)
def A_printed(alpha_bar: Complex, P: Complex) -> Complex:
    """A_i = ½ Σ_jk ᾱ_iijk P_j P_k, for one ν."""
    return np.einsum("iijk,j,k->i", alpha_bar, P, P) / 2.0


def A_corrected(alpha_bar: Complex, P: Complex, psi: Complex) -> Complex:
    """A_i = ¼ Σ_jk ᾱ_iijk P_j P_k cos(ψ_j − ψ_k), for one ν."""
    return np.einsum("iijk,j,k,jk->i", alpha_bar, P, P, np.cos(psi[:, None] - psi)) / 4.0


def B_printed(x: Textbook) -> Complex:
    """B_i = ½ Σ_j (B_ii + B_ij) P_j cos ψ_j, for one ν."""
    return np.einsum("ij,j->i", np.diag(x.B2)[:, None] + x.B2, x.P * np.cos(x.psi)) / 2.0


def B_corrected(x: Textbook) -> Complex:
    """B_i = ½ Σ_j (B_iij + B_iji) P_j cos ψ_j, for one ν."""
    return np.einsum("iij,j->i", x.B3 + x.B3.swapaxes(1, 2), x.P * np.cos(x.psi)) / 2.0


def pair_sum(x: Textbook, *, halved: bool) -> Complex:
    """Σ_j ᾱ_iijj+n/2 s_j s_j+n/2 (n); `halved`: the term j = i mod n/2 by two, as its orders are fewer."""
    m = len(x.beta) // 2
    terms = np.einsum("iijj->ij", x.alpha_bar[:, :, :m, m:]) * (x.s[:m] * x.s[m:])
    if halved:
        own = np.arange(2 * m)
        terms[own, own % m] /= 2.0
    return terms.sum(axis=1)


def missed(mean: Complex, formula: Complex) -> float:
    """Largest |formula − mean| over largest |mean|."""
    return float(np.abs(formula - mean).max() / np.abs(mean).max())


def still(x: Textbook) -> Textbook:
    """The same system on a flat road."""
    return Textbook(x.beta, x.W, x.alpha, 0.0 * x.P, x.psi, x.B2, x.B3, x.s)


def relative(measure: str, printed: float, derived: float) -> Evidence:
    return Evidence(measure=measure, printed=printed, derived=derived, unit="1", tolerance=1e-11, apart=0.1)


def _limit() -> Row:
    """The right side of (3.20), corrected, against the integral of exp(−iβ_i t) R_i over 100 periods, and over T."""
    x, periods = textbook(*QUIET), 100
    t = np.linspace(0.0, 2.0 * np.pi * periods, SAMPLES * periods + 1)
    xi = x.xi(t)
    R = np.einsum("ijkl,jt,kt,lt->it", x.alpha, xi, xi, xi, optimize=True)
    integral = np.trapezoid(np.exp(-1j * x.beta[:, None] * t) * R, t, axis=1)
    right = x.s * (A_corrected(x.alpha_bar, x.P, x.psi) + pair_sum(x, halved=True))
    return Row(
        equation="before (3.20), (3.20)",
        printed="lim ∫",
        derived="lim (1/T) ∫",
        evidence=[
            relative(
                "largest error of the right side of (3.20), corrected as below, against ∫ over 200π, and (1/T) ∫, "
                "system of 2 oscillators",
                missed(integral, right),
                missed(integral / t[-1], right),
            )
        ],
    )


def _pairs() -> Row:
    x = still(textbook(*QUIET))
    mean = x.R_mean()
    return Row(
        equation="(3.20) R̄_i",
        printed="s_i Σ_j ᾱ_ijj+7 s_j s_j+7",
        derived="s_i Σ_j ᾱ_iijj+7 s_j s_j+7, halved where j = i mod 7",
        evidence=[
            relative(
                "largest error of the mean by quadrature, system of 2 oscillators on a flat road, ᾱ_iijj+2 read",
                missed(mean, x.s * pair_sum(x, halved=False)),
                missed(mean, x.s * pair_sum(x, halved=True)),
            )
        ],
    )


def _A() -> Row:
    x = textbook(*QUIET)
    rest = x.s * pair_sum(x, halved=True)
    mean = x.R_mean() - rest
    bar, P, psi, truth = of_the_car()
    return Row(
        equation="(3.20) A_i",
        printed="½ Σ ᾱ_iijk Σ_ν P_jν P_kν",
        derived="¼ Σ ᾱ_iijk Σ_ν P_jν P_kν cos(ψ_νj − ψ_νk), complex",
        evidence=[
            relative(
                "largest error of the mean by quadrature, system of 2 oscillators",
                missed(mean, x.s * A_printed(x.alpha_bar, x.P)),
                missed(mean, x.s * A_corrected(x.alpha_bar, x.P, x.psi)),
            ),
            relative(
                "least error of any A_i of the default car, sine road under the front left wheel",
                float((np.abs(A_printed(bar, P) - truth) / np.abs(truth)).min()),
                float((np.abs(A_corrected(bar, P, psi) - truth) / np.abs(truth)).max()),
            ),
        ],
    )


def of_the_car() -> tuple[Complex, Complex, Complex, Complex]:
    """ᾱ, P, ψ of the default car on the default sine road under the front left wheel, and A_i by quadrature."""
    found, cubic, w = modal.modes(), modal.cubic_part(), modal.omega()
    P, psi = modal.printed_amplitude(found.eigenvalues, modal.gains(), w)
    alpha = modes.modal(cubic, found, 8)[0]
    t = np.linspace(0.0, 2.0 * np.pi / w, 32, endpoint=False)
    x = (found.K @ (P[:, None] * np.sin(w * t + psi[:, None]))).real
    slope = np.mean([cubic.jacobian(np.append(state, np.zeros(8)))[:, :14] for state in x.T], axis=0)
    truth = np.einsum("ai,ij,ja->a", found.K_inverse, slope, found.K)
    return over_orders(alpha), P, psi, truth


def _B() -> Row:
    x = textbook(*QUIET)
    mean = x.P_mean()
    return Row(
        equation="(3.20) B_i",
        printed="½ Σ (B_νii + B_νij) P_jν cos ψ_νj",
        derived="½ Σ (B_νiij + B_νiji) P_jν cos ψ_νj; 0 for a front wheel",
        evidence=[
            relative(
                "largest error of the mean by quadrature, system of 2 oscillators with B_νij and B_νijk",
                missed(mean, x.s * B_printed(x)),
                missed(mean, x.s * B_corrected(x)),
            )
        ],
    )
