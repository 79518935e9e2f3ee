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

from fmu_src.controller.design import design
from fmu_src.controller.hardware import NONE, Forces, Loop, Memory
from fmu_src.controller.law import SNAP, ControlParameters, control_law, control_parameters
from fmu_src.quantities import CORNERS, PARAMETERS, STATES
from fmu_src.road.profiles import HARMONICS, PROFILE, Road, RoadParameters, road
from fmu_src.vehicle.equations import equations_of_motion
from fmu_src.vehicle.parameters import Car

from .errors import InputError
from .scenario import Scenario
from .trajectory import Array

Parameters = dict[str, float | str | bool]
Command = Callable[[float, Sequence[float]], Sequence[float]]
NUDGE = 1.1 * SNAP  # s; inputs of a stretch are taken up to this before its end: asked for a time within SNAP below a
# corner, roads and laws already answer from behind it, as they should at the start of a stretch


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


@cache
def _law(p: ControlParameters) -> Callable[[float, Sequence[float]], Forces]:
    """The control law with gains designed anew, not read from the FMU."""
    finite = p.horizon == "finite"
    made = design(p.model, infinite=not finite, span=p.end - p.begin if finite else None) if p.enabled else None
    return control_law(p, made)


def closed_loop(scenario: Scenario, times: Array, *, rtol: float = 1e-12) -> Array:
    """The 14 states at `times` (n,) of car, road and controller as one system; shape (n, 14).

    The controller acts continuously, or with a sample time at its samples, which the times, as communication points,
    make: the first at or after each multiple. The forces of lagging actuators are states of the system.
    """
    control = control_parameters(scenario.parameters)
    loop, lag = Loop(control.hardware, _law(control), control.end), control.hardware.actuator_lag
    x0 = [scenario.start.get(q.name, 0.0) for q in STATES]
    y0 = np.array([*x0, *NONE] if lag else x0)

    def path(command: Command, switches: Sequence[float], y: Array, at: Array) -> Array:
        def lagging(t: float, y: Sequence[float]) -> list[float]:
            return [(u - f) / lag for u, f in zip(command(t, y), y[14:], strict=True)]

        def forces(t: float, y: Sequence[float]) -> Forces:
            return loop.passed(y, _four(y[14:] if lag else command(t, y)))

        return integrate(scenario.parameters, forces, switches, y, at, rtol=rtol, rest=lagging if lag else None)

    if not control.hardware.sample_time:
        switches = [t - SNAP for t in (control.begin, control.end) if control.enabled and t < times[-1]]
        return path(loop.command, switches, y0, times)[:, :14]
    due = [loop.number(t) for t in times]
    over = times >= (control.end if control.enabled else np.inf) - SNAP
    changes = [k for k in range(1, len(times)) if due[k] != due[k - 1] or over[k] != over[k - 1]]
    return _sampled(loop, path, y0, times, times[changes])[:, :14]


def _sampled(loop: Loop, path: Callable[..., Array], y: Array, times: Array, looks: Array) -> Array:
    """Rows (n, …) at `times` from y on, with the command held from one look at the states [s] to the next."""
    found, memory = np.empty((len(times), len(y))), Memory()
    found[0] = y
    for begin, end in pairwise([times[0], *looks.tolist(), times[-1]]):
        if len(y) > 14:
            memory = memory._replace(reached=_four(y[14:].tolist()))
        memory = loop.sampled(begin, y[:14].tolist(), memory)
        if end - begin > SNAP:
            within = (times > begin + SNAP) & (times < end + SNAP)
            at = np.unique(np.array([begin, *times[within].clip(max=end), end]))
            held = memory.command
            rows = path(lambda t, y, held=held: held, [], y, at)
            found[within], y = rows[1 : 1 + np.count_nonzero(within)], rows[-1]
    return found


def _four(values: Sequence[float]) -> Forces:
    u11, u12, u21, u22 = values
    return u11, u12, u21, u22


def outputs(scenario: Scenario, times: Array, states: Array) -> Array:
    """All outputs of car, road and controller in each row, from its time and states.

    As a co-simulation records them: accelerations at the end of a step are those under the forces held over it.
    Forces are those of the law itself, without the hardware that may stand behind it.
    """
    ground, motion = road_of(scenario.parameters), equations_of_motion(car_of(scenario.parameters))
    law = _law(control_parameters(scenario.parameters))
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
    rest: Command | None = None,
) -> Array:
    """States (n, 14) at `times` (n,), from x0 at times[0], under forces(t, x) [N] that jump only at `switches` [s].

    With `rest`, their rates as a function of time and all states, x0 has further states behind the car's 14.
    """
    ground, motion = road_of(parameters), equations_of_motion(car_of(parameters))

    def rate(t: float, y: Array) -> list[float]:
        state = y.tolist()
        q, v = state[:7], state[7:14]
        accelerations, _, _ = motion(q, v, forces(t, state), ground.heights(t), ground.rates(t))
        return [*v, *accelerations, *(rest(t, state) if rest else ())]

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

    The rate has jumped at each corner, and not yet NUDGE before it. Raises InputError where the integration does not
    come to its end.
    """
    from scipy.integrate import solve_ivp  # takes a moment to import

    inner = (t for t in {*corners} if times[0] < t < times[-1])
    edges = [times[0], *sorted(inner), times[-1]]
    states = np.empty((len(times), len(x0)))
    states[0] = x = x0
    tolerances = {"rtol": rtol, "atol": rtol * 1e-3 if atol is None else atol}
    for begin, end in pairwise(edges):
        within = (times > begin) & (times <= end)
        sampled = np.union1d(times[within], end)
        solution = solve_ivp(_inside(rate, begin, end), (begin, end), x, method=method, t_eval=sampled, **tolerances)
        if not solution.success:
            raise InputError(f"from t = {begin:g} s the motion cannot be integrated: {solution.message}")
        states[within], x = solution.y.T[: np.count_nonzero(within)], solution.y[:, -1]
    return states


def _inside(rate: Callable[[float, Array], Any], begin: float, end: float) -> Callable[[float, Array], Any]:
    """The rate on one stretch [begin, end]: on its last NUDGE, where the rate may have jumped, the straight line there.

    To hold it there would be a linear error, as an integrator's last stage, at `end`, counts for its whole step.
    """
    last, earlier = end - NUDGE, end - 2.0 * NUDGE

    def inside(t: float, y: Array) -> Any:
        if earlier <= begin:
            return rate(begin, y)
        if t <= last:
            return rate(t, y)
        at_last, before = np.asarray(rate(last, y)), np.asarray(rate(earlier, y))
        return at_last + (at_last - before) * ((t - last) / NUDGE)

    return inside
