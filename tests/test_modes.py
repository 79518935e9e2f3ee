"""Modes: eigenvalues and their enclosures, modal matrix, (3.14), and what moves in the car's seven modes."""

from __future__ import annotations

import json
import math
import re
from fractions import Fraction
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from test_standard_form import duffing, pendulum

from analysis import mode_drawing
from analysis.__main__ import main
from analysis.car import car_form, exact_A, road_signal
from analysis.car_modes import MOTIONS, car_modes, energy_shares
from analysis.energy import kinetic_energy
from analysis.errors import InputError
from analysis.methods.linear_response import periodic_response
from analysis.methods.modes import Enclosures, enclosures, modal, modes
from analysis.methods.standard_form import standard_form
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.linear import extensions, wheel_heights
from fmu_src.vehicle.parameters import Car

UNEVEN = Car(bp1=150.0, bp2=170.0, Jz=700.0, m11=31.0)


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


def test_two_equal_oscillators_keep_two_modes() -> None:
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    found = modes(A)
    np.testing.assert_allclose(found.eigenvalues, [1j, 1j, -1j, -1j], atol=1e-15)
    np.testing.assert_allclose(found.K @ np.diag(found.eigenvalues) @ found.K_inverse, A, atol=1e-15)


def test_a_defective_matrix_is_refused() -> None:
    with pytest.raises(InputError, match="no full set of eigenvectors"):
        modes(np.array([[0.0, 1.0], [-1.0, -2.0]]))


# ---------------------------------------------------------------------------------------------------- enclosures
def test_discs_hold_eigenvalues_that_are_known_exactly() -> None:
    """A companion matrix with the roots −1, −2, −3, and another with −1/3 ± i/3."""
    found = enclosures([[0, 1, 0], [0, 0, 1], [-6, -11, -6]], np.array([-3.001, -0.999, -2.0 + 0.01j]))
    assert np.all(np.abs(found.centres - [-3.0, -1.0, -2.0]) <= found.radii)
    assert np.all(found.radii < 1e-15)
    assert -1.0 <= found.abscissa < -1.0 + 1e-14
    assert 1.0 - 1e-13 < found.gap <= 1.0
    thirds = enclosures([[Fraction(-1, 3), Fraction(-1, 3)], [Fraction(1, 3), Fraction(-1, 3)]], np.array([1j, -1j]))
    exact = (Fraction(-1, 3), Fraction(1, 3))  # which no double is
    for value, radius, sign in zip(thirds.centres, thirds.radii, (1, -1), strict=True):
        away = (Fraction(value.real) - exact[0]) ** 2 + (Fraction(value.imag) - sign * exact[1]) ** 2
        assert 0 < away <= Fraction(radius) ** 2


def test_eigenvalues_that_coincide_are_refused() -> None:
    with pytest.raises(InputError, match="do not tell apart"):
        enclosures(np.array([[0.0, 1.0], [-1.0, -2.0]]), np.array([-1.0, -1.0]))


def test_discs_that_touch_leave_no_gap() -> None:
    assert Enclosures(np.array([0.0j, 1.0]), np.array([0.5, 0.5])).gap < 0.0
    assert Enclosures(np.array([0.0j, 1.0]), np.array([0.5, 0.5])).touching == 1
    assert Enclosures(np.array([0.0j, 1.0]), np.array([0.4, 0.5])).touching == 0


def test_the_abscissa_counts_the_radius_of_every_disc() -> None:
    """A wide disc may reach further right than the one whose centre is furthest right; and rounding is to the right."""
    wide = Enclosures(np.array([-3.0 + 1.0j, -1.0, -3.0 - 1.0j]), np.array([2.5, 0.25, 2.5]))
    assert -0.5 < wide.abscissa < -0.5 + 1e-15
    assert Enclosures(np.array([-1.0 + 0.0j]), np.array([1.0])).abscissa > 0.0  # not proved to be stable
    third, tenth = 1.0 / 3.0, 0.1
    rounded = Enclosures(np.array([-third + 0.0j]), np.array([tenth])).abscissa
    assert Fraction(rounded) >= Fraction(-third) + Fraction(tenth)


@pytest.mark.parametrize("car", [Car(), UNEVEN, Car(b1=8000.0), Car(b1=0.0, b2=0.0)])
def test_the_cars_eigenvalues_lie_in_their_discs(car: Car) -> None:
    """The discs are proved from the exact parameters; the usual eigenvalues, of a rounded A, are near their centres."""
    A, found = exact_A(car), car_modes(car)
    np.testing.assert_allclose(np.array(A, float), car_form(car, order=1).A, rtol=1e-14, atol=1e-12)
    assert np.all(found.discs.radii < 1e-13)
    np.testing.assert_allclose(found.discs.centres, found.modes.eigenvalues, atol=1e-9)
    if car.b1:
        assert found.discs.abscissa < -1.0
        assert found.discs.touching == 0
    else:
        assert 0.0 <= found.discs.abscissa < 1e-13  # an undamped car is not proved to be damped
    trace = sum((A[i][i] for i in range(14)), Fraction(0))
    total = sum((Fraction(value.real) for value in found.discs.centres), Fraction(0))
    assert abs(total - trace) <= sum((Fraction(radius) for radius in found.discs.radii), Fraction(0))


# ---------------------------------------------------------------------------------------------------- (3.13), (3.14)
def test_the_cubic_terms_of_duffing_in_modal_coordinates() -> None:
    """x'' + 0.3 x' + 4 x + x³ = w: K⁻¹ has the second column ∓1/(2iβ), so α_1jkl = i/(2β) for all jkl."""
    form = standard_form(duffing, ["x", "x'"], 1)
    found = modes(form.A)
    alpha, *excited = modal(form.terms[1][0], found, 1)
    beta = math.sqrt(4.0 - 0.15**2)
    np.testing.assert_allclose(alpha[0], np.full((2, 2, 2), 0.5j / beta), rtol=1e-12)
    np.testing.assert_allclose(alpha[1], np.full((2, 2, 2), -0.5j / beta), rtol=1e-12)
    assert all(not part.any() for part in excited)
    np.testing.assert_allclose(found.input(form.B)[:, 0], [-0.5j / beta, 0.5j / beta], rtol=1e-12)


def test_the_parametric_terms_of_a_pendulum_on_a_moving_support() -> None:
    """θ'' + 9.81 sin θ + w_up sin θ + w_across cos θ = 0, undamped: the products ξ w have one input, ξ ξ w two ξ."""
    form = standard_form(pendulum, ["theta", "theta'"], 2, order=3)
    found, omega = modes(form.A), math.sqrt(9.81)
    quadratic, cubic = (modal(form.terms[power][0], found, 2) for power in (1, 2))
    np.testing.assert_allclose(quadratic[1][0, :, 1], np.full(2, 0.5j / omega), rtol=1e-12)  # −θ w_up
    assert not quadratic[0].any() and not quadratic[1][..., 0].any() and not quadratic[2].any()
    np.testing.assert_allclose(cubic[0][0], np.full((2, 2, 2), 9.81 / 6.0 * -0.5j / omega), rtol=1e-12)
    np.testing.assert_allclose(cubic[1][0, :, :, 0], np.full((2, 2), 0.5 * -0.5j / omega), rtol=1e-12)  # θ² w_across/2


def test_modal_coordinates_carry_the_cubic_terms_of_the_car() -> None:
    """Σ_r a_r ξ … w … = K⁻¹ Φ(K ξ, w) for any complex ξ, and each a_r is symmetric."""
    form = car_form(UNEVEN, order=3)
    found, rng = modes(form.A), np.random.default_rng(2)
    xi, w = rng.uniform(-1, 1, 14) + 1j * rng.uniform(-1, 1, 14), rng.uniform(-1, 1, 8)
    parts = modal(form.terms[1][0], found, 8)
    assert [part.shape for part in parts] == [(14,) * 4, (14, 14, 14, 8), (14, 14, 8, 8), (14, 8, 8, 8)]
    total = np.einsum("ijkl,j,k,l", parts[0], xi, xi, xi) + np.einsum("ijkl,j,k,l", parts[1], xi, xi, w)
    assert not parts[2].any() and not parts[3].any()  # P has one h and two q
    expected = found.K_inverse @ form.Phi(found.K @ xi, w)
    np.testing.assert_allclose(total, expected, atol=1e-11 * np.abs(expected).max())
    scale = np.abs(parts[0]).max()
    np.testing.assert_allclose(parts[0], parts[0].transpose(0, 2, 3, 1), atol=1e-12 * scale)
    np.testing.assert_allclose(parts[1], parts[1].transpose(0, 2, 1, 3), atol=1e-12 * np.abs(parts[1]).max())


def test_the_modes_answer_a_sine_as_the_whole_car_does() -> None:
    """(3.17): ξ_k = Σ d̂_k a/(σ − λ_k) exp(σt), and x = K ξ."""
    form, t = car_form(UNEVEN, order=1), np.linspace(3.0, 3.2, 7)
    found = modes(form.A)
    piece = road_signal(RoadParameters(profile="sine", tau0=0.013)).pieces[-1]
    forces = found.input(form.B) @ piece.amplitudes
    waves = np.exp(np.multiply.outer(piece.exponents, t - piece.begin))
    xi = forces / (piece.exponents[None, :] - found.eigenvalues[:, None]) @ waves
    expected = periodic_response(form.A, form.B, piece, t)
    np.testing.assert_allclose(found.K @ xi, expected, atol=1e-12 * np.abs(expected).max())


# ---------------------------------------------------------------------------------------------------- the car's seven
def test_the_default_cars_modes_have_the_names_of_what_moves() -> None:
    found = car_modes(Car())
    assert found.names == (
        "heave",
        "roll",
        "pitch",
        "rear axle hop",
        "front wheel hop, in phase",
        "front wheel hop, opposite",
        "rear axle tramp",
    )
    frequencies = found.modes.beta[:7] / (2.0 * np.pi)
    assert frequencies[:3].max() < 2.0 and frequencies[3:].min() > 10.0
    side = [MOTIONS.index(name) for name in ("roll", "front wheel hop, opposite", "rear axle tramp")]
    parts = found.shares[:, side].sum(axis=1)
    assert np.all((parts < 1e-12) | (parts > 1.0 - 1e-12))  # left and right are alike: no mode has both


def test_names_follow_what_moves_and_none_comes_twice() -> None:
    stiff = car_modes(Car(c1=60000.0, Jx=60.0, cp2=40000.0))
    assert sorted(stiff.names) == sorted(MOTIONS)
    assert stiff.names.index("roll") > car_modes(Car()).names.index("roll")


def test_shares_are_those_of_the_kinetic_energy() -> None:
    """Of a shape in which only one coordinate moves, and of any shape as a sum."""
    car = Car(m11=31.0)
    np.testing.assert_allclose(energy_shares(car, np.eye(7)[:, [0, 1, 2, 5, 6]])[:, [0, 1, 2, 5, 6]], np.eye(5))
    equal = np.diag([0, 0, 0, 1 / math.sqrt(31.0), 1 / math.sqrt(30.0), 0, 0]).sum(axis=1)[:, None]
    np.testing.assert_allclose(energy_shares(car, equal)[0], np.eye(7)[3], atol=1e-15)
    v = np.random.default_rng(1).uniform(-1, 1, 7)
    body = np.where(np.arange(7) < 3, v, 0.0)
    whole, part = (float(kinetic_energy(car, np.concatenate([np.zeros(7), x])[None])[0]) for x in (v, body))
    shares = energy_shares(car, v[:, None].astype(complex))[0]
    assert shares.sum() == pytest.approx(1.0)
    assert shares[:3].sum() == pytest.approx(part / whole)


def test_the_frame_that_is_drawn_moves_as_struts_and_tyres_do() -> None:
    car, q = UNEVEN, np.random.default_rng(4).uniform(-0.1, 0.1, 7)
    rest, moved = mode_drawing.frame(car, np.zeros(7)), mode_drawing.frame(car, q)

    def lengths(lines: mode_drawing.Lines) -> np.ndarray:
        return np.array([line[1, 2] - line[0, 2] for line in lines[2:10]])

    expected = np.concatenate([np.array(extensions(car)) @ q, np.array(wheel_heights(car)) @ q])
    np.testing.assert_allclose(lengths(moved) - lengths(rest), expected, atol=1e-14)


# ---------------------------------------------------------------------------------------------------- the command
def test_the_command_prints_seven_modes_and_writes_its_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["modes", "bump", "-o", str(tmp_path / "out" / "modes")]) == 0
    out = capsys.readouterr().out.splitlines()
    assert len(out) == 1 + 7 + 2 + 1
    assert out[1].startswith("heave ") and "1.158 Hz, ζ = 0.275" in out[1]
    assert all(line.startswith("holds: ") for line in out[8:10])
    folder = tmp_path / "out" / "modes"
    assert sorted(path.name for path in folder.iterdir()) == ["modes.json", "modes.svg", "quasilinear.md"]
    record = json.loads((folder / "modes.json").read_text(encoding="utf-8"))
    assert record["stable"] and [mode["name"] for mode in record["modes"]] == list(car_modes(Car()).names)
    entries = {tuple(e[:-1]): e[-1] for e in record["tensors"]["d_ijkl"]["entries"]}
    assert entries[7, 3, 7, 7] == -entries[7, 4, 7, 7] != 0.0
    assert ElementTree.parse(folder / "modes.svg").getroot().tag.endswith("svg")
    assert "the car of bump" in (folder / "quasilinear.md").read_text(encoding="utf-8")


def test_the_command_fails_on_a_car_that_is_not_damped_and_refuses_what_it_cannot_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "undamped.toml").write_text("[parameters]\nb1 = 0.0\nb2 = 0.0\n")
    assert main(["modes", str(tmp_path / "undamped.toml")]) == 1
    out = capsys.readouterr().out
    assert "FAILS: every motion of the linear part decays" in out
    assert all("Hz, ζ = 0.000  ∞  " in re.sub(" {2,}", "  ", line) for line in out.splitlines()[1:8])  # no round-off
    assert main(["modes", "nonesuch"]) == 2
    (tmp_path / "file").touch()
    assert main(["modes", "bump", "-o", str(tmp_path / "file")]) == 2
    assert "wanted a folder, got a file" in capsys.readouterr().err
    (tmp_path / "overdamped.toml").write_text("[parameters]\nb1 = 8000.0\n")
    assert main(["modes", str(tmp_path / "overdamped.toml")]) == 0
    assert "aperiodic, 281.5 and 3.107 1/s" in capsys.readouterr().out
