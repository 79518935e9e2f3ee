"""Vehicle7DOF: the car as a co-simulation component. Vectors are mapped to variables here; the physics is elsewhere."""

from __future__ import annotations

from dataclasses import fields
from math import ceil, isfinite
from typing import Any, ClassVar

from ..integrate import RoadWithin, Vector, cubic_road, rk4, straight_road
from ..quantities import (
    ACCELERATIONS,
    FORCES,
    ROAD,
    STATES,
    STRUT_TRAVELS,
    TYRE_FORCES,
    Choice,
)
from ..slave import Slave, StepError
from .equations import equations_of_motion
from .parameters import Car
from .structure import FEED_THROUGH, INITIALLY

CAR = tuple(f.name for f in fields(Car))
SAMPLING = Choice(
    name="road_sampling",
    values=("start", "end"),
    text="road inputs are values at the start of a step, carried on by their rates, or at its end (road stepped first)",
)
MOST_PARTS = 200_000  # internal steps of a communication step: more would look like a hang


class Vehicle7DOF(Slave):
    """x' = f(x, u, h(t)), Eqs. (3.1)–(3.7), by Runge–Kutta steps no longer than h_max; forces held over the step."""

    description = "Nonlinear car with seven degrees of freedom on an uneven road, with an actuator in each strut"
    inputs = FORCES + ROAD
    outputs = STATES + ACCELERATIONS + STRUT_TRAVELS + TYRE_FORCES
    settable = len(STATES)
    reals = (*CAR, "h_max")
    choices = (SAMPLING,)
    dependencies: ClassVar[dict[str, tuple[str, ...]]] = FEED_THROUGH
    initially: ClassVar[dict[str, tuple[str, ...]]] = INITIALLY

    def configure(self) -> None:
        p = self.parameters()
        h_max, (sampling,) = p.pop("h_max"), self.chosen
        self._h_max, self._sampled_at_end = h_max, sampling == "end"
        self._motion = equations_of_motion(Car(**p))

    def begin(self) -> None:
        self._q, self._v = tuple(self.y[:7]), tuple(self.y[7:14])
        # forces, road heights and rates at the present instant
        self._at: tuple[Vector, Vector, Vector] = (self.u[:4], self.u[4:8], self.u[8:12])

    def advance(self, t: float, step: float) -> None:
        road = self._road_within(step)
        u = self.u[:4]
        start = (u, *road(0.0))
        first = self.y[14:21] if start == self._at else None  # nothing has changed: the accelerations are known
        n = max(1, ceil(min(step / self._h_max - 1e-9, 2.0 * MOST_PARTS)))
        if n > MOST_PARTS:
            raise StepError(f"wanted at most {MOST_PARTS} internal steps of h_max = {self._h_max:g} s")
        q, v = self._q, self._v
        try:
            for i in range(n):
                end = (u, *road((i + 1) / n))
                q, v = rk4(self._motion, q, v, step / n, (start, (u, *road((i + 0.5) / n)), end), first)
                start, first = end, None
            if not isfinite(sum(q) + sum(v)):
                raise OverflowError
        except (ValueError, OverflowError):  # ValueError: sin(inf)
            raise StepError(self._runaway([*q, *v])) from None
        self._q, self._v, self._at = q, v, end
        if self._sampled_at_end:  # the rate that the next step sets out with: beyond a corner, if there is one here
            self._at = (u, self.u[4:8], self.u[8:12])
        self._observe()

    def _road_within(self, step: float) -> RoadWithin:
        """Road over this step as a function of the fraction of it."""
        h, dh = self.u[4:8], self.u[8:12]
        if self._sampled_at_end:
            _, h0, dh0 = self._at
            return cubic_road(h0, dh0, h, self.u[12:16], step)
        return straight_road(h, dh, step)

    def _runaway(self, reached: list[float]) -> str:
        """Which state left the finite numbers; where all that is known is that one did, the largest before the step."""
        lost = [(q, x) for q, x in zip(STATES, reached, strict=True) if not isfinite(x)]
        before = zip(STATES, [*self._q, *self._v], strict=True)
        worst = lost or [max(before, key=lambda pair: abs(pair[1]) / pair[0].nominal)]
        names = ", ".join(f"{q.name} = {x:g} {q.unit}" for q, x in worst)
        return f"the state leaves the finite numbers: {names}. A smaller h_max (now {self._h_max:g} s) may help"

    def memory(self) -> list[Any]:
        return [self._q, self._v, self._at]

    def recall(self, memory: list[Any]) -> None:
        q, v, (u, h, dh) = memory
        self._q, self._v, self._at = tuple(q), tuple(v), (u, h, dh)

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
