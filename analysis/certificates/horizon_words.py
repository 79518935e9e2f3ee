"""What is proved of the car under a gain by time, in words, and what a motion apart from the proof reaches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from fmu_src.controller.design import Design
from fmu_src.controller.law import DESIGN, control_law

from ..bertolino_baksa.adversary import STEP, long_enough
from ..bertolino_baksa.motions_by_time import Motions
from ..bertolino_baksa.norms import Norm
from ..bertolino_baksa.switched import SwitchedProof
from ..bertolino_baksa.switched_certificate import SwitchedCertificate
from ..car import actuators, car_equations, car_form, road_signal
from ..methods.nonlinear_response import SMALL
from ..methods.polynomials import Array
from ..reference import car_of, road_parameters
from .car_certificates import KINDS, car_norms
from .certificate_words import model_words, named_by_content, number, start_words
from .finite_horizon import CONTROL, parts
from .motion_words import along, claim_words

TIGHT = 1e-11  # relative, of an integration apart from the proof


def statement(certificate: SwitchedCertificate, proof: SwitchedProof) -> list[str]:
    """What is proved, line by line, as `certificate_command.statement`; it raises the same."""
    parameters, control, table = parts(certificate.model)
    road = {name: value for name, value in parameters.items() if name in KINDS}
    claims = named_by_content(certificate.claims, car_norms(road))
    start, end = start_words(np.zeros(14)), float(certificate.pieces[-1].end)
    true = reference_floors(certificate.model, [c.norm for c in claims], end)
    tubes = [(s.tube, s.metric) for s in proof.stretches]
    made_for = ", ".join(f"{name} = {number(value)}" for name, value in parameters.items() if name in CONTROL)
    which = f"{len(table.edges) - 1} intervals, {parameters.get(DESIGN.name, DESIGN.start)}"
    return [
        *claim_words(claims, true, f"{start} is almost stable (definition 2.1): for all t >= 0"),
        *model_words({"parameters": road})[:-1],
        f"  controlled at every instant from {control.begin:g} to {control.end:g} s, x_lin too, by u = K(t) x [N, SI]",
        f"    K: the file's table ({which}), 0 before and after; that it is optimal for the controller's parameters "
        f"({made_for or 'all default'}) is not proved",
        "  x -> 0 after the road's end",
        *along(road, proof.switched.system, tubes, f"{start} itself, until t = {end:g} s"),
    ]


def reference_floors(model: dict[str, Any], norms: Sequence[Norm], end: float) -> Array:
    """sup N(x − x_lin) (norms,) of the motion from rest, by the controller's own law with the model's table."""
    parameters, control, table = parts(model)
    car, road = car_of(parameters), road_parameters(parameters)
    law = control_law(control, Design(control.model, finite=table))
    form, signal, Bu, equations = car_form(car, order=1), road_signal(road), actuators(car), car_equations(car, None)

    def rate(t: float, y: Array) -> Array:
        w, x, x_lin = signal(np.array([t]))[:, 0], y[:14].tolist(), y[14:]
        full = equations(x, [*w.tolist(), *law(t, x)], math.sin, math.cos)
        return np.concatenate([full, form.A @ x_lin + form.B @ w + Bu @ law(t, x_lin.tolist())])

    found, y = np.zeros(len(norms)), np.zeros(28)
    stop = min(end, long_enough(form, signal))
    corners = [t for t in sorted({*signal.edges, control.begin, control.end}) if 0.0 <= t < stop]
    for begin, until in pairwise([*corners, stop]):
        at = np.linspace(begin, until, int(np.ceil((until - begin) / STEP)) + 1)
        rows = solve_ivp(rate, (begin, until), y, "DOP853", at, rtol=TIGHT, atol=TIGHT * SMALL).y
        found, y = np.maximum(found, [norm(rows[:14] - rows[14:]).max() for norm in norms]), rows[:, -1]
    return found


def motions_of(model: dict[str, Any], stop: float, step: float = 2e-3) -> Motions:
    """Of the full car from t = 0 to `stop` [s], under the controller's own law with the model's table."""
    parameters, control, table = parts(model)
    law = control_law(control, Design(control.model, finite=table))
    form, signal = car_form(car_of(parameters), forces=True), road_signal(road_parameters(parameters))

    def inputs(t: float, x: Array) -> Array:
        w, u = signal(np.array([t])), [force + 0.0 * x[0] for force in law(t, list(x))]
        return np.concatenate([np.repeat(w, x.shape[1], axis=1), np.stack(u)])

    def linear(t: float, x: Array) -> Array:
        return np.asarray(form.A @ x + form.B @ inputs(t, x))

    corners = sorted({*signal.edges, control.begin, control.end})
    return Motions(lambda t, x: form.rate(x, inputs(t, x)), linear, corners, stop, step)
