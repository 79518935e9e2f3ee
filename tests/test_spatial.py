"""Energy between modes: what adds up, a system in which it moves, and the car, in which it hardly does."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_run import made_up_run
from orders import observed_order

from analysis import run_figures
from analysis.__main__ import main
from analysis.car import car_form
from analysis.cosimulation import simulate
from analysis.discrepancy import linear_states
from analysis.errors import InputError
from analysis.methods.linear_response import linear_response
from analysis.methods.nonlinear_response import nonlinear_response
from analysis.methods.signals import constant, harmonic
from analysis.methods.spatial import UNDRIVEN, Transfer, transfer, undamped_modes
from analysis.methods.standard_form import StandardForm, standard_form
from analysis.reference import Parameters
from analysis.run_energies import energies_of
from analysis.scans import spatial_scan
from analysis.scans.car_scans import VARIATIONS, higher_road
from analysis.scans.spatial_scan import Point, car_modes, changed, motions, transfer_of
from analysis.scenario import read_scenario
from analysis.trajectory import Run, new_run_folder, write_run
from fmu_src.quantities import STATES
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
        assert found.moved > 0.15  # measured: 0.19, and off resonance 0.0000
    else:
        assert max(found.moved, found.largest_gain, found.undriven_gain) < 1e-3


def test_a_mode_that_takes_its_energy_from_the_drive_is_not_missed() -> None:
    """y, which nothing drives, gets 1.6 times all the linear energy while x keeps its own: nothing moves between."""

    def equations(z: Sequence[Any], w: Sequence[Any], s: Any, c: Any) -> Sequence[Any]:
        x, y, dx, dy = z
        return [dx, dy, x * -4.0 - 0.05 * dx + w[0], -y - 0.05 * dy - 2.0 * x * y - y * y * y]

    form, drive = standard_form(equations, ["x", "y", "x'", "y'"], 1), harmonic([0.02], 2.0)
    t, start = np.linspace(0.0, 400.0, 2001), np.array([0.0, 1e-3, 0.0, 0.0])
    linear = linear_response(form.A, form.B, start, drive, t)
    full = nonlinear_response(form, start, drive, t, rtol=1e-9)
    late = t > 200.0
    found = transfer(undamped_modes(np.eye(2), np.diag([4.0, 1.0])), t[late], linear[:, late], full[:, late])
    assert found.moved < 1e-3  # x loses nothing
    assert found.largest_gain > 1.0 and found.undriven_gain == pytest.approx(found.largest_gain, rel=1e-6)


def test_only_what_some_modes_lose_and_others_gain_counts() -> None:
    gaining = Transfer(linear=np.array([1.0, 1.0]), nonlinear=np.array([1.5, 1.2]))
    assert (gaining.moved, gaining.largest_gain, gaining.undriven_gain) == (0.0, 0.25, 0.0)
    losing = Transfer(linear=np.array([1.0, 1.0]), nonlinear=np.array([0.5, 1.2]))
    assert losing.moved == losing.largest_gain == pytest.approx(0.1)
    assert Transfer(linear=np.array([1.0, 1.0]), nonlinear=np.array([0.5, 0.9])).largest_gain == 0.0
    hidden = Transfer(linear=np.array([9.99, 0.005, 0.005]), nonlinear=np.array([9.0, 0.1, 0.02]))
    assert hidden.undriven_gain == pytest.approx(0.0095)  # of (0.1 - 0.005)/10 and (0.02 - 0.005)/10
    losing_too = Transfer(linear=np.array([9.995, 0.005]), nonlinear=np.array([11.0, 0.004]))
    assert losing_too.undriven_gain == 0.0 and losing_too.largest_gain > 0.1
    assert "where Φ adds most to an undriven mode: nowhere" in "\n".join(
        spatial_scan.most_lines([Point(values={"speed": 1.0}, transfer=losing_too)])
    )


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


def test_what_phi_adds_to_an_undriven_mode_grows_with_the_square_of_the_road() -> None:
    """Mode 7 has 6e-4 of the energy in the linear motion already, on a road of any height: no doing of Φ."""
    parameters = read_scenario("fourier-fl").parameters

    def gain(factor: float) -> float:
        road = higher_road(parameters, factor)
        found = transfer(car_modes(Car()), *motions(road, rtol=1e-11))
        assert 5e-4 < found.linear[6] / found.linear.sum() < UNDRIVEN
        return found.undriven_gain

    slope, bend = observed_order(gain, [16.0, 8.0, 4.0])
    assert slope == pytest.approx(2.0, abs=0.05) and bend < 0.03
    assert gain(4.0) < 1e-7


def test_the_command_finds_the_worst_point_and_shows_the_car_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every row of the table is the case that it names; the second table is that of the row with the largest gain."""
    monkeypatch.setattr(spatial_scan, "STEPS", (2, 2))
    monkeypatch.setattr(spatial_scan, "HEIGHTS", (2.0,))
    assert main(["spatial", "fourier-fl", "-o", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    rows = list(csv.DictReader((tmp_path / "spatial.csv").read_text().splitlines()))
    assert len(rows) == 12
    parameters = read_scenario("fourier-fl").parameters
    gains = []
    for row in rows:
        values = {name: float(row[name]) for name in VARIATIONS if row[name]}
        assert set(values) == {"speed", *values} and len(values) == 2
        gains.append(float(row["largest gain of one mode [1]"]))
        if row in (rows[0], rows[7], rows[-1]):
            assert gains[-1] == transfer_of(changed(parameters, values)).largest_gain
    assert len({row["linear share 1"] for row in rows}) == 12
    worst = rows[int(np.argmax(gains))]
    values = {name: float(worst[name]) for name in VARIATIONS if worst[name]}
    there = changed(parameters, values)
    words = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
    assert f"worst of 12, by the largest gain of one mode: {words}; on the edge of the grid in " in said
    assert "\n".join(spatial_scan.lines(there, "there")[1:]) in said
    for column, words in (
        ("moved between modes [1]", "moves most between modes"),
        ("largest gain of an undriven mode [1]", "adds most to an undriven mode"),
    ):
        most = max(rows, key=lambda row: float(row[column]))
        assert min(float(row[column]) for row in rows) < 0.1 * float(most[column])
        at = ", ".join(f"{name} = {float(most[name]):.4g}" for name in VARIATIONS if most[name])
        assert f"where Φ {words}: {at}: {float(most[column]):.3g}\n" in said
    twice = transfer_of(higher_road(there, 2.0)).largest_gain
    assert f"on the road 2 times as high: largest gain of one mode {twice:.3g} " in said
    assert twice == pytest.approx(4.0 * max(gains), rel=0.02)


def test_only_what_lies_at_the_end_of_a_grid_is_called_its_edge() -> None:
    nothing = Transfer(linear=np.ones(7), nonlinear=np.ones(7))
    points = [Point(values={"speed": v, "Jy": J}, transfer=nothing) for v in (5.0, 10.0, 20.0) for J in (1.0, 2.0)]
    found = [spatial_scan.edges(point, points) for point in points]
    assert found == [["speed", "Jy"]] * 2 + [["Jy"]] * 2 + [["speed", "Jy"]] * 2


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


@pytest.fixture(scope="module")
def run() -> Run:
    """Of the bump, ten times as high, so that what Φ does is more than the run's error."""
    scenario = read_scenario("bump")
    return simulate(replace(scenario, stop_time=1.0, parameters={**scenario.parameters, "A": 0.1}))


@pytest.mark.usefixtures("dist")
def test_energies_along_a_run_are_those_of_its_rows_and_order_1_has_what_phi_changes(run: Run) -> None:
    found = energies_of(run)
    x, x_lin = run.trajectory.columns([q.name for q in STATES]).T, linear_states(run).T
    M, C = found.modes.M, -found.modes.M @ car_form(Car(), order=1).A[7:, :7]
    whole = 0.5 * (np.einsum("it,ij,jt->t", x[7:], M, x[7:]) + np.einsum("it,ij,jt->t", x[:7], C, x[:7]))
    np.testing.assert_allclose(found.energies("run").sum(axis=0), whole, rtol=1e-9, atol=1e-9 * whole.max())
    energies = found.energies("order 0")
    np.testing.assert_allclose(energies, found.modes.energies(x_lin), atol=1e-6 * energies.max())
    change, first = found.transfer("run").change, found.transfer("order 1").change
    assert np.abs(change).max() > 1e-4
    np.testing.assert_allclose(first, change, atol=0.02 * np.abs(change).max())


@pytest.mark.usefixtures("dist")
def test_spatial_on_a_run_writes_table_and_figure_which_the_report_takes(
    run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with new_run_folder(tmp_path / "run") as folder:
        write_run(run, folder)
    assert main(["spatial", str(tmp_path / "run")]) == 0
    said = capsys.readouterr().out
    found = energies_of(run)
    assert f"largest gain of one mode {found.transfer('run').largest_gain:.3g} of the linear energy" in said
    table = list(csv.DictReader((tmp_path / "run" / "modal-energies.csv").read_text().splitlines()))
    assert len(table) == len(run.trajectory.time) and len(table[0]) == 1 + 3 * 7
    assert float(table[300]["E_2 order 1 [J]"]) == found.energies("order 1")[1, 300]
    (entry,) = run_figures.energies(tmp_path / "run")
    assert entry.title == "Energy of the modes" and "of order 0 (linear) and 1" in entry.caption
    assert main(["report", str(tmp_path / "run")]) == 0
    assert entry.title in (tmp_path / "run" / "report.html").read_text()


def test_a_run_that_stands_still_has_no_energies_to_tell() -> None:
    still = made_up_run()
    still.trajectory.values[:] = 0.0
    with pytest.raises(InputError, match="stands still"):
        energies_of(still)
