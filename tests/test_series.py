"""The series in the small parameter: its algebra, closed forms of textbook systems, orders of truncation, the car."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath
import numpy as np
import pytest
from orders import observed_order
from scipy.integrate import solve_ivp

from analysis.car import car_form, road_signal
from analysis.methods.modes import modes
from analysis.methods.sampled_series import sampled_series
from analysis.methods.series import Series, exact_series, partial_sums, successive_ratios
from analysis.methods.signals import Piece, Signal, constant, harmonic
from analysis.methods.standard_form import StandardForm, perturbed, standard_form
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car

NO_INPUT = Signal((Piece(0.0, np.zeros(0, complex), np.zeros((0, 0), complex)),))


# ---------------------------------------------------------------------------------------------------- textbook systems
def duffing(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any) -> Sequence[Any]:
    return [x[1], -x[0] - x[0] * x[0] * x[0]]


def forced_duffing(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any) -> Sequence[Any]:
    return [x[1], x[0] * -4.0 + x[1] * -0.4 - x[0] * x[0] * x[0] + w[0]]


def oscillator(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any) -> Sequence[Any]:
    return [x[1], -x[0]]


def van_der_pols_damping(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any) -> Sequence[Any]:
    return [0.0, x[1] - x[0] * x[0] * x[1]]


def mathieu(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any) -> Sequence[Any]:
    return [x[1], -x[0] - x[0] * w[0]]


def cubic_pair(stiffness: float) -> Callable[..., Sequence[Any]]:
    """Two oscillators, β = 1 and √stiffness, under a common cubic spring."""

    def equations(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any) -> Sequence[Any]:
        pull = (x[0] - x[1]) * (x[0] - x[1]) * (x[0] - x[1])
        return [x[2], x[3], x[0] * -1.0 - pull, x[1] * -stiffness + pull]

    return equations


DUFFING = standard_form(duffing, ["x", "x'"], 0)
VAN_DER_POL = perturbed(standard_form(oscillator, ["x", "x'"], 0), van_der_pols_damping)
MATHIEU = standard_form(mathieu, ["x", "x'"], 1)


def pair(stiffness: float) -> StandardForm:
    return standard_form(cubic_pair(stiffness), ["x", "y", "x'", "y'"], 0)


def series(form: StandardForm, x0: Sequence[float], order: int, w: Signal = NO_INPUT) -> Series:
    return exact_series(form, modes(form.A), w, x0, order)


def integrated(form: StandardForm, epsilon: float, w: Signal, x0: Sequence[float], t: Any) -> Any:
    """x' = A x + B w + ε (F − A x − B w) by DOP853, all of F, restarted at the edges of w; t sorted from w's begin."""
    x, found = np.asarray(x0, float), np.empty((len(x0), len(t)))
    for piece, end in zip(w.pieces, [*w.edges[1:], t[-1]], strict=True):

        def rate(s: float, x: Any, piece: Piece = piece) -> Any:
            linear = form.A @ x + form.B @ piece(s)
            return linear + epsilon * (form.rate(x, piece(s)) - linear)

        inside = (t >= piece.begin) & (t <= end)
        at = np.union1d(t[inside], [end])
        solution = solve_ivp(rate, (piece.begin, end), x, "DOP853", at, rtol=1e-13, atol=1e-15)
        found[:, inside], x = solution.y[:, : np.count_nonzero(inside)], solution.y[:, -1]
    return found


def names(found: Series, order: int) -> set[str]:
    return {str(s).split(": ")[1] for s in found.secular if s.order == order}


# ---------------------------------------------------------------------------------------------------- the algebra
def test_duffings_first_correction_is_the_textbooks() -> None:
    """x'' + x + ε x³ = 0 from rest at 1: x⁽¹⁾ = (cos 3t − cos t)/32 − ⅜ t sin t."""
    t = np.linspace(0.0, 40.0, 201)
    found = series(DUFFING, [1.0, 0.0], 1)
    x = found.physical(t)[:, 0]
    np.testing.assert_allclose(x[0], np.cos(t), atol=1e-13)
    np.testing.assert_allclose(x[1], (np.cos(3 * t) - np.cos(t)) / 32 - 0.375 * t * np.sin(t), atol=1e-12)
    assert names(found, 1) == {"λ_1 = 2 λ_1 + λ_2"}
    assert [s.coefficient for s in found.secular] == [pytest.approx(0.1875j)]  # ½ · ⅜ i


def test_van_der_pols_first_correction_has_no_secular_term_on_the_limit_cycle_only() -> None:
    """From rest at 2, x⁽¹⁾ = ¾ sin t − ¼ sin 3t; from rest at 1 the amplitude grows like ½ t (1 − ¼) cos t."""
    t = np.linspace(0.0, 30.0, 101)
    found = series(VAN_DER_POL, [2.0, 0.0], 1)
    np.testing.assert_allclose(found.physical(t)[1, 0], 0.75 * np.sin(t) - 0.25 * np.sin(3 * t), atol=1e-12)
    assert not found.secular
    grows = series(VAN_DER_POL, [1.0, 0.0], 1)
    assert names(grows, 1) == {"λ_1 = λ_1", "λ_1 = 2 λ_1 + λ_2"}
    assert sum(s.coefficient for s in grows.secular) == pytest.approx(0.5 * (0.5 - 0.125))


@pytest.mark.parametrize("frequency", [0.7, 2.0])
def test_mathieus_first_correction(frequency: float) -> None:
    """x'' + x = −ε x cos Ωt from rest at 1; in the main resonance, Ω = 2, it grows like ¼ t sin t."""
    t = np.linspace(0.0, 25.0, 101)
    found = series(MATHIEU, [1.0, 0.0], 1, harmonic([1.0], frequency))

    def driven(w: float) -> Any:  # x'' + x = −½ cos wt from rest at 0
        return -0.25 * t * np.sin(t) if abs(w) == 1.0 else -0.5 * (np.cos(w * t) - np.cos(t)) / (1.0 - w * w)

    expected = driven(1.0 + frequency) + driven(1.0 - frequency)
    np.testing.assert_allclose(found.physical(t)[1, 0], expected, atol=1e-12)
    assert names(found, 1) == ({"λ_1 = λ_2 + σ_1"} if frequency == 2.0 else set())


@pytest.mark.parametrize(
    ("stiffness", "expected"),
    [
        (9.0, {"λ_1 = 2 λ_1 + λ_3", "λ_2 = 3 λ_1"}),
        (1.0, {"λ_1 = 2 λ_1 + λ_3", "λ_2 = 2 λ_1 + λ_3"}),
        (7.0, {"λ_1 = 2 λ_1 + λ_3"}),
    ],
    ids=["1:3", "1:1", "none"],
)
def test_internal_resonances_show_themselves_by_name(stiffness: float, expected: set[str]) -> None:
    """Only the first oscillator is displaced: the second one gets a secular term in resonance, and only there."""
    assert names(series(pair(stiffness), [1.0, 0.0, 0.0, 0.0], 1), 1) == expected


@pytest.mark.parametrize(
    ("w", "expected"),
    [
        (harmonic([0.3], 0.7), {"λ_1 = 2 λ_1 + λ_2", "λ_1 = λ_1 + σ_1 + σ_2"}),
        (constant([0.3]), {"λ_1 = 2 λ_1 + λ_2", "λ_1 = λ_1 + 2 σ_1"}),
    ],
    ids=["sine", "constant"],
)
def test_waves_that_cancel_are_kept_in_the_name_of_what_they_make_grow(w: Signal, expected: set[str]) -> None:
    """Forced Duffing: the frequency of the free motion is shifted by itself and by the forced one."""
    form = standard_form(lambda z, w, s, c: [z[1], -z[0] - z[0] * z[0] * z[0] + w[0]], ["x", "v"], 1)
    found = series(form, [1.0, 0.0], 1, w)
    assert names(found, 1) == expected
    forced = 0.3 / (1.0 - 0.7**2) if len(w.pieces[0].exponents) > 1 else 0.3 * np.sqrt(2.0)
    drift = [s.coefficient for s in found.secular if "σ" in str(s)]
    free = (modes(form.A).K_inverse @ np.array([1.0 - (forced if len(w.pieces[0].exponents) > 1 else 0.3), 0.0]))[0]
    assert sum(drift) / free == pytest.approx(0.75j * forced**2, rel=1e-9)


def test_a_near_resonance_is_named_with_its_distance() -> None:
    named = [str(s) for s in series(pair(9.000001), [1.0, 0.0, 0.0, 0.0], 1).secular]
    assert any("λ_2 ≈ 3 λ_1 (apart by" in name for name in named)


# ---------------------------------------------------------------------------------------------------- truncation
BUMP = Signal((*harmonic([-0.8j], np.pi).pieces, Piece(1.0, np.zeros(0, complex), np.zeros((1, 0), complex))))


@pytest.mark.parametrize("order", [0, 1, 2, 3])
@pytest.mark.parametrize(
    ("form", "x0", "w"),
    [
        (DUFFING, [1.0, 0.5], NO_INPUT),
        (VAN_DER_POL, [1.0, 0.5], NO_INPUT),
        (MATHIEU, [1.0, 0.5], harmonic([1.0], 2.0)),
        (pair(9.0), [1.0, 0.3, 0.0, 0.5], NO_INPUT),
        (pair(1.0), [1.0, 0.3, 0.0, 0.5], NO_INPUT),
        (standard_form(forced_duffing, ["x", "x'"], 1), [0.5, 0.0], BUMP),
    ],
    ids=["Duffing", "van der Pol", "Mathieu", "1:3", "1:1", "Duffing on a bump"],
)
def test_the_truncation_error_is_of_the_next_order(form: StandardForm, x0: list[float], w: Signal, order: int) -> None:
    t = np.linspace(0.0, 3.0, 31)
    terms = series(form, x0, order, w).physical(t)

    def error(epsilon: float) -> float:
        return float(np.abs(partial_sums(terms, epsilon)[order] - integrated(form, epsilon, w, x0, t)).max())

    slope, bend = observed_order(error, [0.04, 0.02, 0.01])
    assert slope == pytest.approx(order + 1, abs=0.1)
    assert bend < 0.05


def test_a_forced_duffing_settles_where_harmonic_balance_says() -> None:
    """Against mousai: order k of the series errs like ε^(k+1) in the periodic motion."""
    import mousai

    form, omega = standard_form(forced_duffing, ["x", "x'"], 1), 1.3
    begin = 240.0  # the transient exp(−0.2 t) is gone
    terms = series(form, [0.0, 0.0], 2, harmonic([1.0], omega)).physical(begin + 2 * np.pi / omega * np.arange(41) / 41)

    def balance(epsilon: float) -> Any:
        def acceleration(x: Any, v: Any, params: dict[str, Any]) -> Any:
            drive = np.cos(omega * (params["cur_time"] + begin))
            return np.array([[-4.0 * x[0] - 0.4 * v[0] - epsilon * x[0] ** 3 + drive]])

        _, x, *_ = mousai.hb_time(
            acceleration, np.zeros((1, 41)), omega=omega, num_harmonics=20, f_tol=1e-12, params={}
        )
        return x[0]

    exact = {epsilon: balance(epsilon) for epsilon in (0.4, 0.2, 0.1)}
    for order in (0, 1, 2):

        def error(epsilon: float, order: int = order) -> float:
            return float(np.abs(partial_sums(terms[:, 0], epsilon)[order] - exact[epsilon]).max())

        slope, bend = observed_order(error, list(exact))
        assert slope == pytest.approx(order + 1, abs=0.1)
        assert bend < 0.05


# ---------------------------------------------------------------------------------------------------- any input
def test_the_quadrature_is_of_order_5_and_tends_to_the_exact_sums() -> None:
    form, w = car_form(Car(), order=3), road_signal(RoadParameters(tau0=0.02))
    linear = modes(form.A)
    t = np.linspace(0.0, 0.8, 2999)  # within steps
    exact = exact_series(form, linear, w, np.zeros(14), 1).physical(t)
    sizes = [0.005, 0.0025, 0.00125]  # with the corners of the road on edges
    grids = {H: np.linspace(0.0, 0.8, round(0.8 / H) + 1) for H in sizes}
    found = {H: sampled_series(form, linear, w, grid, np.zeros(14), 1).physical(t) for H, grid in grids.items()}
    for k in (0, 1):

        def error(H: float, k: int = k) -> float:
            return float(np.abs(found[H][k] - exact[k]).max())

        slope, bend = observed_order(error, sizes)
        assert slope == pytest.approx(5.0, abs=0.2)
        assert bend < 0.05
    assert np.abs(found[0.00125] - exact).max() < 1e-9 * np.abs(exact).max()


def test_the_first_order_of_cubics_is_exact_even_where_it_is_stiff() -> None:
    """x' = −λx + t³ in two steps of unequal length, λh up to 10⁴, where a Runge–Kutta method would blow up."""
    for rate in (1e-3, 1.0, 1e4):

        def lag(x: Sequence[Any], w: Sequence[Any], sine: Any, cosine: Any, rate: float = rate) -> Sequence[Any]:
            return [x[0] * -rate + w[0]]

        form = standard_form(lag, ["x"], 1)
        grid, t = np.array([0.0, 0.3, 1.0]), np.linspace(0.0, 1.0, 11)
        found = sampled_series(form, modes(form.A), lambda t: t[None] ** 3, grid, [1.0], 0).physical(t)[0, 0]
        exact = [
            float(
                mpmath.exp(-rate * s) + mpmath.mpf(s) ** 4 / 4 * mpmath.exp(-rate * s) * mpmath.hyp1f1(4, 5, rate * s)
            )
            for s in t.tolist()
        ]
        np.testing.assert_allclose(found, exact, rtol=1e-11)


def test_successive_terms_say_how_far_the_series_reaches() -> None:
    """x' = −x + ε x² from 1: x⁽ᵏ⁾ = e^(−t) (1 − e^(−t))ᵏ ≤ kᵏ/(k + 1)^(k+1), whose ratios tend to 1, ε's radius."""
    form = standard_form(lambda x, w, s, c: [-x[0] + x[0] * x[0]], ["x"], 0)
    t = np.linspace(0.0, 5.0, 20001)
    found = exact_series(form, modes(form.A), NO_INPUT, [1.0], 6)
    expected = np.exp(-t) * (1.0 - np.exp(-t)) ** np.arange(7)[:, None]
    np.testing.assert_allclose(found.physical(t)[:, 0], expected, atol=1e-12)
    sups = [k**k / (k + 1.0) ** (k + 1) for k in range(7)]
    np.testing.assert_allclose(successive_ratios(found.modal(t)), np.divide(sups[1:], sups[:-1]), rtol=1e-6)


# ---------------------------------------------------------------------------------------------------- the car
