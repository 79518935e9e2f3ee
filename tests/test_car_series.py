"""The series (3.15)–(3.16) of the seven-degree car: orders in the amplitude, and what each part of (3.10) gains."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from orders import observed_order

from analysis.car import car_form, road_signal, without_cubic_stiffness
from analysis.methods.modes import modes
from analysis.methods.nonlinear_response import nonlinear_response
from analysis.methods.sampled_series import sampled_series
from analysis.methods.series import exact_series, partial_sums
from analysis.methods.standard_form import only
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car

TIMES = np.linspace(0.0, 1.0, 201)
AMPLITUDES = [0.2, 0.15, 0.1]  # m
CARS = {"default": Car(), "damped tyres": Car(bp1=150.0, bp2=170.0, Jz=700.0)}


def whole(car: Car, amplitude: float) -> Any:
    """The full equations on the bump, integrated tightly."""
    return nonlinear_response(car_form(car), np.zeros(14), road_signal(RoadParameters(A=amplitude)), TIMES, rtol=1e-13)


def relative(error: Any, of: Any) -> float:
    """Largest difference, over each state's maximum."""
    return float((np.abs(error) / np.abs(of).max(axis=1, keepdims=True)).max())


@pytest.mark.parametrize("car", CARS.values(), ids=CARS)
def test_the_cars_truncation_error_falls_with_amplitude_at_orders_3_5_7_and_9(car: Car) -> None:
    """Against the full equations; x⁽ᵏ⁾ of a road of 1 m, times A^(2k+1), is that of the amplitude A.

    Terms of degree 3 (cubic stiffness and P among them) carry order 1, of degree 5 order 2, of degree 7 order 3.
    """
    form, grid = car_form(car, order=7), np.linspace(0.0, 1.0, 2001)
    w = road_signal(RoadParameters(A=1.0))
    terms = sampled_series(form, modes(form.A), w, grid, np.zeros(14), 3).physical(TIMES)
    exact = {A: whole(car, A) for A in AMPLITUDES}
    for order in range(4):

        def error(A: float, order: int = order) -> float:
            return A * relative(exact[A] - A * partial_sums(terms, A * A)[order], exact[A])

        slope, bend = observed_order(error, AMPLITUDES)
        assert slope == pytest.approx(2 * order + 3, abs=0.1)
        assert bend < 0.02


def test_exact_sums_and_quadrature_are_two_ways_to_the_same_terms() -> None:
    """Up to order 2, from a start off rest, with pieces of 1 ms, on which the sums nearly cancel."""
    form = car_form(CARS["damped tyres"])
    w, linear = road_signal(RoadParameters(tau0=0.001, excited=(True, True, False, False))), modes(form.A)
    x0, grid = np.linspace(-0.01, 0.01, 14), np.linspace(0.0, 0.5, 1001)
    exact = exact_series(form, linear, w, x0, 2).physical(TIMES[:101])
    found = sampled_series(form, linear, w, grid, x0, 2).physical(TIMES[:101])
    for k, tolerance in enumerate([1e-11, 1e-9, 1e-9]):
        np.testing.assert_allclose(found[k], exact[k], atol=tolerance * np.abs(exact[k]).max())


@pytest.mark.parametrize(
    ("left_out", "least", "most"), [("nothing", 100.0, 200.0), ("P", 2.0, 20.0), ("cubic stiffness", 0.9, 1.1)]
)
def test_what_the_first_correction_gains(left_out: str, least: float, most: float) -> None:
    """The paper's own R̄ lacks c_ijkl q q q and gains nothing; without P a part of the gain is lost."""
    car, A = Car(), 0.1
    form = car_form(car)
    kept = {
        "nothing": form,
        "P": only(form, lambda monomial: max(monomial) < 14),
        "cubic stiffness": without_cubic_stiffness(form),
    }[left_out]
    terms = exact_series(kept, modes(form.A), road_signal(RoadParameters(A=A)), np.zeros(14), 1).physical(TIMES)
    exact = whole(car, A)
    errors = [relative(exact - sums, exact) for sums in partial_sums(terms)]
    assert least < errors[0] / errors[1] < most
