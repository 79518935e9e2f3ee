"""How much the loop u = K x may be wrong at its actuators before it loses stability: gain, phase, delay, and all at
once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from ..methods.polynomials import Array

DECADES = (-2.0, 5.0)  # of the frequencies looked at [rad/s]
PER_DECADE = 200
MOST_GAIN = 1e6  # what the polynomials of a loop give beyond it is round-off: taken for none


@dataclass(frozen=True, slots=True)
class LoopMargins:
    """One actuator's: its gain may be multiplied by any number in (down, up); its phase may lag or lead by so much.

    Phase in degrees, infinite where the loop's gain never reaches 1.
    """

    down: float
    up: float
    phase: float


@dataclass(frozen=True, slots=True)
class Margins:
    """of each actuator, the others as they are; and of all at once:

    return_difference : least singular value of I + L(iω), 1 or more for an optimal state feedback with R = ρ I.
    disk              : α of the largest |Δ| with I + L (I + Δ/2)(I − Δ/2)⁻¹ singular for no Δ, of any structure,
                        smaller than α.
    delay             : least common delay [s] that takes the loop to an undamped oscillation; infinite if none does.
    """

    loops: tuple[LoopMargins, ...]
    return_difference: float
    disk: float
    delay: float


def margins(A: Array, B: Array, K: Array) -> Margins:
    """Of the stable closed loop x' = (A + B K) x, broken at the actuators."""

    def L(omega: float) -> NDArray[np.complex128]:
        return -K @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B)

    unit = np.eye(len(K))
    return Margins(
        loops=tuple(loop_margins(A, B, K, i) for i in range(len(K))),
        return_difference=_least(lambda omega: np.linalg.norm(unit + L(omega), -2)),
        disk=_least(lambda omega: 1.0 / np.linalg.norm(np.linalg.inv(unit + L(omega)) - 0.5 * unit, 2)),
        delay=delay_margin(L),
    )


def loop_margins(A: Array, B: Array, K: Array, i: int) -> LoopMargins:
    """Of the i-th actuator alone, by python-control."""
    others = np.arange(len(K)) != i
    loop = control.ss(A + B[:, others] @ K[others], B[:, [i]], -K[[i]], 0.0)
    gains, phases, *_ = control.stability_margins(loop, returnall=True)
    gains = gains[gains < MOST_GAIN]
    return LoopMargins(
        down=float(max(gains[gains < 1.0], default=0.0)),
        up=float(min(gains[gains > 1.0], default=np.inf)),
        phase=float(min(np.abs(phases), default=np.inf)),
    )


def delay_margin(L: Callable[[float], NDArray[np.complex128]]) -> float:
    """Least τ ≥ 0 [s] with det(I + L(iω) exp(−iωτ)) = 0 for some ω > 0.

    An eigenvalue of L(iω) that crosses the unit circle at the angle θ gives τ = (θ + π)/ω, taken into a turn.
    """
    omega = _frequencies()
    loci = _tracked(np.array([np.linalg.eigvals(L(w)) for w in omega]))
    found = [np.inf]
    for locus in loci.T:
        for k in np.flatnonzero(np.diff(np.sign(np.abs(locus) - 1.0))):
            near = locus[k]

            def eigenvalue(w: float, near: complex = near) -> complex:
                values = np.linalg.eigvals(L(w))
                return complex(values[np.argmin(np.abs(values - near))])

            w = brentq(lambda w, e=eigenvalue: abs(e(w)) - 1.0, omega[k], omega[k + 1], xtol=1e-12, rtol=1e-14)
            found.append(float((np.angle(eigenvalue(w)) + np.pi) % (2.0 * np.pi)) / w)
    return min(found)


def _frequencies() -> Array:
    first, last = DECADES
    return np.logspace(first, last, 1 + int((last - first) * PER_DECADE))


def _least(measure: Callable[[float], Any]) -> float:
    """Least value over all frequencies, refined between those of the grid."""
    omega = _frequencies()
    values = [measure(w) for w in omega]
    k = int(np.argmin(values))
    bounds = np.log(omega[max(k - 1, 0)]), np.log(omega[min(k + 1, len(omega) - 1)])
    found = minimize_scalar(lambda x: measure(np.exp(x)), bounds=bounds, method="bounded", options={"xatol": 1e-9})
    return float(min(values[k], found.fun))


def _tracked(loci: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Eigenvalues (k, m) of one frequency after the other, each in the column of its nearest predecessor."""
    tracked = loci.copy()
    for k in range(1, len(loci)):
        free = list(loci[k])
        for j, before in enumerate(tracked[k - 1]):
            tracked[k, j] = free.pop(int(np.argmin(np.abs(np.array(free) - before))))
    return tracked
