"""The linear-quadratic regulator, car-free: what is refused, and closed forms against every way to the optimal arc."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analysis.errors import InputError
from analysis.stabilization.pontryagin import by_collocation, by_exponentials
from analysis.stabilization.regulator import (
    Arc,
    Regulator,
    by_riccati,
    energy_to_rest,
    instants,
    modal_reach,
    quadrature,
    stationary,
)

Array = np.ndarray[Any, Any]
Way = Callable[[Regulator, Array, Array], Arc]
WAYS: tuple[Way, ...] = (by_riccati, by_exponentials, by_collocation)

# ------------------------------------------------------------------ what is refused
UNIT = np.eye(2)
DOUBLE = np.array([[0.0, 1.0], [0.0, 0.0]])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"R": np.diag([1.0, -1.0])}, r"R is not positive definite: .* got -1; some control would be free"),
        ({"R": np.diag([1.0, 0.0])}, r"R is not positive definite: .* got 0"),
        ({"R": np.array([[1.0, 2.0], [2.0, 1.0]])}, r"R is not positive definite: .* got -1"),
        ({"R": np.array([[1.0, 1.0], [0.0, 1.0]])}, r"R is not symmetric"),
        ({"Q": np.diag([1.0, -1e-3])}, r"Q is indefinite: .* got -0\.001; the cost would reward motion"),
        ({"Q": np.array([[1.0, 0.0], [1.0, 1.0]])}, r"Q is not symmetric"),
        ({"Q": np.eye(3)}, r"Q: wanted the shape \(2, 2\), as B has it, got \(3, 3\)"),
        ({"A": np.array([[0.0, np.nan], [0.0, 0.0]])}, r"A: wanted finite numbers, got nan"),
    ],
)
def test_weights_that_make_no_problem_are_refused_with_the_reason(changes: dict[str, Array], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Regulator(**{"A": DOUBLE, "B": UNIT, "Q": UNIT, "R": UNIT, **changes})


@pytest.mark.parametrize(
    ("end", "step", "said"),
    [
        (0.0, 0.1, r"T = 0 s: wanted an end of control after its start"),
        (-1.0, 0.1, r"T = -1 s: wanted an end of control after its start"),
        (0.05, 0.1, r"T = 0\.05 s: wanted at least one step of 0\.1 s"),
        (1.0, 0.0, r"step = 0 s: wanted > 0"),
        (float("nan"), 0.1, r"T = nan s"),
    ],
)
def test_horizons_that_make_no_problem_are_refused_with_the_reason(end: float, step: float, said: str) -> None:
    with pytest.raises(InputError, match=said):
        instants(0.0, end, step)


def test_one_step_is_a_horizon_and_no_step_is_longer_than_asked() -> None:
    assert_allclose(instants(0.3, 0.4, 0.1), [0.3, 0.4])
    assert np.diff(instants(0.0, 1.0, 0.3)).max() == pytest.approx(0.25)


def test_no_stationary_control_is_refused() -> None:
    with pytest.raises(InputError, match="no control u = K x is optimal for ever"):
        stationary(Regulator(np.zeros((1, 1)), np.zeros((1, 1)), np.eye(1), np.eye(1)))


# ------------------------------------------------------------------ closed forms
@pytest.mark.parametrize("way", WAYS)
def test_the_scalar_problem_has_its_closed_form(way: Way) -> None:
    """x' = a x + u, q = r = 1: x ∝ w cosh w(T − t) − a sinh w(T − t), u = −x'/… = −L x, with w = √(a² + 1)."""
    a, T, start = 0.7, 3.0, np.array([2.0])
    scalar = Regulator(*(np.array([[v]]) for v in (a, 1.0, 1.0, 1.0)))
    t, w = instants(0.0, T, 0.01), np.sqrt(a**2 + 1)
    arc = way(scalar, start, t)
    left = w * (T - t)
    below = w * np.cosh(left) - a * np.sinh(left)
    assert_allclose(arc.x[0], start * below / below[0], atol=1e-9)
    assert_allclose(arc.u[0], -start * np.sinh(left) / below[0], atol=1e-9)
    L0 = np.sinh(w * T) / below[0]
    assert_allclose(quadrature(scalar, t, arc.x, arc.u), 0.5 * L0 * start[0] ** 2, rtol=1e-8)


@pytest.mark.parametrize("way", WAYS)
def test_the_double_integrator_has_its_closed_form(way: Way) -> None:
    """q'' = u with J = ½ ∫ q² + u²: q'''' = −q, and q'' = q''' = 0 at T; for ever L = [[√2, 1], [1, √2]]."""
    double = Regulator(DOUBLE, np.array([[0.0], [1.0]]), np.diag([1.0, 0.0]), np.eye(1))
    T, start = 4.0, np.array([1.0, -0.5])
    t, roots = instants(0.0, T, 0.01), np.exp(1j * np.pi / 4 * np.array([1, 3, 5, 7]))
    conditions = [roots**0, roots, roots**2 * np.exp(roots * T), roots**3 * np.exp(roots * T)]
    parts = np.linalg.solve(np.array(conditions), [*start, 0.0, 0.0])
    q, u = ((parts * roots**k @ np.exp(np.outer(roots, t))).real for k in (0, 2))
    arc = way(double, start, t)
    assert_allclose(arc.x[0], q, atol=1e-9)
    assert_allclose(arc.u[0], u, atol=1e-9)
    L, K = stationary(double)
    assert_allclose(L, [[np.sqrt(2), 1], [1, np.sqrt(2)]], rtol=1e-12)
    assert_allclose(K, [[-1, -np.sqrt(2)]], rtol=1e-12)


def test_the_effort_to_rest_has_its_closed_form() -> None:
    """A mass at the distance d is brought to rest in T with ∫ u² = 12 d²/T³; one that no force reaches, never."""
    assert_allclose(
        energy_to_rest(DOUBLE, np.array([[0.0], [1.0]]), np.array([0.3, 0.0]), 2.0), 12 * 0.3**2 / 8, rtol=1e-10
    )
    assert energy_to_rest(DOUBLE, np.zeros((2, 1)), np.array([0.3, 0.0]), 2.0) == np.inf
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])  # two decays of which the control reaches one, in turned coordinates
    A, B = turn @ np.diag([-1.0, -2.0]) @ turn.T, turn @ np.array([[1.0], [0.0]])
    assert energy_to_rest(A, B, np.array([0.3, 0.1]), 2.0) == np.inf
    assert modal_reach(A, B) < 1e-14


def test_the_reach_of_the_weakest_mode_has_its_closed_form_and_is_0_where_a_mode_is_out_of_reach() -> None:
    """Left modes of this A: (1, 0) for −2, (3, 1)/√10 for −5."""
    A = np.array([[-2.0, 0.0], [-9.0, -5.0]])
    for b1, b2 in ((1.0, 0.5), (0.0, 1.0), (1.0, -3.0)):
        expected = min(abs(b1), abs(3 * b1 + b2) / np.sqrt(10)) / np.hypot(b1, b2)
        assert_allclose(modal_reach(A, np.array([[b1], [b2]])), expected, atol=1e-15)
