"""Certificates of almost stability for the car on its road: model, norms, and how long the pieces must last."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from flint import fmpq

from fmu_src.controller.lqr_controller import LqrController
from fmu_src.quantities import ParameterError
from fmu_src.road.profiles import PROFILE
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.vehicle.parameters import Car
from fmu_src.vehicle.vehicle7dof import CAR, SAMPLING

from ..bertolino_baksa import strict
from ..bertolino_baksa.balls import ExactSystem, NotProvedError, precision
from ..bertolino_baksa.certificate import Certificate, certify
from ..bertolino_baksa.norms import Norm, modal_metric, proved_metric
from ..bertolino_baksa.proof import Proof, prove
from ..bertolino_baksa.taylor import find_pieces
from ..car import car_form, road_signal
from ..errors import InputError
from ..methods.linear_response import linear_response
from ..methods.polynomials import Array
from ..reference import Parameters, car_of, road_parameters
from .exact_car import energy_norm, exact_system, norms

AFTER_REST = (7.0, 14.0)  # the pieces last so many times 1/α beyond the last corner if the road then is flat,
AFTER_PERIODIC = (10.0, 12.0, 16.0, 22.0)  # and so many if it goes on: what is left of the start is as small as e^−10 …
KINDS: dict[str, type] = {
    **dict.fromkeys((*CAR, *RoadExcitation.reals), float),
    PROFILE.name: str,
    **dict.fromkeys(RoadExcitation.switches, bool),
}  # of the parameters of car and road
OTHERS = {
    *LqrController.reals,
    *LqrController.switches,
    *(c.name for c in LqrController.choices),
    SAMPLING.name,
    "h_max",
}
WORDS = {float: "number with a decimal point", str: "word", bool: "truth value, true or false"}
POINTS = 4000  # of x_lin, for the weights of its norm
ROUND_OFF = 1e-9  # of the largest eigenvalue: a decay below it is not told from none


def model_of(parameters: Mapping[str, Any], gain: Array | None = None) -> dict[str, Any]:
    """The model of a certificate: the parameters of car and road, and a constant gain (u = −gain x).

    Parameters of the controller and of the co-simulation have no part in it.
    """
    ours = {name: value for name, value in parameters.items() if name in KINDS or name not in OTHERS}
    model: dict[str, Any] = {"kind": "car", "parameters": ours}
    return model if gain is None else {**model, "gain": gain.tolist()}


def build(model: dict[str, Any]) -> ExactSystem:
    """The system of a certificate. Raises InputError for another kind, or for a car or road that cannot be."""
    if model.get("kind") != "car":
        raise InputError(f"model: wanted the kind 'car', got {model.get('kind')!r}")
    parameters, gain = _checked(model)
    return exact_system(car_of(parameters), road_parameters(parameters), gain)


def _checked(model: dict[str, Any]) -> tuple[Parameters, Array | None]:
    if unknown := set(model) - {"kind", "parameters", "gain"}:
        raise InputError(f"model: wanted kind, parameters and perhaps a gain, got {', '.join(sorted(unknown))}")
    parameters = checked_parameters(model.get("parameters"), KINDS, "car or road")
    if "gain" not in model:
        return parameters, None
    try:
        gain = strict.numbers(model["gain"], 2)
    except ValueError as error:
        raise InputError(f"model: gain: {error}") from error
    if gain.shape != (4, 14):
        raise InputError(f"model: wanted a gain of 4 x 14 numbers, got the shape {gain.shape}")
    return parameters, gain


def checked_parameters(parameters: Any, kinds: Mapping[str, type], of: str) -> Parameters:
    """The parameters themselves. Raises InputError unless each has a known name and is of its kind."""
    if not isinstance(parameters, dict):
        raise InputError(f"model: wanted parameters by name, got {parameters!r}")
    for name, value in parameters.items():
        if name not in kinds:
            raise InputError(f"model: {name}: no parameter of {of}; known are {', '.join(kinds)}")
        if not isinstance(value, kinds[name]) or isinstance(value, bool) is not (kinds[name] is bool):
            raise InputError(f"model: {name} = {value!r}: wanted a {WORDS[kinds[name]]}")
    return parameters


def certify_car(parameters: Mapping[str, Any], gain: Array | None = None) -> tuple[Certificate, Proof]:
    """The certificate of x_lin from rest for these parameters of car and road, in the norms `car_norms`.

    Raises NotProvedError, with the reason, if there is none; InputError for parameters that cannot be.
    """
    model, S, ends = _prepared(parameters, gain)
    named = car_norms(parameters)
    return certify(model, build, S, lambda _: named, ends, np.zeros(14))


def prove_reference(parameters: Mapping[str, Any], gain: Array | None = None) -> Proof:
    """The proof behind a certificate, without its table of δ(ε)."""
    model, S, ends = _prepared(parameters, gain)
    with precision(2):
        system = build(model)
        return prove(system, proved_metric(system, S), find_pieces(system, [0.0] * 14, ends[0]), [0.0] * 14)


def _prepared(parameters: Mapping[str, Any], gain: Array | None) -> tuple[dict[str, Any], Array, list[fmpq]]:
    """Model, metric, and the times at which the pieces may end."""
    model = model_of(parameters, gain)
    try:
        with precision(2):
            system = build(model)
    except (TypeError, ValueError, ParameterError) as error:
        raise InputError(f"the parameters of car and road: {error}") from error
    car = car_of(dict(parameters))
    A = car_form(car, gain=gain, order=1).A
    return model, metric_of(car, gain), stops(system, A)


def car_norms(parameters: Mapping[str, Any]) -> tuple[Norm, ...]:
    """The norms of a statement on this car and road: by x_lin from rest, without control. Raises as `stops`."""
    model = model_of(parameters)
    with precision(2):
        system = build(model)
    car = car_of(model["parameters"])
    end = float(stops(system, car_form(car, order=1).A)[0])
    return norms(car, linear_motion(model["parameters"], np.linspace(0.0, end, POINTS)).T)


def linear_motion(parameters: Parameters, times: Array) -> Array:
    """x_lin (n, 14) from rest at t = 0, at times (n,) [s] from 0 on."""
    form = car_form(car_of(parameters), order=1)
    return linear_response(form.A, form.B, np.zeros(14), road_signal(road_parameters(parameters)), times).T


def metric_of(car: Car, gain: Array | None = None) -> Array:
    """S (14, 14): modes of the (fed back) car, weighed by the energy."""
    return modal_metric(car_form(car, gain=gain, order=1).A, energy_norm(car).T)


def stops(system: ExactSystem, A: Array) -> list[fmpq]:
    """When the pieces may end: what is left of the start is small, and a whole number of periods is over."""
    roots = np.linalg.eigvals(A)
    alpha = -float(roots.real.max())
    if not alpha > ROUND_OFF * np.abs(roots).max():  # a rate of zero is computed as some 1e-16, of either sign
        raise NotProvedError(f"the linear car does not settle: growth rate {-alpha:.3g} 1/s; wanted < 0")
    corner, period = system.pieces[-1][0], system.period
    if period == 0:
        return [corner + fmpq(int(times / alpha * 1000) + 1, 1000) for times in AFTER_REST]
    return [corner + period * int(times / alpha / float(period) + 1) for times in AFTER_PERIODIC]
