"""`python -m analysis certify SCENARIO --quick`: floors by comparison, no certificate, and how coarse they are."""

from __future__ import annotations

import sys

import numpy as np

from ..bertolino_baksa.adversary import long_enough, reference_floor
from ..bertolino_baksa.balls import NotProvedError, precision
from ..bertolino_baksa.norms import proved_metric
from ..bertolino_baksa.quick import quick_floors
from ..car import car_form, road_signal
from ..reference import Parameters, car_of, road_parameters
from .car_certificates import build, car_norms, metric_of, model_of, stops
from .certificate_words import model_words
from .directed import at_most


def quick_answer(parameters: Parameters) -> int:
    """Print floors from the comparison, and how coarse they are; 0, or 1 if it proves none."""
    if parameters.get("enabled", True):
        print("The car is taken without its controller.", file=sys.stderr)
    car, model = car_of(parameters), model_of(parameters)
    form, signal = car_form(car), road_signal(road_parameters(parameters))
    try:
        with precision(2):
            system = build(model)
            end = stops(system, form.A)[0]
            named = car_norms(parameters)
            floors = quick_floors(system, proved_metric(system, metric_of(car)), named, [0.0] * 14, end)
    except NotProvedError as error:
        print(f"no quick answer: {error}")
        return 1
    true = reference_floor(form, signal, named, np.zeros(14), min(float(end), long_enough(form, signal)))
    print("for all t >= 0 the motion from rest stays within l of x_lin:")
    for norm, floor, least in zip(named, floors, true.tolist(), strict=True):
        coarse = f"{floor / least:.2g} times what a reference motion reaches" if least else "a reference motion: 0"
        print(f"  {norm.name} norm: l <= {at_most(floor)} ({coarse})")
    print("\n".join(model_words(model)))
    return 0
