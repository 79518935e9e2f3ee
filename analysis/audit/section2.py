"""§2: evidence on (2.5), definition 2.1 and the averaging of (2.7), on an oscillator that can be done by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import quad, solve_ivp

from .car import CROSSING
from .oscillator import ONE_PERIOD, START, Force, P, S, S_printed, flow, mean, pulled_back, turned, w
from .rows import Evidence, Row
from .system import Array, derived

EPSILONS = np.array([0.04, 0.02, 0.01])


def rows() -> list[Row]:
    """§2 in the order of the paper."""
    return [_arbitrary_motion(), _definition(), _averaged(), _damped(), _w(), _remainder(), _rest()]


def _arbitrary_motion() -> Row:
    """On x' = −x, x̂0 = 1."""
    return Row(
        equation="(2.5)",
        printed="x̂ = x(t, x̂0) = ẋ(t)",
        derived="x̂ = x(t, x̂0) = x̂(t)",
        evidence=[
            Evidence(
                measure="distance at t = 0 from x̂0, on x' = −x",
                printed=abs(-1.0 - 1.0),
                derived=abs(float(np.exp(0.0)) - 1.0),
                unit="|x̂0|",
                tolerance=1e-15,
                apart=1.0,
            )
        ],
    )


def least_l(times: Array) -> tuple[float, float]:
    """Largest |x − ψ| of the default car at these times on a bump of 10 mm, ψ = 0 and ψ = x_lin."""
    car = derived("A")
    x, linear = car.over_the_bump(times, 0.01), car.linear_over_the_bump(times, 0.01)
    size = np.abs(x).max(axis=0)
    return float((np.abs(x) / size).max()), float((np.abs(x - linear) / size).max())


def _definition() -> Row:
    """The least l of the definition, with each ψ."""
    rest, linear = least_l(CROSSING)
    return Row(
        equation="definition 2.1",
        printed="a function ψ(t) = 0",
        derived="a function ψ(t): the definition is applied to (2.3), which is not 0",
        evidence=[
            Evidence(
                measure="largest |x − ψ| of the car on the bump, over each state's maximum, with ψ = 0 and ψ = x_lin",
                printed=rest,
                derived=linear,
                unit="1",
                tolerance=1e-3,
                apart=0.1,
            )
        ],
    )


def averaging_error(force: Force, epsilon: float) -> float:
    """|ζ − v| at t = 1/ε (whole periods), ζ of (2.7), v of (2.10) with the mean of this force."""
    end = 2.0 * np.pi * round(1.0 / (2.0 * np.pi * epsilon))
    exact = flow(lambda t, zeta: epsilon * pulled_back(S)(np.asarray(t), zeta), end)
    return float(np.linalg.norm(exact - flow(lambda t, v: epsilon * mean(force, v), end)))


def order(error: Callable[[float], float]) -> float:
    """Slope of log error over log ε."""
    return float(np.polyfit(np.log(EPSILONS), np.log([error(e) for e in EPSILONS]), 1)[0])


def _averaged() -> Row:
    return Row(
        equation="(2.10)",
        printed="S_1(v) = mean of X⁻¹ Φ[t, X v]",
        derived="S_1(v) = mean of X⁻¹ S(t, v) = mean of X⁻¹ Φ[t, x_lin + X v]",
        evidence=[
            Evidence(
                measure="order in ε of |ζ − v| at t = 1/ε, oscillator",
                printed=order(lambda e: averaging_error(S_printed, e)),
                derived=order(lambda e: averaging_error(S, e)),
                unit="1",
                expected=1.0,
                tolerance=0.1,
                apart=0.5,
            ),
            Evidence(
                measure="slow frequency shift (2.10) gives at r = 1, over the shift by hand, ε (3 r² + 6 P²)/8",
                printed=_shift(S_printed) / _shift_by_hand(),
                derived=_shift(S) / _shift_by_hand(),
                unit="1",
                expected=1.0,
                tolerance=1e-12,
                apart=0.1,
            ),
        ],
    )


def _shift(force: Force) -> float:
    """Rate of turn of v under v' = S_1(v), at v = (1, 0)."""
    return float(-mean(force, np.array([1.0, 0.0]))[1])


def _shift_by_hand() -> float:
    return (3.0 + 6.0 * P**2) / 8.0


def _damped() -> Row:
    """x' = −x − ε x³ with ζ = exp(t) x; and a mode damped 4 times as fast under the cube of another, exp(4t − 3t)."""
    epsilon = 0.5
    late = solve_ivp(lambda t, z: -epsilon * np.exp(-2.0 * t) * z**3, (0.0, 30.0), [1.0], rtol=1e-12, atol=1e-14).y[
        0, -1
    ]

    def average(growth: float, T: float) -> float:
        return float(quad(lambda t: np.exp(growth * t), 0.0, T, limit=200)[0] / T)

    return Row(
        equation="(2.10) with assumption 1",
        printed="v = 0 is an asymptotically stable solution of v' = ε S_1(v)",
        derived="impossible for constant damped A: S_1 is 0 in slowly and infinite in fast damped modes; take only "
        "exp(iβt) out and keep α, or bound x − x_lin directly",
        evidence=[
            Evidence(
                measure="ζ(∞)/ζ(0) of (2.7) on x' = −x − ε x³, ε = 0.5: by assumption 1, and integrated",
                printed=0.0,
                derived=float(late),
                unit="1",
                expected=(1.0 + epsilon) ** -0.5,
                tolerance=1e-9,
                apart=0.5,
            ),
            Evidence(
                measure="mean over 40 s over that over 20 s, mode damped by 4/s under the cube of one damped by 1/s: "
                "with X⁻¹ and X, and with α kept in the equation",
                printed=average(4.0 - 3.0, 40.0) / average(4.0 - 3.0, 20.0),
                derived=average(0.0, 40.0) / average(0.0, 20.0),
                unit="1",
                expected=1.0,
                tolerance=1e-12,
                apart=1e6,
            ),
        ],
    )


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


def _derivative(function: Callable[[Array], Array], v: Array) -> Array:
    """Jacobian (2, 2) by central differences; of cubic polynomials, exact up to STEP²."""
    return np.column_stack([(function(v + STEP * e) - function(v - STEP * e)) / (2.0 * STEP) for e in np.eye(2)])


def _right_side(t: float, v: Array, epsilon: float) -> tuple[Array, Array, Array]:
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
    t = 2.0
    rest, at = np.zeros(2), START

    def left(which: int) -> Callable[[float], float]:
        def error(epsilon: float) -> float:
            sides = _right_side(t, at, epsilon)
            return float(np.linalg.norm(sides[0] - sides[which]))

        return error

    exact, _, corrected = _right_side(t, rest, 1e-3)
    return Row(
        equation="(2.13)",
        printed="v' = ε S_1 − ε (∂w/∂v) [ε S_1 + O(v)]",
        derived="v' = ε S_1 + ε² X⁻¹ (∂S/∂ζ) w − ε (∂w/∂v) [ε S_1 + O(ε²)] + O(ε³); O(v) is O(ε) in (2.14)",
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
                measure="v' at v = 0 over ε² (ε = 10⁻³), which the print has as 0, over that of the exact right side",
                printed=0.0,
                derived=float(np.linalg.norm(corrected) / np.linalg.norm(exact)),
                unit="1",
                expected=1.0,
                tolerance=1e-2,
                apart=0.5,
            ),
        ],
    )


def _rest() -> Row:
    """S(t, 0) = Φ[t, x_lin] is not 0, so that ζ = 0 is no motion; the one that starts there follows ε w(0, t)."""
    origin, epsilon, periods = np.zeros(2), 1e-3, 2.0 * np.pi
    largest = np.linalg.norm(S(ONE_PERIOD, np.zeros((len(ONE_PERIOD), 2))), axis=1).max()
    run = solve_ivp(
        lambda t, z: epsilon * pulled_back(S)(np.asarray(t), z), (0.0, periods), origin, rtol=1e-10, atol=1e-14
    )
    reached = np.linalg.norm(run.y, axis=0).max() / epsilon
    S_1: Force = lambda t, v: mean(S, v)  # noqa: E731
    first_order = max(np.linalg.norm(w(S, S_1, origin, t)) for t in run.t[1:])
    return Row(
        equation="after (2.14)",
        printed="from the stability of the solution ζ = 0 of (2.7)",
        derived="from the boundedness of all ζ that start near 0; ζ = 0 is no solution",
        evidence=[
            Evidence(
                measure="largest |ζ'|/ε at ζ = 0, oscillator: if ζ = 0 is a solution, and by (2.7)",
                printed=0.0,
                derived=float(largest),
                unit="1/s",
                expected=P**3,
                tolerance=1e-4,
                apart=0.1,
            ),
            Evidence(
                measure="largest |ζ|/ε that is reached from ζ = 0 in a period, over that of w(0, t) (ε = 10⁻³)",
                printed=0.0,
                derived=float(reached / first_order),
                unit="1",
                expected=1.0,
                tolerance=0.01,
                apart=0.5,
            ),
        ],
    )
