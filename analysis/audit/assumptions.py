"""§3.1: evidence on R, and on what the seven equations take for granted: symbols, masses, static loads, their form."""

from __future__ import annotations

import sympy as sp

from fmu_src.vehicle.parameters import Car

from ..derivation import derive
from . import printed_car
from .differences import CONVENTION, SIGNS, derived_equations, plain
from .rows import RIGHT, Evidence, Row

ROUND_OFF = 1e-12
SENSE = SIGNS[CONVENTION][6, 6]  # of ψ2: 1 if a positive one lifts the axle's left side


def rotation() -> Row:
    """Heights of the strut tops, and the body's rates of turn, by both readings of R."""
    return Row(
        equation="e = R i",
        printed="e = R i",
        derived="i = R e: the columns of R are the body's axes in the fixed frame",
        evidence=[
            Evidence(
                measure="height of the front left strut's top against that in (3.2), best of the four senses of ψ, φ, "
                "over the height (ψ = φ = 0.3 rad)",
                printed=_height_error(printed_car.R.T),
                derived=_height_error(printed_car.R),
                unit="1",
                tolerance=ROUND_OFF,
                apart=1e-2,
            ),
            Evidence(
                measure="kinetic energy of turning, by the rates of R, against that which gives the (Jy − Jz) terms "
                "(ψ = φ = 0.3 rad, rates 1 rad/s)",
                printed=_turning_energy_error(printed_car.R.T),
                derived=_turning_energy_error(printed_car.R),
                unit="1",
                tolerance=ROUND_OFF,
                apart=1e-2,
            ),
        ],
    )


def _height_error(to_fixed: sp.Matrix) -> float:
    """Relative error of the strut top's height if this matrix takes components in the body to fixed ones."""
    p, (_, ψ, φ, *_) = printed_car, derive().q
    height = (to_fixed * sp.Matrix([p.a, p.s1, 0]))[2]
    wanted = derive().struts[0].xreplace({p.z: sp.S.Zero, p.z11: sp.S.Zero})
    car = Car()
    at = {ψ: 0.3, φ: 0.3, p.a: car.a, p.s1: car.s1}
    senses = [{ψ: i * ψ, φ: j * φ} for i in (1, -1) for j in (1, -1)]
    return min(float(abs((height.xreplace(s) - wanted).subs(at) / wanted.subs(at))) for s in senses)


def _turning_energy_error(to_fixed: sp.Matrix) -> float:
    p, d = printed_car, derive()
    rates = {p.ψ: p.dψ, p.φ: p.dφ}
    turning = to_fixed.T * sum((to_fixed.diff(x) * dx for x, dx in rates.items()), sp.zeros(3))
    ω = (turning[2, 1], turning[0, 2], turning[1, 0])
    by_R = sum(J * w**2 for J, w in zip((p.Jx, p.Jy, p.Jz), ω, strict=True)) / 2
    still = dict.fromkeys([v for v in d.v if v not in (p.dψ, p.dφ)], sp.S.Zero)
    car = Car()
    at = {p.ψ: 0.3, p.φ: 0.3, p.dψ: 1.0, p.dφ: 1.0, p.Jx: car.Jx, p.Jy: car.Jy, p.Jz: car.Jz}
    wanted = d.kinetic.xreplace(still).subs(at)
    return float(abs(by_R.subs(at) / wanted - 1))


def rows() -> list[Row]:
    """The rest, in the order of the paper."""
    return [_unused(), _axle_masses(), _gravity(), form()]


def _unused() -> Row:
    d = derive()
    used = d.equations.free_symbols
    return Row(
        equation="list after (3.7)",
        printed="m2, bp1, bp2 and l are listed",
        derived="m2 belongs into (3.4), tyre dampers into (3.2)–(3.4) and (3.7); l = a + b",
        evidence=[
            Evidence(
                measure="listed symbols, but for l, that no equation has",
                printed=float(len(printed_car.NOMENCLATURE - {printed_car.l} - printed_car.EQUATIONS.free_symbols)),
                derived=float(len(printed_car.NOMENCLATURE - {printed_car.l} - used)),
                unit="1",
                tolerance=0.0,
                apart=1.0,
            )
        ],
        note="The tyre dampers of this project are an addition; at bp1 = bp2 = 0 the equations are the paper's.",
    )


def _axle_kinetic_energy() -> sp.Expr:
    """Of the rear axle with its wheels as points at ± s2, before anything is assumed of their masses; ψ2 as in rows."""
    p = printed_car
    total = p.m2 * p.dz2**2 + p.J2 * p.dψ2**2
    for mass, side in ((p.m21, 1), (p.m22, -1)):
        y, z = side * p.s2 * sp.cos(p.ψ2), p.z2 + SENSE * side * p.s2 * sp.sin(p.ψ2)
        total += mass * sum((x.diff(p.z2) * p.dz2 + x.diff(p.ψ2) * p.dψ2) ** 2 for x in (y, z))
    return sp.expand(total / 2)


def _axle_masses() -> Row:
    """(3.4) and (3.7) with m21 and m22 by their own names: they are coupled unless the masses are equal."""
    p, car = printed_car, Car()
    T = _axle_kinetic_energy()
    coupling = T.diff(p.dz2, p.dψ2)
    moved, turned = (plain(sp.factor(factor)) for factor in (coupling, coupling.diff(p.ψ2)))
    numbers = {p.m21: 1.1 * car.m21, p.m22: car.m22, p.m2: car.m2, p.J2: car.J2, p.s2: car.s2, p.ψ2: 0.0}
    size = sp.sqrt(T.diff(p.dz2, 2) * T.diff(p.dψ2, 2)).subs(numbers)
    masses = 2.1 * car.m22
    size_by_hand = ((masses + car.m2) * (masses * car.s2**2 + car.J2)) ** 0.5
    in_print = [row.diff(a) for row, a in ((p.EQ_3_4, p.ddψ2), (p.EQ_3_7, p.ddz2))]
    return Row(
        equation="(3.4), (3.7)",
        printed="m21 and m22 may differ",
        derived=f"+ {moved} ψ̈2 + {turned} ψ̇2² in (3.4), + {moved} z̈2 in (3.7), unless m21 = m22".replace("+ −", "− "),
        evidence=[
            Evidence(
                measure="inertial coupling of z2 and ψ2 over the root of their masses, m21 = 1.1 m22",
                printed=float(sum(in_print)),
                derived=float((coupling.subs(numbers) / size).evalf()),
                unit="1",
                expected=float(SENSE) * 0.1 * car.m22 * car.s2 / size_by_hand,
                tolerance=ROUND_OFF,
                apart=1e-3,
            )
        ],
        note="So the model refuses m21 ≠ m22.",
    )


def weights_left(struts: sp.Matrix, wheels: sp.Matrix) -> int:
    """Equations in which weights and static loads leave a force, once they balance at rest.

    struts, wheels : slopes (7, 2), (7, 4) by q of what the front and the rear struts' loads act on, and of the wheels'
                     heights, on which the tyres' loads and the unsprung weights act; the axle's own weight acts on z2.
    """
    p, d = printed_car, derive()
    *loads, g = sp.symbols("F_f F_r N_fl N_fr N_rl N_rr g", real=True)
    body, axle = (sp.Matrix([int(x == at) for x in d.q]) for at in (p.z, p.z2))
    weight = p.m * body + wheels * sp.Matrix([p.m11, p.m12, p.m21, p.m22]) + p.m2 * axle
    forces = g * weight - struts * sp.Matrix(loads[:2]) - wheels * sp.Matrix(loads[2:])
    at_rest = forces.xreplace(dict.fromkeys(d.q, sp.S.Zero))
    balance = sp.solve(list(at_rest), loads, dict=True)[0]
    return sum(sp.simplify(force.subs(balance)) != 0 for force in forces)


def slopes_in_print() -> tuple[sp.Matrix, sp.Matrix]:
    """The slopes for `weights_left` as the print has them: factors of its springs' forces on wheels and road."""
    p, E = printed_car, printed_car.EQUATIONS
    front = -sum((E.diff(p.c1, z) for z in (p.z11, p.z12)), sp.zeros(7, 1))
    struts = sp.Matrix.hstack(front, -E.diff(p.c2, p.z2))
    wheels = [-E.diff(cp, h) for cp, h in ((p.cp1, p.h11), (p.cp1, p.h12), (p.cp2, p.h21), (p.cp2, p.h22))]
    return struts, sp.Matrix.hstack(*wheels)


def _gravity() -> Row:
    """Weights and the struts' and tyres' static loads cancel in all seven equations at any deflection."""
    p, d = printed_car, derive()
    heights = sp.Matrix([p.z11, p.z12, p.z2 + p.s2 * sp.sin(p.ψ2), p.z2 - p.s2 * sp.sin(p.ψ2)])
    front_left, front_right, rear_left, rear_right = d.struts
    loaded = sp.Matrix([front_left + front_right, rear_left + rear_right])
    return Row(
        equation="(3.1)–(3.7)",
        printed="no gravity, no static load",
        derived="the same: from static equilibrium they cancel for any deflection and any m11, m12, m21, m22",
        evidence=[
            Evidence(
                measure="equations in which gravity and static loads would leave a force, by the slopes that springs "
                "and tyres have in the print, and by the geometry",
                printed=float(weights_left(*slopes_in_print())),
                derived=float(weights_left(loaded.jacobian(d.q).T, heights.jacobian(d.q).T)),
                unit="1",
                tolerance=0.0,
                apart=1.0,
            )
        ],
        kind=RIGHT,
    )


def form() -> Row:
    """(3.8): linear in q̈, of second degree in q̇ where inertia is, of first where dampers are, linear in h."""

    def left(equations: sp.Matrix) -> float:
        d = derive()
        size = sp.Symbol("size")
        mass, rates = equations.jacobian(d.a), equations.xreplace(dict.fromkeys(d.a, sp.S.Zero))
        scaled = rates.xreplace({v: size * v for v in d.v})
        parts = [scaled.diff(size, k).xreplace({size: sp.S.Zero}) / sp.factorial(k) for k in range(3)]
        statics = parts[0].xreplace(dict.fromkeys(d.h, sp.S.Zero)) + parts[0].jacobian(d.h) * d.h
        rest = equations - mass * d.a - statics - parts[1] - parts[2]
        return float(sum(sp.expand(term) != 0 for term in rest))

    return Row(
        equation="(3.8)",
        printed="M̃_ij q̈_j − M̃_ijk q̇_j q̇_k = −C̃_i − B̃_ij q̇_j + D̃_i(q, h)",
        derived="the same, for bp1 = bp2 = 0; with tyre dampers D̃_i takes ḣ too",
        evidence=[
            Evidence(
                measure="equations that have terms of another form",
                printed=left(sp.Matrix(printed_car.EQUATIONS)),
                derived=left(sp.Matrix(derived_equations(CONVENTION))),
                unit="1",
                tolerance=0.0,
                apart=1.0,
            )
        ],
        kind=RIGHT,
    )
