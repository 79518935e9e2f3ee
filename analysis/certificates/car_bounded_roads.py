"""`python -m analysis certify SCENARIO --bounded A [--slope V]`: every road of |h| ≤ A, |ḣ| ≤ V, around ψ = 0."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fmu_src.quantities import STATES
from fmu_src.vehicle.vehicle7dof import CAR

from ..bertolino_baksa.balls import Array, NotProvedError, precision
from ..bertolino_baksa.bounded_certificate import BoundedCertificate, certify, smallest, to_json
from ..bertolino_baksa.bounded_inputs import Bounds, Driven, Gains, gains
from ..bertolino_baksa.norms import proved_metric
from ..bertolino_baksa.search import CLOSE, largest
from ..bertolino_baksa.worst_inputs import reached, reached_from, worst_inputs
from ..car import car_form
from ..errors import InputError
from ..files import write_whole
from ..reference import Parameters, car_of
from .car_certificates import build, metric_of, model_of
from .certificate_words import model_words, named_by_content, refuse_exceeded
from .directed import at_least, at_most
from .exact_car import norms


def flat(parameters: Mapping[str, Any], gain: Array | None = None) -> dict[str, Any]:
    """The model of the car alone, or with a gain (4, 14)."""
    return model_of({**{name: value for name, value in parameters.items() if name in CAR}, "profile": "flat"}, gain)


def car_gains(parameters: Mapping[str, Any]) -> Gains:
    """Gains of the car of these parameters. Raises NotProvedError if its linear part does not contract."""
    with precision(2):
        system = build(flat(parameters))
        return gains(system, proved_metric(system, metric_of(car_of(dict(parameters)))))


def heights(parameters: Parameters, A: float, V: float | None = None) -> Bounds:
    """Bounds of (h, ḣ) (8); without V, of roads of any slope.

    Raises InputError unless A, V > 0, or without V for tyres with dampers, which feel slopes without bound.
    """
    if not 0.0 < A < math.inf:
        raise InputError(f"--bounded {A!r}: wanted a height in metres, greater than 0")
    if V is not None:
        if not 0.0 < V < math.inf:
            raise InputError(f"--slope {V!r}: wanted a rate of height in metres per second, greater than 0")
        return Bounds(np.array([A] * 4 + [V] * 4), tied=True)
    car = car_of(parameters)
    if car.bp1 or car.bp2:
        raise InputError(
            f"--bounded: bp1 = {car.bp1!r}, bp2 = {car.bp2!r} N s/m: a bounded road may have any slope, of which these "
            "dampers make any force; wanted tyres without dampers, or --slope"
        )
    return Bounds(np.array([A] * 4 + [0.0] * 4))


def highest(found: Gains, parameters: Parameters, A: float, V: float | None) -> float:
    """Largest A [m] that is found with a δ > 0 in every norm; at least `A`, for which that is known."""

    def driven(A: float) -> Driven:
        return found.under(heights(parameters, A, V))

    top = largest(lambda A: driven(A).motion(np.zeros(14)), A)  # from rest alone, which is quicker
    while top > A:
        each = driven(top)
        try:
            for norm in norms(car_of(parameters), each.states[:, None]):
                smallest(each, norm)
            return top
        except NotProvedError:
            top /= CLOSE
    return A


def command(parameters: Parameters, A: float, V: float | None, where: Path | None) -> int:
    """Print what is proved of all roads of |h| ≤ A [m] (|ḣ| ≤ V [m/s]), write it; 0, or 1 if nothing is."""
    bounds = heights(parameters, A, V)
    try:
        with precision(2):
            found = car_gains(parameters)
            driven = found.under(bounds)
            certificate = certify(flat(parameters), driven, norms(car_of(parameters), driven.states[:, None]))
            for line in statement(certificate, driven):
                print(line, flush=True)
            print(f"  proved up to A = {at_least(highest(found, parameters, A, V))} m")
    except NotProvedError as error:
        print(f"no certificate of all these roads, perhaps of lower ones (a smaller A): {error}")
        return 1
    if where is not None:
        write_whole(where, to_json(certificate))
        print(f"{where}: written")
    return 0


def statement(certificate: BoundedCertificate, driven: Driven) -> list[str]:
    """What is proved, each number beside what a road of the class reaches from rest.

    Raises NotProvedError if that exceeds it, or where the bounds of the inputs are not those of a class of roads.
    """
    parameters, bounds = certificate.model["parameters"], certificate.bounds
    A, V = float(bounds.sizes[0]), float(bounds.sizes[4])
    if "gain" in certificate.model or not np.array_equal(
        heights(parameters, A, V if bounds.tied else None).sizes, bounds.sizes
    ):
        raise NotProvedError("wanted the car without control and the same bounds under each wheel")
    form = car_form(car_of(parameters))
    slope = f" and |dh/dt| <= {V!r} m/s that begins at 0" if bounds.tied else ""
    with precision(2):
        states, _ = driven.motion(np.zeros(14))
    named = ", ".join(f"{q.name} {at_most(y, 3)} {q.unit}" for q, y in zip(STATES[:7], states.tolist(), strict=False))
    lines = [
        f"psi = 0 is almost stable (definition 2.1) under every road with |h| <= {A!r} m{slope}, whatever its course:",
        f"  from rest: {named}",
    ]
    for claim in named_by_content(certificate.claims, norms(car_of(parameters), driven.states[:, None])):
        inputs = worst_inputs(form, claim.norm, bounds)
        most = reached(form, claim.norm, bounds, inputs)
        refuse_exceeded(claim, most)
        table = ", ".join(
            f"{at_most(e)} for {at_least(d)} ({e / max(most, reached_from(form, claim.norm, bounds, inputs, d)):.3g})"
            for e, d in claim.table[1:].tolist()
        )
        lines.append(
            f"  {claim.norm.name} norm: l <= {at_most(claim.floor)}, which is eps for delta = "
            f"{at_least(claim.table[0, 1])} (a worst road reaches {most:.4g} from rest: "
            f"ratio {claim.floor / most:.3g}); eps for larger delta (over what starts there reach): {table}"
        )
    return [*lines, *model_words(certificate.model, road=False)]
