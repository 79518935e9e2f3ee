"""Equations of motion of the car, Eqs. (3.1)–(3.7), written as forces, then accelerations.

Frames (ISO 8855): x forward, y left, z up. q = (z, ψ, φ, z11, z12, z2, ψ2): body heave, roll (left side up), pitch
(nose down), front wheels' heave, rear axle's heave and roll (left side up), all from static equilibrium, which takes
gravity out. With the strut's extension Δ, a strut pushes the body up by

    F = −c Δ − b Δ̇ + u          (u: actuator, up on the body, down on the wheel)

and a tyre pushes its wheel up by N = cp (h − z_w) + bp (ḣ − ż_w), over its static load. Each equation below is the sum
of these forces times the derivative of their points of attack by the coordinate. Multiplied out they are the
printed (3.1)–(3.7), except where the print is not the derivative of its own energies; each such place is marked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from .parameters import Car

Vector = Sequence[Any]
Forces = tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]
"""Strut travels Δ [m], strut forces F [N], tyre forces N [N], each for the corners fl, fr, rl, rr."""


def strut_and_tyre_forces(car: Car, sin: Callable = math.sin, cos: Callable = math.cos) -> Callable[..., Forces]:
    """Function (q, v, u, h, dh) -> (Δ, F, N) of this car.

    q (7) [m, rad], v = q̇ (7) [m/s, rad/s], u (4) actuator forces [N], h (4) road heights [m], dh (4) their rates [m/s].
    `sin` and `cos` may be those of numpy, sympy or an interval library: the equations then run in its numbers.
    """
    c1, c2, cp1, cp2 = car.c1, car.c2, car.cp1, car.cp2
    b1, b2, bp1, bp2 = car.b1, car.b2, car.bp1, car.bp2
    a, b, s0, s1, s2 = car.a, car.b, car.s0, car.s1, car.s2

    def forces(q: Vector, v: Vector, u: Vector, h: Vector, dh: Vector) -> Forces:
        z, psi, phi, z11, z12, z2, psi2 = q
        dz, dpsi, dphi, dz11, dz12, dz2, dpsi2 = v
        u11, u12, u21, u22 = u
        h11, h12, h21, h22 = h
        dh11, dh12, dh21, dh22 = dh

        # heights of the strut tops over the middle of each axle: ± s sin ψ cos φ, and their rates.
        # (3.2), (3.3): the φ̇ term of the rate is s1 sin ψ sin φ; the print has cos φ there.
        sin_psi, cos_psi, sin_phi, cos_phi = sin(psi), cos(psi), sin(phi), cos(phi)
        lift = sin_psi * cos_phi
        dlift = cos_psi * cos_phi * dpsi - sin_psi * sin_phi * dphi
        front, dfront = z - a * sin_phi, dz - a * cos_phi * dphi
        rear, drear = z + b * sin_phi, dz + b * cos_phi * dphi
        # rear axle: ± s0 sin ψ2 under the struts, ± s2 sin ψ2 over the tyres
        sin_psi2 = sin(psi2)
        dsin_psi2 = cos(psi2) * dpsi2

        travel11 = front + s1 * lift - z11
        travel12 = front - s1 * lift - z12
        rear_lift = s0 * (lift - sin_psi2)
        travel21 = rear - z2 + rear_lift
        travel22 = rear - z2 - rear_lift
        F11 = u11 - c1 * travel11 - b1 * (dfront + s1 * dlift - dz11)
        F12 = u12 - c1 * travel12 - b1 * (dfront - s1 * dlift - dz12)
        drear_lift = s0 * (dlift - dsin_psi2)
        F21 = u21 - c2 * travel21 - b2 * (drear - dz2 + drear_lift)
        F22 = u22 - c2 * travel22 - b2 * (drear - dz2 - drear_lift)

        N11 = cp1 * (h11 - z11) + bp1 * (dh11 - dz11)
        N12 = cp1 * (h12 - z12) + bp1 * (dh12 - dz12)
        N21 = cp2 * (h21 - z2 - s2 * sin_psi2) + bp2 * (dh21 - dz2 - s2 * dsin_psi2)
        N22 = cp2 * (h22 - z2 + s2 * sin_psi2) + bp2 * (dh22 - dz2 + s2 * dsin_psi2)
        return (travel11, travel12, travel21, travel22), (F11, F12, F21, F22), (N11, N12, N21, N22)

    return forces


def accelerations(car: Car, sin: Callable = math.sin, cos: Callable = math.cos) -> Callable[..., tuple[Any, ...]]:
    """Function (q, v, F, N) -> q̈ (7) [m/s², rad/s²] of this car, from strut forces F (4) [N] and tyre forces N (4) [N]."""
    m, m11, m12, axle_mass = car.m, car.m11, car.m12, car.m21 + car.m22 + car.m2  # (3.4): m2; the print has m_z
    Jx, Jy, Jz = car.Jx, car.Jy, car.Jz
    a, b, s0, s1, s2 = car.a, car.b, car.s0, car.s1, car.s2
    axle_inertia = (car.m21 + car.m22) * s2**2 + car.J2

    def q_double_dot(q: Vector, v: Vector, F: Vector, N: Vector) -> tuple[Any, ...]:
        _, psi, phi, _, _, _, psi2 = q
        _, dpsi, dphi, _, _, _, _ = v
        F11, F12, F21, F22 = F
        N11, N12, N21, N22 = N
        sin_psi, cos_psi, sin_phi, cos_phi = sin(psi), cos(psi), sin(phi), cos(phi)
        front, rear = F11 + F12, F21 + F22
        rear_roll = s0 * (F21 - F22)
        roll = s1 * (F11 - F12) + rear_roll
        gyro = (Jy - Jz) * sin_psi * cos_psi * dphi

        # (3.5) [and (3.7)]: the couplings of ψ and ψ2 have the signs of ψ2 positive like ψ; the print mixes both senses.
        # (3.6): the term in ż is 2 (b2 b − b1 a) cos φ ż, by the symmetry of the damping; the print lacks the 2.
        return (
            (front + rear) / m,  # (3.1)
            (roll * cos_psi * cos_phi - gyro * dphi) / Jx,  # (3.5)
            ((b * rear - a * front) * cos_phi - roll * sin_psi * sin_phi + 2 * gyro * dpsi)
            / (Jy - (Jy - Jz) * sin_psi * sin_psi),  # (3.6)
            (N11 - F11) / m11,  # (3.2)
            (N12 - F12) / m12,  # (3.3)
            (N21 + N22 - rear) / axle_mass,  # (3.4)
            (s2 * (N21 - N22) - rear_roll) * cos(psi2) / axle_inertia,  # (3.7)
        )

    return q_double_dot
