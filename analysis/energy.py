"""Energy of the car along an exported trajectory: what is stored, what the road and the actuators give, what is lost.

d(T + V)/dt = Σ N ḣ + Σ u Δ̇ − Σ b Δ̇² − Σ bp (ḣ − ż_w)²
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from fmu_src.quantities import FORCES, ROAD_HEIGHTS, STATES, STRUT_TRAVELS
from fmu_src.vehicle import equations
from fmu_src.vehicle.parameters import Car

from .recorded_road import recorded_road
from .trajectory import Array, Trajectory
from .tyres import tyre_heights


@dataclass(frozen=True, slots=True)
class Balance:
    """Energies [J] over a whole trajectory: gain of T + V, work of the road, work of the actuators, loss in dampers."""

    stored: float
    road: float
    actuators: float
    dissipated: float

    @property
    def residual(self) -> float:
        """What the balance leaves unexplained [J]."""
        return self.stored - self.road - self.actuators + self.dissipated


def kinetic_energy(car: Car, x: Array) -> Array:
    """T [J] (n,) of states x (n, 14)."""
    psi, (dz, dpsi, dphi, dz11, dz12, dz2, dpsi2) = x[:, 1], x[:, 7:].T
    J = car.Jy * np.cos(psi) ** 2 + car.Jz * np.sin(psi) ** 2
    rear = car.m21 + car.m22
    twice = car.m * dz**2 + car.Jx * dpsi**2 + J * dphi**2 + car.m11 * dz11**2 + car.m12 * dz12**2
    return 0.5 * (twice + (rear + car.m2) * dz2**2 + (rear * car.s2**2 + car.J2) * dpsi2**2)


def strut_rates(car: Car, x: Array) -> Array:
    """Rates of strut travel Δ̇ [m/s] (n, 4)."""
    return np.column_stack(equations.strut_rates(car, np.sin, np.cos)(x[:, :7].T, x[:, 7:].T))


def balance(car: Car, trajectory: Trajectory) -> Balance:
    """Energy balance of a trajectory from its exported columns, to order 4 in its step.

    Within a step the road is that of `recorded_road`; wheels and struts are the cubics of their values and rates at
    both ends; powers are integrated by Gauss's rule. Actuator forces are held.
    """
    t, step, road = trajectory.time, np.diff(trajectory.time), recorded_road(trajectory)
    x, h, u, travel = (trajectory.columns([q.name for q in table]) for table in _TABLES)
    heights, rates = map(np.column_stack, tyre_heights(car, x[:, :7].T, x[:, 7:].T, np.sin, np.cos))
    c, cp = np.array([car.c1, car.c1, car.c2, car.c2]), np.array([car.cp1, car.cp1, car.cp2, car.cp2])
    b, bp = np.array([car.b1, car.b1, car.b2, car.b2]), np.array([car.bp1, car.bp1, car.bp2, car.bp2])
    energy = kinetic_energy(car, x) + 0.5 * (travel**2 @ c + (h - heights) ** 2 @ cp)
    wheel, strut = CubicHermiteSpline(t, heights, rates), CubicHermiteSpline(t, travel, strut_rates(car, x))

    nodes, weights = np.polynomial.legendre.leggauss(4)
    road_power, loss = np.zeros(len(step)), np.zeros(len(step))
    for node, weight in zip(0.5 * (1.0 + nodes), 0.5 * weights, strict=True):
        at = t[:-1] + node * step
        road_rate = road(at, 1)
        compression_rate = road_rate - wheel(at, 1)
        N = cp * (road(at) - wheel(at)) + bp * compression_rate
        road_power += weight * np.sum(N * road_rate, axis=1)
        loss += weight * (strut(at, 1) ** 2 @ b + compression_rate**2 @ bp)
    return Balance(
        stored=float(energy[-1] - energy[0]),
        road=float(road_power @ step),
        actuators=float(np.sum(u[:-1] * np.diff(travel, axis=0))),
        dissipated=float(loss @ step),
    )


_TABLES = (STATES, ROAD_HEIGHTS, FORCES, STRUT_TRAVELS)
