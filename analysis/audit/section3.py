"""§3.2 and §3.4: evidence on the quasi-linear equations of the default car, and on its road."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import road
from fmu_src.vehicle.parameters import Car

from ..derivation import COORDINATES
from ..figures import readable
from ..polynomials import Homogeneous
from . import modal
from .car import discrepancy_order
from .modal import ROAD_11, cubic_part, form
from .rows import Evidence, Row
from .system import Array, bump, derived

SIZES = np.array([0.04, 0.02, 0.01])


def rows() -> list[Row]:
    """§3.2 to §3.4 but for the averaging, in the order of the paper."""
    return [_autonomous(), _stiffness(), _parametric(), *modal.rows(), _parameter(), _delay()]


def _restricted(rates: int) -> Homogeneous:
    """The terms of degree 3 in q and q̇ alone, with this many factors q̇."""
    part = cubic_part()
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
    whole = cubic_part()(np.concatenate([x, np.zeros((8, x.shape[1]))]))
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


def _by_road(monomial: tuple[int, ...]) -> tuple[int, ...]:
    """The same variables, the road's first."""
    return tuple(sorted(monomial, key=lambda place: (place < ROAD_11, place)))


def _parametric() -> Row:
    terms = parametric_terms()
    named = [
        f"d_{i - 6}{m[0] - 13}{m[1] + 1}{m[2] + 1} = {readable(c)}"
        for i, m, c in ((i, _by_road(m), c) for i, m, c in terms)
    ]
    own = {COORDINATES[i - 7].replace("psi", "ψ") for i, _, _ in terms}
    return Row(
        equation="P_i(t, ξ), B_νij, B_νijk",
        printed="ε Σ B_νij ξ_j sin νΩt + ε Σ B_νijk ξ_j ξ_k sin νΩt for the front left wheel",
        derived=f"only h q q, only in the row of {', '.join(sorted(own))}: {', '.join(named)} 1/(m s²); for a front "
        "wheel P = 0",
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
