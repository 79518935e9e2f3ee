"""The same motion without FMI: the whole system as one, by scipy's DOP853, restarted wherever the input has a corner.

A second way to the numbers of a co-simulation, and the honest comparison for its cost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

import numpy as np
from scipy.integrate import solve_ivp

from fmu_src.controller.design import design
from fmu_src.controller.halfcar import HalfCar, half_car_state, strut_forces
from fmu_src.quantities import CORNERS, PARAMETERS, STATES
from fmu_src.road.profiles import HARMONICS, PROFILE, Road, RoadParameters, road
from fmu_src.vehicle.equations import accelerations, strut_and_tyre_forces
from fmu_src.vehicle.parameters import Car

from .scenario import Scenario
from .trajectory import Array

Parameters = dict[str, float | str | bool]
NUDGE = 1e-10  # s; inputs within a segment are taken this far inside it, on the segment's own side of a corner


def car_of(parameters: Parameters) -> Car:
    """The car that these parameters describe; defaults where they are silent."""
    return Car(**{f.name: float(parameters.get(f.name, PARAMETERS[f.name].start)) for f in fields(Car)})


def road_of(parameters: Parameters) -> Road:
    """The road that these parameters describe; defaults where they are silent."""
    names = ("A", "Lambda", "v0", "a", "b", "tau0", "t_start")
    fl, fr, rl, rr = (bool(parameters.get(f"excite_{corner}", True)) for corner in CORNERS)
    return road(
        RoadParameters(
            profile=str(parameters.get(PROFILE.name, PROFILE.start)),
            amplitudes=tuple(float(parameters.get(name, PARAMETERS[name].start)) for name in HARMONICS),
            excited=(fl, fr, rl, rr),
            **{name: float(parameters.get(name, PARAMETERS[name].start)) for name in names},  # type: ignore[arg-type]
        )
    )
