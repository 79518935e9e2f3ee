"""Both designs on the car with its wheels: their gains by struts, and both plants as functions of their parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np

from fmu_src.controller.design import design
from fmu_src.controller.fullcar import FullCar
from fmu_src.controller.halfcar import HalfCar, half_car_state, strut_forces
from fmu_src.vehicle.linear import linearized, masses
from fmu_src.vehicle.parameters import Car

from ..bertolino_baksa.balls import decimal
from ..methods.polynomials import Array
from .certified import Plant

BODY = ("m", "c1", "c2")
VARIED = (*BODY, "cp1", "cp2", "m11", "m21")
"""What is varied: the body's mass and the struts' stiffness, front and rear each for itself; of the car also the tyres'
stiffness and the wheels' masses, front and rear. M, S and G of M q̈ = S (q, q̇) + G u are affine in all of them."""
WITH = {"m": ("Jx", "Jy", "Jz"), "m11": ("m12",), "m21": ("m22", "m2", "J2")}
"""What goes in proportion with a mass: the body's moments of inertia; the other front wheel; the rear axle."""
AXLES = ((0, 1), (2, 3))
"""The struts fl, fr, rl, rr by what commands them: in the half-car design one signal goes to both of an axle."""


def strut_gain(K: Array) -> Array:
    """Gain (4, 14) from the car's states to the forces of its struts, of u = K x with K (2, 4) of the half car."""
    seen = np.array([half_car_state(x[0], x[2], x[7], x[9]) for x in np.eye(14)]).T
    forces = np.array([strut_forces(u) for u in ((1.0, 0.0), (0.0, 1.0))]).T
    gain: Array = forces @ K @ seen
    return gain


def full_gain(car: FullCar) -> Array:
    """Gain (4, 14) of the full-car design's u = K x, infinite horizon."""
    return np.array(design(car, infinite=True, span=None).infinite, dtype=float).reshape(4, 14)


def half_car_plant(car: HalfCar) -> Plant:
    """(4.1), corrected, by the parameters of `BODY`, in any kind of number."""

    def plant(values: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        changed = _varied(car, values)
        M = [changed.m, changed.Jy]
        A, B = (of.fget(changed) for of in (HalfCar.A, HalfCar.B))  # type: ignore[attr-defined]
        return M, _forces(M, A), _forces(M, B)

    return plant


def car_plant(car: Car) -> Plant:
    """The linear car under its struts' forces, by the parameters of `VARIED`, in any kind of number."""

    def plant(values: Mapping[str, Any]) -> tuple[Any, Any, Any]:
        changed = _varied(car, values)
        M, linear = masses(changed), linearized(changed)
        return M, _forces(M, linear.A), _forces(M, linear.Bu)

    return plant


def varied_values(car: HalfCar | Car) -> dict[str, float]:
    """The car's own values of what is varied of it."""
    return {name: getattr(car, name) for name in (BODY if isinstance(car, HalfCar) else VARIED)}


def _forces(M: Sequence[Any], rows: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """The lower half of A or B, accelerations, as forces."""
    return [[mass * each for each in row] for mass, row in zip(M, rows[len(M) :], strict=True)]


def _varied(car: HalfCar | Car, values: Mapping[str, Any]) -> Any:
    """The car's parameters, the varied ones replaced; all of one kind of number, exactly as their decimals say."""
    kind = type(values["m"])
    own = {f.name: getattr(car, f.name) for f in fields(car)}
    own = {name: value if kind is float else kind(decimal(value)) for name, value in own.items()}
    moved = {
        other: own[other] / own[name] * values[name] for name in values for other in WITH.get(name, ()) if other in own
    }
    return SimpleNamespace(**own | moved | dict(values))
