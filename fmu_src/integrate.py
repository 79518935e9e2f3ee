"""Classical Runge–Kutta over one step, and the road between two communication points. Pure functions.

Vectors have a fixed length here (7 coordinates, 4 wheels) and are written out: in plain Python that takes a third of
the time of a loop, and this is where a simulation spends its time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

Vector = Sequence[float]
Seven = tuple[float, float, float, float, float, float, float]
Motion = Callable[..., Any]
RoadWithin = Callable[[float], tuple[Vector, Vector]]
"""Heights [m] and rates [m/s] under the four wheels at the fraction σ of a step, 0 ≤ σ ≤ 1."""


def advanced(x: Vector, h: float, k: Vector) -> Seven:
    """x + h k, seven components."""
    x1, x2, x3, x4, x5, x6, x7 = x
    k1, k2, k3, k4, k5, k6, k7 = k
    return x1 + h * k1, x2 + h * k2, x3 + h * k3, x4 + h * k4, x5 + h * k5, x6 + h * k6, x7 + h * k7


def rk4(
    motion: Motion, q: Vector, v: Vector, step: float, inputs: Sequence[Any], first: Any = None
) -> tuple[Seven, Seven]:
    """(q, v) after one step of the classical fourth-order Runge–Kutta method on q̇ = v, q̈ = motion(q, v, *w)[0].

    inputs : w at the start, the middle and the end of the step.
    first  : q̈ at the start, where it is known already.
    The slopes of q are the stage velocities, hence q + h (v + h/6 (a1 + a2 + a3)) for q after the step.
    """
    start, middle, end = inputs
    half, sixth = 0.5 * step, step / 6.0
    a1 = motion(q, v, *start)[0] if first is None else first
    v2 = advanced(v, half, a1)
    a2 = motion(advanced(q, half, v), v2, *middle)[0]
    v3 = advanced(v, half, a2)
    a3 = motion(advanced(q, half, v2), v3, *middle)[0]
    a23 = advanced(a2, 1.0, a3)
    a4 = motion(advanced(q, step, v3), advanced(v, step, a3), *end)[0]
    return (
        advanced(q, step, advanced(v, sixth, advanced(a1, 1.0, a23))),
        advanced(v, sixth, advanced(advanced(a1, 2.0, a23), 1.0, a4)),
    )


def cubic_road(h0: Vector, dh0: Vector, h1: Vector, bow: Vector, step: float) -> RoadWithin:
    """Road within a step from what is known at its ends.

        h(σ) = h0 + σ H ḣ0 + σ² (h1 − h0 − H ḣ0) + 8 β σ² (1 − σ)

    ḣ0 is the rate just after the start (right-hand limit), so a corner at either end of the step costs nothing: the
    rate at the end is never asked for. β (bow) is the height at σ = 1/2 over the parabola; 0 leaves the parabola, right
    to order 3; with it the cubic meets the road at σ = 0, 1/2, 1, where the Runge–Kutta method looks.
    """
    if not (any(h0) or any(dh0) or any(h1) or any(bow)):
        return lambda sigma: (h0, dh0)
    cubics = [(a, step * d, b - a - step * d + 8.0 * w, -8.0 * w) for a, d, b, w in zip(h0, dh0, h1, bow, strict=True)]
    (a1, b1, c1, d1), (a2, b2, c2, d2), (a3, b3, c3, d3), (a4, b4, c4, d4) = cubics

    def at(s: float) -> tuple[Vector, Vector]:
        if s == 0.0:
            return h0, dh0
        return (
            a1 + s * (b1 + s * (c1 + s * d1)),
            a2 + s * (b2 + s * (c2 + s * d2)),
            a3 + s * (b3 + s * (c3 + s * d3)),
            a4 + s * (b4 + s * (c4 + s * d4)),
        ), (
            (b1 + s * (2.0 * c1 + s * 3.0 * d1)) / step,
            (b2 + s * (2.0 * c2 + s * 3.0 * d2)) / step,
            (b3 + s * (2.0 * c3 + s * 3.0 * d3)) / step,
            (b4 + s * (2.0 * c4 + s * 3.0 * d4)) / step,
        )

    return at


def straight_road(h0: Vector, dh0: Vector, step: float) -> RoadWithin:
    """Road within a step, carried on from its start by the rates: order 2."""
    h1, h2, h3, h4 = h0
    d1, d2, d3, d4 = dh0

    def at(s: float) -> tuple[Vector, Vector]:
        t = s * step
        return (h1 + t * d1, h2 + t * d2, h3 + t * d3, h4 + t * d4), dh0

    return at
