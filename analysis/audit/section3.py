"""§3.2 to §3.4 but for the averaging: the quasi-linear equations of the default car, and its road."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import combinations_with_replacement

import numpy as np
import sympy as sp

from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import road
from fmu_src.vehicle.parameters import Car

from ..derivation import COORDINATES, derive
from ..figures import readable
from ..quasilinear import TERMS, quasilinear
from . import modal, printed_car, small_parameter
from .car import CROSSING, discrepancy_order
from .differences import CONVENTION, derived_equations
from .modal import cubic_part, form
from .rows import INSPECTION, READING, REFUTED, Evidence, Row
from .system import SMALL, Array, bump, derived

SIZES = np.array([0.04, 0.02, 0.01])


def rows() -> list[Row]:
    """§3.2, and §3.3 up to the averaging, in the order of the paper."""
    return [
        *[_autonomous(), _stiffness(), _footnote(), *modal.rows()],
        *[small_parameter.neglected(), small_parameter.series(), _parametric(), modal.steady()],
        *[small_parameter.transformed(), small_parameter.amplitudes()],
    ]


def road_rows() -> list[Row]:
    """Parameters and road of §3.4."""
    return [_parameter(), _delay()]


CUBIC = ("c_ijkl", "b_ijkl", "m_ijkl")  # stiffness, damping, inertia


def _term(name: str, x: Array, kinds: str = "") -> Array:
    """One cubic term (14, …) of x' at x (14, …), q̈ = ± t_ijkl …; `kinds`: other factors than its own, q or v each."""
    tensor, (own, sign) = quasilinear(Car())[name].dense(), TERMS[name]
    values = np.einsum("ijkl,j...,k...,l...->i...", tensor, *({"q": x[:7], "v": x[7:]}[kind] for kind in kinds or own))
    return sign * np.concatenate([np.zeros_like(values), values])


def _sum(names: Iterable[str], x: Array) -> Array:
    return np.sum([_term(name, x) for name in names], axis=0)


def remainder_order(cubic: Callable[[Array], Array]) -> float:
    """Order in the size of x of x' − A x − cubic(x), on a fixed direction."""
    direction = np.random.default_rng(3).normal(size=14)

    def left(size: float) -> float:
        x = size * direction
        return float(np.linalg.norm(form().rate(x, np.zeros(8)) - form().A @ x - cubic(x)))

    return float(np.polyfit(np.log(SIZES), np.log([left(size) for size in SIZES]), 1)[0])


def _order_row(printed: Callable[[Array], Array]) -> Evidence:
    return Evidence(
        measure="order in the size of x of what the cubic equations leave of the full ones",
        printed=remainder_order(printed),
        derived=remainder_order(lambda x: _sum(CUBIC, x)),
        unit="1",
        expected=5.0,
        tolerance=0.2,
        apart=1.0,
    )


def _autonomous() -> Row:
    """The b-term with b_ijkl that of q̇_j q_k q_l, as below (3.9)."""
    return Row(
        equation="R̄_i",
        printed="− b̄_ijkl q̇_j q̇_k q_l",
        derived="− b̄_ijkl q̇_j q_k q_l, from B̄_ij(q) q̇_j",
        evidence=[_order_row(lambda x: _sum(("c_ijkl", "m_ijkl"), x) + _term("b_ijkl", x, "vvq"))],
        note="Evidence with the cubic stiffness put in, so that this term alone is judged.",
    )


def cubic_accelerations(times: Array) -> list[float]:
    """Largest on the bump [rad/s²]: of each kind in CUBIC (3), of what is left out without stiffness, and with all."""
    x = derived("A").over_the_bump(times, PARAMETERS["A"].start).T
    terms = [_term(name, x) for name in CUBIC]
    whole = cubic_part()(np.concatenate([x, np.zeros((8, x.shape[1]))]))
    found = [*terms, whole - terms[1] - terms[2], whole - terms[0] - terms[1] - terms[2]]
    return [float(np.linalg.norm(values, axis=0).max()) for values in found]


def _stiffness() -> Row:
    *sizes, without, complete = cubic_accelerations(CROSSING)
    return Row(
        equation="C̄_i, R̄_i",
        printed="C̄_i = c̄_ij q_j; no cubic stiffness in R̄_i",
        derived="C̄_i = c̄_ij q_j + c̄_ijkl q_j q_k q_l, of the same order as the terms kept",
        evidence=[
            _order_row(lambda x: _sum(CUBIC[1:], x)),
            Evidence(
                measure="largest cubic acceleration on the bump that is left out, over the sum of all three kinds'",
                printed=without / sum(sizes),
                derived=complete / sum(sizes),
                unit="1",
                tolerance=1e-12,
                apart=0.1,
            ),
        ],
        note=f"Largest on the bump: stiffness {sizes[0]:.2g}, damping {sizes[1]:.2g}, inertia {sizes[2]:.2g} rad/s².",
    )


def _footnote() -> Row:
    return Row(
        equation="footnote 1",
        printed="b_ij, b̄_ijkl, m_ij, m̄_ijkl, d_ij, d̄_ijkl",
        derived="b̄_ij, b̄_ijkl, c̄_ij, m̄_ijkl, d̄_ij, d_ijkl: m_ij is nowhere defined (M̃ is divided out in (3.9)), c̄_ij "
        "is left out",
        kind=INSPECTION,
    )


def road_products(equations: sp.Matrix, wheel: int, degree: int) -> int:
    """Products h_wheel q … with so many q that the series of q̈ at rest has in these left sides, by algebra."""
    d = derive()
    found = 0
    for left, a in zip(equations, d.a, strict=True):
        pull = -left.diff(d.h[wheel]) / left.diff(a)
        for factors in combinations_with_replacement(d.q, degree):
            found += sp.simplify(pull.diff(*factors).xreplace(SMALL)) != 0
    return found


def _parametric() -> Row:
    d = quasilinear(Car())["d_ijkl"].entries
    named = [f"d_{''.join(str(n + 1) for n in index)} = {readable(value)}" for index, value in d.items()]
    own = {COORDINATES[i].replace("psi", "ψ") for i, *_ in d}
    systems = sp.Matrix(printed_car.EQUATIONS), sp.Matrix(derived_equations(CONVENTION))

    def count(measure: str, wheels: Sequence[int], degree: int, expected: float) -> Evidence:
        wrong, right = (float(sum(road_products(each, wheel, degree) for wheel in wheels)) for each in systems)
        return Evidence(
            measure=measure, printed=wrong, derived=right, unit="1", expected=expected, tolerance=0.0, apart=1.0
        )

    return Row(
        equation="P_i(t, ξ), B_νij, B_νijk",
        printed="ε Σ B_νij ξ_j sin νΩt + ε Σ B_νijk ξ_j ξ_k sin νΩt for the front left wheel",
        derived=f"only h q q, only in the row of {', '.join(sorted(own))}: {', '.join(named)} 1/(m s²) (convention A); "
        "for a front wheel P = 0",
        kind=REFUTED,
        evidence=[
            count(
                "products h q, linear in the coordinates, in (3.1)–(3.7) as printed and as derived", range(4), 1, 0.0
            ),
            count("products h11 q q", [0], 2, 0.0),
            count("products h21 q q, which P̄_i = d_ijkl h_j q_k q_l of §3.2 needs", [2], 2, 1.0),
        ],
        note="P̄_i of §3.2 is right; §3.3 has others for P_i.",
    )


def _parameter() -> Row:
    order = discrepancy_order(derived("A"), COORDINATES.index("psi")) - 1.0
    return Row(
        equation="§3.4, ε = 0.01",
        printed="the small parameter ε = 0.01, beside A = 0.01 m",
        derived="ε stands for A² over the square of a length, as the system is odd; read as A (over 1 m), which has "
        "the same number, it is not what the terms go by",
        kind=READING,
        evidence=[
            Evidence(
                measure="order in A of |x − x_lin|/|x_lin| over ε, ψ on the bump, ε read as A and as A²",
                printed=order - 1.0,
                derived=order - 2.0,
                unit="1",
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
