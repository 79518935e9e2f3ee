"""RoadExcitation: the road under the four wheels as a co-simulation component."""

from __future__ import annotations

from typing import ClassVar

from ..quantities import CORNER_WORDS, CORNERS, ROAD
from ..slave import Slave
from .profiles import HARMONICS, PROFILE, RoadParameters, road

DELAYS = dict(zip(CORNERS, ((), ("tau0",), ("a", "b"), ("a", "b", "tau0")), strict=True))
INITIALLY = {
    **{
        f"{kind}_{corner}": ("profile", "A", "Lambda", "v0", "t_start", *delay, *HARMONICS, f"excite_{corner}")
        for kind in ("h", "dh")
        for corner, delay in DELAYS.items()
    },
    **{f"bow_{corner}": () for corner in CORNERS},  # there is no step yet
}


class RoadExcitation(Slave):
    """Heights, rates and bows under the wheels at the present time; a function of time alone."""

    description = "Road under the four wheels of a car that drives straight on: bump, sine, Fourier series, step, flat"
    outputs = ROAD
    reals = ("A", "Lambda", "v0", "a", "b", "tau0", "t_start", *HARMONICS)
    choices = (PROFILE,)
    switches: ClassVar[dict[str, str]] = {
        f"excite_{corner}": f"whether the profile lies in the track of the {words} wheel; flat if not"
        for corner, words in zip(CORNERS, CORNER_WORDS, strict=True)
    }

    initially: ClassVar[dict[str, tuple[str, ...]]] = INITIALLY

    def configure(self) -> None:
        p = self.parameters()
        amplitudes = tuple(p.pop(name) for name in HARMONICS)
        fl, fr, rl, rr = self.on
        self._road = road(RoadParameters(**p, profile=self.chosen[0], amplitudes=amplitudes, excited=(fl, fr, rl, rr)))
        self._end = self._road.end

    def begin(self) -> None:
        self.y[:] = (*self._road.heights(self.time), *self._road.rates(self.time), 0.0, 0.0, 0.0, 0.0)

    def jump(self, t: float) -> None:
        """The road is a function of time alone: it follows."""
        self.time = t
        self.begin()

    def advance(self, t: float, step: float) -> None:
        if t >= self._end:
            self.y[8:] = (0.0, 0.0, 0.0, 0.0)
            return
        h0, dh0 = self.y[:4], self.y[4:8]
        heights = self._road.heights
        h1, middle = heights(t + step), heights(t + 0.5 * step)
        bows = [m - 0.25 * (3.0 * a + b + step * d) for m, a, b, d in zip(middle, h0, h1, dh0, strict=True)]
        self.y[:] = (*h1, *self._road.rates(t + step), *bows)
