"""§2 from (2.12) on: w, and the permanent perturbation that (2.13) and (2.14) make of it, on the oscillator."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from ..figures import readable
from .oscillator import START, Force, S, mean, order, pulled_back, turned, w
from .rows import FAILS, Evidence, Row
from .system import Array


def rows() -> list[Row]:
    """(2.12) to the end of §2, in the order of the paper."""
    return [_w(), _remainder(), _small(), _perturbation(), _rest()]


def _w() -> Row:
    """S already holds X: with S[τ, X v] it comes in twice, and another mean is taken out than there is."""
    doubled: Force = lambda t, v: S(t, turned(t, v))  # noqa: E731
    S_1: Force = lambda t, v: mean(S, v)  # noqa: E731
    T = 2.0 * np.pi * 100
    return Row(
        equation="(2.12) and below it",
        printed="S[t, X(t) v]",
        derived="S[t, v], and S[t, v + εw] in the equation below",
        evidence=[
            Evidence(
                measure="growth of |w| per unit of time, over |S_1|, oscillator, over 100 periods",
                printed=float(np.linalg.norm(w(doubled, S_1, START, T)) / T / np.linalg.norm(mean(S, START))),
                derived=float(np.linalg.norm(w(S, S_1, START, T)) / T / np.linalg.norm(mean(S, START))),
                unit="1",
                tolerance=1e-10,
                apart=0.1,
            )
        ],
    )


# ------------------------------------------------------------------ (2.13)
STEP = 1e-5
TIME = 2.0  # at which the right side of (2.13) is looked at


def _derivative(function: Callable[[Array], Array], v: Array) -> Array:
    """Jacobian (2, 2) by central differences; of cubic polynomials, exact up to STEP²."""
    return np.column_stack([(function(v + STEP * e) - function(v - STEP * e)) / (2.0 * STEP) for e in np.eye(2)])


def right_sides(t: float, v: Array, epsilon: float) -> tuple[Array, Array, Array]:
    """v' at (t, v): exactly, from (2.7) with ζ = v + εw; by (2.13) as printed, without O(·); with what it lacks."""
    S_1: Force = lambda _, at: mean(S, at)  # noqa: E731
    pulled = pulled_back(S)
    w_there = w(S, S_1, v, t)
    w_v = _derivative(lambda at: w(S, S_1, at, t), v)
    by_zeta = _derivative(lambda at: pulled(np.asarray(t), at), v)
    change = pulled(np.asarray(t), v + epsilon * w_there) - pulled(np.asarray(t), v)
    slope = mean(S, v)
    exact = np.asarray(np.linalg.solve(np.eye(2) + epsilon * w_v, epsilon * (slope + change)), dtype=float)
    as_printed = epsilon * slope - epsilon * w_v @ (epsilon * slope)
    return exact, as_printed, as_printed + epsilon**2 * by_zeta @ w_there


def _remainder() -> Row:
    def left(which: int) -> Callable[[float], float]:
        def error(epsilon: float) -> float:
            sides = right_sides(TIME, START, epsilon)
            return float(np.linalg.norm(sides[0] - sides[which]))

        return error

    exact, as_printed, corrected = right_sides(TIME, np.zeros(2), 1e-3)
    return Row(
        equation="(2.13)",
        printed="v' = ε S_1 − ε (∂w/∂v) [ε S_1 + O(v)]",
        derived="v' = ε S_1 + ε² X⁻¹ (∂S/∂ζ) w − ε (∂w/∂v) [ε S_1 + O(ε²)] + O(ε³)",
        evidence=[
            Evidence(
                measure="order in ε of what the right side leaves of v', oscillator, t = 2",
                printed=order(left(1)),
                derived=order(left(2)),
                unit="1",
                expected=3.0,
                tolerance=0.1,
                apart=0.5,
            ),
            Evidence(
                measure="the right side at v = 0 (ε = 10⁻³) over v' there",
                printed=float(np.linalg.norm(as_printed) / np.linalg.norm(exact)),
                derived=float(np.linalg.norm(corrected) / np.linalg.norm(exact)),
                unit="1",
                expected=1.0,
                tolerance=1e-2,
                apart=0.5,
            ),
        ],
    )


def perturbations(v: Array, epsilon: float) -> tuple[float, float, float]:
    """Sizes at (TIME, v): |v' − ε S_1| exactly; |λ| of (2.14), what is known of it; |λ| with what (2.13) gives it."""
    slope = epsilon * mean(S, v)
    exact, as_printed, corrected = right_sides(TIME, v, epsilon)
    printed = (as_printed - slope) / -epsilon  # (2.14) is the bracket of (2.13) without its factor
    change, known, corrected_change = (float(np.linalg.norm(x)) for x in (exact - slope, printed, corrected - slope))
    return change, known, corrected_change


def _small() -> Row:
    """|v' − ε S_1|/ε, of which the inequality bounds a part: next to v = 0 it shrinks with ε, not any more with v.

    What does not is ε X⁻¹ (∂S/∂ζ) w, which the print lacks; the bracket, corrected, is of order ε² at v = 0.
    """

    def size(scale: float, epsilon: float) -> float:
        return perturbations(scale * START, epsilon)[0] / epsilon

    reference = size(1e-3, 0.04)
    return Row(
        equation="between (2.13) and (2.14)",
        printed="‖(∂w/∂v) [ε S_1 + O(v)]‖ < Δ if ‖v‖ < δ",
        derived="what (2.13) adds to ε S_1, over ε, is < Δ if ‖v‖ < δ and ε is small: with ε X⁻¹ (∂S/∂ζ) w, which the "
        "bracket lacks, it is of order ε at v = 0, not 0",
        kind=FAILS,
        evidence=[
            Evidence(
                measure="|v' − ε S_1|/ε next to v = 0, oscillator, t = 2, where |v| is made 1000 times as small, and "
                "where ε is too, over that before",
                printed=size(1e-6, 0.04) / reference,
                derived=size(1e-6, 0.04e-3) / reference,
                unit="1",
                tolerance=1e-2,
                apart=0.5,
            )
        ],
    )


def _perturbation() -> Row:
    exact, as_printed, corrected = perturbations(START, 1e-3)
    ratios = ", ".join(readable(printed / true, 3) for true, printed, _ in map(_at_start, (1e-2, 1e-3, 1e-4)))

    def over_slope(which: int) -> Callable[[float], float]:
        return lambda epsilon: _at_start(epsilon)[which] / epsilon

    return Row(
        equation="(2.14)",
        printed="λ = (∂w/∂v) [ε S_1 + O(ε)]",
        derived="λ = −ε (∂w/∂v) [ε S_1 + O(ε²)] + ε² X⁻¹ (∂S/∂ζ) w + O(ε³), by (2.13); as printed it is not small "
        "beside ε S_1",
        evidence=[
            Evidence(
                measure="what is known of |λ| over |v' − ε S_1|, oscillator, t = 2, ε = 10⁻³",
                printed=as_printed / exact,
                derived=corrected / exact,
                unit="1",
                expected=1.0,
                tolerance=1e-2,
                apart=1.0,
            ),
            Evidence(
                measure="order in ε of |λ| over |ε S_1|, at least 1 for a small perturbation",
                printed=order(over_slope(1)),
                derived=order(over_slope(2)),
                unit="1",
                expected=1.0,
                tolerance=0.1,
                apart=0.5,
            ),
        ],
        note=f"The first number for ε = 10⁻², 10⁻³, 10⁻⁴: {ratios}.",
    )


def _at_start(epsilon: float) -> tuple[float, float, float]:
    return perturbations(START, epsilon)


def _rest() -> Row:
    """S(t, 0) = Φ[t, x_lin] is not 0, so that ζ = 0 is no motion; the one that starts there follows ε w(0, t)."""
    origin, epsilon, period = np.zeros(2), 1e-3, 2.0 * np.pi
    rate = pulled_back(S)
    run = solve_ivp(
        lambda t, z: epsilon * rate(np.asarray(t), z), (0.0, period), origin, rtol=1e-10, atol=1e-14, dense_output=True
    )
    t = np.linspace(STEP, period - STEP, 400)
    slope = (run.sol(t + STEP) - run.sol(t - STEP)).T / (2.0 * STEP)
    left = np.linalg.norm(slope - epsilon * rate(t, run.sol(t).T), axis=1)
    left_at_rest = np.linalg.norm(rate(t, np.zeros((len(t), 2))), axis=1)
    S_1: Force = lambda t, v: mean(S, v)  # noqa: E731
    first_order = np.array([w(S, S_1, origin, end) for end in run.t[1:]])
    return Row(
        equation="after (2.14)",
        printed="from the stability of the solution ζ = 0 of (2.7)",
        derived="from the boundedness of all ζ that start near 0; ζ = 0 is no solution",
        kind=FAILS,
        evidence=[
            Evidence(
                measure="largest |ζ' − ε X⁻¹ S(t, ζ)|/ε over a period, oscillator, of ζ = 0 and of the motion from "
                "there (ε = 10⁻³)",
                printed=float(left_at_rest.max()),
                derived=float(left.max() / epsilon),
                unit="1/s",
                tolerance=1e-6,
                apart=0.1,
            ),
            Evidence(
                measure="largest distance of that motion over ε, from ζ = 0 and from ε w(0, t)",
                printed=float(np.linalg.norm(run.y, axis=0).max() / epsilon),
                derived=float(np.linalg.norm(run.y.T[1:] / epsilon - first_order, axis=1).max()),
                unit="1",
                tolerance=1e-2,
                apart=0.1,
            ),
        ],
    )
