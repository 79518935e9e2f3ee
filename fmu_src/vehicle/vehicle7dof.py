"""Vehicle7DOF: the car as a co-simulation component. Vectors are mapped to variables here; the physics is elsewhere."""

from __future__ import annotations

from dataclasses import fields
from math import ceil, isfinite
from typing import ClassVar

from ..integrate import RoadWithin, Vector, cubic_road, rk4, straight_road
from ..quantities import (
    ACCELERATIONS,
    FORCES,
    PARAMETERS,
    ROAD,
    ROAD_HEIGHTS,
    ROAD_RATES,
    STATES,
    STRUT_TRAVELS,
    TYRE_FORCES,
    Choice,
    refuse,
)
from ..slave import Slave, StepError
from .equations import equations_of_motion
from .parameters import Car

CAR = tuple(f.name for f in fields(Car))
SAMPLING = Choice(
    name="road_sampling",
    values=("start", "end"),
    text="road inputs are values at the start of a step, carried on by their rates, or at its end (road stepped first)",
)


class Vehicle7DOF(Slave):
    """x' = f(x, u, h(t)), Eqs. (3.1)–(3.7), by Runge–Kutta steps no longer than h_max; forces held over the step."""

    description = "Nonlinear car with seven degrees of freedom on an uneven road, with an actuator in each strut"
    inputs = FORCES + ROAD
    outputs = STATES + ACCELERATIONS + STRUT_TRAVELS + TYRE_FORCES
    settable = len(STATES)
    reals = (*CAR, "h_max")
    choices = (SAMPLING,)
    dependencies: ClassVar[dict[str, tuple[str, ...]]] = {
        **{q.name: tuple(w.name for w in FORCES + ROAD_HEIGHTS + ROAD_RATES) for q in ACCELERATIONS},
        **{q.name: tuple(w.name for w in ROAD_HEIGHTS + ROAD_RATES) for q in TYRE_FORCES},
    }

    def configure(self) -> None:
        p = self.parameters()
        h_max, (sampling,) = p.pop("h_max"), self.chosen
        refuse([PARAMETERS["h_max"].fault(h_max), SAMPLING.fault(sampling)])
        self._h_max, self._sampled_at_end = h_max, sampling == "end"
        self._motion = equations_of_motion(Car(**p))

    def begin(self) -> None:
        self._q, self._v = tuple(self.y[:7]), tuple(self.y[7:14])
        # forces, road heights and rates at the present instant
        self._at: tuple[Vector, Vector, Vector] = (self.u[:4], self.u[4:8], self.u[8:12])

    def advance(self, t: float, step: float) -> None:
        road = self._road_within(t, step)
        u = self.u[:4]
        start = (u, *road(0.0))
        first = self.y[14:21] if start == self._at else None  # nothing has changed: the accelerations are known
        n = max(1, ceil(step / self._h_max - 1e-9))
        q, v = self._q, self._v
        try:
            for i in range(n):
                end = (u, *road((i + 1) / n))
                q, v = rk4(self._motion, q, v, step / n, (start, (u, *road((i + 0.5) / n)), end), first)
                start, first = end, None
            if not isfinite(sum(q) + sum(v)):
                raise OverflowError
        except (ValueError, OverflowError):  # ValueError: sin(inf)
            raise StepError(self._runaway([*q, *v], t, step)) from None
        self._q, self._v, self._at = q, v, end
        if self._sampled_at_end:  # the rate that the next step sets out with: beyond a corner, if there is one here
            self._at = (u, self.u[4:8], self.u[8:12])
        self._observe()

    def _road_within(self, t: float, step: float) -> RoadWithin:
        """Road over this step as a function of the fraction of it."""
        if not isfinite(sum(self.u)):
            faults = [f"{q.name} = {x!r} {q.unit}" for q, x in zip(self.inputs, self.u, strict=True) if not isfinite(x)]
            raise StepError(f"step from t = {t:g} s: wanted finite inputs, got {', '.join(faults)}")
        h, dh = self.u[4:8], self.u[8:12]
        if self._sampled_at_end and step > 0.0:
            _, h0, dh0 = self._at
            return cubic_road(h0, dh0, h, self.u[12:16], step)
        return straight_road(h, dh, step)

    def _runaway(self, reached: list[float], t: float, step: float) -> str:
        """Which state left the finite numbers, and when."""
        before = [*self._q, *self._v]
        lost = [(q, x) for q, x in zip(STATES, reached, strict=True) if not isfinite(x)]
        worst = lost or [max(zip(STATES, before, strict=True), key=lambda pair: abs(pair[1]) / pair[0].nominal)]
        names = ", ".join(f"{q.name} = {x:g} {q.unit}" for q, x in worst)
        return (
            f"step from t = {t:g} s by {step:g} s: the state leaves the finite numbers: {names}; "
            f"the state at t = {t:g} s is kept. A smaller h_max (now {self._h_max:g} s) or other parameters may help"
        )

    def feed_through(self) -> None:
        if self._sampled_at_end:
            self._at = (self.u[:4], *self._at[1:])  # the road inputs may already be those of the coming step's end
        else:
            self._at = (self.u[:4], self.u[4:8], self.u[8:12])
        self._observe()

    def _observe(self) -> None:
        """All outputs, at the present state and inputs."""
        accelerations, travels, N = self._motion(self._q, self._v, *self._at)
        self.y[:] = (*self._q, *self._v, *accelerations, *travels, *N)
