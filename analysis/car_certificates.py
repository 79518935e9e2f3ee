"""Certificates of almost stability for the car on its road: model, norms, and how long the pieces must last."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from flint import fmpq

from fmu_src.quantities import ParameterError

from .bertolino_baksa.balls import ExactSystem, NotProvedError, precision
from .bertolino_baksa.certificate import Certificate, certify
from .bertolino_baksa.norms import modal_metric
from .bertolino_baksa.proof import Proof
from .car import car_form
from .errors import InputError
from .exact_car import energy_norm, exact_system, norms
from .polynomials import Array
from .reference import Parameters, car_of, road_parameters

SETTLED_REST = 7.0  # the pieces last this many times 1/α beyond the last corner if the road then is flat,
SETTLED_PERIODIC = 14.0  # and this many if it goes on: what is left of the start, exp(−14), is what e may be off by


def model_of(parameters: Mapping[str, Any], gain: Array | None = None) -> dict[str, Any]:
    """The model of a certificate: the parameters of car and road, and a constant gain (u = −gain x)."""
    model: dict[str, Any] = {"kind": "car", "parameters": dict(parameters)}
    return model if gain is None else {**model, "gain": gain.tolist()}


def build(model: dict[str, Any]) -> ExactSystem:
    """The system of a certificate. Raises InputError for another kind, or for a car or road that cannot be."""
    if model.get("kind") != "car":
        raise InputError(f"model: wanted the kind 'car', got {model.get('kind')!r}")
    parameters, gain = _checked(model)
    return exact_system(car_of(parameters), road_parameters(parameters), gain)


def _checked(model: dict[str, Any]) -> tuple[Parameters, Array | None]:
    parameters = model.get("parameters")
    if not isinstance(parameters, dict):
        raise InputError(f"model: wanted parameters by name, got {parameters!r}")
    gain = None if model.get("gain") is None else np.array(model["gain"], dtype=float)
    if gain is not None and (gain.shape != (4, 14) or not np.all(np.isfinite(gain))):
        raise InputError(f"model: wanted a gain of 4 x 14 finite numbers, got the shape {gain.shape}")
    return parameters, gain


def certify_car(parameters: Mapping[str, Any], gain: Array | None = None) -> tuple[Certificate, Proof]:
    """The certificate of x_lin from rest for these parameters of car and road.

    Raises NotProvedError, with the reason, if there is none; InputError for parameters that cannot be.
    """
    model = model_of(parameters, gain)
    try:
        with precision(2):
            system = build(model)
    except (TypeError, ValueError, ParameterError) as error:
        raise InputError(f"the parameters of car and road: {error}") from error
    car = car_of(dict(parameters))
    form = car_form(car, gain=gain, order=1)
    S = modal_metric(form.A, energy_norm(car).T)
    return certify(model, build, S, lambda x_lin: norms(car, x_lin), stop(system, form.A), np.zeros(14))


def stop(system: ExactSystem, A: Array) -> fmpq:
    """When the pieces may end: what is left of the start is small, and a whole number of periods is over."""
    alpha = -float(np.linalg.eigvals(A).real.max())
    if not alpha > 0.0:
        raise NotProvedError(f"the linear car does not settle: growth rate {-alpha:.3g} 1/s; wanted < 0")
    corner = system.pieces[-1][0]
    if system.period == 0:
        return corner + fmpq(int(SETTLED_REST / alpha * 1000) + 1, 1000)
    return corner + system.period * int(SETTLED_PERIODIC / alpha / float(system.period) + 1)
