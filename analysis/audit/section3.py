"""§3.2, (3.17) and §3.4: evidence on the quasi-linear equations and the linear response of the default car."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import RoadParameters, road
from fmu_src.vehicle.parameters import Car

from ..car import car_form
from ..derivation import COORDINATES
from ..linear_response import periodic_response
from ..polynomials import Homogeneous
from ..signals import harmonic
from ..standard_form import StandardForm
from .car import discrepancy_order
from .rows import RIGHT, Evidence, Row
from .system import Array, bump, derived

Complex = NDArray[np.complex128]

SIZES = np.array([0.04, 0.02, 0.01])
ROAD_11 = 14  # place of h11 in (x, h, ḣ)


def rows() -> list[Row]:
    """§3.2 to §3.4 but for the averaging, in the order of the paper."""
    return [_autonomous(), _stiffness(), _parametric(), _forced(), _modal_matrix(), _steady(), _parameter(), _delay()]


@cache
def form() -> StandardForm:
    """The default car, expanded to degree 3."""
    return car_form(Car(), order=3)


def _cubic() -> Homogeneous:
    (part,) = (part for parts in form().terms.values() for part in parts if part.degree == 3)
    return part


def autonomous_tensor() -> Array:
    """r_ijkl (14, 14, 14, 14), symmetric in j, k, l: R̄ with the cubic stiffness, as x' has it."""
    part = _cubic()
    own = (part.monomials < ROAD_11).all(axis=1)
    return Homogeneous(part.monomials[own], part.coefficients[:, own]).tensor(14)


def _restricted(rates: int) -> Homogeneous:
    """The terms of degree 3 in q and q̇ alone, with this many factors q̇."""
    part = _cubic()
    own = (part.monomials < ROAD_11).all(axis=1) & ((part.monomials >= 7).sum(axis=1) == rates)
    return Homogeneous(part.monomials[own], part.coefficients[:, own])


def _raised_damping(x: Array) -> Array:
    """The b-term as printed, b_ijkl q̇_j q̇_k q_l (14), with b_ijkl that of q̇_j q_k q_l, symmetric in k, l."""
    q, v = x[:7], x[7:]
    result = np.zeros(14)
    part = _restricted(rates=1)
    for column, monomial in zip(part.coefficients.T, np.sort(part.monomials, axis=1).tolist(), strict=True):
        k, l, j = monomial[0], monomial[1], monomial[2] - 7  # noqa: E741  the paper's letters
        result += column * v[j] * (v[k] * q[l] + v[l] * q[k]) / 2.0
    return result


def remainder_order(cubic: Callable[[Array], Array]) -> float:
    """Order in the size of x of x' − A x − cubic(x), on a fixed direction."""
    direction = np.random.default_rng(3).normal(size=14)

    def left(size: float) -> float:
        x = size * direction
        return float(np.linalg.norm(form().rate(x, np.zeros(8)) - form().A @ x - cubic(x)))

    return float(np.polyfit(np.log(SIZES), np.log([left(size) for size in SIZES]), 1)[0])


def _order_row(printed: Callable[[Array], Array]) -> Evidence:
    terms = [_restricted(rates) for rates in range(3)]
    return Evidence(
        measure="order in the size of x of what the cubic equations leave of the full ones",
        printed=remainder_order(printed),
        derived=remainder_order(lambda x: sum((part(x) for part in terms), np.zeros(14))),
        unit="1",
        expected=5.0,
        tolerance=0.2,
        apart=1.0,
    )


def _autonomous() -> Row:
    stiffness, _, inertia = (_restricted(rates) for rates in range(3))
    return Row(
        equation="R̄_i",
        printed="− b̄_ijkl q̇_j q̇_k q_l",
        derived="− b̄_ijkl q̇_j q_k q_l, from B̄_ij(q) q̇_j",
        evidence=[_order_row(lambda x: stiffness(x) + _raised_damping(x) + inertia(x))],
        note="Evidence with the cubic stiffness put in, so that this term alone is judged.",
    )


def _stiffness() -> Row:
    stiffness, damping, inertia = (_restricted(rates) for rates in range(3))
    times = np.linspace(0.0, 2.0, 401)
    x = derived("A").over_the_bump(times, PARAMETERS["A"].start).T
    values = [part(x) for part in (stiffness, damping, inertia)]
    sizes = [np.linalg.norm(value, axis=0).max() for value in values]
    whole = _cubic()(np.concatenate([x, np.zeros((8, x.shape[1]))]))
    left_out = [np.linalg.norm(whole - sum(kept), axis=0).max() / sum(sizes) for kept in (values[1:], values)]
    return Row(
        equation="C̄_i, R̄_i",
        printed="C̄_i = c̄_ij q_j; no cubic stiffness in R̄_i",
        derived="C̄_i = c̄_ij q_j + c̄_ijkl q_j q_k q_l, of the same order as the terms kept",
        evidence=[
            _order_row(lambda x: damping(x) + inertia(x)),
            Evidence(
                measure="largest cubic acceleration on the bump that is left out, over the sum of all three kinds'",
                printed=float(left_out[0]),
                derived=float(left_out[1]),
                unit="1",
                tolerance=1e-12,
                apart=0.1,
            ),
        ],
        note=f"Largest on the bump: stiffness {sizes[0]:.2g}, damping {sizes[1]:.2g}, inertia {sizes[2]:.2g} rad/s².",
    )


def parametric_terms() -> list[tuple[int, tuple[int, ...], float]]:
    """(row, monomial, coefficient) of all terms of degree ≤ 3 that hold both a road height and a coordinate."""
    found = (entry for parts in form().terms.values() for part in parts for entry in part.entries())
    return [(i, m, c) for i, m, c in found if min(m) < ROAD_11 <= max(m)]


def _parametric() -> Row:
    terms = parametric_terms()
    wheels = ("h11", "h12", "h21", "h22")
    named = [
        f"{c:.4g} {wheels[m[-1] - ROAD_11]} {' '.join(COORDINATES[j].replace('psi', 'ψ') for j in m[:-1])}"
        for _, m, c in terms
    ]
    own = {COORDINATES[i - 7].replace("psi", "ψ") for i, _, _ in terms}
    return Row(
        equation="P_i(t, ξ), B_νij, B_νijk",
        printed="ε Σ B_νij ξ_j sin νΩt + ε Σ B_νijk ξ_j ξ_k sin νΩt for the front left wheel",
        derived=f"only h q q, only in the row of {', '.join(sorted(own))}: {'; '.join(named)}; for a front wheel P = 0",
        evidence=[
            Evidence(
                measure="terms h·q, linear in the coordinates, that the print has and the car has",
                printed=14.0 * 14.0,
                derived=float(sum(len(m) == 2 for _, m, _ in terms)),
                unit="1",
                tolerance=0.0,
                apart=1.0,
            ),
            Evidence(
                measure="terms h11·q·q that the print has and the car has",
                printed=14.0**3,
                derived=float(sum(ROAD_11 in m for _, m, _ in terms)),
                unit="1",
                tolerance=0.0,
                apart=1.0,
            ),
        ],
        note="P̄_i = d_ijkl h_j q_k q_l of §3.2 is right.",
    )


# ------------------------------------------------------------------ modes
@cache
def modes() -> tuple[Complex, Complex]:
    """λ (14), those with β > 0 first and their conjugates in the same order, and K (14, 14)."""
    values, vectors = np.linalg.eig(form().A)
    upper = sorted(np.flatnonzero(values.imag > 0), key=lambda k: values[k].imag)
    return (
        np.concatenate([values[upper], values[upper].conj()]),
        np.concatenate([vectors[:, upper], vectors[:, upper].conj()], axis=1),
    )


def omega() -> float:
    """Ω of the default road [rad/s]."""
    return RoadParameters().omega


@cache
def gains() -> Complex:
    """γ_k1 (14): f_k = γ_k1 h11."""
    return np.asarray(np.linalg.solve(modes()[1], form().B[:, 0]))


def printed_amplitude(lam: Complex, gain: Complex, w: float) -> tuple[Complex, Complex]:
    """P_kν over A_ν and ψ_νk as printed below (3.17), with principal branches."""
    return gain / np.sqrt(lam**2 + w**2), np.arctan(w / lam)


def _wave_residual(amplitude: Complex, phase: Complex) -> float:
    """Largest |ξ' − λξ − γ sin Ωt|/|γ| of ξ = P sin(Ωt + ψ) over all modes and times."""
    lam, _ = modes()
    t = np.linspace(0.0, 2.0 * np.pi / omega(), 50)[:, None]
    angle = omega() * t + phase
    left = amplitude * (omega() * np.cos(angle) - lam * np.sin(angle)) - gains() * np.sin(omega() * t)
    return float((np.abs(left) / np.abs(gains())).max())


def _forced() -> Row:
    """Homogeneous ξ, which K⁻¹ (3.11) gives, and forced ξ, put into (3.13)."""
    lam, _ = modes()
    P, psi = printed_amplitude(lam, gains(), omega())
    t = 0.25 * 2.0 * np.pi / omega()  # f is largest
    free = np.exp(lam * t)
    left = np.abs(lam * free - lam * free - gains() * np.sin(omega() * t)) / np.abs(gains())
    return Row(
        equation="(3.13)",
        printed="ξ of free vibrations, superscript (h), by K⁻¹ times (3.11)",
        derived="ξ of forced vibrations, by K⁻¹ times the linear part of (3.10)",
        evidence=[
            Evidence(
                measure="|ξ' − Λξ − f(t)| over |f|, sine road under the front left wheel",
                printed=float(left.max()),
                derived=_wave_residual(P, psi),
                unit="1",
                tolerance=1e-10,
                apart=0.5,
            )
        ],
    )


def _modal_matrix() -> Row:
    lam, K = modes()

    def error(matrix: Complex) -> float:
        product = np.linalg.solve(K, form().A @ matrix)
        return float(np.abs(product - np.diag(lam)).max() / np.abs(lam).max())

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


def _steady() -> Row:
    lam, K = modes()
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


# ------------------------------------------------------------------ §3.4
def _parameter() -> Row:
    return Row(
        equation="§3.4, ε = 0.01",
        printed="the small parameter is 0.01, as is A in metres",
        derived="the small parameter of this odd system is A²",
        evidence=[
            Evidence(
                measure="order in A of |x − x_lin|/|x_lin|, ψ on the bump",
                printed=1.0,
                derived=discrepancy_order(derived("A"), COORDINATES.index("psi")) - 1.0,
                unit="1",
                expected=2.0,
                tolerance=0.05,
                apart=0.5,
            )
        ],
    )


def _delay() -> Row:
    p = bump(Car(), PARAMETERS["A"].start)
    ground, t = road(p), np.arange(-0.2, 0.2, 1e-4)
    left = np.array([ground.heights(time)[0] for time in t])
    as_printed = np.array([ground.heights(time + p.tau0)[0] for time in t])
    as_meant = np.array([ground.heights(time - p.tau0)[0] for time in t])

    def behind(right: Array) -> float:
        return float(t[right.argmax()] - t[left.argmax()])

    return Row(
        equation="§3.4, h12, h22",
        printed="h12(t) = h11(t + τ0), h22(t) = h21(t + τ0), with a delay τ0",
        derived="h12(t) = h11(t − τ0), h22(t) = h21(t − τ0)",
        evidence=[
            Evidence(
                measure="time by which the right wheel's peak is behind the left one's",
                printed=behind(as_printed),
                derived=behind(as_meant),
                unit="s",
                expected=p.tau0,
                tolerance=1e-4,
                apart=p.tau0,
            )
        ],
    )
