"""The same motion without FMI: the whole system as one, by scipy's DOP853, restarted wherever the input has a corner.

A second way to the numbers of a co-simulation, and the honest comparison for its cost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from fmu_src.controller.design import design
from fmu_src.controller.halfcar import HalfCar
from fmu_src.controller.law import ACTIVATION, HORIZON, ControlParameters, control_law
from fmu_src.controller.lqr_controller import HALF_CAR
from fmu_src.quantities import CORNERS, PARAMETERS, STATES
from fmu_src.road.profiles import HARMONICS, PROFILE, Road, RoadParameters, road
from fmu_src.vehicle.equations import equations_of_motion
from fmu_src.vehicle.parameters import Car

from .errors import InputError
from .scenario import Scenario
from .trajectory import Array

Parameters = dict[str, float | str | bool]
NUDGE = 1e-10  # s; inputs within a segment are taken this far inside it, on the segment's own side of a corner


def car_of(parameters: Parameters) -> Car:
    """The car that these parameters describe; defaults where they are silent."""
    return Car(**{f.name: float(parameters.get(f.name, PARAMETERS[f.name].start)) for f in fields(Car)})


def road_of(parameters: Parameters) -> Road:
    """The road that these parameters describe; defaults where they are silent."""
    return road(road_parameters(parameters))


def road_parameters(parameters: Parameters) -> RoadParameters:
    """The parameters of the road among these; defaults where they are silent."""
    names = ("A", "Lambda", "v0", "a", "b", "tau0", "t_start")
    fl, fr, rl, rr = (bool(parameters.get(f"excite_{corner}", True)) for corner in CORNERS)
    return RoadParameters(
        profile=str(parameters.get(PROFILE.name, PROFILE.start)),
        amplitudes=tuple(float(parameters.get(name, PARAMETERS[name].start)) for name in HARMONICS),
        excited=(fl, fr, rl, rr),
        **{name: float(parameters.get(name, PARAMETERS[name].start)) for name in names},
    )


def control_of(parameters: Parameters) -> ControlParameters:
    """The control that these parameters describe; defaults where they are silent."""
    names = ("T", "t_on", "v0", "Lambda", "tau0", "t_start")
    half_car = {field: float(parameters.get(name, PARAMETERS[name].start)) for name, field in HALF_CAR.items()}
    return ControlParameters(
        car=HalfCar(**half_car),
        enabled=bool(parameters.get("enabled", True)),
        horizon=str(parameters.get(HORIZON.name, HORIZON.start)),
        activation=str(parameters.get(ACTIVATION.name, ACTIVATION.start)),
        **{name: float(parameters.get(name, PARAMETERS[name].start)) for name in names},
    )


@cache
def _law(p: ControlParameters) -> Callable[[float, Sequence[float]], Sequence[float]]:
    """The control law with gains designed anew, not read from the FMU."""
    finite = p.horizon == "finite"
    made = design(p.car, infinite=not finite, span=p.end - p.begin if finite else None) if p.enabled else None
    return control_law(p, made)


def closed_loop(scenario: Scenario, times: Array, *, rtol: float = 1e-12) -> Array:
    """The 14 states at `times` (n,) of car, road and continuously acting controller as one system; shape (n, 14)."""
    control = control_of(scenario.parameters)
    switches = [t for t in (control.begin, control.end) if control.enabled and t < times[-1]]
    x0 = np.array([scenario.start.get(q.name, 0.0) for q in STATES])
    return integrate(scenario.parameters, _law(control), switches, x0, times, rtol=rtol)


def outputs(scenario: Scenario, times: Array, states: Array) -> Array:
    """All outputs of car, road and controller in each row, from its time and states.

    As a co-simulation records them: accelerations at the end of a step are those under the forces held over it.
    """
    ground, motion = road_of(scenario.parameters), equations_of_motion(car_of(scenario.parameters))
    law = _law(control_of(scenario.parameters))
    rows: list[tuple[float, ...]] = []
    held: Sequence[float] | None = None
    for t, x in zip(times.tolist(), states.tolist(), strict=True):
        u, h, dh = law(t, x), ground.heights(t), ground.rates(t)
        accelerations, travels, tyres = motion(x[:7], x[7:], held or u, h, dh)
        held = u
        rows.append((*h, *dh, *x, *accelerations, *travels, *tyres, *u))
    return np.array(rows)


def integrate(
    parameters: Parameters,
    forces: Callable[[float, list[float]], Sequence[float]],
    switches: Sequence[float],
    x0: Array,
    times: Array,
    *,
    rtol: float = 1e-12,
) -> Array:
    """States (n, 14) at `times` (n,), from x0 at times[0], under forces(t, x) [N] that jump only at `switches` [s]."""
    ground, motion = road_of(parameters), equations_of_motion(car_of(parameters))

    def rate(t: float, y: Array) -> list[float]:
        state = y.tolist()
        q, v = state[:7], state[7:]
        accelerations, _, _ = motion(q, v, forces(t, state), ground.heights(t), ground.rates(t))
        return [*v, *accelerations]

    return in_stretches(rate, [*ground.corners(times[-1]), *switches], x0, times, rtol=rtol)


def in_stretches(
    rate: Callable[[float, Array], Sequence[float] | Array],
    corners: Sequence[float],
    x0: Array,
    times: Array,
    *,
    rtol: float = 1e-12,
    atol: float | None = None,
    method: str = "DOP853",
) -> Array:
    """States (n, len(x0)) at `times` (n,) [s] of x' = rate(t, x) from x0 at times[0], restarted at each corner [s].

    The rate is asked for times a little inside each stretch, where it has not jumped. Raises InputError where the
    integration does not come to its end.
    """
    inner = (t for t in {*corners} if times[0] + NUDGE < t < times[-1] - NUDGE)
    edges = [times[0], *sorted(inner), times[-1]]
    states = np.empty((len(times), len(x0)))
    states[0] = x = x0
    tolerances = {"rtol": rtol, "atol": rtol * 1e-3 if atol is None else atol}
    for begin, end in pairwise(edges):

        def inside(t: float, y: Array, first: float = begin + NUDGE, last: float = end - NUDGE) -> Any:
            return rate(min(max(t, first), last), y)

        within = (times > begin) & (times <= end)
        sampled = np.union1d(times[within], end)
        solution = solve_ivp(inside, (begin, end), x, method=method, t_eval=sampled, **tolerances)
        if not solution.success:
            raise InputError(f"from t = {begin:g} s the motion cannot be integrated: {solution.message}")
        states[within], x = solution.y.T[: np.count_nonzero(within)], solution.y[:, -1]
    return states
