"""The algebra of exponential polynomials: values, Duhamel integrals, accuracy near resonance."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad_vec

from analysis.errors import InputError
from analysis.methods.exponentials import Exponentials, forced_modes, time_scales
from analysis.methods.series import common_rates


def test_functions_add_multiply_and_map_like_arrays_of_their_values(rng: np.random.Generator) -> None:
    rates = rng.normal(size=4) * 0.3 + 1j * rng.normal(size=4)

    def random(terms: int) -> Exponentials:
        multiples = rng.integers([0, -2, -2, -2, -2], 3, (terms, 5))
        values = rng.normal(size=(terms, 3)) + 1j * rng.normal(size=(terms, 3))
        none = Exponentials(rates, multiples[:0], values[:0])
        return sum((Exponentials(rates, m[None], c[None]) for m, c in zip(multiples, values, strict=True)), none)

    f, g, s = random(40), random(7), np.linspace(0.0, 2.0, 9)
    matrix = rng.normal(size=(2, 3))
    np.testing.assert_allclose((f + g)(s), f(s) + g(s), rtol=1e-12)
    np.testing.assert_allclose((f * g)(s), f(s) * g(s), rtol=1e-10, atol=1e-10 * np.abs(f(s) * g(s)).max())
    np.testing.assert_allclose((matrix @ f)(s), matrix @ f(s), rtol=1e-12, atol=1e-12 * np.abs(f(s)).max())
    np.testing.assert_array_equal(f[[2, 0]](s), f(s)[[2, 0]])
    assert not len((f + (-np.eye(3)) @ f).multiples)  # equal sums are one term, and zeros none


def test_more_exponents_than_can_be_numbered_are_refused() -> None:
    f = Exponentials(np.ones(20, complex), np.diag([9] * 20 + [0])[:, :21], np.ones((21, 1), complex))
    with pytest.raises(InputError, match="lower order"):
        f * f


def test_a_forced_mode_is_its_duhamel_integral(rng: np.random.Generator) -> None:
    rates = np.array([-0.3 + 2.0j, -0.3 - 2.0j, 1.7j])
    multiples = np.array([[2, 1, 0, 0], [0, 1, 0, 0], [0, 2, 1, 0], [1, 0, 0, -1], [3, 0, 0, 1], [0, 0, 0, 0]])
    f = Exponentials(rates, multiples, rng.normal(size=(6, 2)) + 1j * rng.normal(size=(6, 2)))
    start = np.array([0.4 - 0.1j, 1.0 + 2.0j])
    xi, resonances = forced_modes(f, start)
    for s in (0.0, 0.7, 5.0):
        integral, _ = quad_vec(lambda u, s=s: np.exp(rates[:2] * (s - u)) * f(np.array([u]))[:, 0], 0.0, s, 1e-13)
        np.testing.assert_allclose(xi(np.array([s]))[:, 0], np.exp(rates[:2] * s) * start + integral, rtol=1e-11)
    assert {(r.mode, r.multiples, r.degree) for r in resonances} == {(0, (1, 0, 0), 0), (0, (1, 0, 0), 2)}


def test_a_constant_force_on_a_free_mass_is_a_power_of_time() -> None:
    """ξ' = s² from 1, λ = 0: no time scale at all."""
    f = Exponentials(np.zeros(1, complex), np.array([[2, 0]]), np.ones((1, 1), complex))
    xi, _ = forced_modes(f, np.ones(1, complex))
    np.testing.assert_allclose(xi(np.array([0.0, 3.0]))[0], [1.0, 10.0])


@pytest.mark.parametrize("eigenvalue", [-2.0 + 7.0j, -0.01 + 3.0j, 3.0j, 0.2 + 1.0j], ids=str)
@pytest.mark.parametrize("degree", [0, 2])
def test_near_resonance_loses_no_more_accuracy_than_is_said(eigenvalue: complex, degree: int) -> None:
    """∫ uʲ exp(δu) du = s^(j+1) M(j+1, j+2, δs)/(j+1), Kummer's function, for δ from round-off to λ itself."""
    kummer = np.vectorize(lambda z: complex(mpmath.hyp1f1(degree + 1, degree + 2, z)))
    scale = float(time_scales(np.array([eigenvalue]))[0])
    for last, allowed in ((3.0 / abs(eigenvalue), 1e-11 if degree == 0 else 1e-5), (10.0 * scale, 1e-9)):
        s = np.linspace(0.0, last, 13)
        for distance in 10.0 ** np.arange(-15.0, 0.5, 0.5) * abs(eigenvalue) * np.exp(2.0j):
            rates = np.array([eigenvalue, eigenvalue + distance])
            f = Exponentials(rates, np.array([[degree, 0, 1]]), np.ones((1, 1), complex))
            xi, _ = forced_modes(f, np.zeros(1, complex))
            integral = s ** (degree + 1) * kummer((rates[1] - rates[0]) * s) / (degree + 1)
            exact = np.exp(eigenvalue * s) * integral
            assert np.abs(xi(s)[0] - exact).max() < allowed * np.abs(exact).max(), distance


def test_exponents_in_a_rational_ratio_share_a_rate() -> None:
    exponents = np.array([2j, -2j, 3j, 0.0, -0.5 + 1j * np.sqrt(2.0), 6j])
    rates, multiples = common_rates(exponents)
    assert multiples.tolist() == [[2, 0, 0, 0], [0, 1, 0, 0], [3, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [6, 0, 0, 0]]
    np.testing.assert_allclose(multiples @ rates, exponents, rtol=1e-15)


# ---------------------------------------------------------------------------------------------------- closed forms
