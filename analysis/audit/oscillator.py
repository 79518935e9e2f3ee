"""An oscillator on which the averaging of §2 can be done by hand, in the paper's letters.

x'' + x = F sin Ωt − ε x³, state (x, x'). It is undamped, so that its X(t), a rotation, keeps (2.10) finite, and with
Ω = 2 no combination of frequencies but the intended one is slow; everything repeats after 2π.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from ..methods.polynomials import Array

OMEGA, P = 2.0, 0.7  # forcing frequency; x_lin = P sin Ωt, so F = P (1 − Ω²)
ONE_PERIOD = np.linspace(0.0, 2.0 * np.pi, 512, endpoint=False)  # a mean over these is exact for trigonometric sums
START = np.array([1.0, 0.2])  # ζ at the start
EPSILONS = np.array([0.04, 0.02, 0.01])
Force = Callable[[Array, Array], Array]


def X(t: Array) -> Array:
    """Fundamental matrices (…, 2, 2) of x'' + x = 0."""
    return np.moveaxis(np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]]), (0, 1), (-2, -1))


def x_lin(t: Array) -> Array:
    """(…, 2)."""
    return np.stack([P * np.sin(OMEGA * t), P * OMEGA * np.cos(OMEGA * t)], axis=-1)


def Phi(x: Array) -> Array:
    """(0, −x³)."""
    return np.stack([np.zeros_like(x[..., 0]), -(x[..., 0] ** 3)], axis=-1)


def turned(t: Array, v: Array) -> Array:
    """X(t) v."""
    return np.einsum("...ij,...j->...i", X(t), v)


def S(t: Array, zeta: Array) -> Array:
    """S(t, ζ) as defined below (2.7): Φ[t, x_lin + X ζ]."""
    return Phi(x_lin(t) + turned(t, zeta))


def S_printed(t: Array, v: Array) -> Array:
    """What (2.10) averages: Φ[t, X v]."""
    return Phi(turned(t, v))


def pulled_back(force: Force) -> Force:
    """X⁻¹ times the force."""
    return lambda t, v: np.einsum("...ji,...j->...i", X(t), force(t, v))


def mean(force: Force, v: Array) -> Array:
    """(2.10): the mean of X⁻¹ force over explicit time."""
    return np.mean(pulled_back(force)(ONE_PERIOD, np.broadcast_to(v, (len(ONE_PERIOD), 2))), axis=0)


def flow(rate: Callable[[float, Array], Array], end: float, start: Array = START) -> Array:
    """v(end) (2) from `start`."""
    return np.asarray(solve_ivp(rate, (0.0, end), start, method="DOP853", rtol=1e-9, atol=1e-11).y[:, -1])


def order(error: Callable[[float], float]) -> float:
    """Slope of log error over log ε."""
    return float(np.polyfit(np.log(EPSILONS), np.log([error(e) for e in EPSILONS]), 1)[0])


def w(force: Force, S_1: Force, v: Array, T: float) -> Array:
    """(2.12): the integral over time from 0 to T of X⁻¹ force − S_1, at fixed v (2)."""
    t = np.linspace(0.0, T, round(512 * T / (2.0 * np.pi)) + 1)
    values = pulled_back(force)(t, np.broadcast_to(v, (len(t), 2))) - S_1(t, v)
    return np.asarray(np.trapezoid(values, t, axis=0))
