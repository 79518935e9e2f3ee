"""Vertical loads of the tyres, and how long a tyre is without one."""

from __future__ import annotations

from typing import Any

import numpy as np

from fmu_src.quantities import CORNER_WORDS, TYRE_FORCES
from fmu_src.vehicle.parameters import Car

from .reference import car_of
from .trajectory import Array, Run

G = 9.81  # m/s2


def static_loads(run: Run) -> Array:
    """Loads (4) [N] of the tyres fl, fr, rl, rr of the run's car at rest. Raises InputError if it is not recorded."""
    run.reals("m", "m11", "m12", "m21", "m22", "m2", "a", "b")  # no default may stand in for what was not recorded
    return static_loads_of(car_of(run.parameters))


def static_loads_of(car: Car) -> Array:
    """Loads (4) [N] of the tyres of a car at rest: its share of the body, its wheel, half the beam."""
    front, rear = car.m * car.b / (2 * (car.a + car.b)), car.m * car.a / (2 * (car.a + car.b)) + car.m2 / 2
    return G * np.array([front + car.m11, front + car.m12, rear + car.m21, rear + car.m22])


def tyre_heights(car: Car, q: Any, v: Any, sin: Any, cos: Any) -> tuple[list[Any], list[Any]]:
    """Heights (4) [m] of the wheels over the road at rest, and their rates [m/s], from q (7) and v = q̇ (7).

    In numbers of any kind that `sin` and `cos` take.
    """
    (z11, z12, z2, psi2), (dz11, dz12, dz2, dpsi2) = q[3:], v[3:]
    tilt, dtilt = car.s2 * sin(psi2), car.s2 * cos(psi2) * dpsi2
    return [z11, z12, z2 + tilt, z2 - tilt], [dz11, dz12, dz2 + dtilt, dz2 - dtilt]


def tyre_loads(run: Run) -> Array:
    """Total vertical loads (n, 4) [N] of the tyres: static load and exported tyre force."""
    return static_loads(run) + run.trajectory.columns([q.name for q in TYRE_FORCES])


def lift_off(run: Run) -> str:
    """Which tyres had no load, and for how long, in words; "" for none, or where their forces were not recorded."""
    if any(q.name not in run.trajectory.names for q in TYRE_FORCES):
        return ""
    lost = [time_below_zero(run.trajectory.time, loads) for loads in tyre_loads(run).T]
    return ", ".join(f"{words} {s * 1e3:.3g} ms" for words, s in zip(CORNER_WORDS, lost, strict=True) if s > 0.0)


def time_below_zero(time: Array, values: Array) -> float:
    """How long [s] the straight lines between the samples run below zero."""
    low, high = np.minimum(values[:-1], values[1:]), np.maximum(values[:-1], values[1:])
    level = (low < 0.0).astype(float)  # share of an interval in which nothing changes
    share = np.divide(-low, high - low, out=level, where=high > low).clip(0.0, 1.0)
    return float(np.sum(share * np.diff(time)))
