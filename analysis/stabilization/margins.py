"""How much the loop u = K x may be wrong at its actuators before it loses stability: gain, phase, delay; where one
signal is wrong, and where all are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
REAL = 1e-9  # of an eigenvalue's size: an imaginary part below is round-off

Locus = Callable[[float], NDArray[np.complex128]]
Crossings = list[tuple[float, complex]]


@dataclass(frozen=True, slots=True)
class LoopMargins:
    """The gain may be multiplied by any number in (down, up); the phase may lag or lead by so much.

    Phase in degrees, infinite where the loop's gain never reaches 1.
    """

    down: float
    up: float
    phase: float


@dataclass(frozen=True, slots=True)
class Margins:
    """loops             : of each signal, the others as they are.
    common            : of all actuators, whose gains or phases are wrong by the same.
    return_difference : least singular value of I + L(iω), 1 or more for an optimal state feedback with R = ρ I.
    disk              : α of the largest |Δ| with I + L (I + Δ/2)(I − Δ/2)⁻¹ singular for no Δ, of any structure,
                        smaller than α.
    delay             : least common delay [s] that takes the loop to an undamped oscillation; infinite if none does.
    """

    loops: tuple[LoopMargins, ...]
    common: LoopMargins
    return_difference: float
    disk: float
    delay: float


def margins(A: Array, B: Array, K: Array, signals: Sequence[Sequence[int]] | None = None) -> Margins:
    """Of the stable closed loop x' = (A + B K) x, broken at the actuators.

    signals : the actuators that one signal commands, whose rows of K are equal; each has its own if there are none.
    """

    def L(omega: float) -> NDArray[np.complex128]:
        return -K @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B)

    unit, omega = np.eye(len(K)), _frequencies()
    loci = _tracked(np.array([np.linalg.eigvals(L(w)) for w in omega]))
    crossings = _crossings(L, loci, lambda locus: np.abs(locus) - 1.0)
    return Margins(
        loops=tuple(loop_margins(A, B, K, each) for each in signals or [[i] for i in range(len(K))]),
        common=_common_margins(A, B, K, crossings, _crossings(L, loci, np.imag)),
        return_difference=_least(lambda omega: np.linalg.norm(unit + L(omega), -2)),
        disk=_least(lambda omega: 1.0 / np.linalg.norm(np.linalg.inv(unit + L(omega)) - 0.5 * unit, 2)),
        delay=float(min(((np.angle(e) + np.pi) % (2.0 * np.pi) / w for w, e in crossings), default=np.inf)),
    )


def loop_margins(A: Array, B: Array, K: Array, actuators: Sequence[int]) -> LoopMargins:
    """Of the signal that goes to these actuators, whose rows of K are equal, alone; by python-control."""
    others = ~np.isin(np.arange(len(K)), actuators)
    all_of_it = B[:, actuators].sum(axis=1, keepdims=True)
    loop = control.ss(A + B[:, others] @ K[others], all_of_it, -K[[actuators[0]]], 0.0)
    gains, phases, *_ = control.stability_margins(loop, returnall=True)
    return _worst(gains, phases)


def _common_margins(A: Array, B: Array, K: Array, unit: Crossings, real: Crossings) -> LoopMargins:
    """Of all actuators together: 1 + g e^{iθ} λ = 0 for eigenvalues λ of L(iω), at rest (ω = 0) too.

    unit, real : where eigenvalues cross the unit circle, and where the real axis.
    """
    at = [e.real for _, e in real]
    if np.linalg.cond(A) < 1.0 / np.finfo(float).eps:
        still = np.linalg.eigvals(K @ np.linalg.solve(A, B))
        at.extend(still.real[np.abs(still.imag) <= REAL * np.abs(still)])
    gains = np.array([-1.0 / e for e in at if e < 0.0])
    return _worst(gains, np.degrees([np.angle(-e) for _, e in unit]))


def _worst(gains: Array, phases: Array) -> LoopMargins:
    """The nearest of all factors and of all phases [°] that take the loop to the verge."""
    gains = gains[gains < MOST_GAIN]
    return LoopMargins(
        down=float(max(gains[gains < 1.0], default=0.0)),
        up=float(min(gains[gains > 1.0], default=np.inf)),
        phase=float(min(np.abs(phases), default=np.inf)),
    )


def _crossings(L: Locus, loci: NDArray[np.complex128], measure: Callable[[Any], Any]) -> Crossings:
    """Frequencies ω > 0 [rad/s] at which `measure` of an eigenvalue of L(iω) changes its sign, and the eigenvalue."""
    omega, found = _frequencies(), []
    for locus in loci.T:
        for k in np.flatnonzero(np.diff(np.sign(measure(locus)))):
            near = locus[k]

            def eigenvalue(w: float, near: complex = near) -> complex:
                values = np.linalg.eigvals(L(w))
                return complex(values[np.argmin(np.abs(values - near))])

            ends = [measure(eigenvalue(w)) for w in omega[k : k + 2]]
            if ends[0] * ends[1] < 0.0:  # else the eigenvalue is 0 but for round-off
                w = brentq(lambda w, e=eigenvalue: measure(e(w)), omega[k], omega[k + 1], xtol=1e-12, rtol=1e-14)
                found.append((w, eigenvalue(w)))
    return found


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
