"""Energy between modes: what adds up, a system in which it moves, and the car, in which it hardly does."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from orders import observed_order

from analysis.__main__ import main
from analysis.car import car_form
from analysis.errors import InputError
from analysis.methods.linear_response import linear_response
from analysis.methods.nonlinear_response import nonlinear_response
from analysis.methods.signals import constant, harmonic
from analysis.methods.spatial import Transfer, transfer, undamped_modes
from analysis.methods.standard_form import StandardForm, standard_form
from analysis.reference import Parameters
from analysis.scans import spatial_scan
from analysis.scans.spatial_scan import car_modes, motions, transfer_of
from fmu_src.vehicle.parameters import Car

ONE_WHEEL: Parameters = {
    "profile": "fourier",
    "A_nu[1]": 0.02,
    "A_nu[2]": 0.008,
    "Lambda": 8.0,
    "excite_fr": False,
    "excite_rl": False,
    "excite_rr": False,
}


def test_the_energies_of_the_modes_add_up_and_each_is_kept_without_damping() -> None:
    car = Car(b1=0.0, b2=0.0)
    modes, A = car_modes(car), car_form(car, order=1).A
    C = -modes.M @ A[7:, :7]
    x0 = np.linspace(-0.01, 0.02, 14)
    t = np.linspace(0.0, 0.5, 21)
    x = linear_response(A, np.zeros((14, 1)), x0, constant([0.0]), t)
    energies = modes.energies(x)
    np.testing.assert_allclose(energies.sum(axis=0)[0], 0.5 * (x0[7:] @ modes.M @ x0[7:] + x0[:7] @ C @ x0[:7]))
    np.testing.assert_allclose(energies, np.tile(energies[:, :1], 21), rtol=1e-8)
    kinetic = modes.kinetic_energies(x)
    np.testing.assert_allclose(kinetic.sum(axis=0), 0.5 * np.einsum("it,ij,jt->t", x[7:], modes.M, x[7:]))
    assert np.ptp(kinetic.sum(axis=0)) > 0.1 * energies.sum(axis=0)[0]  # which is why modes are looked at


def swing(ratio: float) -> StandardForm:
    """x of frequency 2, driven; y of frequency ratio, coupled by y² and x y: the textbook's saturation at ratio 1."""

    def equations(z: Sequence[Any], w: Sequence[Any], s: Any, c: Any) -> Sequence[Any]:
        x, y, dx, dy = z
        return [dx, dy, x * -4.0 - 0.05 * dx - y * y + w[0], y * -(ratio**2) - 0.05 * dy - 2.0 * x * y]

    return standard_form(equations, ["x", "y", "x'", "y'"], 1)


@pytest.mark.parametrize(("ratio", "moved"), [(1.0, True), (1.3, False)])
def test_the_indicator_shows_what_the_textbook_calls_saturation(ratio: float, moved: bool) -> None:
    """In resonance y takes over and x stays far below its linear response; off it nothing happens."""
    form, drive = swing(ratio), harmonic([0.02], 2.0)
    t, start = np.linspace(0.0, 400.0, 2001), np.array([0.0, 0.01, 0.0, 0.0])
    linear = linear_response(form.A, form.B, start, drive, t)
    full = nonlinear_response(form, start, drive, t, rtol=1e-9)
    late = t > 200.0
    found = transfer(undamped_modes(np.eye(2), np.diag([4.0, ratio**2])), t[late], linear[:, late], full[:, late])
    driven = 1 if ratio < 2.0 else 0
    assert found.linear[driven] / found.linear.sum() > 0.999
    if moved:
        assert found.nonlinear[driven] < 0.2 * found.linear[driven]
        assert found.nonlinear[1 - driven] > found.nonlinear[driven]
        assert found.indicator > 0.15  # measured: 0.19, and off resonance 0.0000
    else:
        assert found.indicator < 1e-3


def test_only_what_some_modes_lose_and_others_gain_counts() -> None:
    assert Transfer(linear=np.array([1.0, 1.0]), nonlinear=np.array([1.5, 1.2])).indicator == 0.0
    assert Transfer(linear=np.array([1.0, 1.0]), nonlinear=np.array([0.5, 1.2])).indicator == pytest.approx(0.1)


def test_a_linear_car_spreads_the_energy_of_one_wheel_and_phi_changes_it_by_the_square_of_the_road() -> None:
    shares = transfer_of(ONE_WHEEL).linear
    assert np.count_nonzero(shares > 0.05 * shares.sum()) >= 3  # without any Φ

    def change(factor: float) -> float:
        scaled = {**ONE_WHEEL, "A_nu[1]": 0.02 * factor, "A_nu[2]": 0.008 * factor}
        t, linear, full = motions(scaled, rtol=1e-12)
        return float(np.abs(transfer(car_modes(Car()), t, linear, full).change).max())

    slope, bend = observed_order(change, [4.0, 2.0, 1.0])
    assert slope == pytest.approx(2.0, abs=0.05) and bend < 0.03
    assert change(1.0) < 1e-3


def test_the_grid_holds_the_scenario_itself_and_the_command_writes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spatial_scan, "STEPS", (1, 1))
    monkeypatch.setattr(spatial_scan, "SPAN", 1.0)
    assert main(["spatial", "fourier-fl", "-o", str(tmp_path)]) == 0
    assert "worst of 3" in capsys.readouterr().out
    assert len((tmp_path / "spatial.csv").read_text().splitlines()) == 4


def test_a_flat_road_moves_nothing_and_says_so() -> None:
    with pytest.raises(InputError, match="wanted a road that moves the car"):
        transfer_of({"profile": "flat"})


def test_modes_need_symmetric_matrices_and_mass() -> None:
    with pytest.raises(InputError, match="symmetric"):
        undamped_modes(np.eye(2), np.array([[1.0, 0.5], [0.0, 1.0]]))
    with pytest.raises(InputError, match="positive definite"):
        undamped_modes(np.diag([1.0, 0.0]), np.eye(2))
    with pytest.raises(InputError, match="stiffness >= 0"):
        undamped_modes(np.eye(2), np.diag([1.0, -1.0]))
