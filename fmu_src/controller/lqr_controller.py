"""LqrController: optimal stabilization of heave and pitch (§4) as a co-simulation component."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import ClassVar

from ..quantities import FORCES, PARAMETERS, STATES, Choice, ParameterError, refuse
from ..slave import Slave
from .design import Design, design, stored
from .halfcar import STATE_NAMES, HalfCar, half_car_state, strut_forces

HALF_CAR = tuple("lambda" if f.name == "lam" else f.name for f in fields(HalfCar))
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
TINY = 1e-9  # s; a communication point this close below a switching time is that time


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
        horizon, activation = self.chosen
        (self._enabled,) = self.on
        refuse([*(PARAMETERS[name].fault(x) for name, x in p.items()), HORIZON.fault(horizon), ACTIVATION.fault(activation)])
        come_down = p["t_start"] + (p["a"] + p["b"]) / p["v0"] + max(p["tau0"], 0.0) + 0.5 * p["Lambda"] / p["v0"]
        self._t_on = p["t_on"] if activation == "at t_on" else come_down
        self._T = p["T"] if horizon == "finite" else float("inf")
        if self._enabled and not self._T > self._t_on:
            refuse([f"T = {self._T!r} s: wanted an end of control after its start, t = {self._t_on:g} s ({activation})"])
        car = HalfCar(**{"lam" if name == "lambda" else name: p[name] for name in HALF_CAR})
        if self._enabled:
            self._design = self._designed(car, horizon)

    def _designed(self, car: HalfCar, horizon: str) -> Design:
        span = self._T - self._t_on
        for known in (self._design, stored(Path(self.resources)) if self.resources else None):
            if known is not None and known.serves(car, horizon, span):
                return known
        try:
            return design(car, infinite=horizon == "infinite", span=span if horizon == "finite" else None)
        except ImportError as missing:
            raise ParameterError(
                f"no design is stored for these parameters ({', '.join(HALF_CAR)}, horizon = {horizon}, "
                f"{span:g} s of control), and computing one needs a package that is not installed: {missing.name}. "
                "Install 'control' (it brings numpy and scipy) into the Python that runs this FMU, or keep the defaults"
            ) from missing

    def advance(self, t: float, step: float) -> None:
        self.time = t + step
        self.feed_through()

    def feed_through(self) -> None:
        self.y[:] = (0.0, 0.0, 0.0, 0.0)
        if not (self._enabled and self._t_on - TINY <= self.time < self._T - TINY):
            return
        assert self._design is not None
        if self._design.finite is not None and self._T < float("inf"):
            K = self._design.finite.gain(self._T - self.time)
        else:
            assert self._design.infinite is not None
            K = self._design.infinite
        z, phi, dz, dphi = half_car_state(self.u[0], self.u[2], self.u[7], self.u[9])
        u = tuple(k1 * z + k2 * phi + k3 * dz + k4 * dphi for k1, k2, k3, k4 in (K[:4], K[4:]))
        self.y[:] = strut_forces(u)
