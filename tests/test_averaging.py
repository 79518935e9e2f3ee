"""Averaging (3.18)–(3.20): textbook systems with closed forms, tight integrations, harmonic balance; then the car."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from orders import observed_order
from scipy.optimize import brentq
from scipy.special import ellipk

from analysis.errors import InputError
from analysis.methods.amplitudes import equilibria, left_out, stability, steady_states
from analysis.methods.averaging import AmplitudeEquations, average
from analysis.methods.floquet import floquet, period_of
from analysis.methods.nonlinear_response import nonlinear_response
from analysis.methods.signals import Piece, Signal, harmonic
from analysis.methods.standard_form import StandardForm, standard_form

EPSILONS = [0.08, 0.04, 0.02, 0.01]


def oscillator(
    force: Callable[[Any, Any, Any], Any], inputs: int = 0, order: int = 3, omega: float = 1.0
) -> StandardForm:
    """x'' + ω² x = force(x, x', w)."""
    return standard_form(
        lambda x, w, s, c: [x[1], x[0] * -(omega**2) + force(x[0], x[1], w)], ["x", "x'"], inputs, order=order
    )


def duffing(eps: float, damping: float = 0.0, inputs: int = 0) -> StandardForm:
    return oscillator(lambda x, v, w: -eps * x * x * x - damping * v + (w[0] if inputs else 0.0), inputs)


def van_der_pol(eps: float) -> StandardForm:
    return oscillator(lambda x, v, w: eps * v - eps * x * x * v)


def mathieu(eps: float) -> StandardForm:
    """x'' + (1 + ε w) x = 0."""
    return oscillator(lambda x, v, w: -eps * x * w[0], 1)


def pair(eps: float, ratio: float, damping: float = 0.0) -> StandardForm:
    """Two oscillators, 1 and ratio [rad/s], in the potential ε (x⁴/4 + x³ y/3 + x² y²/2)."""

    def equations(z: Sequence[Any], w: Sequence[Any], s: Any, c: Any) -> Sequence[Any]:
        x, y, dx, dy = z
        force = eps * (x * x * x + x * x * y + x * y * y)
        return [dx, dy, -x - damping * dx - force, -(ratio**2) * y - damping * dy - eps * (x * x * x / 3.0 + x * x * y)]

    return standard_form(equations, ["x", "y", "x'", "y'"], 0)


def sup_error(
    form: StandardForm, equations: AmplitudeEquations, x0: Sequence[float], end: float, w: Signal | None = None
) -> float:
    """Of the averaged motion over [0, end] against a tight integration."""
    t = np.linspace(0.0, end, 400)
    s = equations.solve(equations.amplitudes(np.array(x0)), t, rtol=1e-11)
    return float(np.abs(equations.states(s, t) - nonlinear_response(form, x0, w, t)).max())


def frequency(equations: AmplitudeEquations, r: float) -> complex:
    """Growth + i frequency of the oscillation with |s_1| = r."""
    return complex(equations.rate(0.0, np.array([r, r], complex))[0] / r + 1j * equations.modes.beta[0])


# ---------------------------------------------------------------------------------------------------- closed forms
def test_duffings_frequency_is_the_textbooks() -> None:
    """ω = 1 + (3/8) ε a², a = 2|s|."""
    equations = average(duffing(0.1))
    assert frequency(equations, 0.5) == pytest.approx(1j * (1.0 + 3.0 / 8.0 * 0.1), abs=1e-14)


@pytest.mark.parametrize(("order", "expected"), [(1, 2.0), (2, 3.0)])
def test_duffings_frequency_against_the_elliptic_integral(order: int, expected: float) -> None:
    def error(eps: float) -> float:
        equations = average(duffing(eps), order=order)
        r = abs(equations.amplitudes(np.array([1.0, 0.0]))[0])
        exact = np.pi * np.sqrt(1.0 + eps) / 2.0 / ellipk(eps / 2.0 / (1.0 + eps))
        return abs(frequency(equations, r).imag - exact)

    slope, bend = observed_order(error, EPSILONS)
    assert slope == pytest.approx(expected, abs=0.1 if order == 2 else 0.3)  # measured: 2.2 (a is not x(0)), 2.9
    assert bend < 0.05


def test_a_quadratic_spring_has_no_first_order_and_the_textbooks_second() -> None:
    """x'' + x + ε x² = 0: ω = 1 − (5/12) ε² a²."""
    form = oscillator(lambda x, v, w: -0.05 * x * x)
    assert frequency(average(form), 0.5) == pytest.approx(1j, abs=1e-14)
    assert frequency(average(form, order=2), 0.5).imag - 1.0 == pytest.approx(-5.0 / 12.0 * 0.05**2, rel=1e-12)


def test_van_der_pols_limit_cycle() -> None:
    """|s| = 1 (a = 2), stable; rest is not; ω = 1 − ε²/16 + O(ε⁴)."""
    rest, cycle = equilibria(average(van_der_pol(0.01)))
    assert not rest.stable and rest.growth[0] == pytest.approx(0.005)
    assert cycle.stable and cycle.amplitudes[0] == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(stability(average(van_der_pol(0.01))).critical_amplitude, cycle.amplitudes[0], rtol=1e-9)

    def error(eps: float) -> float:
        equations = average(van_der_pol(eps), order=2)
        r = brentq(lambda r: frequency(equations, r).real, 0.5, 2.0, xtol=1e-15)
        return abs(frequency(equations, r).imag - (1.0 - eps**2 / 16.0))

    slope, bend = observed_order(error, [0.2, 0.1, 0.05])
    assert slope == pytest.approx(4.0, abs=0.1) and bend < 0.05


def test_mathieus_principal_resonance() -> None:
    """x'' + (1 + ε cos 2t) x = 0 grows like exp(ε t/4): against the multipliers of the full equation."""

    def error(eps: float) -> float:
        form, drive = mathieu(eps), harmonic([1.0], 2.0)
        equations = average(form, drive.pieces[0], detuning=0.1)
        columns = [equations.rate(0.0, np.array([s, s.conjugate()]))[0] for s in (1.0 + 0j, 1j)]
        growth = np.linalg.eigvals(np.array([[c.real for c in columns], [c.imag for c in columns]])).real.max()
        assert growth == pytest.approx(eps / 4.0, rel=1e-12)
        ends = [nonlinear_response(form, x0, drive, np.array([0.0, np.pi]))[:, -1] for x0 in ([1.0, 0.0], [0.0, 1.0])]
        return float(abs(growth - np.log(np.abs(np.linalg.eigvals(np.array(ends)))).max() / np.pi))

    slope, bend = observed_order(error, [0.4, 0.2, 0.1])
    assert slope == pytest.approx(3.0, abs=0.1) and bend < 0.05  # measured: 2.99; even powers of ε do not occur


def test_the_input_at_which_the_condition_is_lost_is_that_at_which_floquet_exponents_cross_zero() -> None:
    """x'' + 0.02 x' + x = 0.1 w² x', w = κ cos 3t: α = −0.01 + 0.025 κ²."""
    form = oscillator(lambda x, v, w: -0.02 * v + 0.1 * w[0] * w[0] * v, 1)
    found = stability(average(form, harmonic([1.0], 3.0).pieces[0]))
    assert found.critical_scale.min() == pytest.approx(np.sqrt(0.4), rel=1e-9) and found.critical_scale.min() < 0.8
    assert found.valid_scale > found.critical_scale.min() and found.lost == "lost at 0.632 times this input"
    exact = brentq(lambda k: floquet(form, harmonic([k], 3.0).pieces[0]).exponents.real.max(), 0.5, 0.8, xtol=1e-6)
    assert found.critical_scale.min() == pytest.approx(exact, rel=1e-3)


def test_in_a_parametric_resonance_the_condition_counts_what_couples_an_amplitude_to_its_conjugate() -> None:
    """x'' + 0.02 x' + (1 + ε cos 2t) x = 0 grows like exp((ε/4 − 0.01) t): lost at ε = 0.04; beyond, not decided."""

    def of(eps: float) -> AmplitudeEquations:
        form = oscillator(lambda x, v, w: -0.02 * v - x * w[0], 1)
        return average(form, harmonic([eps], 2.0).pieces[0], detuning=0.005)

    found = stability(of(0.02))
    np.testing.assert_allclose(found.growth, -0.005, rtol=1e-3)
    np.testing.assert_allclose(found.critical_scale, 2.0, rtol=1e-3)
    assert found.lost == "lost at 2 times this input"
    with pytest.raises(InputError, match="got s_2 in s_1', s_1 in s_2'"):
        stability(of(0.05))


def test_up_to_which_amplitude_averaging_describes_is_told_from_what_it_takes_out() -> None:
    """Duffing: W has u³, u u*², u*³ with sizes ε (1/4 + 3/4 + 1/8) |s|³, a tenth of |s| at |s|² = 0.1/(1.125 ε)."""
    equations = average(duffing(0.2))
    reach = stability(equations).valid_amplitudes
    np.testing.assert_allclose(reach, np.sqrt(0.1 / 1.125 / 0.2), rtol=1e-9)
    assert left_out(equations, reach.astype(complex)) == pytest.approx(0.1 * reach[0], rel=1e-9)
    assert stability(average(van_der_pol(0.01))).valid_amplitudes[0] > 1.0


# ---------------------------------------------------------------------------------------------------- the remainder
@pytest.mark.parametrize(
    ("form_of", "x0", "near"),
    [
        (duffing, [1.0, 0.0], 0.0),
        (van_der_pol, [0.5, 0.0], 0.0),
        (lambda eps: pair(eps, np.sqrt(2.0)), [1.0, 0.7, 0.0, 0.0], 0.0),
        (lambda eps: pair(eps, 3.0 + eps), [1.0, 0.7, 0.0, 0.0], 6.0),
        (lambda eps: pair(eps, 1.0 + eps), [1.0, 0.7, 0.0, 0.0], 6.0),
    ],
    ids=["Duffing", "van der Pol", "pair", "pair 1:3", "pair 1:1"],
)
@pytest.mark.parametrize("order", [1, 2])
def test_the_averaged_motion_is_right_to_order_eps_for_times_up_to_one_over_eps(
    form_of: Callable[[float], StandardForm], x0: list[float], near: float, order: int
) -> None:
    def error(eps: float) -> float:
        form = form_of(eps)
        return sup_error(form, average(form, order=order, detuning=near * eps), x0, 1.0 / eps)

    slope, bend = observed_order(error, EPSILONS)
    assert slope == pytest.approx(order, abs=0.15)
    assert bend < 0.1


@pytest.mark.parametrize("order", [1, 2])
def test_so_is_that_of_mathieus_equation_near_its_principal_resonance(order: int) -> None:
    def error(eps: float) -> float:
        form, drive = mathieu(eps), harmonic([1.0], 2.0 + eps)
        equations = average(form, drive.pieces[0], order=order, detuning=6.0 * eps)
        return sup_error(form, equations, [1.0, 0.5], 1.0 / eps, drive)

    slope, bend = observed_order(error, EPSILONS)
    assert slope == pytest.approx(order, abs=0.15)
    assert bend < 0.1


def test_in_second_order_a_term_that_was_kept_and_one_that_was_taken_out_can_be_slow_together() -> None:
    """Two waves a little apart, one within the detuning and one beyond: −DW·N counts; without it the slope is 1."""
    one, two = harmonic([1.0], 2.499).pieces[0], harmonic([1.0], 2.501).pieces[0]
    both = Piece(0.0, np.concatenate([one.exponents, two.exponents]), np.hstack([one.amplitudes, two.amplitudes]))

    def error(eps: float) -> float:
        form = mathieu(eps)
        return sup_error(form, average(form, both, order=2, detuning=0.5), [1.0, 0.5], 1.0 / eps, Signal((both,)))

    slope, bend = observed_order(error, EPSILONS)
    assert slope == pytest.approx(2.0, abs=0.15)
    assert bend < 0.1


def test_beyond_one_over_eps_the_phase_is_lost_but_a_limit_cycle_is_not() -> None:
    """At t = 1/ε² the undamped Duffing's phase is off by O(1); van der Pol's amplitude stays right."""

    def late(form_of: Callable[[float], StandardForm], eps: float) -> tuple[float, float]:
        form = form_of(eps)
        equations, t = average(form), np.linspace(0.0, 1.0 / eps**2, 6)[-2:]
        t = np.concatenate([[0.0], np.linspace(t[-1] - 10.0, t[-1], 200)])
        s = equations.solve(equations.amplitudes(np.array([1.0, 0.0])), t)
        x, exact = equations.states(s, t), nonlinear_response(form, [1.0, 0.0], None, t)
        size = np.abs(x[0, 1:]).max() - np.abs(exact[0, 1:]).max()
        return float(np.abs(x - exact)[:, 1:].max()), abs(float(size))

    slope, _ = observed_order(lambda eps: late(duffing, eps)[0], [0.1, 0.05])
    assert abs(slope) < 0.3  # measured: no longer falls with ε
    slope, _ = observed_order(lambda eps: late(van_der_pol, eps)[1], [0.2, 0.1, 0.05])
    assert slope > 0.9


def test_without_its_resonant_terms_the_pair_1_to_3_is_wrong_by_order_one() -> None:
    def error(eps: float) -> float:
        form = pair(eps, 3.0 + eps)
        return sup_error(form, average(form, detuning=0.0), [1.0, 0.7, 0.0, 0.0], 1.0 / eps)

    slope, _ = observed_order(error, EPSILONS)
    assert slope < 0.2


# ---------------------------------------------------------------------------------------------------- equilibria
def test_equilibria_of_two_modes_are_zeros_of_the_amplitude_equations_and_their_growth_its_derivative() -> None:
    def coupled(z: Sequence[Any], w: Sequence[Any], s: Any, c: Any) -> Sequence[Any]:
        x, y, dx, dy = z
        size = x * x + 0.6 * y * y
        return [dx, dy, -x + 0.1 * dx - 0.2 * dx * size, -2.0 * y + 0.1 * dy - 0.25 * dy * size]

    equations = average(standard_form(coupled, ["x", "y", "x'", "y'"], 0))
    found = equilibria(equations)
    assert len(found) == 4
    for e in found:
        s = np.concatenate([e.amplitudes, e.amplitudes]).astype(complex)
        rate = equations.rate(0.0, s)
        np.testing.assert_allclose(rate.real, 0.0, atol=1e-14)
        h, half = 1e-6, len(e.amplitudes)
        slopes = []
        for k in range(half):
            step = np.zeros(2 * half, complex)
            step[[k, k + half]] = h
            slopes.append((equations.rate(0.0, s + step) - equations.rate(0.0, s - step)).real[:half] / 2.0 / h)
        np.testing.assert_allclose(
            np.sort(np.linalg.eigvals(np.array(slopes).T).real), np.sort(e.growth.real), atol=1e-8
        )
    assert sum(e.stable for e in found) >= 1


def test_equilibria_refuse_what_they_do_not_cover() -> None:
    with pytest.raises(InputError, match="use steady_states"):
        equilibria(average(pair(0.1, 3.0), detuning=0.1))


@dataclass(frozen=True)
class Steady:
    """A system, its input, the frequency of its steady motion, and q'' (q, q', w) for harmonic balance."""

    form: StandardForm
    force: float  # of w = force · cos(Ω t)
    Omega: float
    omega: float
    accelerations: Callable[[Any, Any, Any], list[Any]]
    modes: int = 1


def second_order(accelerations: Callable[[Any, Any, Any], list[Any]], modes: int = 1) -> StandardForm:
    """Of q'' = accelerations(q, q', w)."""
    names = [f"q{k}" for k in range(modes)] + [f"v{k}" for k in range(modes)]
    return standard_form(
        lambda z, w, s, c: [*z[modes:], *accelerations(z[:modes], z[modes:], w[0])], names, 1, powers={1: 0, 2: 1, 3: 1}
    )


def forced_duffing(eps: float, primary: bool) -> Steady:
    """In primary resonance with weak, in 3:1 with strong forcing."""
    omega = 1.0 + eps * 0.5 if primary else (1.0 + eps * 0.4) / 3.0

    def q(x: Any, v: Any, w: Any) -> list[Any]:
        return [-x[0] - eps * x[0] * x[0] * x[0] - 0.2 * eps * v[0] + w]

    return Steady(second_order(q), eps * 0.3 if primary else 0.6, omega, omega, q)


def forced_van_der_pol(eps: float) -> Steady:
    """Its limit cycle locked to the force."""

    def q(x: Any, v: Any, w: Any) -> list[Any]:
        return [-x[0] + eps * v[0] - eps * x[0] * x[0] * v[0] + w]

    return Steady(second_order(q), eps, 1.0 + 0.1 * eps, 1.0 + 0.1 * eps, q)


def mathieu_with_a_cubic_spring(eps: float) -> Steady:
    """In the principal resonance: half the frequency of the excitation."""

    def q(x: Any, v: Any, w: Any) -> list[Any]:
        return [-x[0] - eps * x[0] * w - 0.2 * eps * v[0] - eps * x[0] * x[0] * x[0]]

    return Steady(second_order(q), 1.0, 2.0 + 0.2 * eps, 1.0 + 0.1 * eps, q)


def forced_pair(eps: float, ratio: float) -> Steady:
    """The pair of `pair`, damped, the first oscillator forced near its resonance, the second nearly at ratio : 1."""
    omega = 1.0 + 0.3 * eps

    def q(z: Any, v: Any, w: Any) -> list[Any]:
        x, y = z
        first = -x - 0.4 * eps * v[0] - eps * (x * x * x + x * x * y + x * y * y) + w
        return [first, y * -((ratio + eps) ** 2) - 0.4 * eps * v[1] - eps * (x * x * x * (1.0 / 3.0) + x * x * y)]

    return Steady(second_order(q, 2), 0.4 * eps, omega, omega, q, 2)


STEADY: dict[str, Callable[[float], Steady]] = {
    "Duffing, primary": lambda eps: forced_duffing(eps, True),
    "Duffing, superharmonic": lambda eps: forced_duffing(eps, False),
    "van der Pol, locked": forced_van_der_pol,
    "Mathieu, subharmonic": mathieu_with_a_cubic_spring,
    "pair 1:3": lambda eps: forced_pair(eps, 3.0),
    "pair 1:1": lambda eps: forced_pair(eps, 1.0),
}


@pytest.mark.parametrize("name", STEADY)
def test_steady_motions_against_harmonic_balance_of_a_third_party(name: str) -> None:
    """Stable steady motions, of one mode or two locked to the input and each other: slope in ε."""
    import mousai

    n = 9

    def error(eps: float) -> float:
        case = STEADY[name](eps)
        equations = average(case.form, harmonic([case.force], case.Omega).pieces[0], detuning=3.0 * eps)
        rng = np.random.default_rng(5)
        starts = [rng.uniform(0.1, 1.2, case.modes) * np.exp(2j * np.pi * rng.random(case.modes)) for _ in range(40)]
        states = steady_states(equations, starts)
        moving = [(S, d) for S, growth, d in states if growth.real.max() < 0.0 and abs(S[0]) > 0.02]
        S, delta = min(moving, key=lambda state: abs(state[0][0]))
        t = np.linspace(0.0, 2.0 * np.pi / case.omega, 2 * n + 1, endpoint=False)
        mine = equations.states(S[:, None] * np.exp(1j * np.multiply.outer(delta, t)), t)[: case.modes]
        assert np.abs(mine).max(axis=1).min() > 0.02  # both move

        def acceleration(x: Any, v: Any, params: dict[str, float]) -> Any:
            w = case.force * np.cos(case.Omega * params["cur_time"])
            return np.array(case.accelerations(x.ravel(), v.ravel(), w)).reshape(case.modes, 1)

        _, x, e, *_ = mousai.hb_time(
            acceleration, mine, case.omega, num_harmonics=n, num_variables=case.modes, f_tol=1e-10
        )
        assert np.abs(e).max() < 1e-9
        return float(np.abs(mine - x).max())

    slope, bend = observed_order(error, [0.08, 0.04, 0.02])
    assert slope == pytest.approx(1.0, abs=0.15)
    assert bend < 0.1


# ---------------------------------------------------------------------------------------------------- refusals
def test_bad_input_is_refused() -> None:
    form = duffing(0.1, inputs=1)
    with pytest.raises(InputError, match="waves that last"):
        average(form, Piece(0.0, np.array([-1.0 + 1j]), np.ones((1, 1), complex)))
    with pytest.raises(InputError, match="order 1 or 2"):
        average(form, order=3)
    with pytest.raises(InputError, match="no common part"):
        period_of(Piece(0.0, 1j * np.array([1.0, np.sqrt(2.0)]), np.ones((1, 2), complex)))
