"""What a real car puts between the law and the struts: samples, sensors, limits, lag, valves. All of it off by default.

A sample is taken at the first communication point at or after each multiple of the sample time (at every communication
point without one) and its forces are held until the next, or until control ends. It is taken when the step to that
point is made, of the inputs that the host set before this step (for the first, before the end of initialization);
reading outputs, or a step of no length, takes none. Per sample: sensors and filter, if there are any, make the states
that the law sees; the forces are cut to the limit. The actuators follow with a lag; those that are semi-active are
dampers with a valve: they give a force only while it takes energy out of the strut, u Δ̇ ≤ 0, and no more of it than
with the valve shut, |u| ≤ b_max |Δ̇|. (Without that bound the force would hold a strut still as dry friction does.) That
is so at communication points: under a force that a master holds over its step a strut may turn, and gets a little.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from math import exp, floor, inf
from typing import NamedTuple

from ..quantities import PARAMETERS, Choice, refuse
from ..vehicle.equations import strut_rates
from ..vehicle.parameters import Car
from .kalman import Filter, filter_for

ACTUATORS = Choice(
    name="actuators",
    values=("active", "semi-active"),
    text="forces as the law asks for, or as a damper with a valve can give them: while they take energy out of their "
    "strut, and up to valve_damping times its rate",
)
FEEDBACK = Choice(
    name="feedback",
    values=("states", "estimate"),
    text="the law sees the states, or a Kalman filter's estimate from noisy accelerometers at the strut tops and "
    "strut travel sensors",
)
SNAP = 1e-9  # s; a communication point this close below a multiple of the sample time is that multiple
Forces = tuple[float, float, float, float]
Law = Callable[[float, Sequence[float]], Forces]
NONE: Forces = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """Actuators, sampling, sensors; words in `quantities.PARAMETERS`. Raises ParameterError with every fault.

    car : of semi-active actuators (whose struts) and of the estimate (what the filter knows).
    """

    car: Car = field(default_factory=Car)
    actuators: str = ACTUATORS.start
    feedback: str = FEEDBACK.start
    force_limit: float = 0.0
    actuator_lag: float = 0.0
    valve_damping: float = PARAMETERS["valve_damping"].start
    sample_time: float = 0.0
    sigma_acceleration: float = PARAMETERS["sigma_acceleration"].start
    sigma_travel: float = PARAMETERS["sigma_travel"].start
    sigma_road: float = PARAMETERS["sigma_road"].start
    seed: float = PARAMETERS["seed"].start

    def __post_init__(self) -> None:
        faults = [PARAMETERS[f.name].fault(getattr(self, f.name)) for f in fields(self) if f.name in PARAMETERS]
        faults += [ACTUATORS.fault(self.actuators), FEEDBACK.fault(self.feedback)]
        if not float(self.seed).is_integer():
            faults.append(f"seed = {self.seed!r}: wanted a whole number")
        if self.feedback == "estimate" and not self.sample_time > 0.0:
            faults.append("feedback = 'estimate', sample_time = 0.0 s: wanted a sample time > 0 for the filter")
        refuse(faults)

    @property
    def ideal(self) -> bool:
        """Whether the struts do at once what the law asks for."""
        plain = self.actuators == ACTUATORS.start and self.feedback == FEEDBACK.start
        return plain and not (self.force_limit or self.actuator_lag or self.sample_time)


class Memory(NamedTuple):
    """What the hardware remembers: number and time [s] of the last sample (number None: none yet), the forces [N] that
    were asked for then, those that the actuators have reached, and the filter's estimate of the states (14)."""

    sample: int | None = None
    time: float = 0.0
    command: Forces = NONE
    reached: Forces = NONE
    estimate: tuple[float, ...] = (0.0,) * 14


class Loop:
    """The law behind this hardware. Memory goes in and comes out; nothing is kept here."""

    def __init__(self, hardware: Hardware, law: Law, end: float = inf) -> None:
        """end : time [s] from which the law acts no more.

        Raises ImportError for an estimate where numpy and scipy are missing, ParameterError where there is none.
        """
        self._p, self._law, self._end = hardware, law, end
        self._rates = strut_rates(hardware.car)
        self._filter: Filter | None = None
        if hardware.feedback == "estimate":
            sigmas = (hardware.sigma_acceleration, hardware.sigma_travel, hardware.sigma_road)
            self._filter = filter_for(hardware.car, hardware.sample_time, *sigmas, int(hardware.seed))

    def number(self, t: float) -> int:
        """Number of the last multiple of the sample time up to the time t [s]."""
        return floor((t + SNAP) / self._p.sample_time)

    def sampled(self, t: float, x: Sequence[float], m: Memory) -> Memory:
        """The memory after a look at the states x (14) at the time t [s]: that of a new sample, if one is due."""
        p, number, estimate = self._p, None, m.estimate
        if p.sample_time:
            number = self.number(t)
            if number == m.sample:
                return m if t < self._end - SNAP else self._asked(m, NONE)
        if self._filter:
            acting = self.forces(x, m)
            elapsed = 0.0 if m.sample is None else t - m.time
            estimate = self._filter.updated(estimate, acting, elapsed, self._filter.measured(x, acting, number or 0))
        command = self.command(t, estimate if self._filter else x)
        return self._asked(Memory(number, t, m.command, m.reached, estimate), command)

    def _asked(self, m: Memory, command: Forces) -> Memory:
        """The memory with this command, which actuators without a lag reach at once."""
        return m._replace(command=command, reached=m.reached if self._p.actuator_lag else command)

    def command(self, t: float, x: Sequence[float]) -> Forces:
        """What the law asks for, within the limit [N]."""
        u, limit = self._law(t, x), self._p.force_limit
        if not limit:
            return u
        u1, u2, u3, u4 = (min(max(each, -limit), limit) for each in u)
        return u1, u2, u3, u4

    def elapsed(self, step: float, m: Memory) -> Memory:
        """The memory after a step [s] during which the command stood: f' = (u − f)/τ, exactly."""
        if not self._p.actuator_lag:
            return m
        left = exp(-step / self._p.actuator_lag)
        f1, f2, f3, f4 = (u + left * (f - u) for u, f in zip(m.command, m.reached, strict=True))
        return m._replace(reached=(f1, f2, f3, f4))

    def forces(self, x: Sequence[float], m: Memory) -> Forces:
        """Forces [N] on the struts fl, fr, rl, rr while the car has the states x (14)."""
        return self.passed(x, m.reached)

    def passed(self, x: Sequence[float], u: Forces) -> Forces:
        """What of the forces u [N] the actuators can give: all, or where semi-active those of a damper."""
        if self._p.actuators == "active":
            return u
        most = (-self._p.valve_damping * rate for rate in self._rates(x[:7], x[7:14]))
        u1, u2, u3, u4 = (min(max(f, min(w, 0.0)), max(w, 0.0)) for f, w in zip(u, most, strict=True))
        return u1, u2, u3, u4
