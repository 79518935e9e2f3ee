"""Equations of motion of the car, Eqs. (3.1)–(3.7), written as forces, then accelerations.

Frames (ISO 8855): x forward, y left, z up. q = (z, ψ, φ, z11, z12, z2, ψ2): body heave, roll (left side up), pitch
(nose down), front wheels' heave, rear axle's heave and roll (left side up), all from static equilibrium, which takes
gravity out. With the strut's extension Δ, a strut pushes the body up by

    F = −c Δ − b Δ̇ + u          (u: actuator, up on the body, down on the wheel)

and a tyre pushes its wheel up by N = cp (h − z_w) + bp (ḣ − ż_w), over its static load. Each equation is the sum of
these forces times the derivative of their points of attack by the coordinate. Multiplied out they are the printed
(3.1)–(3.7), except where the print is not what its own energies give; each such place is marked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from .parameters import Car

Rates = Callable[..., tuple[Any, Any, Any, Any]]
Motion = Callable[..., tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]]


def equations_of_motion(car: Car, sin: Callable[..., Any] = math.sin, cos: Callable[..., Any] = math.cos) -> Motion:
    """Function (q, v, u, h, dh) -> (q̈, Δ, N) of this car.

    Takes q (7) [m, rad], v = q̇ (7) [m/s, rad/s], actuator forces u (4) [N], road heights h (4) [m], their rates dh (4)
    [m/s]; gives q̈ (7) [m/s², rad/s²], strut travels Δ (4) [m], tyre forces N (4) [N]; corners fl, fr, rl, rr.
    `sin` and `cos` may be those of numpy, sympy or an interval library: the equations then run in its numbers.
    """
    m, m11, m12, axle_mass = car.m, car.m11, car.m12, car.m21 + car.m22 + car.m2  # (3.4): m2; the print has m_z
    Jx, Jy, Jy_Jz, axle_inertia = car.Jx, car.Jy, car.Jy - car.Jz, (car.m21 + car.m22) * car.s2**2 + car.J2
    c1, c2, cp1, cp2, b1, b2, bp1, bp2 = car.c1, car.c2, car.cp1, car.cp2, car.b1, car.b2, car.bp1, car.bp2
    a, b, s0, s1, s2 = car.a, car.b, car.s0, car.s1, car.s2

    def motion(q: Sequence[Any], v: Sequence[Any], u: Sequence[Any], h: Sequence[Any], dh: Sequence[Any]) -> Any:
        z, psi, phi, z11, z12, z2, psi2 = q
        dz, dpsi, dphi, dz11, dz12, dz2, dpsi2 = v
        u11, u12, u21, u22 = u
        h11, h12, h21, h22 = h
        dh11, dh12, dh21, dh22 = dh
        sin_psi, cos_psi, sin_phi, cos_phi = sin(psi), cos(psi), sin(phi), cos(phi)
        sin_psi2, cos_psi2 = sin(psi2), cos(psi2)

        # Strut tops: z − a sin φ ± s1 sin ψ cos φ in front, z + b sin φ ± s0 sin ψ cos φ behind; upper sign left.
        # The rate of sin ψ cos φ has −sin ψ sin φ φ̇; (3.2) and (3.3) print the φ̇ term with cos φ in place of sin φ.
        lift, cos_cos, sin_sin, rate = sin_psi * cos_phi, cos_psi * cos_phi, sin_psi * sin_phi, cos_phi * dphi
        dlift = cos_cos * dpsi - sin_sin * dphi
        front, dfront = z - a * sin_phi, dz - a * rate
        rear, drear = z + b * sin_phi - z2, dz + b * rate - dz2
        front_roll, dfront_roll = s1 * lift, s1 * dlift
        rear_roll, drear_roll = s0 * (lift - sin_psi2), s0 * (dlift - cos_psi2 * dpsi2)
        travel11, travel12 = front + front_roll - z11, front - front_roll - z12
        travel21, travel22 = rear + rear_roll, rear - rear_roll

        F11 = u11 - c1 * travel11 - b1 * (dfront + dfront_roll - dz11)
        F12 = u12 - c1 * travel12 - b1 * (dfront - dfront_roll - dz12)
        F21 = u21 - c2 * travel21 - b2 * (drear + drear_roll)
        F22 = u22 - c2 * travel22 - b2 * (drear - drear_roll)

        # Tyres: h − z11, h − z12 in front, h − (z2 ± s2 sin ψ2) behind.
        tilt, dtilt = s2 * sin_psi2, s2 * cos_psi2 * dpsi2
        N11 = cp1 * (h11 - z11) + bp1 * (dh11 - dz11)
        N12 = cp1 * (h12 - z12) + bp1 * (dh12 - dz12)
        N21 = cp2 * (h21 - z2 - tilt) + bp2 * (dh21 - dz2 - dtilt)
        N22 = cp2 * (h22 - z2 + tilt) + bp2 * (dh22 - dz2 + dtilt)

        # (3.5), (3.7): the couplings of ψ and ψ2 have the signs of ψ2 positive like ψ; the print mixes both senses.
        # (3.6): so have its terms in ψ̇2 and ψ2, against the print; and its ż term is 2 (b2 b − b1 a) cos φ ż, as (3.1)
        # and the symmetry of damping ask: the print lacks the 2.
        F1, F2, roll2 = F11 + F12, F21 + F22, s0 * (F21 - F22)
        roll, gyro = s1 * (F11 - F12) + roll2, Jy_Jz * sin_psi * cos_psi * dphi
        q_double_dot = (
            (F1 + F2) / m,  # (3.1)
            (roll * cos_cos - gyro * dphi) / Jx,  # (3.5)
            ((b * F2 - a * F1) * cos_phi - roll * sin_sin + 2.0 * gyro * dpsi)
            / (Jy - Jy_Jz * sin_psi * sin_psi),  # (3.6)
            (N11 - F11) / m11,  # (3.2)
            (N12 - F12) / m12,  # (3.3)
            (N21 + N22 - F2) / axle_mass,  # (3.4)
            (s2 * (N21 - N22) - roll2) * cos_psi2 / axle_inertia,  # (3.7)
        )
        return q_double_dot, (travel11, travel12, travel21, travel22), (N11, N12, N21, N22)

    return motion


def strut_rates(car: Car, sin: Callable[..., Any] = math.sin, cos: Callable[..., Any] = math.cos) -> Rates:
    """Function (q, v) -> Δ̇ (4) [m/s] of this car: rates of strut travel, as in `equations_of_motion`."""
    a, b, s0, s1 = car.a, car.b, car.s0, car.s1

    def rates(q: Iterable[Any], v: Iterable[Any]) -> tuple[Any, Any, Any, Any]:
        _, psi, phi, _, _, _, psi2 = q
        dz, dpsi, dphi, dz11, dz12, dz2, dpsi2 = v
        dlift = cos(psi) * cos(phi) * dpsi - sin(psi) * sin(phi) * dphi
        front, rear = dz - a * cos(phi) * dphi, dz + b * cos(phi) * dphi - dz2
        roll = s0 * (dlift - cos(psi2) * dpsi2)
        return front + s1 * dlift - dz11, front - s1 * dlift - dz12, rear + roll, rear - roll

    return rates
