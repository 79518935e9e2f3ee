"""The control law of §4, for the controller's FMU and the reference solution: when it acts, with which gain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import ceil, inf
from operator import mul
from typing import Any

from ..quantities import PARAMETERS, Choice, refuse
from ..vehicle.parameters import Car
from .design import Design, Model
from .fullcar import N_STATES, FullCar
from .halfcar import HalfCar, half_car_state, strut_forces
from .hardware import ACTUATORS, FEEDBACK, Forces, Hardware, Law

DESIGN = Choice(
    name="design",
    values=("half-car", "full-car"),
    text="the car that the gains are made for: in the plane, Eq. (4.1), or with seven degrees of freedom, a force for "
    "each strut",
)
HORIZON = Choice(
    name="horizon",
    values=("finite", "infinite"),
    text="gain by time from Eq. (4.7) with L(T) = 0, or the constant gain of remark 4.1",
)
ACTIVATION = Choice(
    name="activation",
    values=("come-down", "at t_on"),
    text="control begins when the last rear wheel has come down from the bump (from t_start, a, b, v0, tau0, Lambda), "
    "or at the time t_on",
)
SNAP = 1e-9  # s; a communication point this close below a switching time is that time


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlParameters:
    """What the controller is told; words in `quantities.PARAMETERS`. Raises ParameterError with every fault.

    model : the car that the gains are made for.  hardware : what stands between the law and the struts.
    """

    model: Model = field(default_factory=HalfCar)
    enabled: bool = True
    horizon: str = HORIZON.start
    activation: str = ACTIVATION.start
    T: float = PARAMETERS["T"].start
    t_on: float = PARAMETERS["t_on"].start
    v0: float = PARAMETERS["v0"].start
    Lambda: float = PARAMETERS["Lambda"].start
    tau0: float = PARAMETERS["tau0"].start
    t_start: float = PARAMETERS["t_start"].start
    hardware: Hardware = field(default_factory=Hardware)

    def __post_init__(self) -> None:
        faults = [PARAMETERS[f.name].fault(getattr(self, f.name)) for f in fields(self) if f.name in PARAMETERS]
        refuse([*faults, HORIZON.fault(self.horizon), ACTIVATION.fault(self.activation)])
        if self.enabled and not self.end > self.begin:
            refuse(
                [f"T = {self.T!r} s: wanted an end of control after its start at {self.begin:g} s ({self.activation})"]
            )

    @property
    def begin(self) -> float:
        """Time [s] from which the controller acts: t_B2 of §4 with the right side's delay, or t_on."""
        if self.activation == "at t_on":
            return self.t_on
        car = self.model.car if isinstance(self.model, FullCar) else self.model
        rear = self.t_start + (car.a + car.b) / self.v0
        return rear + max(self.tau0, 0.0) + 0.5 * self.Lambda / self.v0

    @property
    def end(self) -> float:
        """Time [s] from which it acts no more: T, or never."""
        return self.T if self.horizon == "finite" else inf

    def fault_of_step(self, t: float, step: float) -> str | None:
        """Why a step [s] from t [s] cannot be made, if it is longer than the whole of the control that it meets."""
        span = self.end - self.begin
        meets = t < self.end - SNAP and t + step > self.begin + SNAP
        if not (self.enabled and meets and step > span + SNAP):
            return None
        wanted = f"wanted at least a step of {step:g} s of control"
        return f"T = {self.T!r} s: {wanted}, got {span:g} s from {self.begin:g} s on"

    def fault_of_samples(self, t: float, step: float, last: float) -> str | None:
        """Why a step [s] from t [s] cannot be made, if it ends a control of which no sample was taken.

        last : time [s] of the last sample up to t. A shorter step meets one: that there is one `fault_of_start` saw to.
        """
        sampled = self.enabled and self.hardware.sample_time
        if not (sampled and t < self.end - SNAP <= t + step and last < self.begin - SNAP):
            return None
        wanted = f"wanted a sample within the control from {self.begin:g} s on"
        got = f"got one at {last:g} s and the next at {t + step:g} s"
        return f"T = {self.T!r} s, sample_time = {self.hardware.sample_time!r} s: {wanted}, {got}"

    def fault_of_start(self, t: float) -> str | None:
        """Why a run cannot start at t [s]: control is over by then, or no multiple of the sample time falls into it."""
        if not self.enabled:
            return None
        if self.end <= t + SNAP:
            return f"T = {self.T!r} s: wanted an end of control after the start of the run at {t:g} s"
        step, first = self.hardware.sample_time, self.begin
        if step and t < self.begin - SNAP:  # else the run's first sample, at its start, is one of control
            first = step * ceil((self.begin - SNAP) / step)
        if first < self.end - SNAP:
            return None
        wanted = f"wanted a sample within the control from {self.begin:g} s on, got the first at {first:g} s"
        return f"T = {self.T!r} s, sample_time = {step!r} s: {wanted}"


REALS = ("T", "t_on", "v0", "Lambda", "tau0", "t_start")
HALF_CAR, CAR, WEIGHTS, HARDWARE = (  # names of the parameters, as the FMUs have them
    tuple("lambda" if f.name == "lam" else f.name for f in fields(each) if f.name in PARAMETERS or f.name == "lam")
    for each in (HalfCar, Car, FullCar, Hardware)
)
CHOICES = (HORIZON, ACTIVATION, DESIGN, ACTUATORS, FEEDBACK)


def control_parameters(values: Mapping[str, Any]) -> ControlParameters:
    """The control that these parameters describe, by the FMU's names; defaults where they are silent.

    Raises ParameterError; the parts of a car that are not needed are not looked at.
    """
    refuse(choice.fault(values.get(choice.name, choice.start)) for choice in CHOICES)
    chosen = {choice.name: values.get(choice.name, choice.start) for choice in CHOICES}

    def among(names: Sequence[str]) -> dict[str, float]:
        return {("lam" if n == "lambda" else n): float(values.get(n, PARAMETERS[n].start)) for n in names}

    full = chosen["design"] == "full-car"
    needs_car = full or chosen["actuators"] == "semi-active" or chosen["feedback"] == "estimate"
    car = Car(**among(CAR)) if needs_car else Car()
    return ControlParameters(
        model=FullCar(car=car, **among(WEIGHTS)) if full else HalfCar(**among(HALF_CAR)),
        enabled=bool(values.get("enabled", True)),
        horizon=chosen["horizon"],
        activation=chosen["activation"],
        hardware=Hardware(car=car, actuators=chosen["actuators"], feedback=chosen["feedback"], **among(HARDWARE)),
        **among(REALS),
    )


def control_law(p: ControlParameters, made: Design | None) -> Law:
    """Forces [N] of the struts fl, fr, rl, rr as a function of the time [s] and the car's 14 states.

    `made` holds the gains that p asks for; None only if the controller is switched off. Ideal: without p.hardware.
    """
    off = (0.0, 0.0, 0.0, 0.0)
    if not p.enabled or made is None:
        return lambda t, x: off
    begin, end = p.begin - SNAP, p.end - SNAP
    table, constant, T = made.finite, made.infinite, p.T

    def gain(t: float) -> Sequence[float]:
        if p.horizon == "finite":
            assert table is not None
            return table.gain(T - t)
        assert constant is not None
        return constant

    def half_car(t: float, x: Sequence[float]) -> Forces:
        if not begin <= t < end:
            return off
        k11, k12, k13, k14, k21, k22, k23, k24 = gain(t)
        z, phi, dz, dphi = half_car_state(x[0], x[2], x[7], x[9])
        return strut_forces((k11 * z + k12 * phi + k13 * dz + k14 * dphi, k21 * z + k22 * phi + k23 * dz + k24 * dphi))

    def full_car(t: float, x: Sequence[float]) -> Forces:
        if not begin <= t < end:
            return off
        K, n = gain(t), N_STATES
        return (
            sum(map(mul, K[:n], x)),
            sum(map(mul, K[n : 2 * n], x)),
            sum(map(mul, K[2 * n : 3 * n], x)),
            sum(map(mul, K[3 * n :], x)),
        )

    return full_car if isinstance(p.model, FullCar) else half_car
