"""The certificate under constant feedback: its gain is the controller's, it is proved anew, and no start escapes."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from analysis.bertolino_baksa.adversary import excursions
from analysis.bertolino_baksa.balls import NotProvedError
from analysis.bertolino_baksa.certificate import Certificate, Claim, from_json, to_json, verify
from analysis.bertolino_baksa.norms import Norm
from analysis.car import car_form, road_signal
from analysis.certificates.car_certificates import build
from analysis.certificates.closed_loop_certificate import both, comparison, infinite_gain
from analysis.errors import InputError
from analysis.reference import road_parameters
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
