"""The car linearized at rest: M q̈ + D q̇ + K q = G u + P h + P' ḣ, and A of (3.10). Plain lists of numbers.

Written from the linear parts of the strut extensions and tyre deflections: with e = E q for the four struts and
w = W q for the four tyres, K = Eᵀ c E + Wᵀ cp W, D = Eᵀ b E + Wᵀ bp W, G = Eᵀ, P = Wᵀ cp, P' = Wᵀ bp.
"""

from __future__ import annotations

from dataclasses import dataclass

from .parameters import Car

Matrix = list[list[float]]


@dataclass(frozen=True, slots=True)
class Linear:
    """x' = A x + Bu u + Bh h + Bdh ḣ with x = (q, q̇); A (14 × 14), Bu, Bh, Bdh (14 × 4), SI units."""

    A: Matrix
    Bu: Matrix
    Bh: Matrix
    Bdh: Matrix


def extensions(car: Car) -> Matrix:
    """E (4 × 7): strut extensions fl, fr, rl, rr [m] of small q."""
    a, b, s0, s1 = car.a, car.b, car.s0, car.s1
    return [
        [1.0, s1, -a, -1.0, 0.0, 0.0, 0.0],
        [1.0, -s1, -a, 0.0, -1.0, 0.0, 0.0],
        [1.0, s0, b, 0.0, 0.0, -1.0, -s0],
        [1.0, -s0, b, 0.0, 0.0, -1.0, s0],
    ]


def wheel_heights(car: Car) -> Matrix:
    """W (4 × 7): heights of the wheels fl, fr, rl, rr [m] of small q."""
    s2 = car.s2
    return [
        [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, s2],
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -s2],
    ]


def masses(car: Car) -> list[float]:
    """Diagonal of M (7) at rest [kg, kg m²]."""
    rear = car.m21 + car.m22
    return [car.m, car.Jx, car.Jy, car.m11, car.m12, rear + car.m2, rear * car.s2**2 + car.J2]


def linearized(car: Car) -> Linear:
    """The linear part of the equations of motion at rest on a flat road."""
    E, W, M = extensions(car), wheel_heights(car), masses(car)
    c, cp = (car.c1, car.c1, car.c2, car.c2), (car.cp1, car.cp1, car.cp2, car.cp2)
    b, bp = (car.b1, car.b1, car.b2, car.b2), (car.bp1, car.bp1, car.bp2, car.bp2)
    zero = [[0.0] * 4 for _ in range(7)]

    def pull(strut: tuple[float, ...], tyre: tuple[float, ...], i: int, j: int) -> float:
        return -sum(E[k][i] * strut[k] * E[k][j] + W[k][i] * tyre[k] * W[k][j] for k in range(4)) / M[i]

    lower = [[*(pull(c, cp, i, j) for j in range(7)), *(pull(b, bp, i, j) for j in range(7))] for i in range(7)]
    return Linear(
        A=[[float(j == i + 7) for j in range(14)] for i in range(7)] + lower,
        Bu=zero + [[E[k][i] / M[i] for k in range(4)] for i in range(7)],
        Bh=zero + [[W[k][i] * cp[k] / M[i] for k in range(4)] for i in range(7)],
        Bdh=zero + [[W[k][i] * bp[k] / M[i] for k in range(4)] for i in range(7)],
    )
