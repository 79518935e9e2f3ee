"""LqrController: optimal stabilization (§4) as a co-simulation component."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Any, ClassVar

from ..quantities import FORCES, STATES, ParameterError, refuse
from ..slave import Slave, StepError
from .design import FILE_NAMES, Design, design, stored
from .hardware import Loop, Memory
from .law import CAR, CHOICES, HALF_CAR, HARDWARE, REALS, WEIGHTS, ControlParameters, control_law, control_parameters

# The half car and its cost, times and road, the rest of the car, the other weights, hardware.
PARAMETER_NAMES = tuple(dict.fromkeys([*HALF_CAR, *REALS, *CAR, *WEIGHTS, *HARDWARE]))


class LqrController(Slave):
    """u = K x at the present time: axle forces for heave and pitch, halved between the sides, or a force each strut."""

    description = "Linear-quadratic optimal control of the car by actuators in the four struts"
    inputs = STATES
    outputs = FORCES
    reals = PARAMETER_NAMES
    choices = CHOICES
    switches: ClassVar[dict[str, str]] = {"enabled": "whether the controller acts; all forces are 0 if not"}
    dependencies: ClassVar[dict[str, tuple[str, ...]]] = {q.name: tuple(x.name for x in STATES) for q in FORCES}

    _control = ControlParameters()
    _design: Design | None = None
    _loop: Loop | None = None  # None: ideal actuators and full knowledge of the states
    _memory = Memory()  # after the look at the inputs that was taken when the present time was reached

    def configure(self) -> None:
        choices = {choice.name: value for choice, value in zip(self.choices, self.chosen, strict=True)}
        wanted = control_parameters({**self.parameters(), **choices, "enabled": self.on[0]})
        if wanted.enabled:
            self._design = self._designed(wanted)
        self._control, self._law = wanted, control_law(wanted, self._design)
        self._loop = None
        if wanted.enabled and not wanted.hardware.ideal:
            try:
                self._loop = Loop(wanted.hardware, self._law, wanted.end)
            except ImportError as missing:
                raise _lacking("feedback = 'estimate' needs a filter, whose computation", missing) from missing

    def _designed(self, p: ControlParameters) -> Design:
        """The design for these parameters: the one at hand, the one that is stored in the resources, or a new one."""
        span = p.end - p.begin
        at_hand = stored(Path(self.resources) / FILE_NAMES[type(p.model)]) if self.resources else None
        for known in (self._design, at_hand):
            if known is not None and known.serves(p.model, p.horizon, span):
                return known
        try:
            return design(p.model, infinite=p.horizon == "infinite", span=span if p.horizon == "finite" else None)
        except ImportError as missing:
            what = ", ".join(p.model.changes) or f"{span:g} s of control"
            raise _lacking(
                f"no design is stored for {what}, horizon = {p.horizon}, and computing one", missing
            ) from missing

    def begin(self) -> None:
        refuse([self._control.fault_of_start(self.time)])
        self._memory = self._looked(self.time, Memory())

    def memory(self) -> list[Any]:
        return [self._design, self._memory]

    def recall(self, memory: list[Any]) -> None:
        design, remembered = memory
        self._design = Design.of(design) if isinstance(design, dict) else design
        self._memory = _memory(remembered)

    def advance(self, t: float, step: float) -> None:
        control = self._control
        if fault := control.fault_of_step(t, step) or control.fault_of_samples(t, step, self._memory.time):
            raise StepError(fault)
        if self._loop:
            self._memory = self._looked(t + step, self._loop.elapsed(step, self._memory))
        self.time = t + step
        self.feed_through()

    def feed_through(self) -> None:
        """The forces for the present inputs. Nothing is remembered, or reading outputs would change the motion."""
        if self._loop:
            self.y[:] = self._loop.forces(self.u, self._loop.sampled(self.time, self.u, self._memory))
        else:
            self.y[:] = self._law(self.time, self.u)

    def _looked(self, t: float, before: Memory) -> Memory:
        """The memory after a look at the inputs; raises StepError where it would leave the finite numbers."""
        if self._loop is None:
            return before
        after = self._loop.sampled(t, self.u, before)
        lost = [f"{q.name} = {x!r} {q.unit}" for q, x in zip(FORCES, after.command, strict=True) if not isfinite(x)]
        lost += [
            f"estimated {q.name} = {x!r} {q.unit}"
            for q, x in zip(STATES, after.estimate, strict=True)
            if not isfinite(x)
        ]
        if lost:
            raise StepError(f"the law asks for what is not finite: {', '.join(lost)}")
        return after


def _memory(data: list[Any]) -> Memory:
    """The memory from its plain data, through JSON or not."""
    sample, time, command, reached, estimate = data
    return Memory(sample, time, tuple(command), tuple(reached), tuple(estimate))


def _lacking(what: str, missing: ImportError) -> ParameterError:
    return ParameterError(
        [
            f"{what} needs a package that is not installed: {missing.name}. Install numpy and scipy into the "
            "Python that runs this FMU, or keep the defaults"
        ]
    )
