"""The certificate under constant feedback: its gain is the controller's, it is proved anew, and no start escapes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_mat, fmpq
from scipy.integrate import solve_ivp

from analysis.bertolino_baksa.adversary import excursions
from analysis.bertolino_baksa.balls import Array, ExactSystem, NotProvedError, precision
from analysis.bertolino_baksa.certificate import Certificate, Claim, from_json, to_json, verify
from analysis.bertolino_baksa.norms import Norm, euclid
from analysis.bertolino_baksa.switched import measured, phases
from analysis.bertolino_baksa.taylor import find_pieces
from analysis.car import actuators, car_equations, car_form, road_signal
from analysis.certificates.car_certificates import build
from analysis.certificates.closed_loop_certificate import both, comparison, infinite_gain
from analysis.certificates.exact_car import norms
from analysis.certificates.finite_horizon import finite_horizon
from analysis.errors import InputError
from analysis.reference import car_of, road_parameters
from analysis.scenario import read_scenario
from fmu_src.controller.design import design
from fmu_src.controller.law import control_law, control_parameters
from fmu_src.vehicle.parameters import Car


def test_the_gain_is_what_the_controller_does() -> None:
    control = dataclasses.replace(control_parameters({}), horizon="infinite", activation="at t_on", t_on=0.0)
    law = control_law(control, design(control.model, infinite=True, span=None))
    x = np.random.default_rng(1).normal(size=14)
    np.testing.assert_allclose(-infinite_gain({}) @ x, law(1.0, x.tolist()), rtol=1e-12)


def test_control_is_certified_in_the_passive_norms() -> None:
    parameters = dict(read_scenario("bump-lqr").parameters)
    (passive, _), (closed, _) = both(parameters)
    read = from_json(to_json(closed), "here")
    verify(read, build)
    stiffer = (1.1 * infinite_gain(parameters)).tolist()
    with pytest.raises(NotProvedError):
        verify(dataclasses.replace(read, model={**read.model, "gain": stiffer}), build)
    form, signal = car_form(Car(), gain=infinite_gain(parameters)), road_signal(road_parameters(parameters))
    rng = np.random.default_rng(4)
    for before, claim in zip(passive.claims, closed.claims, strict=True):
        assert np.array_equal(before.norm.T, claim.norm.T)
        assert 0.9 < claim.floor / before.floor < 1.0  # it acts late on what the axle does within 0.1 s
        epsilon, delta = claim.table[-1].tolist()
        off = rng.normal(size=(14, 20))
        off *= delta / claim.norm(off)
        assert excursions(form, signal, [claim.norm], np.zeros(14), off, 1.0, 1e-3).max() < epsilon
    energy = closed.claims[0]
    assert energy.largest_delta > 1.08 * passive.claims[0].largest_delta  # both to CLOSE
    assert len(comparison(passive, closed)) == 3


@pytest.mark.parametrize(
    "option", [{"force_limit": 500.0}, {"actuator_lag": 0.02}, {"sample_time": 0.01}, {"actuators": "semi-active"}]
)
def test_a_loop_with_hardware_is_refused_by_name(option: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f"no hardware, got {next(iter(option))} = "):
        infinite_gain(option)


def test_deltas_are_compared_where_they_are_proved_and_not_between() -> None:
    """By the table's steps; where one of the two claims nothing, at an ε below its floor, nothing is compared."""

    def made(rows: list[list[float]]) -> Certificate:
        claim = Claim(Norm("energy", np.eye(14)), np.array(rows))
        return Certificate({}, np.zeros(14), np.eye(14), (), (claim,))

    before, after = made([[0.05, 1.0], [0.4, 2.0], [1.0, 8.0]]), made([[0.04, 3.0], [0.6, 4.0], [1.0, 9.0]])
    assert comparison(before, after) == [
        "  energy norm: l times 0.8; largest delta times 1.12; delta times 3 at eps = 0.1, 1.5 at eps = 0.5"
    ]


def test_the_gain_by_time_is_certified_on_its_horizon_and_after_it() -> None:
    """l is that of the motion from rest, and starts inside δ stay inside ε, under the controller's own law."""
    parameters = dict(read_scenario("bump-full-car").parameters)
    passive, found = finite_horizon(parameters)
    car, form = car_of(parameters), car_form(Car())
    control = control_parameters(parameters)
    law = control_law(control, design(control.model, infinite=False, span=control.end - control.begin))
    rng, Bu, signal = np.random.default_rng(6), actuators(car), road_signal(road_parameters(parameters))
    norm = norms(car, np.concatenate([p.linear[:, :1] for p in found.pieces], axis=1))[0]
    delta = 1.0
    start = rng.normal(size=(14, 1))
    start *= delta / norm(start)
    with precision(2):
        floor, epsilon = found.epsilon(norm, 0.0), found.epsilon(norm, delta)
        assert floor < passive.epsilon(norm, 0.0)

    def largest_error(start: Array, stop: float, tight: float) -> float:
        def rate(t: float, y: Array) -> Array:
            w, full, linear = signal(np.array([t]))[:, 0], y[:14].tolist(), y[14:]
            pushed = equations(full, [*w, *law(t, full)], math.sin, math.cos)
            return np.concatenate([pushed, form.A @ linear + form.B @ w + Bu @ law(t, linear.tolist())])

        most, y = 0.0, np.concatenate([start, np.zeros(14)])
        corners = [t for t in sorted({*signal.edges, control.begin, control.end}) if t < stop]
        for begin, end in pairwise([*corners, stop]):
            at = np.linspace(begin, end, 400)
            rows = solve_ivp(rate, (begin, end), y, "DOP853", at, rtol=tight, atol=1e-3 * tight).y
            most, y = max(most, float(norm(rows[:14] - rows[14:]).max())), rows[:, -1]
        return most

    equations = car_equations(car, None)
    true = largest_error(np.zeros(14), 0.4, 1e-9)
    assert true < floor < 1.01 * true
    assert largest_error(start[:, 0], 2.4, 1e-6) < epsilon


@pytest.mark.parametrize(("ends", "proved"), [(1, True), (3, False), (None, False)])
def test_a_tube_by_phases_is_refused_where_the_input_goes_on_after_it(ends: int | None, proved: bool) -> None:
    """x' = −x + w, w = 1 up to `ends` [s], pieces up to 2 s: what is said of all later times needs w = 0 there."""

    def equations(x: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> list[Any]:
        return [w[0] - x[0]]

    begins = [(fmpq(0), lambda t: [arb(1)]), *([] if ends is None else [(fmpq(ends), lambda t: [arb(0)])])]
    with precision(2):
        system = ExactSystem(1, 1, equations, tuple(begins), fmpq(0))
        switched = phases(system, equations, lambda x, w: arb_mat([[0]]), [fmpq(0)], [np.eye(1)])
        pieces = find_pieces(system, [0.0], fmpq(2))
        if proved:
            assert measured(switched, pieces).epsilon(euclid(1), 0.1) < 0.1001
        else:
            with pytest.raises(NotProvedError, match="not proved to be 0"):
                measured(switched, pieces)
