"""Both designs on the car with its wheels: their gains by struts, and both plants as functions of their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np

from fmu_src.controller.design import design
from fmu_src.controller.fullcar import FullCar
from fmu_src.controller.halfcar import HalfCar, half_car_state, strut_forces
from fmu_src.vehicle.linear import linearized
from fmu_src.vehicle.parameters import Car

from ..bertolino_baksa.balls import decimal
from ..methods.polynomials import Array
from .certified import Plant

VARIED = ("m", "c1", "c2")
"""What is varied: the body's mass, its moments of inertia in proportion, and the struts' stiffness, front and rear each
for itself. A and B are affine in 1/m, in c1 and in c2."""
INERTIAS = ("Jx", "Jy", "Jz")
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
    """(A, B) of (4.1), corrected, by the parameters of `VARIED`, in any kind of number."""

    def plant(values: Mapping[str, Any]) -> tuple[Any, Any]:
        changed = _varied(car, values)
        return _property(HalfCar.A, changed), _property(HalfCar.B, changed)

    return plant


def car_plant(car: Car) -> Plant:
    """(A, Bu) of the linear car by the parameters of `VARIED`, in any kind of number."""

    def plant(values: Mapping[str, Any]) -> tuple[Any, Any]:
        linear = linearized(_varied(car, values))
        return linear.A, linear.Bu

    return plant


def varied_values(car: HalfCar | Car) -> dict[str, float]:
    """The car's own values of `VARIED`."""
    return {name: getattr(car, name) for name in VARIED}


def _property(of: Any, instance: Any) -> Any:
    return of.fget(instance)


def _varied(car: HalfCar | Car, values: Mapping[str, Any]) -> Any:
    """The car's parameters, those of `VARIED` replaced; all of one kind of number, exactly as their decimals say."""
    kind = type(values["m"])
    own = {f.name: getattr(car, f.name) for f in fields(car)}
    own = {name: value if kind is float else kind(decimal(value)) for name, value in own.items()}
    inertias = {name: own[name] / own["m"] * values["m"] for name in INERTIAS if name in own}
    return SimpleNamespace(**own | inertias | dict(values))
