"""The car under the controller's own gain table on its finite horizon, with nothing rounded; after T it is passive."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from flint import arb, arb_mat, fmpq

from fmu_src.controller.design import design
from fmu_src.controller.gain_table import GainTable
from fmu_src.controller.law import control_parameters

from ..bertolino_baksa.balls import Balls, ExactSystem, NotProvedError, column, decimal, jacobian, precision
from ..bertolino_baksa.norms import Norm
from ..bertolino_baksa.search import largest
from ..bertolino_baksa.switched import Measured, measured, phases
from ..bertolino_baksa.taylor import find_pieces
from ..bertolino_baksa.tube import Excess
from ..car import car_equations
from ..methods.polynomials import Array
from ..reference import Parameters, car_of, road_parameters
from ..stabilization.full_car import strut_gain
from .car_certificates import metric_of
from .exact_car import exact_car, exact_system

AFTER = 7.0  # times 1/α of the passive car that the pieces go on after T


def finite_horizon(parameters: Parameters) -> tuple[Measured, Measured]:
    """The motion from rest without control, and with the law on its horizon [t_on, T), ready for ε of δ.

    Raises NotProvedError where no tube is found, or where control would begin before the road's end.
    """
    control = control_parameters(parameters)
    table = design(control.model, infinite=True, span=control.end - control.begin)
    assert table.finite is not None and table.infinite is not None
    begin, end = decimal(control.begin), decimal(control.end)
    car = car_of(parameters)
    gain = -as_gain(np.array(table.infinite))
    S, closed = metric_of(car), metric_of(car, gain)
    with precision(2):
        system, linear, excess = controlled(parameters, table.finite, begin, end)
        passive = exact_system(car, road_parameters(parameters))
        if passive.period != 0:
            raise NotProvedError("the finite horizon is proved on a road that ends flat only")
        _, resting, left = controlled(parameters, None, begin, end)
        found = []
        for each, rates, more, begins, metrics in (
            (passive, resting, left, [fmpq(0)], [S]),
            (system, linear, excess, [fmpq(0), begin, end], [S, closed, S]),
        ):
            switched = phases(each, rates, more, begins, metrics)
            stop = max(end, each.pieces[-1][0]) + decimal(round(AFTER / switched.phases[0].metric.alpha, 2))
            pieces = find_pieces(each, [0.0] * 14, stop, changing=switched.linear_system)
            found.append(measured(switched, pieces))
    return found[0], found[1]


def as_gain(K: Array) -> Array:
    """Gain (4, 14) at the struts of u = K x, from the rows of the half car's K (8) or of the full car's (56)."""
    return strut_gain(K.reshape(2, 4)) if K.size == 8 else K.reshape(4, 14)


def controlled(
    parameters: Parameters, table: GainTable | None, begin: fmpq, end: fmpq
) -> tuple[ExactSystem, Callable[..., Sequence[Any]], Excess]:
    """The car with inputs w = (h, ḣ, K), K row by row as in the table, and the rates of its linear part.

    K runs as the table's polynomials in the time to go between begin and end, and is 0 before and after.
    """
    car = car_of(parameters)
    road, equations = exact_system(car, road_parameters(parameters)), car_equations(exact_car(car), None)
    n = 0 if table is None else len(table.coefficients[0])
    shares = [np.argwhere(g).tolist() for g in (as_gain(row) for row in np.eye(n))]
    values = [as_gain(row) for row in np.eye(n)]
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

    pieces = road.pieces if table is None else _with_gains(road, table, begin, end, n)
    return ExactSystem(14, 8 + n, full, pieces, road.period), linear, excess


def _times(A: arb_mat, x: Sequence[Any], B: arb_mat, w: Sequence[Any]) -> list[Any]:
    rates = []
    for row, more in zip(A.tolist(), B.tolist(), strict=True):
        terms = [v * a for a, v in zip((*row, *more), (*x, *w), strict=True) if a != 0]
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
        i = min(bisect_right(edges, end - at - fmpq(1, 10**12)), len(edges) - 1) - 1  # just after `at`
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


def largest_delta(found: Measured, norm: Norm) -> float:
    """The largest δ, to 1 %, for which a tube is proved; 0.0 if there is none."""
    x_lin = np.stack([piece.linear[:, 0] for piece in found.pieces], axis=1)
    return largest(lambda delta: found.epsilon(norm, delta), float(norm(x_lin).max()) or 1.0)
