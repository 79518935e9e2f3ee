"""§2 up to (2.10): definition 2.1, perturbed motion and averaging, on an oscillator that can be done by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import quad, solve_ivp

from ..figures import readable
from . import permanent
from .car import CROSSING
from .oscillator import OMEGA, START, Force, P, Phi, S, S_printed, flow, mean, order, pulled_back, turned, x_lin
from .rows import FAILS, INSPECTION, RIGHT, Evidence, Row
from .system import Array, derived


def rows() -> list[Row]:
    """§2 in the order of the paper."""
    return [_arbitrary_motion(), _definition(), _perturbed(), _averaged(), _damped(), *permanent.rows()]


def _arbitrary_motion() -> Row:
    return Row(
        equation="(2.5)",
        printed="x̂ = x(t, x̂0) = ẋ(t)",
        derived="x̂ = x(t, x̂0) = x̂(t): a motion, not its rate",
        kind=INSPECTION,
    )


def _perturbed() -> Row:
    """The oscillator from x_lin(0) + START: x itself, by (2.6) and (2.7), and by x − x_lin directly."""
    epsilon, end = 0.1, 10.0
    linear = x_lin(np.asarray(end))

    def full(t: float, x: Array) -> Array:
        return np.array([x[1], -x[0] + P * (1.0 - OMEGA**2) * np.sin(OMEGA * t)]) + epsilon * Phi(x)

    def difference(t: float, e: Array) -> Array:
        return np.array([e[1], -e[0]]) + epsilon * Phi(x_lin(np.asarray(t)) + e)

    motion = flow(full, end, x_lin(np.asarray(0.0)) + START)
    zeta = flow(lambda t, zeta: epsilon * pulled_back(S)(np.asarray(t), zeta), end)
    ways = [linear + turned(np.asarray(end), zeta), linear + flow(difference, end)]
    by_print, by_difference = (float(np.linalg.norm(x - motion) / np.linalg.norm(motion - linear)) for x in ways)
    return Row(
        equation="(2.6), (2.7)",
        printed="x̂ = x_lin + X ζ, ζ' = ε X⁻¹ S(t, ζ)",
        derived="the same",
        kind=RIGHT,
        evidence=[
            Evidence(
                measure="error of x̂ at t = 10 against the motion of (2.1), over |x̂ − x_lin|, oscillator, ε = 0.1: by "
                "(2.7), and by the equation of x̂ − x_lin",
                printed=by_print,
                derived=by_difference,
                unit="1",
                tolerance=1e-7,
                apart=1e-3,
            )
        ],
    )


def least_l(times: Array) -> tuple[float, float]:
    """Largest |x − ψ| over each state's |x_lin|, default car at these times on a bump of 10 mm; ψ = 0 and ψ = x_lin."""
    car = derived("A")
    x, linear = car.over_the_bump(times, 0.01), car.linear_over_the_bump(times, 0.01)
    size = np.abs(linear).max(axis=0)
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
                measure="largest |x − ψ| of the car on the bump, over each state's largest |x_lin|, with ψ = 0 and "
                "ψ = x_lin",
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


# ------------------------------------------------------------------ (2.10) where A is damped
EPSILON = 0.5  # of x' = −x − ε x³, whose ζ goes from 1 to (1 + ε)^(−1/2)


def _mean(rate: Callable[[float], float], T: float) -> float:
    """(1/T) ∫ rate dt from 0 to T."""
    return float(quad(rate, 0.0, T, limit=500)[0] / T)


def _forced(t: float) -> float:
    """x_lin of x' = −x + sin 2t from rest."""
    return float((np.sin(2.0 * t) - 2.0 * np.cos(2.0 * t) + 2.0 * np.exp(-t)) / 5.0)


def pulled_cube(t: float, v: float) -> float:
    """X⁻¹ Φ(x_lin + X v) of x' = −x + sin 2t − ε x³, as (2.10) averages it, x_lin put in."""
    return float(-np.exp(t) * (_forced(t) + np.exp(-t) * v) ** 3)


def _damped() -> Row:
    """Cubes in a mode of its own, in one damped 4 times as fast, exp(4t − 3t), and on a road that lasts; v = 1."""
    slow, fast = (lambda t: float(np.exp(-2.0 * t))), (lambda t: float(np.exp((4.0 - 3.0) * t)))
    kept, kept_lasting = (lambda t: 1.0), (lambda t: (_forced(t) + 1.0) ** 3)  # nothing is taken out of a real mode
    rest = solve_ivp(lambda t, z: -EPSILON * np.exp(-2.0 * t) * z**3, (0.0, 30.0), [1.0], rtol=1e-12, atol=1e-14).y
    lasting = {T: _mean(lambda t: pulled_cube(t, 1.0), T) for T in (10.0, 20.0, 30.0)}

    def twice(rate: Callable[[float], float]) -> float:
        return _mean(rate, 40.0) / _mean(rate, 20.0)

    def evidence(measure: str, printed: float, derived: float, tolerance: float, apart: float) -> Evidence:
        return Evidence(
            measure=f"{measure}: with X⁻¹ and X, and with α kept in the equation",
            printed=printed, derived=derived, unit="1", expected=1.0, tolerance=tolerance, apart=apart,
        )  # fmt: skip

    return Row(
        equation="(2.10) with assumption 1",
        printed="v = 0 is an asymptotically stable solution of v' = ε S_1(v)",
        derived="not where A is constant and damped and Φ cubic: if x_lin dies out, S_1 is 0 in slowly damped modes "
        "(v = 0 is but neutral) and infinite in fast ones; on a lasting road it is infinite in slow modes too. So of "
        "X take only exp(iβt) out and keep α, or bound x − x_lin directly. (Of linear Φ it may hold: A = −1, "
        "Φ = −x have S_1 = −v.)",
        kind=FAILS,
        evidence=[
            evidence("mean over 40 s over that over 20 s, x' = −x − ε x³", twice(slow), twice(kept), 1e-12, 0.4),
            evidence(
                "the same, mode damped by 4/s under the cube of one damped by 1/s", twice(fast), twice(kept), 1e-12, 1e6
            ),
            evidence(
                "mean over 30 s over that over 10 s, size, lasting road x' = −x + sin 2t − ε x³",
                abs(lasting[30.0] / lasting[10.0]),
                _mean(kept_lasting, 30.0) / _mean(kept_lasting, 10.0),
                0.1,
                1e6,
            ),
        ],
        note=f"Means on the lasting road over 10, 20, 30 s, v = 1: {', '.join(map(readable, lasting.values()))}. "
        f"On x' = −x − ε x³, ε = {EPSILON}, ζ of (2.7) comes to rest at {readable(rest[0, -1], 3)} of its start.",
    )
