"""Cost of the series to order 2 on the default bump, all 14 states at 5000 times, beside a direct integration.

Medians of CPU time over a few rounds: the exact sums (formed once, then evaluated), the quadrature on steps of 1 ms,
and DOP853 at rtol 1e-12 on the full equations. A series is formed once for all amplitudes; an integration is for one.
Last, the table of resonances on the default sine road.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import analysis  # noqa: F401  before numpy: linear algebra in one thread

# isort: split
import numpy as np

from analysis.car import car_form, road_signal
from analysis.methods.modes import modes
from analysis.methods.resonance import resonances
from analysis.methods.sampled_series import sampled_series
from analysis.methods.series import exact_series
from analysis.reference import integrate
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car

ROUNDS = 5


def main() -> None:
    form, w, rest = car_form(Car()), road_signal(RoadParameters()), np.zeros(14)
    linear, t = modes(form.A), np.linspace(0.0, 5.0, 5000)
    grid = np.linspace(0.0, 5.0, 5001)
    cubic, sine = car_form(Car(), order=3), road_signal(RoadParameters(profile="sine")).pieces[-1]
    seconds: dict[str, list[float]] = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        begun = time.process_time()
        result = work()
        seconds.setdefault(name, []).append(time.process_time() - begun)
        return result

    for _ in range(ROUNDS):
        exact = timed("exact sums, formed", lambda: exact_series(form, linear, w, rest, 2))
        terms = timed("exact sums, at 5000 times", partial(exact.physical, t))
        sampled = timed("quadrature, 1 ms", lambda: sampled_series(form, linear, w, grid, rest, 2).physical(t))
        timed("DOP853, rtol 1e-12", lambda: integrate({}, lambda t, x: [0.0] * 4, [], rest, t))
        timed("resonances", lambda: resonances(cubic, sine))
    for name, values in seconds.items():
        print(f"{name:28}{np.median(values):8.3f} s")
    print(f"exponentials by piece and order: {[[len(xi.multiples) for xi in orders] for orders in exact.pieces]}")
    gaps = [float(np.abs(a - b).max() / np.abs(a).max()) for a, b in zip(terms, sampled, strict=True)]
    print(f"quadrature against exact sums, order 0, 1, 2: {', '.join(f'{gap:.1e}' for gap in gaps)}")


if __name__ == "__main__":
    main()
