"""Power series of the equations of motion, their polynomials, and the exact solution of the linear part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from orders import observed_order
from scipy.integrate import solve_ivp

from analysis.car import car_form, road_signal
from analysis.errors import InputError
from analysis.methods.linear_response import linear_response, periodic_response
from analysis.methods.polynomials import homogeneous
from analysis.methods.power_series import PowerSeries, cos, sin, variables
from analysis.methods.signals import constant, harmonic
from analysis.methods.standard_form import StandardForm, standard_form
from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import RoadParameters, road
from fmu_src.vehicle.linear import linearized
from fmu_src.vehicle.parameters import Car

DAMPED_TYRES = Car(bp1=150.0, bp2=170.0, Jz=700.0, m11=31.0)
HARMONICS = (0.01, 0.0, -0.004, 0.0, 0.002, 0.0, 0.0, 0.001)  # m; by default a Fourier road is flat


def duffing(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any) -> Sequence[Any]:
    return [x[1], x[0] * -4.0 + x[1] * -0.3 - x[0] * x[0] * x[0] + w[0]]


def pendulum(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any) -> Sequence[Any]:
    """On a support with the accelerations w (across, up) [m/s²]; l = 1 m, g = 9.81 m/s²."""
    return [x[1], sine(x[0]) * -9.81 - sine(x[0]) * w[1] - cosine(x[0]) * w[0]]


# ---------------------------------------------------------------------------------------------------- power series
def test_series_of_known_functions() -> None:
    x, y = variables(2, 7, Fraction(1))
    assert sin(x).terms[(0,) * 7] == Fraction(-1, math.factorial(7))
    assert cos(x).terms[(0,) * 6] == Fraction(-1, math.factorial(6))
    assert (1 / (1 - x)).terms[(0,) * 7] == 1
    one = sin(x + y) * sin(x + y) + cos(x + y) * cos(x + y)
    assert {m for m, value in one.terms.items() if value != 0} == {()}
    assert ((x / (2.0 + y)) * (2.0 + y) - x).terms.keys() == {*x.terms, *((x / (2.0 + y)) * (2.0 + y)).terms}
    assert all(value == 0 for m, value in ((x / (2.0 + y)) * (2.0 + y) - x).terms.items())
    with pytest.raises(ValueError, match="at 0 only"):
        sin(x + 1.0)


def test_the_coefficients_may_be_symbols() -> None:
    import sympy as sp

    c = sp.Symbol("c")
    (x,) = variables(1, 5, sp.Integer(1))
    assert sin(x * c).terms[(0,) * 5] == c**5 / 120


# ---------------------------------------------------------------------------------------------------- polynomials
def test_a_polynomial_its_tensor_and_its_jacobian_agree() -> None:
    Phi = homogeneous([{(0, 0, 2): 3.0, (1, 1, 1): -1.0}, {(0, 1, 2): 2.0, (0, 0, 0): 0.0}, {}], 3)
    y = np.array([0.3, -1.2, 0.7])
    assert Phi.monomials.tolist() == [[0, 0, 2], [0, 1, 2], [1, 1, 1]]
    np.testing.assert_allclose(Phi(y), [3 * 0.09 * 0.7 + 1.2**3, 2 * 0.3 * -1.2 * 0.7, 0.0])
    np.testing.assert_allclose(np.einsum("ijkl,j,k,l", Phi.tensor(3), y, y, y), Phi(y))
    np.testing.assert_allclose(Phi(np.stack([y, 2 * y], axis=1))[:, 1], 8 * Phi(y))
    h = 1e-30
    numeric = np.stack([Phi(y + 1j * h * e).imag / h for e in np.eye(3)], axis=1)
    np.testing.assert_allclose(Phi.jacobian(y), numeric, rtol=1e-14)
    assert Phi.entries() == [(0, (0, 0, 2), 3.0), (0, (1, 1, 1), -1.0), (1, (0, 1, 2), 2.0)]


# ---------------------------------------------------------------------------------------------------- the car
@pytest.mark.parametrize("car", [Car(), DAMPED_TYRES], ids=["default", "damped tyres"])
def test_the_linear_part_is_that_of_the_fmu(car: Car) -> None:
    form, linear = car_form(car), linearized(car)
    np.testing.assert_allclose(form.A, linear.A, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(form.B, np.hstack([linear.Bh, linear.Bdh]), rtol=1e-13)


@pytest.mark.parametrize("order", [3, 5])
@pytest.mark.parametrize("seed", range(3))
def test_the_polynomial_meets_the_full_equations_to_the_next_odd_order(order: int, seed: int) -> None:
    """Cubic: the error is of order 5 in the size of the motion; quintic: of order 7."""
    form = car_form(DAMPED_TYRES, order=order)
    direction = np.random.default_rng(seed).uniform(-1.0, 1.0, 22)
    x, w = direction[:14], direction[14:]

    def error(size: float) -> float:
        polynomial = form.A @ x * size + form.B @ w * size + form.Phi(x * size, w * size)
        return float(np.abs(form.rate(x * size, w * size) - polynomial).max())

    slope, bend = observed_order(error, [0.4, 0.2, 0.1])
    assert slope == pytest.approx(order + 2, abs=0.1)
    assert bend < 0.05


@pytest.mark.parametrize("degree", [3, 5])
def test_the_symmetric_parts_are_the_derivatives_of_the_full_equations(degree: int) -> None:
    """Cauchy's integral over a circle of complex sizes gives the directional derivatives to round-off."""
    form = car_form(DAMPED_TYRES, order=5)
    directions = np.random.default_rng(7).uniform(-1.0, 1.0, (22, 200))
    circle = 0.3 * np.exp(2j * np.pi * np.arange(32) / 32)
    values = [form.rate(directions[:14] * z, directions[14:] * z) / z**degree for z in circle]
    polynomial = [part for terms in form.terms.values() for part in terms if part.degree == degree]
    expected = np.mean(values, axis=0)
    np.testing.assert_allclose(polynomial[0](directions), expected.real, atol=1e-10 * np.abs(expected).max())


def test_only_odd_parts_and_parametric_excitation_only_in_the_axles_roll() -> None:
    form = car_form(Car())
    assert sorted(form.terms) == [1, 2]
    with_road = [(i, m) for i, m, _ in form.terms[1][0].entries() if max(m) >= 14]
    assert with_road == [(13, (6, 6, 16)), (13, (6, 6, 17))]


def test_a_fed_back_car_is_expanded_with_its_actuators() -> None:
    gain = np.random.default_rng(1).uniform(-300.0, 300.0, (4, 14))
    form, linear = car_form(Car(), gain=gain), linearized(Car())
    np.testing.assert_allclose(form.A, np.array(linear.A) - np.array(linear.Bu) @ gain, rtol=1e-12, atol=1e-12)


def test_rest_must_be_a_motion() -> None:
    with pytest.raises(InputError, match=r"F\(0, 0\) = 0"):
        standard_form(lambda x, w, s, c: [x[0] + 1.0], ["x"], 0)


def test_textbook_systems_come_through_the_same_code() -> None:
    form = standard_form(duffing, ["x", "x'"], 1)
    np.testing.assert_array_equal(form.A, [[0.0, 1.0], [-4.0, -0.3]])
    assert [part.entries() for part in form.terms[1]] == [[(1, (0, 0, 0), -1)]]
    moved = standard_form(pendulum, ["theta", "theta'"], 2, order=3)
    assert moved.terms[1][0].entries() == [(1, (0, 3), -1.0)]  # parametric: the support's upward acceleration
    assert moved.terms[2][0].entries() == [(1, (0, 0, 0), pytest.approx(9.81 / 6)), (1, (0, 0, 2), 0.5)]


# ---------------------------------------------------------------------------------------------------- roads as signals
@pytest.mark.parametrize("profile", ["bump", "sine", "fourier", "step", "flat"])
@pytest.mark.parametrize("begin", [0.0, 0.03, 0.1])
def test_a_road_as_a_signal_is_the_road(profile: str, begin: float) -> None:
    parameters = RoadParameters(
        profile=profile, amplitudes=HARMONICS, tau0=0.013, t_start=0.05, excited=(True, True, False, True)
    )
    exact, times = road(parameters), np.linspace(begin, 2.0, 977)
    expected = np.array([exact.heights(t) + exact.rates(t) for t in times.tolist()]).T
    np.testing.assert_allclose(road_signal(parameters, begin)(times), expected, atol=1e-12)


# ---------------------------------------------------------------------------------------------------- linear response
def integrated(form: StandardForm, x0: Any, w: Any, edges: Sequence[float], times: Any) -> Any:
    """The linear part by DOP853, restarted at the edges of w."""
    states, x = np.empty((len(form.A), len(times))), np.asarray(x0, float)
    for begin, end in zip(edges, [*edges[1:], times[-1]], strict=True):
        inside = (times >= begin) & (times <= end)
        middle = 0.5 * (begin + end)
        w_in = next(piece for piece, mask in w.spans(np.array([middle])) if mask[0])
        at = np.union1d(times[inside], [end])
        solution = solve_ivp(
            lambda t, y, w_in=w_in: form.A @ y + form.B @ w_in(t), (begin, end), x, "DOP853", at, rtol=1e-12, atol=1e-14
        )
        states[:, inside], x = solution.y[:, : np.count_nonzero(inside)], solution.y[:, -1]
    return states


@pytest.mark.parametrize("profile", ["bump", "sine", "fourier", "step"])
def test_the_closed_form_is_what_an_integration_gives(profile: str) -> None:
    form = car_form(DAMPED_TYRES)
    w = road_signal(RoadParameters(profile=profile, amplitudes=HARMONICS, tau0=0.013))
    x0, times = np.linspace(-0.01, 0.01, 14), np.linspace(0.0, 0.8, 161)
    expected = integrated(form, x0, w, w.edges, times)
    found = linear_response(form.A, form.B, x0, w, times)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    free = linear_response(form.A, form.B, x0, constant([0.0] * 8), times)
    assert np.abs(found - free).max() > 0.1 * np.abs(found).max()  # the road is seen, not only the start


def test_any_time_alone_and_in_any_order() -> None:
    form, w = car_form(Car()), road_signal(RoadParameters())
    times = np.array([0.31, 0.02, 4.0, 0.25])
    together = linear_response(form.A, form.B, np.zeros(14), w, times)
    alone = [linear_response(form.A, form.B, np.zeros(14), w, np.array([t]))[:, 0] for t in times]
    np.testing.assert_allclose(together, np.stack(alone, axis=1), rtol=1e-9, atol=1e-15)


def test_there_is_nothing_before_the_signal() -> None:
    form, w = car_form(Car(), order=1), road_signal(RoadParameters(), 1.0)
    for t in (np.array([1.5, 0.5]), np.array([np.nan])):
        with pytest.raises(InputError, match="not before the signal's start, 1 s"):
            linear_response(form.A, form.B, np.zeros(14), w, t)
        with pytest.raises(InputError, match="not before the signal's start"):
            w(t)


def test_resonance_and_defective_matrices_are_no_exception() -> None:
    """x'' + x = cos t grows like ½ t sin t; a critically damped mass has but one eigenvector."""
    t = np.linspace(0.0, 20.0, 41)
    swing = linear_response(
        np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[0.0], [1.0]]), [0, 0], harmonic([1.0], 1.0), t
    )
    np.testing.assert_allclose(swing[0], 0.5 * t * np.sin(t), atol=1e-11)
    creep = linear_response(np.array([[0.0, 1.0], [-1.0, -2.0]]), np.array([[0.0], [1.0]]), [0, 0], constant([1.0]), t)
    np.testing.assert_allclose(creep[0], 1.0 - (1.0 + t) * np.exp(-t), atol=1e-12)


@pytest.mark.parametrize("profile", ["sine", "fourier"])
def test_the_periodic_motion_is_where_the_response_settles_and_returns_to_itself(profile: str) -> None:
    form = car_form(DAMPED_TYRES)
    parameters = RoadParameters(profile=profile, amplitudes=HARMONICS, tau0=0.013)
    w, period = road_signal(parameters), 2.0 * math.pi / parameters.omega
    t = np.array([15.0, 15.02, 15.02 + period])
    forever = periodic_response(form.A, form.B, w.pieces[-1], t)
    assert np.abs(forever[:7]).max() > 1e-3  # m or rad, on a road of 10 mm
    settled = linear_response(form.A, form.B, np.zeros(14), w, t)
    np.testing.assert_allclose(settled, forever, atol=1e-10 * np.abs(forever).max())
    np.testing.assert_allclose(forever[:, 1], forever[:, 2], atol=1e-13 * np.abs(forever).max())


def test_every_parameter_of_the_car_reaches_its_form() -> None:
    base = car_form(Car(), order=3)
    for f in fields(Car):
        names = ("m21", "m22") if f.name in ("m21", "m22") else (f.name,)  # must be equal
        other = car_form(Car(**{name: PARAMETERS[name].start * 1.1 + 1.0 for name in names}), order=3)
        linear = np.array_equal(base.A, other.A) and np.array_equal(base.B, other.B)
        assert not linear or (f.name == "Jz" and base.terms[1][0].entries() != other.terms[1][0].entries()), f.name


def test_a_series_is_what_it_says() -> None:
    x = variables(1, 3)[0]
    assert isinstance(2.0 - x, PowerSeries)
    assert (2.0 - x).terms == {(): 2, (0,): -1}
