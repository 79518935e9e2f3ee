"""LqrController: optimal stabilization of heave and pitch (§4) as a co-simulation component."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar

from ..quantities import FORCES, STATES, ParameterError
from ..slave import Slave
from .design import Design, design, stored
from .halfcar import STATE_NAMES, HalfCar
from .law import ACTIVATION, HORIZON, ControlParameters, control_law

HALF_CAR = {"lambda" if f.name == "lam" else f.name: f.name for f in fields(HalfCar)}  # FMU's name -> field


class LqrController(Slave):
    """u = K x at the present time, from heave and pitch and their rates; half of each axle's force to each strut."""

    description = "Linear-quadratic optimal control of heave and pitch by actuators in the four struts"
    inputs = STATES
    outputs = FORCES
    reals = (*HALF_CAR, "T", "t_on", "v0", "Lambda", "tau0", "t_start")
    choices = (HORIZON, ACTIVATION)
    switches: ClassVar[dict[str, str]] = {"enabled": "whether the controller acts; all forces are 0 if not"}
    dependencies: ClassVar[dict[str, tuple[str, ...]]] = {q.name: STATE_NAMES for q in FORCES}

    _design: Design | None = None

    def configure(self) -> None:
        p = self.parameters()
        car = HalfCar(**{field: p.pop(name) for name, field in HALF_CAR.items()})
        (horizon, activation), (enabled,) = self.chosen, self.on
        wanted = ControlParameters(car=car, enabled=enabled, horizon=horizon, activation=activation, **p)
        if wanted.enabled:
            self._design = self._designed(wanted)
        self._law = control_law(wanted, self._design)

    def _designed(self, p: ControlParameters) -> Design:
        """The design for these parameters: the one at hand, the one that was stored at build time, or a new one."""
        span = p.end - p.begin
        for known in (self._design, stored(Path(self.resources)) if self.resources else None):
            if known is not None and known.serves(p.car, p.horizon, span):
                return known
        try:
            return design(p.car, infinite=p.horizon == "infinite", span=span if p.horizon == "finite" else None)
        except ImportError as missing:
            raise ParameterError(
                [
                    f"no design is stored for these parameters ({', '.join(HALF_CAR)}, horizon = {p.horizon}, "
                    f"{span:g} s of control), and computing one needs a package that is not installed: {missing.name}. "
                    "Install 'control' (it brings numpy and scipy) into the Python that runs this FMU, or keep the "
                    "defaults"
                ]
            ) from missing

    def memory(self) -> list[Any]:
        return [self._design]

    def recall(self, memory: list[Any]) -> None:
        (design,) = memory
        self._design = Design.of(design) if isinstance(design, dict) else design

    def advance(self, t: float, step: float) -> None:
        self.time = t + step
        self.feed_through()

    def feed_through(self) -> None:
        self.y[:] = self._law(self.time, self.u)
