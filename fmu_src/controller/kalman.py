"""States from noisy sensors: eight signals, their seeded noise, and a steady-state Kalman filter.

Sensors at each strut: an accelerometer at its top (vertical, body accelerations to first order in the angles) and its
travel. Both are functions of the car's states and of the actuators' forces alone, as the struts stand between body and
road: the controller works them out of its inputs, with the equations of the car, and needs no further wires. So they
are those of a car with the controller's own parameters, which are to be those of the car.

Their noise by default is that of good sensors of today (0.02 m/s², 0.05 mm, r.m.s.), a choice. Neither sees how high
the body is over a level road: of heave the estimate knows the rate, and the height only as far as the tyres' forces
tell. The default sigma_road is a choice too: the larger, the more of what happens is taken for the road.

The filter knows the car linearized at rest, x' = A x + Bu u + Bh h, and takes the road heights h for white noise: anew
for each sample. Between samples it takes the forces for those that act at the later one: right where they are held, and
with a lag or a valve, which moves them in between, an error of the model that the sensors correct. Computing it takes
numpy and scipy; running it the standard library.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from operator import mul
from random import Random
from typing import TYPE_CHECKING, Any

from ..quantities import ParameterError
from ..vehicle.equations import equations_of_motion
from ..vehicle.linear import Matrix, extensions, linearized
from ..vehicle.parameters import Car

if TYPE_CHECKING:
    from .riccati import Array

LEVEL = (0.0, 0.0, 0.0, 0.0)  # road heights and rates: they do not reach the sensors


def sensor_matrices(car: Car) -> tuple[Matrix, Matrix]:
    """C (8 × 14), D (8 × 4) of the sensors y = C x + D u: accelerations of the strut tops [m/s²], strut travels [m]."""
    linear, E = linearized(car), extensions(car)

    def top(row: Sequence[float], rates: Matrix) -> list[float]:
        return [sum(map(mul, row[:3], column)) for column in zip(*rates[7:10], strict=True)]

    C = [top(row, linear.A) for row in E] + [[*row, *[0.0] * 7] for row in E]
    return C, [top(row, linear.Bu) for row in E] + [[0.0] * 4 for _ in E]


class Filter:
    """x̂ ← x̂⁻ + M (y − C x̂⁻ − D u), where x̂⁻ is x̂ carried on to the sample by the linear car."""

    def __init__(self, car: Car, gain: Array, sigmas: Sequence[float], seed: int) -> None:
        self._car, self._sigmas, self._seed = car, sigmas, seed
        self._motion = equations_of_motion(car)
        self._tops = [row[:3] for row in extensions(car)]
        self._sensors = [[*c, *d] for c, d in zip(*sensor_matrices(car), strict=True)]
        self._gain: Matrix = gain.tolist()

    def measured(self, x: Sequence[float], u: Sequence[float], sample: int) -> list[float]:
        """What the eight sensors say in the states x (14) under forces u (4) [N]; the noise is that of the sample."""
        accelerations, travels, _ = self._motion(x[:7], x[7:], u, LEVEL, LEVEL)
        tops = [sum(map(mul, row, accelerations[:3])) for row in self._tops]
        gauss = Random(f"{self._seed}/{sample}").gauss  # of the number, not of what came before: nothing to remember
        return [y + gauss(0.0, sigma) for y, sigma in zip((*tops, *travels), self._sigmas, strict=True)]

    def updated(
        self, estimate: Sequence[float], u: Sequence[float], elapsed: float, y: Sequence[float]
    ) -> tuple[float, ...]:
        """The estimate (14) at a sample y (8), `elapsed` [s] after the one before, under forces u (4) held since."""
        if elapsed:
            known = (*estimate, *u)
            estimate = [sum(map(mul, row, known)) for row in _carried(self._car, round(elapsed, 12))]
        known = (*estimate, *u)
        news = [got - sum(map(mul, row, known)) for got, row in zip(y, self._sensors, strict=True)]
        return tuple(x + sum(map(mul, row, news)) for x, row in zip(estimate, self._gain, strict=True))


@lru_cache(maxsize=4)
def filter_for(
    car: Car, step: float, sigma_acceleration: float, sigma_travel: float, sigma_road: float, seed: int
) -> Filter:
    """The steady-state filter for samples `step` [s] apart. Raises ImportError without scipy, ParameterError."""
    sigmas = [sigma_acceleration] * 4 + [sigma_travel] * 4
    return Filter(car, steady_state(car, step, sigmas, sigma_road)[1], sigmas, seed)


def steady_state(car: Car, step: float, sigmas: Sequence[float], sigma_road: float) -> tuple[Array, Array]:
    """P (14 × 14), the covariance of the error before a sample, and the gain M (14 × 8) at it.

    P = F (P − P Cᵀ S⁻¹ C P) Fᵀ + G Gᵀ σh²,  S = C P Cᵀ + V,  M = P Cᵀ S⁻¹,  F = exp(A step), G = ∫ exp(A s) ds Bh.
    """
    import numpy as np
    from scipy.linalg import solve_discrete_are

    C, V = np.array(sensor_matrices(car)[0]), np.diag(np.square(sigmas))
    whole = discretized(car, linearized(car).Bh, step)
    F, G = whole[:, :14], whole[:, 14:]
    try:
        P = solve_discrete_are(F.T, C.T, sigma_road**2 * G @ G.T, V)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise ParameterError([f"there is no Kalman filter for this car and these sensors: {error}"]) from error
    return P, np.linalg.solve(C @ P @ C.T + V, C @ P).T


def discretized(car: Car, B: Matrix, step: float) -> Array:
    """[F G] (14 × 18) of x(t + step) = F x(t) + G u, with u held, for x' = A x + B u."""
    import numpy as np
    from scipy.linalg import expm

    whole = np.zeros((18, 18))
    whole[:14] = np.hstack([linearized(car).A, B])
    return expm(whole * step)[:14]


@lru_cache(maxsize=64)
def _carried(car: Car, step: float) -> Any:
    """[F G] for the forces of the struts, as plain numbers."""
    return discretized(car, linearized(car).Bu, step).tolist()
