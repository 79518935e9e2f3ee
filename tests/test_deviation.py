"""e = x − x_lin by Picard's iteration: the full motion of another integrator less x_lin, however large."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from analysis.bertolino_baksa.adversary import STEP, reference_error, reference_floor
from analysis.car import car_form, road_signal
from analysis.certificates.exact_car import energy_norm
from analysis.errors import InputError
from analysis.methods.deviation import deviation
from analysis.methods.linear_response import linear_response
from analysis.methods.nonlinear_response import nonlinear_response
from analysis.methods.signals import Signal, constant, harmonic
from analysis.methods.standard_form import StandardForm, standard_form
from analysis.reference import road_parameters
from fmu_src.vehicle.parameters import Car


def pendulum(x: Any, w: Any, sine: Any, cosine: Any) -> Sequence[Any]:
    return [x[1], sine(x[0]) * -40.0 - x[1] + cosine(x[0]) * w[0]]


def runaway(x: Any, w: Any, sine: Any, cosine: Any) -> Sequence[Any]:
    return [x[0] * -1.0 + x[0] * x[0] * x[0]]


FORM = standard_form(pendulum, ["angle", "rate"], 1)
PUSHED = Signal((*harmonic([3.0], 6.0).pieces, *constant([0.0], 1.3).pieces))


@pytest.mark.parametrize(("angle", "tolerance"), [(0.01, 1e-7), (1.0, 1e-8), (3.0, 1e-8)])
def test_it_is_the_full_motion_less_the_linear_one(angle: float, tolerance: float) -> None:
    """Over the size of e; of a small motion another integrator's digits are few in e."""
    x0 = np.array([angle, 0.0])
    signal = PUSHED if angle > 0.1 else constant([0.0])
    times, e = reference_error(FORM, signal, x0, 4.0, 5e-4)
    x = nonlinear_response(FORM, x0, signal, times, rtol=1e-13)
    expected = x - linear_response(FORM.A, FORM.B, x0, signal, times)
    assert np.abs(e - expected).max() <= tolerance * np.abs(expected).max()


def test_steps_that_differ_from_the_times_asked_for_make_no_difference() -> None:
    x0 = np.array([1.0, 0.0])
    fine, few = (reference_error(FORM, PUSHED, x0, 2.0, step) for step in (5e-4, 0.01))
    assert few[0].tolist() == pytest.approx([fine[0][np.argmin(np.abs(fine[0] - t))] for t in few[0]], abs=1e-12)
    near = fine[1][:, [int(np.argmin(np.abs(fine[0] - t))) for t in few[0]]]
    np.testing.assert_allclose(few[1], near, atol=1e-8 * np.abs(near).max())


def test_its_error_is_of_the_fourth_order() -> None:
    errors = []
    x0 = np.array([1.0, 0.0])
    for count in (100, 200, 400):
        t = np.linspace(0.0, 1.0, 2 * count + 1)
        x_lin = linear_response(FORM.A, FORM.B, x0, constant([0.0]), t)
        e = deviation(FORM, x_lin, np.zeros((1, len(t))), np.zeros(2), t[1])
        x = nonlinear_response(FORM, x0, None, t, rtol=1e-13)
        errors.append(np.abs(x_lin + e - x).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 3.8).all() and (orders < 4.3).all()


def test_a_motion_that_runs_away_is_refused() -> None:
    form: StandardForm = standard_form(runaway, ["x"], 1)
    with pytest.raises(InputError, match="cannot be integrated in steps of"):
        reference_error(form, constant([0.0]), np.array([1.1]), 5.0, 5e-4)


def test_the_floor_is_read_as_often_as_the_fastest_mode_asks() -> None:
    """Of a car whose tyres' dampers are stiff the error is largest within a fraction of a millisecond of a corner."""
    car = Car(bp1=1e5, bp2=1e5)
    form, signal, norm = car_form(car), road_signal(road_parameters({})), energy_norm(car)
    rest, stop = np.zeros(14), 0.4
    found = reference_floor(form, signal, [norm], rest, stop)[0]
    _, e = reference_error(form, signal, rest, stop, 5e-6)
    finest, coarse = norm(e).max(), norm(reference_error(form, signal, rest, stop, STEP)[1]).max()
    assert coarse < 0.9 * finest
    assert found == pytest.approx(finest, rel=2e-3)


def test_stiff_tyres_do_not_end_the_iteration_in_their_round_off() -> None:
    car = Car(cp1=1e8, cp2=1e8)
    form, signal = car_form(car), road_signal(road_parameters({}))
    times, e = reference_error(form, signal, np.zeros(14), 0.1, 2e-4)
    x = nonlinear_response(form, np.zeros(14), signal, times, rtol=1e-13)
    expected = x - linear_response(form.A, form.B, np.zeros(14), signal, times)
    norm = energy_norm(car)
    assert norm(e - expected).max() < 1e-3 * norm(expected).max()
