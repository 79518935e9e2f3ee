"""How robust u = K x is: margins against closed forms and eigenvalues, stability proved over boxes of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import control
import numpy as np
import pytest
from flint import arb, fmpq
from numpy.testing import assert_allclose

from analysis.bertolino_baksa.balls import decimal, precision
from analysis.car import car_form
from analysis.stabilization import certified, study
from analysis.stabilization.certified import _is_positive, around, certify, closed_loop, growth, state_space
from analysis.stabilization.energies import Energy, search
from analysis.stabilization.full_car import (
    AXLES,
    car_plant,
    full_gain,
    half_car_plant,
    strut_gain,
    varied_values,
)
from analysis.stabilization.half_car import corrected
from analysis.stabilization.margins import Margins, loop_margins, margins
from analysis.stabilization.regulator import Regulator, stationary
from analysis.stabilization.study import WEIGHTS, lost_at, robustness
from fmu_src.controller.design import design
from fmu_src.controller.fullcar import FullCar
from fmu_src.controller.halfcar import HalfCar
from fmu_src.controller.law import ControlParameters, control_law
from fmu_src.vehicle.linear import linearized
from fmu_src.vehicle.parameters import Car

Array = np.ndarray[Any, Any]
HALF_CAR, CAR = HalfCar(), Car()
SHARP = 1e12  # λ at which the car with its wheels has small margins


def gain_of(lam: float) -> Array:
    return stationary(corrected(HALF_CAR).regulator(replace(HALF_CAR, lam=lam)))[1]


@pytest.fixture(scope="module")
def sharp() -> tuple[Array, Array, Array]:
    """A, B, K of the car with its wheels under a strong control of the half car."""
    linear = linearized(CAR)
    return np.array(linear.A), np.array(linear.Bu), strut_gain(gain_of(SHARP))


@pytest.fixture(scope="module")
def sharp_margins(sharp: tuple[Array, Array, Array]) -> Margins:
    return margins(*sharp, AXLES)


# ------------------------------------------------------------------ closed forms
def test_margins_of_an_integrator() -> None:
    """L = k/s: any gain > 0, 90°, a delay of π/2k; |1 + L| > 1, and (S − T)/2 is ½ everywhere."""
    k = 3.0
    found = margins(np.zeros((1, 1)), np.eye(1), np.array([[-k]]))
    (loop,) = found.loops
    assert (loop.down, loop.up) == (0.0, np.inf)
    assert loop.phase == pytest.approx(90.0)
    assert found.delay == pytest.approx(np.pi / (2 * k), rel=1e-9)
    assert found.return_difference == pytest.approx(1.0, abs=1e-6)
    assert found.disk == pytest.approx(2.0, rel=1e-9)


def test_margins_of_three_lags() -> None:
    """L = k/(s + 1)³ crosses −180° at ω = √3 with k/8, and the unit circle where (1 + ω²)^(3/2) = k."""
    k = 4.0
    A, B = np.eye(3, k=1) - np.eye(3), np.array([[0.0], [0.0], [1.0]])
    found = margins(A, B, np.array([[-k, 0.0, 0.0]]))
    omega = np.sqrt(k ** (2 / 3) - 1)
    left = np.pi - 3 * np.arctan(omega)
    assert found.loops[0].up == pytest.approx(8 / k, rel=1e-6)
    assert found.loops[0].phase == pytest.approx(np.degrees(left), rel=1e-6)
    assert found.delay == pytest.approx(left / omega, rel=1e-9)


@pytest.mark.parametrize("k", [3.0, 1.5])
def test_margins_of_an_unstable_plant_have_a_least_gain(k: float) -> None:
    """L = k/(s − 1) needs a gain over 1/k, met at rest; |L| = 1 at ω = √(k² − 1), where atan ω is left of its phase."""
    found = margins(np.eye(1), np.eye(1), np.array([[-k]]))
    for loop in (*found.loops, found.common):
        assert loop.down == pytest.approx(1 / k, rel=1e-9)
        assert loop.up == np.inf
        assert loop.phase == pytest.approx(np.degrees(np.arctan(np.sqrt(k**2 - 1))), rel=1e-9)


def test_a_lead_of_the_phase_counts_as_a_lag_does() -> None:
    """L = −k/(s² + 2ζs + 1), k < 1: below the resonance, where |L| = 1, a small lead is what takes it to the verge."""
    k, zeta = 0.8, 0.02
    found = margins(np.array([[0.0, 1.0], [-1.0, -2 * zeta]]), np.array([[0.0], [1.0]]), np.array([[k, 0.0]]))
    square = min(np.roots([1.0, 4 * zeta**2 - 2.0, 1.0 - k**2]).real)  # ω² with |1 − ω² + 2iζω| = k
    lead = np.degrees(np.arctan2(2 * zeta * np.sqrt(square), 1.0 - square))
    assert lead < 2.0
    for loop in (*found.loops, found.common):
        assert loop.phase == pytest.approx(lead, rel=1e-6)
        assert loop.up == pytest.approx(1 / k, rel=1e-9)  # at rest


# ------------------------------------------------------------------ what theory promises
def test_an_optimal_state_feedback_has_its_promised_margins(rng: np.random.Generator) -> None:
    """R. E. Kalman's inequality, σ(I + L) ≥ 1 for R = ρ I: a gain from ½ to any, and 60° of phase, in each loop."""
    for _ in range(4):
        A, B = rng.normal(size=(4, 4)), rng.normal(size=(4, 2))
        _, K = stationary(Regulator(A, B, np.eye(4), 0.3 * np.eye(2)))
        found = margins(A, B, K)
        assert found.return_difference > 1.0 - 1e-9
        assert all(loop.down <= 0.5 and loop.up == np.inf and loop.phase >= 60.0 for loop in found.loops)


def test_the_half_car_keeps_the_promise_and_the_car_with_wheels_does_not(sharp_margins: Margins) -> None:
    model = corrected(HALF_CAR)
    promised = margins(model.A, model.B, gain_of(SHARP))
    assert promised.return_difference > 1.0 - 1e-9
    assert min(loop.up for loop in promised.loops) == np.inf
    assert sharp_margins.return_difference < 0.5
    assert min(loop.up for loop in sharp_margins.loops) < 10.0


def test_the_full_car_design_keeps_the_promise_where_the_half_car_design_loses_the_car() -> None:
    lam = 1e13
    gain = full_gain(FullCar(lam=lam))
    own = margins(*state_space(car_plant(CAR), varied_values(CAR)), gain)
    assert own.return_difference > 1.0 - 1e-9
    assert all(loop.up == np.inf and loop.phase >= 60.0 for loop in (*own.loops, own.common))
    assert growth(car_plant(CAR), gain, varied_values(CAR)) < 0.0
    assert growth(car_plant(CAR), strut_gain(gain_of(lam)), varied_values(CAR)) > 0.0


# ------------------------------------------------------------------ against eigenvalues
def test_at_a_margin_the_closed_loop_has_an_undamped_oscillation(
    sharp: tuple[Array, Array, Array], sharp_margins: Margins
) -> None:
    A, B, K = sharp
    every = list(range(4))
    for wrong, loop in zip([*AXLES, every], [*sharp_margins.loops, sharp_margins.common], strict=True):

        def growths(factor: complex, wrong: Any = wrong) -> Array:
            changed = np.ones(4, complex)
            changed[list(wrong)] = factor
            return np.linalg.eigvals(A + B @ (changed[:, None] * K)).real

        turn = 1j * np.radians(loop.phase)
        for verge in (loop.up, max(np.exp(-turn), np.exp(turn), key=lambda factor: growths(factor).max())):
            assert abs(growths(verge).max()) < 1e-4  # of poles of up to 100 1/s
            assert growths(verge**0.99).max() < 0.0 < growths(verge**1.01).max()
            nearer = [verge**share for share in np.linspace(0.0, 0.99, 30)]
            assert all(growths(factor).max() < 0.0 for factor in nearer)
    assert sharp_margins.common.up == pytest.approx(3.80, abs=0.005)
    assert sharp_margins.common.phase == pytest.approx(30.0, abs=0.05)


def test_the_common_phase_of_a_full_car_design_is_where_eigenvalues_have_it_and_less_than_each_struts(
    sharp: tuple[Array, Array, Array],
) -> None:
    A, B, _ = sharp
    K = full_gain(FullCar(lam=SHARP))
    found = margins(A, B, K)
    rates = [
        np.linalg.eigvals(A + np.exp(-1j * np.radians(f * found.common.phase)) * B @ K).real.max() for f in (0.99, 1.01)
    ]
    assert rates[0] < 0.0 < rates[1]
    assert found.common.phase < 0.8 * min(loop.phase for loop in found.loops)
    assert found.common.up == np.inf
    assert np.linalg.eigvals(A + 1e5 * B @ K).real.max() < 0.0


def rightmost(A: Array, BK: Array, delay: float, points: int = 20) -> float:
    """Largest real part of the roots of x' = A x + B K x(t − delay), by collocation of its semigroup's generator."""
    n, k = len(A), np.arange(points + 1)
    nodes = np.cos(np.pi * k / points)
    c = np.where((k == 0) | (k == points), 2.0, 1.0) * (-1.0) ** k
    D = np.outer(c, 1 / c) / (nodes[:, None] - nodes + np.eye(points + 1))
    D -= np.diag(D.sum(axis=1))
    generator = np.kron(2.0 / delay * D, np.eye(n))
    generator[:n] = 0.0
    generator[:n, :n], generator[:n, -n:] = A, BK
    return float(np.linalg.eigvals(generator).real.max())


def test_at_the_delay_margin_the_delayed_loop_is_on_the_verge(
    sharp: tuple[Array, Array, Array], sharp_margins: Margins
) -> None:
    A, B, K = sharp
    tau = sharp_margins.delay
    assert rightmost(A, B @ K, 0.95 * tau) < -0.1
    assert abs(rightmost(A, B @ K, tau)) < 1e-6
    assert rightmost(A, B @ K, 1.05 * tau) > 0.1


def test_a_loop_that_is_never_large_stands_any_delay() -> None:
    model = corrected(HALF_CAR)
    assert margins(model.A, model.B, gain_of(1e8)).delay == np.inf


def test_no_change_below_the_disk_margin_makes_the_loop_unstable(
    sharp: tuple[Array, Array, Array], sharp_margins: Margins, rng: np.random.Generator
) -> None:
    """Real and complex factors (1 + δ/2)/(1 − δ/2), |δ| < α, in all four loops at once; and one α reaches the verge."""
    A, B, K = sharp

    def worst(delta: Array) -> float:
        factor = np.linalg.solve((np.eye(4) - delta / 2).T, (np.eye(4) + delta / 2).T).T
        return float(np.linalg.eigvals(A + B @ factor @ K).real.max())

    for _ in range(200):
        delta = rng.normal(size=(4, 4)) + 1j * rng.normal(size=(4, 4))
        assert worst(0.999 * sharp_margins.disk * delta / np.linalg.norm(delta, 2)) < 0.0
    omega = np.linspace(40, 80, 4001)
    peaks = [np.linalg.inv(np.eye(4) - K @ np.linalg.solve(1j * w * np.eye(14) - A, B)) - np.eye(4) / 2 for w in omega]
    most = max(peaks, key=lambda peak: np.linalg.norm(peak, 2))
    u, s, vh = np.linalg.svd(most)
    assert 1 / s[0] == pytest.approx(sharp_margins.disk, rel=1e-4)
    verge = np.outer(vh[0].conj(), u[:, 0].conj()) / s[0]
    assert max(worst(1.001 * verge), worst(-1.001 * verge)) > 0.0 > max(worst(0.99 * verge), worst(-0.99 * verge))


def test_the_disk_margin_of_one_loop_is_that_of_python_control() -> None:
    A, B, K = np.eye(3, k=1) - np.eye(3), np.array([[0.0], [0.0], [1.0]]), np.array([[-4.0, 0.0, 0.0]])
    alpha, _, _ = control.disk_margins(control.ss(A, B, -K, 0.0), np.linspace(1.2, 2.2, 4001))
    assert margins(A, B, K).disk == pytest.approx(alpha, rel=1e-6)
    assert loop_margins(A, B, K, [0]).up == pytest.approx(2.0, rel=1e-6)


# ------------------------------------------------------------------ the car
def test_the_gain_by_struts_is_that_of_the_controller(rng: np.random.Generator) -> None:
    made = design(HALF_CAR, infinite=True, span=None)
    law = control_law(ControlParameters(horizon="infinite"), made)
    gain = strut_gain(np.array(made.infinite).reshape(2, 4))
    for x in rng.normal(size=(5, 14)):
        assert_allclose(gain @ x, law(1.0, x.tolist()), rtol=1e-12)
    whole = FullCar(lam=1e11)
    law = control_law(ControlParameters(model=whole, horizon="infinite"), design(whole, infinite=True, span=None))
    x = rng.normal(size=14)
    assert_allclose(full_gain(whole) @ x, law(1.0, x.tolist()), rtol=1e-12)


def test_the_closed_loop_is_that_of_the_standard_form() -> None:
    gain = strut_gain(gain_of(1e10))
    assert_allclose(
        closed_loop(car_plant(CAR), gain, varied_values(CAR)),
        car_form(CAR, gain=-gain, order=1).A,
        rtol=1e-12,
        atol=1e-9,
    )


@pytest.mark.parametrize(
    ("plant", "at"), [(half_car_plant(HALF_CAR), varied_values(HALF_CAR)), (car_plant(CAR), varied_values(CAR))]
)
def test_plants_are_affine_in_each_of_their_parameters(
    plant: Any, at: dict[str, float], rng: np.random.Generator
) -> None:
    """What the certificates rest on: between two values of one parameter M, S, G are the mean of those at both."""
    for name in at:
        others = {other: value * rng.uniform(0.7, 1.3) for other, value in at.items()}
        ends, between = (
            [[np.array(part) for part in plant({**others, name: f * at[name]})] for f in factors]
            for factors in ((0.7, 1.3), (1.0,))
        )
        for k, middle in enumerate(between[0]):
            assert_allclose(middle, 0.5 * (ends[0][k] + ends[1][k]), rtol=1e-12, atol=1e-9)
        assert any(np.abs(ends[1][k] - ends[0][k]).max() > 0.0 for k in range(3))


def test_what_is_varied_of_the_car_is_body_struts_tyres_and_wheels_with_their_companions() -> None:
    """Each parameter doubled alone, against the car with all that goes with it."""
    doubled = {
        "m": ("m", "Jx", "Jy", "Jz"), "c1": ("c1",), "c2": ("c2",), "cp1": ("cp1",), "cp2": ("cp2",),
        "m11": ("m11", "m12"), "m21": ("m21", "m22", "m2", "J2"),
    }  # fmt: skip
    assert list(varied_values(CAR)) == list(doubled)
    for name, together in doubled.items():
        linear = linearized(replace(CAR, **{each: 2.0 * getattr(CAR, each) for each in together}))
        A, B = state_space(car_plant(CAR), {**varied_values(CAR), name: 2.0 * getattr(CAR, name)})
        assert_allclose(A, linear.A, rtol=1e-12, atol=1e-12)
        assert_allclose(B, linear.Bu, rtol=1e-12, atol=1e-12)
    light = state_space(half_car_plant(HALF_CAR), {**varied_values(HALF_CAR), "m": 0.5 * HALF_CAR.m})
    half = replace(HALF_CAR, m=0.5 * HALF_CAR.m, Jy=0.5 * HALF_CAR.Jy)
    assert_allclose(light[0], half.A, rtol=1e-12)
    assert_allclose(light[1], half.B, rtol=1e-12)


def test_the_weight_from_which_wheels_make_the_control_unstable() -> None:
    lam = lost_at(HALF_CAR)
    assert WEIGHTS[0] < lam < WEIGHTS[-1]
    rates = [growth(car_plant(CAR), strut_gain(gain_of(f * lam)), varied_values(CAR)) for f in (0.99, 1.01)]
    assert rates[0] < 0.0 < rates[1]
    sooner = lost_at(HALF_CAR, (0.7, 1.3))
    assert 1e12 < sooner < 0.3 * lam  # measured: 1.1e12
    weak = {"m": 0.7, "c1": 1.3, "c2": 0.7, "cp1": 0.7, "cp2": 0.7, "m11": 1.3, "m21": 1.3}
    corner = {name: weak[name] * value for name, value in varied_values(CAR).items()}
    rates = [growth(car_plant(CAR), strut_gain(gain_of(f * sooner)), corner) for f in (0.99, 1.01)]
    assert rates[0] < 0.0 < rates[1]


@pytest.mark.parametrize(("weights", "lost"), [((1e8, 1e9), np.inf), ((1e13, 1e14), 1e13)])
def test_without_such_a_weight_it_is_infinite_and_from_the_first_on_the_first(
    weights: tuple[float, ...], lost: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "WEIGHTS", weights)
    assert lost_at(HALF_CAR) == pytest.approx(lost)


# ------------------------------------------------------------------ proved
@pytest.mark.parametrize(
    ("matrix", "positive"),
    [
        ([[2.0, 1.0], [1.0, 1.0]], True),
        ([[1.0, 1.0], [1.0, 1.0]], False),
        ([[1.0, 2.0], [2.0, 1.0]], False),
        ([[-1.0, 0.0], [0.0, 1.0]], False),
        ([[float("nan"), 0.0], [0.0, 1.0]], False),
    ],
)
def test_a_matrix_of_balls_is_positive_only_if_it_surely_is(matrix: list[list[float]], positive: bool) -> None:
    assert _is_positive([[arb(entry) for entry in row] for row in matrix]) is positive


def pendulum(values: Mapping[str, Any]) -> Any:
    """q'' = −c q − b q' + u."""
    return [values["c"] * 0 + 1], [[-values["c"], -values["b"]]], [[values["c"] * 0 + 1]]


NO_GAIN = np.zeros((1, 2))


def test_one_energy_proves_a_frequency_that_moves_further_than_the_damping_is_wide() -> None:
    """No V of the same coefficients for all does so: √c would have to move by less than b."""
    small = certify(pendulum, NO_GAIN, {"c": (fmpq(1, 10), fmpq(100)), "b": (fmpq(1, 100), fmpq(1, 10))})
    assert (small.proved, small.unstable, small.boxes, small.witness) == (1.0, 0.0, 1, None)


def test_a_box_is_halved_until_each_part_is_proved_or_unstable() -> None:
    """b from −0.5 to 1.5: a quarter of the box is unstable, and something near the border stays open."""
    found = certify(pendulum, NO_GAIN, {**around({"c": 1.0}, 0.1), **around({"b": 0.5}, 2.0)}, budget=20)
    assert 0.7 < found.proved < 0.75
    assert 0.2 < found.unstable <= 0.25
    assert found.witness is not None
    assert found.witness["b"] == -0.5  # the worst corner


def test_what_decides_is_the_comparison_in_balls_at_every_corner(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each corner alone refused leaves the box unproved."""
    box = around({"c": 1.0, "b": 1.0}, 0.1)
    decided = certified._decreases
    for c, b in product(*box.values()):
        refused = {"c": c, "b": b}
        monkeypatch.setattr(certified, "_decreases", lambda *a, no=refused: a[3] != no and decided(*a))
        assert certify(pendulum, NO_GAIN, box, budget=1).proved == 0.0
    monkeypatch.setattr(certified, "_decreases", decided)
    assert certify(pendulum, NO_GAIN, box, budget=1).proved == 1.0


def exact(energy: Energy) -> Energy:
    return Energy(*(certified._balls(part) for part in (energy.Y, energy.C, energy.X)))


def test_balls_tell_a_tiny_damping_from_none_and_from_a_tiny_growth() -> None:
    """V = (c + b²/2) q² + b q q̇ + q̇² of the pendulum falls by b (c q² + q̇²)."""
    for b, expected in ((fmpq(1, 10**20), True), (fmpq(0), False), (fmpq(-1, 10**20), False)):
        energy = Energy(np.array([1.0]), np.array([[float(b) / 2]]), np.array([[0.0]]))
        corner = {"c": fmpq(1), "b": b}
        with precision(1):
            assert certified._decreases(pendulum, certified._balls(NO_GAIN), exact(energy), corner) is expected


def test_a_falling_V_that_is_not_positive_proves_nothing() -> None:
    """−(energy) of an oscillator that grows falls, too."""
    energy = Energy(np.array([-1.0]), np.array([[0.3]]), np.array([[0.0]]))
    M, S = np.array([1.0]), np.array([[-1.0, 0.6]])
    assert np.linalg.eigvalsh(energy.forms(M, S)[1]).max() < 0.0
    grows = {"c": fmpq(1), "b": fmpq(-6, 10)}
    assert not certified._decreases(pendulum, certified._balls(NO_GAIN), exact(energy), grows)


def test_forms_are_those_of_V_and_of_its_rate(rng: np.random.Generator) -> None:
    """V̇ = ẋᵀPx + xᵀPẋ along M q'' = S x; both forms of a mean of systems are the mean of the forms."""
    n = 3
    X = rng.normal(size=(n, n))
    energy = Energy(rng.normal(size=n), rng.normal(size=(n, n)), X + X.T)
    systems = [(rng.uniform(1, 2, n), rng.normal(size=(n, 2 * n))) for _ in range(2)]
    for M, S in systems:
        A = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), S / M[:, None]])
        P, W = energy.forms(M, S)
        assert_allclose(P, P.T, rtol=1e-13)
        assert_allclose(A.T @ P + P @ A, W, rtol=1e-10, atol=1e-12)
    between = energy.forms(*(0.3 * one + 0.7 * two for one, two in zip(*systems, strict=True)))
    ends = [energy.forms(*system) for system in systems]
    for k in (0, 1):
        assert_allclose(between[k], 0.3 * ends[0][k] + 0.7 * ends[1][k], rtol=1e-10, atol=1e-12)


def test_the_search_adds_systems_until_none_fails_and_gives_up_where_there_is_none() -> None:
    c, b = np.meshgrid(np.linspace(1.0, 50.0, 30), [0.01, 1.0])
    S = -np.stack([c.ravel(), b.ravel()], axis=1)[:, None, :]
    M = np.ones((len(S), 1))
    energy = search(M, S, range(len(S)))
    assert energy is not None
    assert all(np.linalg.eigvalsh(energy.forms(m, s)[1])[-1] < 0.0 for m, s in zip(M, S, strict=True))
    S[-1, 0, 1] = 0.0
    assert search(M, S, range(len(S))) is None


def test_the_control_is_proved_stable_over_masses_and_stiffnesses_also_of_tyres_and_wheels(
    rng: np.random.Generator,
) -> None:
    K = gain_of(HALF_CAR.lam)
    for plant, gain, at in (
        (half_car_plant(HALF_CAR), K, varied_values(HALF_CAR)),
        (car_plant(CAR), strut_gain(K), varied_values(CAR)),
        (car_plant(CAR), full_gain(FullCar()), varied_values(CAR)),
    ):
        found = certify(plant, gain, around(at, 0.3))
        assert (found.proved, found.boxes) == (1.0, 1)
        for factors in rng.uniform(0.7, 1.3, size=(50, len(at))):
            values = dict(zip(at, (factors * list(at.values())).tolist(), strict=True))
            assert growth(plant, gain, values) < 0.0


def test_beyond_a_weight_other_tyres_make_the_half_car_design_unstable_and_that_is_found() -> None:
    """At 2e12 the car is stable for all body masses and struts' stiffnesses within ± 30 %; not with other tyres."""
    gain = strut_gain(gain_of(2e12))
    found = certify(car_plant(CAR), gain, around(varied_values(CAR), 0.3), budget=1)
    assert found.proved == 0.0
    assert found.witness is not None
    assert growth(car_plant(CAR), gain, found.witness) > 0.2
    body = around({name: getattr(CAR, name) for name in ("m", "c1", "c2")}, 0.3)
    rest = {name: (decimal(value), decimal(value)) for name, value in varied_values(CAR).items() if name not in body}
    assert all(
        growth(car_plant(CAR), gain, certified._doubles(each)) < 0.0 for each in certified._corners({**body, **rest})
    )


@pytest.mark.parametrize("worst", [0.7, 1.0, 1.3])
def test_the_worst_of_the_box_is_looked_for_at_its_ends_and_in_its_middle(worst: float) -> None:
    """A damping that is least at one of the three points of the parameter."""

    def plant(values: Mapping[str, Any]) -> Any:
        return [1.0], [[-1.0, -0.1 - (values["p"] - worst) ** 2]], [[1.0]]

    assert robustness(plant, NO_GAIN, {"p": 1.0}).worst == pytest.approx(-0.05)
