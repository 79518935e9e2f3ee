"""The control law of §4, for the controller's FMU and the reference solution: when it acts, with which gain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from math import inf

from ..quantities import PARAMETERS, Choice, refuse
from .design import Design, Gain
from .halfcar import HalfCar, half_car_state, strut_forces

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
Forces = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlParameters:
    """What the controller is told; words in `quantities.PARAMETERS`. Raises ParameterError with every fault."""

    car: HalfCar = field(default_factory=HalfCar)
    enabled: bool = True
    horizon: str = HORIZON.start
    activation: str = ACTIVATION.start
    T: float = PARAMETERS["T"].start
    t_on: float = PARAMETERS["t_on"].start
    v0: float = PARAMETERS["v0"].start
    Lambda: float = PARAMETERS["Lambda"].start
    tau0: float = PARAMETERS["tau0"].start
    t_start: float = PARAMETERS["t_start"].start

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
        rear = self.t_start + (self.car.a + self.car.b) / self.v0
        return rear + max(self.tau0, 0.0) + 0.5 * self.Lambda / self.v0

    @property
    def end(self) -> float:
        """Time [s] from which it acts no more: T, or never."""
        return self.T if self.horizon == "finite" else inf


def control_law(p: ControlParameters, made: Design | None) -> Callable[[float, Sequence[float]], Forces]:
    """Forces [N] of the struts fl, fr, rl, rr as a function of the time [s] and the car's 14 states.

    `made` holds the gains that p asks for; None only if the controller is switched off.
    """
    off = (0.0, 0.0, 0.0, 0.0)
    if not p.enabled or made is None:
        return lambda t, x: off
    begin, end = p.begin - SNAP, p.end - SNAP
    table, constant, T = made.finite, made.infinite, p.T

    def gain(t: float) -> Gain:
        if p.horizon == "finite":
            assert table is not None
            return table.gain(T - t)
        assert constant is not None
        return constant

    def forces(t: float, x: Sequence[float]) -> Forces:
        if not begin <= t < end:
            return off
        k11, k12, k13, k14, k21, k22, k23, k24 = gain(t)
        z, phi, dz, dphi = half_car_state(x[0], x[2], x[7], x[9])
        return strut_forces((k11 * z + k12 * phi + k13 * dz + k14 * dphi, k21 * z + k22 * phi + k23 * dz + k24 * dphi))

    return forces
