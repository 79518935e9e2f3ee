"""The default car in the form and in the modes of §3.2; evidence on (3.13) to (3.17)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car

from ..car import car_form
from ..methods import modes as product
from ..methods.linear_response import linear_response, periodic_response
from ..methods.modes import Complex, Modes
from ..methods.polynomials import Array, Homogeneous
from ..methods.signals import constant, harmonic
from ..methods.standard_form import StandardForm
from .rows import RIGHT, Evidence, Row


def rows() -> list[Row]:
    """(3.13) and (3.14)."""
    return [_forced(), _nonlinear(), _modal_matrix()]


@cache
def form() -> StandardForm:
    """The default car, expanded to degree 3."""
    return car_form(Car(), order=3)


def cubic_part() -> Homogeneous:
    """The terms of degree 3 in (x, h, ḣ)."""
    (part,) = (part for parts in form().terms.values() for part in parts if part.degree == 3)
    return part


@cache
def modes() -> Modes:
    """Of the default car."""
    return product.modes(form().A)


def omega() -> float:
    """Ω of the default road [rad/s]."""
    return RoadParameters().omega


@cache
def gains() -> Complex:
    """γ_k1 (14): f_k = γ_k1 h11."""
    return modes().input(form().B)[:, 0]


def printed_amplitude(lam: Complex, gain: Complex, w: float) -> tuple[Complex, Complex]:
    """P_kν over A_ν and ψ_νk as printed below (3.17), with principal branches."""
    return gain / np.sqrt(lam**2 + w**2), np.arctan(w / lam)


def _left(xi: Callable[[Array], Complex]) -> float:
    """Largest |ξ' − Λξ − f(t)|/|γ| over all modes and a wave of the road, by differences; ξ(t) (14, n)."""
    t, step = np.linspace(0.01, 0.01 + 2.0 * np.pi / omega(), 50), 1e-6
    rate = (xi(t + step) - xi(t - step)) / (2.0 * step)
    force = gains()[:, None] * np.sin(omega() * t)
    left = np.abs(rate - modes().eigenvalues[:, None] * xi(t) - force)
    return float((left / np.abs(gains())[:, None]).max())


def _forced() -> Row:
    """Homogeneous ξ, which K⁻¹ (3.11) gives, and forced ξ, put into (3.13)."""
    P, psi = printed_amplitude(modes().eigenvalues, gains(), omega())
    start, nothing = np.full(14, 0.01), constant([0.0] * 8)
    return Row(
        equation="(3.13)",
        printed="ξ of free vibrations, superscript (h), by K⁻¹ times (3.11)",
        derived="ξ of forced vibrations, by K⁻¹ times the linear part of (3.10)",
        evidence=[
            Evidence(
                measure="|ξ' − Λξ − f(t)| over |f|, sine road under the front left wheel",
                printed=_left(lambda t: modes().K_inverse @ linear_response(form().A, form().B, start, nothing, t)),
                derived=_left(lambda t: P[:, None] * np.sin(omega() * t + psi[:, None])),
                unit="1",
                tolerance=1e-6,
                apart=0.5,
            )
        ],
    )


def by_the_letter() -> tuple[Complex, Complex]:
    """α_abcd (14, …) and of ψ_abc(t) the factors of h_j, (14, 8, 14, 14), by the products after (3.14).

    r_ijkl and d_ijkl are those of the cubic part as it stands, each product once, not symmetric.
    """
    r, d = np.zeros((14, 14, 14, 14)), np.zeros((14, 8, 14, 14))
    for i, (j, k, l), value in cubic_part().entries():  # noqa: E741  the paper's letter
        if l < 14:
            r[i, j, k, l] = value
        else:
            d[i, l - 14, j, k] = value
    K, inverse = modes().K, modes().K_inverse
    alpha = np.einsum("ai,ijkl,jb,kc,ld->abcd", inverse, r, K, K, K, optimize=True)
    return alpha, np.einsum("ai,ijkl,kb,lc->ajbc", inverse, d, K, K, optimize=True)


def _nonlinear() -> Row:
    """εΦ at 20 complex ξ and roads h, against K⁻¹ times the cubic part at Kξ."""
    rng = np.random.default_rng(14)
    xi = rng.normal(size=(14, 20)) + 1j * rng.normal(size=(14, 20))
    h = np.concatenate([rng.normal(size=(4, 20)), np.zeros((4, 20))])
    truth = modes().K_inverse @ cubic_part()(np.concatenate([modes().K @ xi, h]))
    alpha, psi = by_the_letter()
    symmetric, excited = product.modal(cubic_part(), modes(), 8)[:2]

    def error(cubes: Complex, squares: Complex) -> float:
        Phi = np.einsum("ijkl,jt,kt,lt->it", cubes, xi, xi, xi, optimize=True)
        Phi = Phi + np.einsum("ijkl,jt,kt,lt->it", squares, h, xi, xi, optimize=True)
        return float(np.abs(Phi - truth).max() / np.abs(truth).max())

    return Row(
        equation="(3.14)",
        printed="εΦ_i = ε α_ijkl ξ_j ξ_k ξ_l + ε ψ_ijk(t) ξ_j ξ_k, α_abcd = K⁻¹_ai r_ijkl K_jb K_kc K_ld, "
        "ψ_abc = K⁻¹_ai d_ijkl h_j K_kb K_lc",
        derived="the same, K's elements read as below",
        kind=RIGHT,
        evidence=[
            Evidence(
                measure="largest error of εΦ of the default car at random ξ, h against K⁻¹ times the cubic terms at "
                "Kξ: as printed, and by symmetric tensors",
                printed=error(alpha, psi),
                derived=error(symmetric, excited.transpose(0, 3, 1, 2)),
                unit="1",
                tolerance=1e-11,
                apart=1e-3,
            )
        ],
    )


def _modal_matrix() -> Row:
    lam, K = modes().eigenvalues, modes().K

    def error(matrix: Complex) -> float:
        return float(np.abs(np.linalg.solve(K, form().A @ matrix) - np.diag(lam)).max() / np.abs(lam).max())

    return Row(
        equation="after (3.14)",
        printed="K_i^(j) the i-th column and the j-th row element of K",
        derived="i-th row and j-th column: the j-th mode's i-th state",
        evidence=[
            Evidence(
                measure="largest |K⁻¹ A K − Λ| over largest |λ|, K's elements read in both ways",
                printed=error(K.T),
                derived=error(K),
                unit="1",
                tolerance=1e-10,
                apart=0.1,
            )
        ],
    )


def steady() -> Row:
    lam, K = modes().eigenvalues, modes().K
    t = np.linspace(0.0, 2.0 * np.pi / omega(), 50)
    front_left = harmonic([-1j], omega())  # sin Ωt
    truth = np.linalg.solve(K, periodic_response(form().A, form().B[:, :1], front_left.pieces[0], t))
    there, back = gains() / (1j * omega() - lam), gains() / (-1j * omega() - lam)
    by_hand = (np.outer(there, np.exp(1j * omega() * t)) - np.outer(back, np.exp(-1j * omega() * t))) / 2j
    P, psi = printed_amplitude(lam, gains(), omega())
    as_printed = P[:, None] * np.sin(omega() * t + psi[:, None])

    def error(waves: Complex) -> float:
        return float(np.abs(waves - truth).max() / np.abs(truth).max())

    return Row(
        equation="(3.17)",
        printed="P_kν = γ_k1 A_ν/√(λ_k² + ν²Ω²), ψ_νk = arctan(νΩ/λ_k)",
        derived="the same, with principal branches and Re λ_k < 0",
        evidence=[
            Evidence(
                measure="largest error of ξ_k against the periodic motion of the 14 states, over largest |ξ|: by "
                "(3.17), and by exponentials",
                printed=error(as_printed),
                derived=error(by_hand),
                unit="1",
                tolerance=1e-12,
                apart=1e-6,
            )
        ],
        kind=RIGHT,
    )
