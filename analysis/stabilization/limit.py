"""How the finite horizon tends to the infinite one, remark 4.1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fmu_src.controller.riccati import finite_horizon

from ..methods.polynomials import Array
from .regulator import Regulator, stationary

FROM, TO = 1e-3, 1e-7  # what of L is still to come at the times to go that are looked at: far above round-off
POINTS = 41


@dataclass(frozen=True, slots=True, eq=False)
class Approach:
    """gap (k,): |vᴴ (L∞ − L(s)) v| / vᴴ L∞ v at the times to go s (k,) [s], v the slowest mode of the closed loop.

    L∞ − L(s) tends to exp(Ãᵀs) G exp(Ãs) with Ã = A + B K, so its part along v dies away as exp(−rate s), without
    oscillation; rate is twice the slowest decay of the closed loop [1/s], fitted what a straight line through
    log gap gives, bend the largest departure from that line.
    """

    s: Array
    gap: Array
    rate: float
    fitted: float
    bend: float


def approach(regulator: Regulator) -> Approach:
    """How L(s) tends to L∞ as the time to go s grows.

    Raises InputError where there is no L∞.
    """
    L, K = stationary(regulator)
    poles, modes = np.linalg.eig(regulator.A + regulator.B @ K)
    slowest = int(np.argmax(poles.real))
    v, rate = modes[:, slowest], -2.0 * float(poles[slowest].real)
    s = np.concatenate([[0.0], np.linspace(-np.log(FROM), -np.log(TO), POINTS) / rate])
    left = L - finite_horizon(regulator.A, regulator.B, regulator.Q, regulator.R, s)[1:]
    gap = np.abs(np.einsum("i,kij,j->k", v.conj(), left, v) / (v.conj() @ L @ v))
    slope, start = np.polyfit(s[1:], np.log(gap), 1)
    bend = float(np.abs(np.log(gap) - slope * s[1:] - start).max())
    return Approach(s[1:], gap, rate, -float(slope), bend)
