"""`python -m analysis certify SCENARIO --bounded A`: every road of |h| ≤ A under a scenario's car, around ψ = 0."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from fmu_src.quantities import STATES

from ..bertolino_baksa.balls import Array, NotProvedError, precision
from ..bertolino_baksa.bounded_inputs import Gains, gains, reached, worst_inputs
from ..bertolino_baksa.norms import proved_metric
from ..car import car_form
from ..errors import InputError
from ..reference import Parameters, car_of
from .car_certificates import build, metric_of, model_of
from .exact_car import norms

CLOSE = 1.01  # ratio at which a bisection stops
SHARES = (0.25, 0.5, 0.75, 1.0)  # of the largest δ, in the table of δ(ε)
LEAST = 1e-6  # of the first number: where a search ends


def car_gains(parameters: Mapping[str, Any]) -> Gains:
    """Gains of the car of these parameters. Raises NotProvedError if its linear part does not contract."""
    flat = {**parameters, "profile": "flat"}
    car = car_of(dict(flat))
    with precision(2):
        system = build(model_of(flat))
        return gains(system, proved_metric(system, metric_of(car)))


def heights(parameters: Parameters, A: float) -> Array:
    """W (8,) of (h, ḣ). Raises InputError unless A > 0, or for tyres with dampers, which feel rates without bound."""
    if not 0.0 < A < math.inf:
        raise InputError(f"--bounded {A!r}: wanted a height in metres, greater than 0")
    car = car_of(parameters)
    if car.bp1 or car.bp2:
        raise InputError(
            f"--bounded: bp1 = {car.bp1!r}, bp2 = {car.bp2!r} N s/m: a bounded road may have any slope, of which these "
            "dampers make any force; wanted tyres without dampers"
        )
    return np.array([A] * 4 + [0.0] * 4)


def largest(proved: Callable[[float], object], first: float) -> float:
    """Largest number, to CLOSE, for which proved(number) raises no NotProvedError; from `first` on up or down."""
    good, bad, middle = 0.0, math.inf, first
    while bad > CLOSE * good and middle > LEAST * first:
        try:
            proved(middle)
            good = middle
        except NotProvedError:
            bad = middle
        middle = 2.0 * good if bad == math.inf else (math.sqrt(good * bad) if good else bad / 2.0)
    return good


def command(parameters: Parameters, A: float) -> int:
    """Print what is proved of all roads of |h| ≤ A [m]; 0, or 1 if nothing is."""
    W = heights(parameters, A)
    try:
        with precision(2):
            for line in _statement(parameters, A, W):
                print(line, flush=True)
    except NotProvedError as error:
        print(f"no certificate: {error}")
        return 1
    return 0


def _statement(parameters: Parameters, A: float, W: Array) -> list[str]:
    found, form = car_gains(parameters), car_form(car_of(parameters))
    rest = np.zeros(14)
    states, _ = found.motion(W, rest)
    top = largest(lambda height: found.motion(heights(parameters, height), rest), A)
    named = ", ".join(f"{q.name} {y:.3g} {q.unit}" for q, y in zip(STATES[:7], states[:7].tolist(), strict=True))
    lines = [
        f"psi = 0 is almost stable under every road of |h| <= {A:g} m, whatever its course; proved up to {top:.4g} m",
        f"  from rest: {named}",
    ]
    for norm in norms(car_of(parameters), (found.of_inputs @ W)[:, None]):
        most, spread = reached(form, worst_inputs(form, norm, W), norm), found.spread(norm)
        floor = found.epsilon(W, norm, [0.0])[0]
        ratio = f" (a bang-bang road reaches {most:.4g}: ratio {floor / most:.3g})"
        top = largest(partial(_moved, found, W, spread), floor)
        delta = [share * top for share in SHARES]
        table = ", ".join(f"{e:.4g} for {d:.4g}" for e, d in zip(found.epsilon(W, norm, delta), delta, strict=True))
        lines.append(f"  {norm.name} norm: l = {floor:.4g}{ratio}; eps for delta: {table}")
    return lines


def _moved(found: Gains, W: Array, spread: Array, delta: float) -> None:
    """Raise NotProvedError unless motions that start within δ are bounded."""
    found.motion(W, spread * delta)
