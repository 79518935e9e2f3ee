"""The design for the car with seven degrees of freedom: Riccati equations with 14 states, their limits, the weights."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm, solve_continuous_lyapunov

from fmu_src.controller.design import Design, design, problem
from fmu_src.controller.fullcar import FullCar
from fmu_src.controller.halfcar import HalfCar
from fmu_src.controller.law import ControlParameters, control_law, control_parameters
from fmu_src.controller.riccati import finite_horizon, flow, infinite_horizon, riccati_rate
from fmu_src.quantities import ParameterError
from fmu_src.vehicle.parameters import Car

Array = np.ndarray[Any, Any]
WEIGHTS = ("lambda_travel", "lambda_tyre", "lambda_hop", "lambda_acceleration", "H2")
UNLIKE = Car(m11=28.0, m12=33.0, bp1=90.0, bp2=70.0)  # no symmetry that the model does not ask for
WEIGHTED = FullCar(car=UNLIKE, lambda_travel=3e9, lambda_tyre=1e10, lambda_hop=1e6, lambda_acceleration=1e5, H2=0.7)
CARS = [FullCar(), WEIGHTED]


@pytest.fixture(scope="module")
def default_design() -> Design:
    return design(FullCar(), infinite=True, span=float("inf"))


@pytest.mark.parametrize("car", CARS)
def test_riccati_residual_symmetry_and_positivity_at_every_time(car: FullCar) -> None:
    A, B, Q, R, _ = problem(car)
    later, _ = flow(A, B, Q, R)
    s, h = np.linspace(0.0, 3.0, 61), 1e-5
    L, before, after = (later(np.zeros((1, 14, 14)), t)[0] for t in (s, s[1:] - h, s[1:] + h))
    largest = np.abs(L[-1]).max()
    for each in L:
        assert_allclose(each, each.T, rtol=0, atol=1e-15 * largest)
        assert np.linalg.eigvalsh(each).min() >= -1e-12 * np.linalg.eigvalsh(each).max()
    growth = (after - before) / (2 * h)  # of order h², and of the rounding of L over h
    rates = np.array([riccati_rate(each, A, B, Q, R) for each in L[1:]])
    assert np.abs(growth - rates).max() < 1e-6 * np.abs(rates).max()


@pytest.mark.parametrize("car", CARS)
def test_closed_form_backward_integration_and_hamiltonian_exponential_agree(car: FullCar) -> None:
    A, B, Q, R, _ = problem(car)
    s = np.linspace(0.0, 1.2, 121)
    closed_form = flow(A, B, Q, R)[0](np.zeros((1, 14, 14)), s)[0]
    integrated = finite_horizon(A, B, Q, R, s)
    step = expm(np.block([[-A, B @ np.linalg.solve(R, B.T)], [Q, A.T]]) * s[1])
    L, doubled = np.zeros((14, 14)), [np.zeros((14, 14))]
    for _ in s[1:]:
        X, P = np.split(step @ np.vstack([np.eye(14), L]), 2)
        L = P @ np.linalg.inv(X)
        doubled.append(L)
    largest = np.abs(L).max()
    assert np.abs(closed_form - integrated).max() < 1e-10 * largest
    assert np.abs(closed_form - np.array(doubled)).max() < 1e-9 * largest


@pytest.mark.parametrize("car", CARS)
def test_the_infinite_horizon_has_no_residual_and_the_finite_one_tends_to_it_at_twice_the_slowest_rate(
    car: FullCar,
) -> None:
    A, B, Q, R, _ = problem(car)
    L, K = infinite_horizon(A, B, Q, R)
    assert np.abs(riccati_rate(L, A, B, Q, R)).max() < 1e-9 * np.abs(Q).max()
    later, _ = flow(A, B, Q, R)
    slowest = np.linalg.eigvals(A + B @ K).real.max()
    assert slowest < np.linalg.eigvals(A).real.max() < 0
    s = np.linspace(0.3, 1.3, 401)
    gap = np.log(np.abs(later(np.zeros((1, 14, 14)), s)[0] - L).max(axis=(1, 2)))
    assert np.polyfit(s, gap, 1)[0] == pytest.approx(2 * slowest, rel=0.05)


@pytest.mark.parametrize("car", CARS)
def test_every_other_gain_costs_more_in_every_state(car: FullCar, rng: np.random.Generator) -> None:
    """x0ᵀ P x0 is twice the cost of u = K x, Lyapunov's equation for P; cross weights of x and u and all."""
    A, B = np.array(car.A), np.array(car.B)
    Q, N, R = map(np.array, car.cost)
    W = np.block([[Q, N], [N.T, R]])
    best = np.array(design(car, infinite=True, span=None).infinite).reshape(4, 14)

    def cost(K: Array) -> Array:
        whole = np.vstack([np.eye(14), K])
        return solve_continuous_lyapunov((A + B @ K).T, -whole.T @ W @ whole)

    least = cost(best)
    A1, _, Q1, _, _ = problem(car)
    assert_allclose(least, infinite_horizon(A1, B, Q1, R)[0], atol=1e-8 * np.abs(least).max())
    for _ in range(20):
        more = cost(best * (1.0 + 0.02 * rng.normal(size=best.shape))) - least
        assert np.linalg.eigvalsh(0.5 * (more + more.T)).min() > -1e-9 * np.abs(more).max()


def test_on_stiff_tyres_under_light_wheels_heave_and_pitch_are_controlled_as_in_the_half_car() -> None:
    """The forces of both sides of an axle together, and nothing of heave and pitch between the sides."""
    light = Car(m11=1e-2, m12=1e-2, m21=1e-2, m22=1e-2, m2=0.0, J2=1e-2, cp1=1e9, cp2=1e9)
    half, full = design(HalfCar(), infinite=True, span=None), design(FullCar(car=light), infinite=True, span=None)
    x = [0.01, 0.02, -0.005, *[0.0] * 4, 0.1, -0.2, 0.07, *[0.0] * 4]  # roll must not matter to the sums
    u, v = (control_law(ControlParameters(model=d.car, horizon="infinite"), d)(1.0, x) for d in (half, full))
    assert_allclose([v[0] + v[1], v[2] + v[3]], [u[0] + u[1], u[2] + u[3]], rtol=2e-3)
    assert abs(v[0] - v[1]) > 10.0  # roll is controlled, which the half car does not see
    assert u[0] == u[1]


def test_a_mirrored_motion_gets_mirrored_forces(default_design: Design, rng: np.random.Generator) -> None:
    law = control_law(ControlParameters(model=FullCar()), default_design)
    x = rng.normal(size=14)
    q, v = x[:7], x[7:]
    mirrored = np.concatenate([np.array([p[0], -p[1], p[2], p[4], p[3], p[5], -p[6]]) for p in (q, v)])
    for t in (0.4, 2.0, 2.29):
        fl, fr, rl, rr = law(t, x.tolist())
        assert_allclose(law(t, mirrored.tolist()), (fr, fl, rr, rl), rtol=1e-6)


@pytest.mark.parametrize("car", CARS)
def test_gains_between_the_edges_of_the_table_are_right(car: FullCar, rng: np.random.Generator) -> None:
    A, B, Q, R, K0 = problem(car)
    table = design(car, infinite=False, span=10.0).finite
    assert table is not None
    assert table.settled
    s = np.sort(rng.uniform(0, 2.0, 60))
    expected = [(K0 - np.linalg.solve(R, B.T @ L)).ravel() for L in finite_horizon(A, B, Q, R, np.array([0, *s]))[1:]]
    got = np.array([table.gain(x) for x in s])
    assert np.abs(got - expected).max() < 2e-8 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("weight", "what"),
    [
        ("lambda_travel", lambda x, u, a: x[0] + 0.695 * x[1] - x[2] - x[3]),
        ("lambda_tyre", lambda x, u, a: -x[3]),
        ("lambda_hop", lambda x, u, a: x[10]),
    ],
)
def test_each_weight_is_that_of_its_quantity_squared(weight: str, what: Any, rng: np.random.Generator) -> None:
    """Of the front left corner, in a motion in which the three others rest; with the default sum taken off."""
    x, u = np.zeros(14), rng.normal(size=4)
    x[3], x[10] = 0.01, 0.2
    (Q, N, R), (Q0, _, R0) = (
        map(np.array, c.cost) for c in (control_parameters({"design": "full-car", weight: 7.0}).model, FullCar())
    )
    both = x @ (Q - Q0) @ x + 2 * x @ N @ u + u @ (R - R0) @ u
    assert both == pytest.approx(7.0 * what(x, u, None) ** 2, rel=1e-9)


def test_the_weight_of_acceleration_is_that_of_the_bodys_three_accelerations(rng: np.random.Generator) -> None:
    car = FullCar(H1=1.3, H2=0.6, lambda_acceleration=1e4)
    (Q, N, R), (Q0, _, R0) = (map(np.array, c.cost) for c in (car, replace(car, lambda_acceleration=0.0)))
    x, u = rng.normal(size=14), rng.normal(size=4)
    heave, roll, pitch = (np.array(car.A) @ x + np.array(car.B) @ u)[7:10]
    expected = 1e4 * (heave**2 + (0.6 * roll) ** 2 + (1.3 * pitch) ** 2)
    assert x @ (Q - Q0) @ x + 2 * x @ N @ u + u @ (R - R0) @ u == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("name", ["lambda", "H1", "H2", *WEIGHTS])
def test_negative_weights_are_refused_by_name(name: str) -> None:
    with pytest.raises(ParameterError, match=rf"^{name} = -1\.0 \S+: wanted a finite number in \[0, inf\]"):
        control_parameters({"design": "full-car", name: -1.0})


def test_an_undamped_car_without_weights_has_no_design_and_says_why() -> None:
    car = FullCar(car=Car(b1=0.0, b2=0.0), lam=0.0)
    said = r"^b1 = 0\.0 N\.s/m, b2 = 0\.0 N\.s/m, lambda = 0\.0 N2/m2: "
    with pytest.raises(ParameterError, match=said):
        design(car, infinite=False, span=1.0)
    with pytest.raises(ParameterError, match=said):
        design(car, infinite=True, span=None)
