"""§3.3: the averages (3.20) as printed, and evidence on textbook systems whose means are exact by quadrature.

A textbook system has n/2 damped oscillators, any cubic coupling ε R(x) that is real, and one sine road. Its frequencies
are integers, so that the mean over 2π of every product that occurs is exact to round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from . import section3
from .rows import Evidence, Row

Complex = NDArray[np.complex128]
SAMPLES = 256
T = np.linspace(0.0, 2.0 * np.pi, SAMPLES, endpoint=False)
QUIET = ((5, 17), 9)  # β, Ω without any resonance of a cubic system


def rows() -> list[Row]:
    """§3.3 in the order of the paper."""
    return [_limit(), _pairs(), _A(), _B(), _factor(), _condition(), *_resonances()]


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


def textbook(beta: Sequence[int], W: int, seed: int = 2026) -> Textbook:
    """A system with these frequencies, its couplings drawn at random."""
    rng = np.random.default_rng(seed)
    m, n = len(beta), 2 * len(beta)
    lam = -0.3 * (1.0 + np.arange(m)) + 1j * np.array(beta)
    half = rng.normal(size=(n, m)) + 1j * rng.normal(size=(n, m))
    K = np.concatenate([half, half.conj()], axis=1)  # of a real system: modes in conjugate pairs
    inverse = np.linalg.inv(K)
    r, b2, b3 = (rng.normal(size=(n,) * k) for k in (4, 2, 3))
    P, psi = section3.printed_amplitude(np.concatenate([lam, lam.conj()]), inverse @ rng.normal(size=n), W)
    s = rng.normal(size=m) + 1j * rng.normal(size=m)
    return Textbook(
        beta=np.array([*beta, *(-b for b in beta)], dtype=float),
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


def _missed(mean: Complex, formula: Complex) -> float:
    """Largest |formula − mean| over largest |mean|."""
    return float(np.abs(formula - mean).max() / np.abs(mean).max())


def _still(x: Textbook) -> Textbook:
    """The same system on a flat road."""
    return Textbook(x.beta, x.W, x.alpha, 0.0 * x.P, x.psi, x.B2, x.B3, x.s)


def _relative(measure: str, printed: float, derived: float) -> Evidence:
    return Evidence(measure=measure, printed=printed, derived=derived, unit="1", tolerance=1e-11, apart=0.1)


def _limit() -> Row:
    """The integral of exp(−iβ_i t) R_i, and the mean, over one period and over 100."""
    x = textbook(*QUIET)

    def integral(periods: int) -> float:
        t = np.linspace(0.0, 2.0 * np.pi * periods, SAMPLES * periods + 1)
        xi = x.xi(t)
        R = np.einsum("ijkl,jt,kt,lt->it", x.alpha, xi, xi, xi, optimize=True)
        return float(np.abs(np.trapezoid(np.exp(-1j * x.beta[:, None] * t) * R, t, axis=1)).max())

    growth = integral(100) / integral(1)
    return Row(
        equation="before (3.20), (3.20)",
        printed="lim ∫",
        derived="lim (1/T) ∫",
        evidence=[
            Evidence(
                measure="R̄ over 100 T against over T, T = 2π, system of 2 oscillators",
                printed=growth,
                derived=growth / 100,
                unit="1",
                expected=1.0,
                tolerance=1e-11,
                apart=10.0,
            )
        ],
    )


def _pairs() -> Row:
    x = _still(textbook(*QUIET))
    mean = x.R_mean()
    return Row(
        equation="(3.20) R̄_i",
        printed="s_i Σ_j ᾱ_ijj+7 s_j s_j+7",
        derived="s_i Σ_j ᾱ_iijj+7 s_j s_j+7, halved where j = i mod 7",
        evidence=[
            _relative(
                "largest error of the mean by quadrature, system of 2 oscillators on a flat road, ᾱ_iijj+2 read",
                _missed(mean, x.s * pair_sum(x, halved=False)),
                _missed(mean, x.s * pair_sum(x, halved=True)),
            )
        ],
    )


def _A() -> Row:
    x = textbook(*QUIET)
    rest = x.s * pair_sum(x, halved=True)
    mean = x.R_mean() - rest
    bar, P, psi, truth = _car()
    return Row(
        equation="(3.20) A_i",
        printed="½ Σ ᾱ_iijk Σ_ν P_jν P_kν",
        derived="¼ Σ ᾱ_iijk Σ_ν P_jν P_kν cos(ψ_νj − ψ_νk), complex",
        evidence=[
            _relative(
                "largest error of the mean by quadrature, system of 2 oscillators",
                _missed(mean, x.s * A_printed(x.alpha_bar, x.P)),
                _missed(mean, x.s * A_corrected(x.alpha_bar, x.P, x.psi)),
            ),
            _relative(
                "least error of any A_i of the default car, sine road under the front left wheel",
                float((np.abs(A_printed(bar, P) - truth) / np.abs(truth)).min()),
                float((np.abs(A_corrected(bar, P, psi) - truth) / np.abs(truth)).max()),
            ),
        ],
    )


def _car() -> tuple[Complex, Complex, Complex, Complex]:
    """ᾱ, P, ψ of the default car on the default sine road under the front left wheel, and A_i by quadrature."""
    lam, K = section3.modes()
    w = section3.omega()
    P, psi = section3.printed_amplitude(lam, section3.gains(), w)
    r = section3.autonomous_tensor()
    alpha = np.einsum("ai,ijkl,jb,kc,ld->abcd", np.linalg.inv(K), r, K, K, K, optimize=True)
    t = np.linspace(0.0, 2.0 * np.pi / w, 32, endpoint=False)
    x = (K @ (P[:, None] * np.sin(w * t + psi[:, None]))).real
    slope = 3.0 * np.einsum("ijkl,kt,lt->ij", r, x, x, optimize=True) / len(t)  # mean derivative of R by the state
    truth = np.einsum("ai,ij,ja->a", np.linalg.inv(K), slope, K)
    return over_orders(alpha), P, psi, truth


def _B() -> Row:
    x = textbook(*QUIET)
    mean = x.P_mean()
    return Row(
        equation="(3.20) B_i",
        printed="½ Σ (B_νii + B_νij) P_jν cos ψ_νj",
        derived="½ Σ (B_νiij + B_νiji) P_jν cos ψ_νj; 0 for a front wheel",
        evidence=[
            _relative(
                "largest error of the mean by quadrature, system of 2 oscillators with B_νij and B_νijk",
                _missed(mean, x.s * B_printed(x)),
                _missed(mean, x.s * B_corrected(x)),
            )
        ],
    )


def _factor() -> Row:
    epsilon = 0.01
    x = _still(textbook(*QUIET))
    mean, pairs = epsilon * x.R_mean(), pair_sum(x, halved=True)
    return Row(
        equation="amplitude equation after (3.20)",
        printed="… + Σ_j ᾱ_kkjj+7 s_j s_j+7",
        derived="… + ε Σ_j ᾱ_kkjj+7 s_j s_j+7",
        evidence=[
            _relative(
                "largest error of ṡ_k − α_k s_k at ε = 0.01, 2 oscillators on a flat road, sum halved as above",
                _missed(mean, x.s * pairs),
                _missed(mean, epsilon * x.s * pairs),
            )
        ],
    )


def _condition() -> Row:
    bar, P, psi, _ = _car()
    A = A_corrected(bar, P, psi)
    return Row(
        equation="condition after (3.20)",
        printed="α_k + ε(A_k + B_k) < 0",
        derived="Re(α_k + ε(A_k + B_k)) < 0; the imaginary part shifts the frequency",
        evidence=[
            Evidence(
                measure="largest |Im|/|·| of what is compared with 0, A_k of the default car, sine road",
                printed=float((np.abs(A.imag) / np.abs(A)).max()),
                derived=float(np.abs(np.imag(A.real + 0j)).max()),
                unit="1",
                tolerance=0.0,
                apart=0.1,
            )
        ],
    )


# ------------------------------------------------------------------ resonances
Cases = Sequence[tuple[Sequence[int], int]]  # β, Ω (0: flat road)
Criterion = Callable[[Sequence[int], int], bool]


def printed_condition(beta: Sequence[int], W: int) -> bool:
    """Before (3.20): resonance if β_k = β_l, k ≠ l, or β_k = νΩ (the road has ν = 1 only)."""
    return len(set(beta)) < len(beta) or W in beta


def printed_internal(beta: Sequence[int], _: int) -> bool:
    """Remark 3.2, of its equalities the imaginary parts: β_j + β_k = β_l or β_j + β_k + β_l = β_m."""
    sums = {sum(chosen) for count in (2, 3) for chosen in product(beta, repeat=count)}
    return bool(sums & set(beta))


def cubic_condition(beta: Sequence[int], W: int) -> bool:
    """Resonance if ±ω_1 ± ω_2 ± ω_3 = β_i, each ω a β or the road's (W > 0), but by pairs that cancel."""
    signed = [sign * b for b in (*beta, *([W] if W else [])) for sign in (1, -1)]
    for i, target in enumerate(beta):
        allowed = _cancelling(signed, 2 * i)
        for places in product(range(len(signed)), repeat=3):
            if tuple(sorted(places)) not in allowed and sum(signed[k] for k in places) == target:
                return True
    return False


def _cancelling(signed: Sequence[int], own: int) -> set[tuple[int, ...]]:
    """The mode itself with any frequency and its opposite."""
    return {tuple(sorted((own, k, k + 1))) for k in range(0, len(signed), 2)}


def is_resonant(beta: Sequence[int], W: int) -> bool:
    """By quadrature: whether the mean of R_i has more than the corrected (3.20)."""
    x = textbook(beta, W or 1)
    x = x if W else _still(x)
    formula = x.s * (A_corrected(x.alpha_bar, x.P, x.psi) + pair_sum(x, halved=True))
    return _missed(x.R_mean(), formula) > 1e-9


def wrong_verdicts(criterion: Criterion, cases: Cases) -> float:
    """How many of the cases a criterion judges otherwise than quadrature."""
    return float(sum(criterion(beta, W) != is_resonant(beta, W) for beta, W in cases))


FORCED = [((b1, b2), W) for b1, b2, W in product((3, 4, 5), (7, 9, 11, 15), (2, 5, 7, 9))]
FREE = [((b1, b2, b3), 0) for b1, b2, b3 in product((3, 4), (5, 6, 7, 8), (9, 10, 12))]


def _resonances() -> list[Row]:
    def row(equation: str, text: str, better: str, criterion: Criterion, cases: Cases) -> Row:
        example = next(c for c in cases if criterion(*c) != is_resonant(*c))
        return Row(
            equation=equation,
            printed=text,
            derived=better,
            evidence=[
                Evidence(
                    measure=f"wrong verdicts on {len(cases)} systems, whether (3.20) misses a part of the mean",
                    printed=wrong_verdicts(criterion, cases),
                    derived=wrong_verdicts(cubic_condition, cases),
                    unit="1",
                    tolerance=0.0,
                    apart=1.0,
                )
            ],
            note=f"The first: β = {', '.join(map(str, example[0]))}" + (f", Ω = {example[1]}." if example[1] else "."),
        )

    return [
        row(
            "no-resonance condition before (3.20)",
            "β_k ≠ β_l, β_k ≠ νΩ",
            "no β_i = ±ω_1 ± ω_2 ± ω_3, each ω a β_j or a νΩ, but by pairs that cancel (so β_i ± β_j ≠ (μ ± ν)Ω too)",
            printed_condition,
            FORCED,
        ),
        row(
            "remark 3.2",
            "λ_j + λ_k − λ_l = 0, λ_j + λ_k + λ_l − λ_m = 0",
            "in an odd system β_j + β_k + β_l = β_m and β_j + β_k = β_l + β_m but by equal pairs; never the first",
            printed_internal,
            FREE,
        ),
    ]
