"""Modes: eigenvalues, modal matrix, their order and normalisation."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.car import car_form
from analysis.errors import InputError
from analysis.modes import modes
from fmu_src.vehicle.parameters import Car


@pytest.mark.parametrize("car", [Car(), Car(b1=8000.0), Car(b1=0.0, b2=0.0)], ids=["default", "overdamped", "undamped"])
def test_the_modal_matrix_makes_a_diagonal_in_the_papers_order(car: Car) -> None:
    A = car_form(car, order=1).A
    found = modes(A)
    np.testing.assert_allclose(found.K_inverse @ A @ found.K, np.diag(found.eigenvalues), atol=1e-10 * np.abs(A).max())
    oscillating = found.beta[:7] > 0
    np.testing.assert_array_equal(found.eigenvalues[7:][oscillating], found.eigenvalues[:7][oscillating].conj())
    assert (np.diff(found.beta[:7][oscillating]) >= 0).all()
    np.testing.assert_allclose(np.abs(found.K[:7]).max(axis=0), 1.0)
    np.testing.assert_allclose(found.K[7:], found.K[:7] * found.eigenvalues, atol=1e-9 * np.abs(found.K).max())


def test_an_oscillator_has_the_textbooks_frequency_and_damping() -> None:
    found = modes(np.array([[0.0, 1.0], [-25.0, -2.0]]))
    np.testing.assert_allclose(found.eigenvalues, [-1 + 1j * np.sqrt(24), -1 - 1j * np.sqrt(24)])
    np.testing.assert_allclose(found.damping_ratios, 0.2)


def test_a_defective_matrix_is_refused() -> None:
    with pytest.raises(InputError, match="no full set of eigenvectors"):
        modes(np.array([[0.0, 1.0], [-1.0, -2.0]]))
