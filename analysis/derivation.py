"""The seven-degree-of-freedom car derived from nothing but its energies, by Lagrange's equations, in symbols.

The truth that the hand-written equations (`fmu_src.vehicle`) and the printed ones are compared with, so it must never
import either. Coordinates q = (z, ψ, φ, z11, z12, z2, ψ2) from static equilibrium, signs as in the FMU
(ψ2 positive like ψ); SI units. Corners stand in the order fl, fr, rl, rr, which for the road is h11, h12, h21, h22.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import NamedTuple

import sympy as sp

COORDINATES = "z psi phi z11 z12 z2 psi2".split()
PARAMETERS = "m m11 m12 m21 m22 m2 Jx Jy Jz J2 c1 c2 cp1 cp2 b1 b2 bp1 bp2 a b s0 s1 s2".split()


class Derivation(NamedTuple):
    """Symbols and expressions; vectors are columns."""

    parameters: list[sp.Symbol]  # in the order of PARAMETERS
    q: sp.Matrix  # 7, m and rad
    v: sp.Matrix  # 7, rates of q
    h: sp.Matrix  # 4, height of the road under each wheel
    dh: sp.Matrix  # 4, rate of h
    f: sp.Matrix  # 4, actuator forces, positive pushes the body up and the wheel down
    a: sp.Matrix  # 7, second rates of q
    struts: sp.Matrix  # 4, extensions of the struts, m
    mass: sp.Matrix  # 7 x 7, diagonal
    equations: sp.Matrix  # 7, left sides of Lagrange's equations, which are zero; linear in a
    accelerations: sp.Matrix  # 7
    kinetic: sp.Expr  # T, J
    energy: sp.Matrix  # 1, T + V, J
    power: sp.Matrix  # 3, W: road, actuators, dissipation

    @property
    def arguments(self) -> list[sp.Symbol]:
        """Everything an expression may depend on besides the parameters: q, v, h, dh, f (26)."""
        return [*self.q, *self.v, *self.h, *self.dh, *self.f]


def _column(names: Iterable[str]) -> sp.Matrix:
    return sp.Matrix([sp.Symbol(name, real=True) for name in names])


def _half_squares(weights: Sequence[sp.Expr], values: Iterable[sp.Expr]) -> sp.Expr:
    return sum(w * x**2 for w, x in zip(weights, values, strict=True)) / 2


def _geometry(q: sp.Matrix, h: sp.Matrix, lengths: Sequence[sp.Symbol]) -> tuple[sp.Matrix, sp.Matrix]:
    """Extension of the four struts (top minus bottom) and of the four tyres (wheel minus road)."""
    z, psi, phi, z11, z12, z2, psi2 = q
    a, b, s0, s1, s2 = lengths
    front, rear = z - a * sp.sin(phi), z + b * sp.sin(phi)
    lean, tilt = sp.sin(psi) * sp.cos(phi), sp.sin(psi2)
    tops = sp.Matrix([front + s1 * lean, front - s1 * lean, rear + s0 * lean, rear - s0 * lean])
    bottoms = sp.Matrix([z11, z12, z2 + s0 * tilt, z2 - s0 * tilt])
    wheels = sp.Matrix([z11, z12, z2 + s2 * tilt, z2 - s2 * tilt])
    return tops - bottoms, wheels - h


@cache
def derive() -> Derivation:
    """Lagrange's equations d/dt dT/dv - dT/dq + dV/dq + dR/dv = Q, solved for the accelerations."""
    parameters = list(_column(PARAMETERS))
    m, m11, m12, m21, m22, m2, Jx, Jy, Jz, J2, c1, c2, cp1, cp2, b1, b2, bp1, bp2, *lengths = parameters
    s2 = lengths[-1]
    q, v, a = (_column(dots + name for name in COORDINATES) for dots in ("", "d", "dd"))
    h, dh = _column(["h11", "h12", "h21", "h22"]), _column(["dh11", "dh12", "dh21", "dh22"])
    f = _column(["f_fl", "f_fr", "f_rl", "f_rr"])

    struts, tyres = _geometry(q, h, lengths)
    strut_rates = struts.jacobian(q) * v
    tyre_rates = tyres.jacobian(q) * v + tyres.jacobian(h) * dh
    pitch_inertia = Jy * sp.cos(q[1]) ** 2 + Jz * sp.sin(q[1]) ** 2
    inertias = [m, Jx, pitch_inertia, m11, m12, m21 + m22 + m2, (m21 + m22) * s2**2 + J2]
    T = _half_squares(inertias, v)
    V = _half_squares([c1, c1, c2, c2], struts) + _half_squares([cp1, cp1, cp2, cp2], tyres)
    R = _half_squares([b1, b1, b2, b2], strut_rates) + _half_squares([bp1, bp1, bp2, bp2], tyre_rates)

    def gradient(energy: sp.Expr, by: sp.Matrix) -> sp.Matrix:
        return sp.Matrix([energy.diff(s) for s in by])

    momenta = gradient(T, v)
    mass = momenta.jacobian(v)
    if not mass.is_diagonal():
        raise ArithmeticError("the mass matrix is not diagonal")
    applied = struts.jacobian(q).T * f - gradient(R, v)
    forces = applied + gradient(T - V, q) - momenta.jacobian(q) * v
    accelerations = sp.Matrix([force / mass[i, i] for i, force in enumerate(forces)])
    road = (gradient(V, h) + gradient(R, dh)).dot(dh)
    power = sp.Matrix([road, strut_rates.dot(f), 2 * R])
    energy = sp.Matrix([T + V])
    return Derivation(parameters, q, v, h, dh, f, a, struts, mass, mass * a - forces, accelerations, T, energy, power)
