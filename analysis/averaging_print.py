"""(3.17) and (3.20) as printed, as they should read, and by quadrature: numbers that say how far the print is off.

The setting is the paper's: one input h(t) = Σ A_ν sin νΩt enters, through column `column` of B and of Φ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .averaging import average
from .modal_polynomials import linear_map, waves, with_input, without_input
from .modes import Complex, modes
from .polynomials import Array
from .signals import Piece
from .standard_form import StandardForm


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedAverages:
    """Coefficients (n,) [1/s] for ε = 1; P, psi (n, N) of (3.17); alpha_pairs (n, n/2) for s_k s_j s_(j + n/2).

    *_printed is the letter of the print, *_closed what it should be, in the print's own symbols.
    """

    P: Complex
    psi: Complex
    A_printed: Complex
    A_closed: Complex
    B_printed: Complex
    B_closed: Complex
    pairs_printed: Complex
    pairs_closed: Complex


def sine_series(amplitudes: Sequence[float], Omega: float, column: int, inputs: int) -> Piece:
    """w_column = Σ A_ν sin νΩt, all other inputs 0."""
    nu = np.arange(1, len(amplitudes) + 1)
    half = np.array(amplitudes, complex) / 2j
    table = np.zeros((inputs, 2 * len(nu)), complex)
    table[column] = np.concatenate([half, -half])
    return Piece(0.0, 1j * Omega * np.concatenate([nu, -nu]), table)


def printed_forced(lam: Complex, gamma: Complex, amplitudes: Array, Omega: float) -> tuple[Complex, Complex]:
    """P_kν and ψ_νk (n, N) of (3.17), complex, with principal branches; right for Re λ < 0."""
    omega = Omega * np.arange(1, len(amplitudes) + 1)
    P = gamma[:, None] * amplitudes / np.sqrt(lam[:, None] ** 2 + omega**2)
    return P, np.arctan(omega / lam[:, None])


def printed_averages(form: StandardForm, amplitudes: Sequence[float], Omega: float, column: int) -> PrintedAverages:
    """All of (3.20), by the tensors of (3.14), as printed and as derived.

    R̄'s ᾱ_ijj+7 is read as ᾱ_iijj+7, as printed not halved where j = i mod 7. B_νij = A_ν π_i1j are terms linear in ξ.
    """
    m, A = modes(form.A), np.array(amplitudes, float)
    n, half = len(form.A), len(form.A) // 2
    P, psi = printed_forced(m.eigenvalues, m.K_inverse @ form.B[:, column], A, Omega)
    alpha, pi2, pi1 = _tensors(form, m.K, m.K_inverse, column)
    bar = 6.0 * alpha
    diagonal = np.einsum("iijk->ijk", bar)
    squares = np.einsum("jv,kv->jk", P, P)
    phased = np.einsum("jv,kv,jkv->jk", P, P, np.cos(psi[:, None] - psi[None]))
    cosines = P * np.cos(psi)  # (n, N)
    quadratic, linear = np.einsum("v,ijk->vijk", A, pi2), np.einsum("v,ij->vij", A, pi1)
    printed = np.einsum("vii->vi", linear)[:, :, None] + linear  # B_νii + B_νij
    whole = np.einsum("viij->vij", quadratic) + np.einsum("viji->vij", quadratic)
    pairs = np.array([[bar[i, i, j, j + half] for j in range(half)] for i in range(n)])
    same = np.arange(n)[:, None] % half == np.arange(half)
    return PrintedAverages(
        P=P,
        psi=psi,
        A_printed=0.5 * np.einsum("ijk,jk->i", diagonal, squares),
        A_closed=0.25 * np.einsum("ijk,jk->i", diagonal, phased),
        B_printed=0.5 * np.einsum("vij,jv->i", printed, cosines),
        B_closed=0.5 * np.einsum("vij,jv->i", whole, cosines),
        pairs_printed=pairs,
        pairs_closed=np.where(same, 0.5, 1.0) * pairs,
    )


def _tensors(form: StandardForm, K: Complex, K_inverse: Complex, column: int) -> tuple[Complex, Complex, Complex]:
    """α_abcd symmetric in b, c, d; π_a1bc symmetric in b, c; π_a1b: of ξξξ, h ξξ and h ξ in Φ_1."""
    n = len(K)
    y, h = n + form.B.shape[1], n + column
    tensors = {part.degree: part.tensor(y) for part in form.terms.get(1, ())}
    zero: NDArray[np.float64] = np.zeros((n, y, y, y))
    cubic = tensors.get(3, zero)
    alpha = np.einsum("ai,ijkl,jb,kc,ld->abcd", K_inverse, cubic[:, :n, :n, :n], K, K, K, optimize=True)
    pi2 = 3.0 * np.einsum("ai,ijk,jb,kc->abc", K_inverse, cubic[:, h, :n, :n], K, K, optimize=True)
    quadratic = tensors.get(2, zero[..., 0])
    return alpha, pi2, 2.0 * np.einsum("ai,ij,jb->ab", K_inverse, quadratic[:, h, :n], K)


def mean_over(T: float, samples: int, values: NDArray[np.complex128], *, smooth: bool = True) -> Complex:
    """(1/T) ∫_0^T of values (…, samples) at equal steps; smooth: weighted by a bump, which speeds the limit up."""
    s = (np.arange(samples) + 0.5) / samples
    weight = np.exp(-1.0 / (s * (1.0 - s))) if smooth else np.ones(samples)
    return np.asarray(values @ (weight / weight.sum()))


def averaged_by_quadrature(
    form: StandardForm, piece: Piece | None, s: Complex, T: float, samples: int, *, smooth: bool = True
) -> Complex:
    """(1/T) ∫_0^T exp(−iβ_k t) Φ_k dt (n,), the s_k kept fixed, for ε = 1 and Φ's first power of ε."""
    m = modes(form.A)
    w = waves(form, m, piece)
    t = (np.arange(samples) + 0.5) * (T / samples)
    turns = np.exp(1j * np.multiply.outer(m.beta, t))
    y = linear_map(m, w) @ np.concatenate([s[:, None] * turns, w.at(t)])
    values = sum((part(y) for part in form.terms[1]), np.zeros(turns.shape, complex))
    return mean_over(T, samples, np.conj(turns) * (m.K_inverse @ values), smooth=smooth)


def unaveraged_growth(form: StandardForm, piece: Piece, T: float, samples: int) -> float:
    """The print's lim ∫ without 1/T: ratio of the integral over 2T to that over T; 2 means that it has no limit."""
    s = np.full(len(form.A), 0.01 + 0.0j)
    once, twice = (averaged_by_quadrature(form, piece, s, k * T, k * samples, smooth=True) * k for k in (1, 2))
    return float(np.abs(twice).max() / np.abs(once).max())


def compare(
    form: StandardForm, amplitudes: Sequence[float], Omega: float, column: int
) -> dict[str, tuple[float, float]]:
    """For each formula of (3.20): relative error of the print, and of what it should read, against `average`."""
    p = printed_averages(form, amplitudes, Omega, column)
    piece = sine_series(amplitudes, Omega, column, form.B.shape[1])
    equations = average(form, piece)
    w = equations.waves
    t = np.linspace(0.0, 2.0 * np.pi / Omega, 50)
    phase = np.multiply.outer(Omega * np.arange(1, len(amplitudes) + 1), t)
    sines = np.einsum("kv,kvt->kt", p.P, np.sin(phase + p.psi[..., None]))
    A, B = (average(replace(form, terms=terms), piece).linear for terms in (without_input(form), with_input(form)))
    return {
        "(3.17)": (_off(sines, w.forced @ w.at(t)),) * 2,
        "A_i of (3.20)": (_off(p.A_printed, A), _off(p.A_closed, A)),
        "B_i of (3.20)": (_off(p.B_printed, B), _off(p.B_closed, B)),
        "sum over j of (3.20)": (_off(p.pairs_printed, equations.cubic), _off(p.pairs_closed, equations.cubic)),
    }


def _off(value: Complex, truth: Complex) -> float:
    """Largest deviation over the largest value; 0 if both vanish."""
    size = float(np.abs(truth).max(initial=0.0))
    off = float(np.abs(value - truth).max(initial=0.0))
    return off / size if size else off
