"""The car under the controller's own gain table on its finite horizon, with nothing rounded; after T it is passive.

The table is a part of the model: what is proved is proved of its polynomials, however they were found.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from flint import arb, arb_mat, fmpq

from fmu_src.controller.design import design
from fmu_src.controller.gain_table import DEGREE, GainTable
from fmu_src.controller.hardware import Hardware
from fmu_src.controller.law import (
    ACTIVATION,
    DESIGN,
    HALF_CAR,
    HORIZON,
    REALS,
    WEIGHTS,
    ControlParameters,
    control_parameters,
)
from fmu_src.quantities import ParameterError

from ..bertolino_baksa import strict
from ..bertolino_baksa.balls import Balls, ExactSystem, NotProvedError, column, decimal, jacobian, precision
from ..bertolino_baksa.norms import Norm, contracting
from ..bertolino_baksa.switched import Phase, Switched, SwitchedProof, switched
from ..bertolino_baksa.switched_certificate import SwitchedCertificate, certify
from ..bertolino_baksa.taylor import find_pieces
from ..bertolino_baksa.tube import Excess
from ..car import car_equations
from ..errors import InputError
from ..methods.polynomials import Array
from ..reference import Parameters, car_of, road_parameters
from ..stabilization.full_car import strut_gain
from .car_certificates import KINDS, OTHERS, checked_parameters, metric_of
from .exact_car import exact_car, exact_system

KIND = "car under a gain by time"
AFTER = 7.0  # times 1/α of the passive car that the pieces go on after T
CONTROL: dict[str, type] = {
    **{name: float for name in (*REALS, *HALF_CAR, *WEIGHTS) if name not in KINDS},
    **dict.fromkeys((HORIZON.name, ACTIVATION.name, DESIGN.name), str),
}  # parameters of the controller that have a part in its gains and times
ENTRIES = {"half-car": 8, "full-car": 56}  # of K, by the design


def certify_horizon(parameters: Parameters, norms: Sequence[Norm]) -> tuple[SwitchedCertificate, SwitchedProof]:
    """The certificate of x_lin from rest with the controller of these parameters on its horizon [begin, T).

    Raises NotProvedError where there is none; InputError for hardware and for a controller without a horizon's end.
    """
    refuse_hardware(parameters)
    control = control_parameters({**parameters, "enabled": True})
    _refuse_endless(control)
    made = design(control.model, infinite=True, span=control.end - control.begin)
    assert made.finite is not None and made.infinite is not None
    return certify_table(parameters, made.finite, -as_gain(np.array(made.infinite)), norms)


def certify_table(
    parameters: Parameters, table: GainTable, near: Array, norms: Sequence[Norm]
) -> tuple[SwitchedCertificate, SwitchedProof]:
    """The same with this table; near (4, 14): a constant gain of u = −gain x, in whose metric control is bounded."""
    model, car = model_of(parameters, table), car_of(parameters)
    passive, closed = metric_of(car), metric_of(car, near)
    with precision(2):
        loop = build(model)
        if loop.system.period != 0:
            raise NotProvedError("the finite horizon is proved on a road that ends flat only")
        begin, end = times(control_parameters(model["parameters"]))
        alpha = contracting(loop.A.rest, passive).alpha
        stop = max(end, loop.system.pieces[-1][0]) + decimal(round(AFTER / alpha, 2))
        pieces = find_pieces(loop.system, [0.0] * 14, stop, changing=loop.linear_system)
    switches = sorted({t for t in (fmpq(0), begin, end) if t >= 0})
    phases = [Phase(t, closed if begin <= t < end else passive) for t in switches]
    return certify(model, loop, phases, pieces, norms)


def refuse_hardware(parameters: Parameters) -> None:
    """Raise InputError, which names it, where the struts do not do at once what the law asks for."""
    hardware = control_parameters(parameters).hardware
    if not hardware.ideal:
        names = ("actuators", "feedback", "force_limit", "actuator_lag", "sample_time")
        found = [name for name in names if getattr(hardware, name) != getattr(Hardware(), name)]
        got = ", ".join(f"{name} = {getattr(hardware, name)!r}" for name in found)
        raise InputError(f"--closed-loop: the proof is of the law itself; wanted no hardware, got {got}")


def _refuse_endless(control: ControlParameters) -> None:
    if control.horizon != "finite":
        raise InputError(f"horizon = {control.horizon}: wanted a finite one, with a gain by time")


def times(control: ControlParameters) -> tuple[fmpq, fmpq]:
    """When control begins and ends [s], exactly."""
    return decimal(control.begin), decimal(control.end)


def model_of(parameters: Parameters, table: GainTable) -> dict[str, Any]:
    """The model of a certificate: parameters of car, road and controller, and the gain table."""
    kinds = {*KINDS, *CONTROL}
    ours = {name: value for name, value in parameters.items() if name in kinds or name not in OTHERS}
    rows = {"edges": list(table.edges), "coefficients": [[list(c) for c in each] for each in table.coefficients]}
    return {"kind": KIND, "parameters": ours, "table": rows}


def build(model: dict[str, Any]) -> Switched:
    """The system of a certificate. Raises InputError for another kind, and for what cannot be."""
    parameters, control, table = parts(model)
    return switched(*controlled(parameters, table, *times(control)))


def parts(model: dict[str, Any]) -> tuple[Parameters, ControlParameters, GainTable]:
    """Parameters, control and gain table of a model; raises InputError as `build`."""
    if set(model) != {"kind", "parameters", "table"} or model["kind"] != KIND:
        raise InputError(f"model: wanted the kind {KIND!r}, parameters and a table, got {', '.join(sorted(model))}")
    parameters = checked_parameters(model["parameters"], {**KINDS, **CONTROL}, "car, road or controller")
    try:
        control = control_parameters(parameters)
        car_of(parameters), road_parameters(parameters)
        table = _table(model["table"], ENTRIES[str(parameters.get(DESIGN.name, DESIGN.start))])
    except (ParameterError, LookupError, TypeError, ValueError) as error:
        raise InputError(f"model: {error}") from error
    _refuse_endless(control)
    return parameters, control, table


def _table(content: Any, entries: int) -> GainTable:
    strict.of_keys(content, ("edges", "coefficients"))
    edges, coefficients = strict.numbers(content["edges"], 1), strict.numbers(content["coefficients"], 3)
    if coefficients.shape != (len(edges) - 1, entries, DEGREE + 1):
        raise ValueError(f"{len(edges)} edges of a gain table with coefficients of the shape {coefficients.shape}")
    if edges[0] != 0.0 or not np.all(np.diff(edges) > 0.0):
        raise ValueError("the edges of a gain table must rise from 0.0")
    return GainTable.of({"edges": edges.tolist(), "coefficients": coefficients.tolist(), "settled": False})


def as_gain(K: Array) -> Array:
    """Gain (4, 14) at the struts of u = K x, from the rows of the half car's K (8) or of the full car's (56)."""
    return strut_gain(K.reshape(2, 4)) if K.size == 8 else K.reshape(4, 14)


def controlled(
    parameters: Parameters, table: GainTable, begin: fmpq, end: fmpq
) -> tuple[ExactSystem, Callable[..., Sequence[Any]], Excess]:
    """The car with inputs w = (h, ḣ, K), K row by row as in the table, and the rates of its linear part.

    K runs as the table's polynomials in the time to go between begin and end, and is 0 before and after.
    """
    car = car_of(parameters)
    road, equations = exact_system(car, road_parameters(parameters)), car_equations(exact_car(car), None)
    n = len(table.coefficients[0])
    values = [as_gain(row) for row in np.eye(n)]
    shares = [np.argwhere(value).tolist() for value in values]
    plain = ExactSystem(14, 12, equations, road.pieces, road.period)
    zeros = [arb(0)] * 14, [arb(0)] * 12
    A, B = jacobian(plain, *zeros), jacobian(plain, *zeros, inputs=True)

    def forces(x: Sequence[Any], K: Sequence[Any]) -> list[Any]:
        u: list[Any] = [arb(0)] * 4
        for k, where, value in zip(K, shares, values, strict=True):
            for strut, state in where:
                u[strut] = u[strut] + k * x[state] * arb(float(value[strut, state]))
        return u

    def full(x: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> Sequence[Any]:
        return equations(x, [*w[:8], *forces(x, w[8:])], sin, cos)

    def linear(x: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> Sequence[Any]:
        return _times(A, x, B, [*w[:8], *forces(x, w[8:])])

    def excess(x: Balls, w: Balls) -> arb_mat:
        K = arb_mat(forces_by_state(w[8:]))
        inputs = [*w[:8], *(K * column(x)).entries()]
        by_forces = arb_mat([row[8:] for row in (jacobian(plain, x, inputs, inputs=True) - B).tolist()])
        return jacobian(plain, x, inputs) - A + by_forces * K

    def forces_by_state(K: Sequence[Any]) -> list[list[Any]]:
        gain: list[list[Any]] = [[arb(0)] * 14 for _ in range(4)]
        for k, where, value in zip(K, shares, values, strict=True):
            for strut, state in where:
                gain[strut][state] += k * arb(float(value[strut, state]))
        return gain

    return ExactSystem(14, 8 + n, full, _with_gains(road, table, begin, end, n), road.period), linear, excess


def _times(A: arb_mat, x: Sequence[Any], B: arb_mat, w: Sequence[Any]) -> list[Any]:
    rates = []
    for row, more in zip(A.tolist(), B.tolist(), strict=True):
        terms = [v * a for a, v in zip((*row, *more), (*x, *w), strict=True) if not a.is_zero()]  # a ball may hold 0
        rates.append(sum(terms[1:], terms[0]))
    return rates


def _with_gains(
    road: ExactSystem, table: GainTable, begin: fmpq, end: fmpq, n: int
) -> tuple[tuple[fmpq, Callable[[Any], list[Any]]], ...]:
    edges = [decimal(e) for e in table.edges]
    cuts = [end - e for e in edges if begin < end - e < end]
    begins = sorted({*(at for at, _ in road.pieces), begin, end, *cuts})

    def inputs(at: fmpq) -> Callable[[Any], list[Any]]:
        under = road.inputs_at(at)
        if not begin <= at < end:
            return lambda t: [*under(t), *[arb(0)] * n]
        i = min(bisect_left(edges, end - at), len(edges) - 1) - 1  # just after `at`, the time to go is just less
        middle, half = (edges[i + 1] + edges[i]) / 2, (edges[i + 1] - edges[i]) / 2
        settled = end - at > edges[-1]

        def w(t: Any) -> list[Any]:
            s = arb(1) if settled else (t * -1 + arb(end - middle)) / arb(half)
            K = []
            for c in table.coefficients[i]:
                value = arb(0)
                for each in reversed(c):
                    value = value * s + arb(each)
                K.append(value)
            return [*under(t), *K]

        return w

    return tuple((at, inputs(at)) for at in begins)
