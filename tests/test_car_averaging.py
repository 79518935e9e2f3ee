"""Averaging (3.18)–(3.20) of the seven-degree car: against Floquet exponents, quadrature and the corrected print."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from orders import observed_order

from analysis.audit import averaging as print_of
from analysis.audit.modal import printed_amplitude
from analysis.car import car_form, road_signal
from analysis.errors import InputError
from analysis.methods.amplitudes import stability
from analysis.methods.averaging import average, slow
from analysis.methods.floquet import floquet, rate_and_slope
from analysis.methods.modal_polynomials import linear_map
from analysis.methods.modes import modal, modes
from analysis.methods.signals import Piece, Signal, harmonic
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car


def sines(amplitudes: Sequence[float], omega: float, column: int) -> Signal:
    """w_column = Σ A_ν sin νωt, the car's other inputs 0."""
    waves = [harmonic(-1j * a * np.eye(8)[column], nu * omega).pieces[0] for nu, a in enumerate(amplitudes, start=1)]
    exponents = np.concatenate([wave.exponents for wave in waves])
    return Signal((Piece(0.0, exponents, np.concatenate([wave.amplitudes for wave in waves], axis=1)),))


def fourier_road(A: float, delay: float = 0.02) -> RoadParameters:
    """Two harmonics, all wheels, the right ones late."""
    return RoadParameters(profile="fourier", amplitudes=(A, 0.4 * A, *[0.0] * 6), Lambda=1.0, tau0=delay)


def test_the_cars_averaged_growth_rates_are_its_floquet_exponents() -> None:
    """C1: λ_k + A_k + B_k against those of the full equations' periodic motion: error O(A⁴); second order, O(A⁶)."""
    form, sizes = car_form(Car()), [0.03, 0.02, 0.0133]
    errors: dict[int, list[float]] = {1: [], 2: []}
    for A in sizes:
        piece = road_signal(RoadParameters(profile="sine", A=A)).pieces[-1]
        exact = floquet(form, piece).exponents
        for order, found in errors.items():
            equations = average(form, piece, order=order)
            found.append(float(np.abs(exact - equations.modes.eigenvalues - equations.linear).max()))
    for order, found in errors.items():
        slope, bend = observed_order(dict(zip(sizes, found, strict=True)).__getitem__, sizes)
        assert slope == pytest.approx(2.0 * order + 2.0, abs=0.1)  # measured: 4.005, 6.007
        assert bend < 0.02


@pytest.mark.parametrize(("column", "least"), [(0, 0.05), (2, 0.5)], ids=["front left wheel", "rear left wheel"])
def test_the_cars_averages_are_the_corrected_3_20(column: int, least: float) -> None:
    """One sine under one wheel: tensors of (3.14), P and ψ of (3.17), and the audit's formulas."""
    form, size, omega = car_form(Car(), order=3), 0.005, 7.85
    equations, m = average(form, sines((size,), omega, column).pieces[0]), modes(form.A)
    cubic, parametric = modal(form.terms[1][0], m, 8)[:2]
    P, psi = printed_amplitude(m.eigenvalues, size * m.input(form.B)[:, column], omega)
    half = 0.02 * np.exp(1j * np.arange(7))
    s = np.concatenate([half, half.conj()])
    x = print_of.Textbook(m.beta, omega, cubic, P, psi, np.zeros((14, 14), complex), size * parametric[..., column], s)
    A, B = print_of.A_corrected(x.alpha_bar, P, psi), print_of.B_corrected(x)
    np.testing.assert_allclose(equations.linear, A + B, rtol=1e-9)
    expected = s * (m.eigenvalues.real + A + B + print_of.pair_sum(x, halved=True))
    np.testing.assert_allclose(equations.rate(0.0, s), expected, rtol=1e-9)
    assert print_of.missed(A, print_of.A_printed(x.alpha_bar, P)) > least
    assert (np.abs(B).max() > 0.0) == (column == 2)  # of a front wheel B is 0


def test_averages_in_closed_form_are_what_quadrature_gives() -> None:
    """Two sines; (1/T) ∫ over 200 s of exp(−iβ_k t) Φ_k, s_k kept fixed, weighted by a bump, which speeds the limit."""
    form, rng = car_form(Car(), order=3), np.random.default_rng(3)
    equations = average(form, sines((0.005, 0.002), 6.0, 2).pieces[0])
    m, w = equations.modes, equations.waves
    half = 0.02 * (rng.normal(size=7) + 1j * rng.normal(size=7))
    s = np.concatenate([half, half.conj()])
    part = (np.arange(32000) + 0.5) / 32000
    t, weight = 200.0 * part, np.exp(-1.0 / (part * (1.0 - part)))
    turns = np.exp(1j * np.multiply.outer(m.beta, t))
    Phi = form.terms[1][0](linear_map(m, w) @ np.concatenate([s[:, None] * turns, w.at(t)]))
    found = (np.conj(turns) * (m.K_inverse @ Phi)) @ (weight / weight.sum())
    expected = equations.rate(0.0, s) - m.alpha * s
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def test_the_condition_speaks_of_roads_no_higher_than_averaging_describes() -> None:
    """Where the formula's own zero lies (92 times the road) it says nothing of the car; where it ends it does."""
    form, piece = car_form(Car()), road_signal(RoadParameters(profile="sine")).pieces[-1]
    found = stability(average(form, piece))
    assert found.margin > 0.0 and 10.0 < found.valid_scale < 20.0 < 80.0 < found.critical_scale.min()
    assert found.lost == f"not lost up to {found.valid_scale:.3g} times this input, where averaging ends"
    there = Piece(piece.begin, piece.exponents, found.valid_scale * piece.amplitudes)
    equations, exact = average(form, there), floquet(form, there).exponents.real
    alpha = equations.modes.alpha
    error = np.abs(stability(equations).growth - exact).max()
    assert error < 0.1 * np.abs(exact - alpha).max()  # measured: 0.046
    assert np.all(exact < 0.0)


def test_where_amplitudes_are_coupled_the_condition_bounds_what_floquet_gives() -> None:
    """Modes that do not oscillate have equal frequencies; a road that meets mode 7 couples s_7 and its conjugate."""
    creeping = Car(b1=12000.0, b2=12000.0), RoadParameters(profile="sine", A=0.03)
    resonant = Car(), RoadParameters(profile="sine", A=0.03, v0=12.75404)
    for car, road in (creeping, resonant):
        form, piece = car_form(car), road_signal(road).pieces[-1]
        m = modes(form.A)
        found = stability(average(form, piece, detuning=slow(m)))
        assert floquet(form, piece).exponents.real.max() <= found.growth.max() < 0.0
        high = Piece(piece.begin, piece.exponents, 200.0 * piece.amplitudes)
        with pytest.raises(InputError, match="no linear term but"):
            stability(average(form, high, detuning=slow(m)))


def test_slopes_of_the_full_equations_are_exact() -> None:
    form, x = car_form(Car()), np.linspace(-0.2, 0.3, 14)
    w = np.linspace(0.01, 0.08, 8)
    value, slope = rate_and_slope(form, x, w)
    np.testing.assert_allclose(value, form.rate(x, w), rtol=1e-14)
    h = 1e-6
    central = [(form.rate(x + h * e, w) - form.rate(x - h * e, w)) / (2.0 * h) for e in np.eye(14)]
    np.testing.assert_allclose(slope, np.array(central).T, atol=1e-7 * np.abs(slope).max())
