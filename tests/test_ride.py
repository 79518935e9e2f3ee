"""The numbers of a ride: the weighting of ISO 2631-1, settling, tyres, energy; and the table of the loop's runs."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_run import EVERYTHING, made_up_run
from numpy.testing import assert_allclose
from scipy import signal

from analysis.__main__ import main
from analysis.cosimulation import simulate
from analysis.energy import balance
from analysis.errors import InputError
from analysis.reference import car_of
from analysis.report import write_report
from analysis.ride import ROWS, Ride, ride, settling_time, table, weighted_acceleration, wk, wk_filter
from analysis.scenario import read_scenario
from analysis.trajectory import COUNTERPART, Run, Trajectory, write_run

FREQUENCIES = np.array([1.0, 2.0, 4.0, 5.0, 8.0, 16.0, 31.5])
STANDARD = np.array([0.482, 0.531, 0.967, 1.039, 1.036, 0.769, 0.405])  # |Wk| there, ISO 2631-1


def test_the_weighting_is_that_of_the_standard_at_its_frequencies() -> None:
    zeros, poles, gain = wk()
    _, analogue = signal.freqs_zpk(zeros, poles, gain, worN=2 * np.pi * FREQUENCIES)
    assert_allclose(np.abs(analogue), STANDARD, atol=5e-4)  # its last digit
    _, digital = signal.sosfreqz(wk_filter(1e-3), worN=FREQUENCIES, fs=1000.0)
    assert_allclose(np.abs(digital), np.abs(analogue), rtol=4e-3)


def test_a_steady_vibration_is_weighted_by_the_factor_of_its_frequency() -> None:
    time = np.arange(0.0, 60.0, 1e-3)
    for frequency, factor in zip(FREQUENCIES, STANDARD, strict=True):
        whole, running = weighted_acceleration(time, np.sin(2 * np.pi * frequency * time))
        assert whole == pytest.approx(factor / np.sqrt(2), rel=0.01)
        assert running == pytest.approx(factor / np.sqrt(2), rel=0.08)  # the start's transient included


def test_a_short_last_row_is_left_out_of_the_weighting() -> None:
    time = np.arange(0.0, 5.0, 1e-3)
    a = np.sin(20 * time)
    late = np.append(time, time[-1] + 3e-4)
    assert weighted_acceleration(late, np.append(a, 1e6)) == weighted_acceleration(time, a)


def test_a_decaying_motion_settles_when_its_envelope_says_and_one_that_goes_on_does_not() -> None:
    time = np.linspace(0.0, 10.0, 100_001)
    assert settling_time(time, np.exp(-time)) == pytest.approx(np.log(20.0), abs=2e-4)
    assert np.isnan(settling_time(time, np.cos(time)))
    assert settling_time(time, np.zeros_like(time)) == 0.0


def test_columns_that_are_missing_are_named() -> None:
    few = tuple(name for name in EVERYTHING if name not in ("body.roll", "strut_rl.travel"))
    with pytest.raises(InputError, match=r"lacks the columns body\.roll, strut_rl\.travel"):
        ride(made_up_run(few))


def altered(run: Run, **columns: np.ndarray) -> Run:
    values = run.trajectory.values.copy()
    for name, column in columns.items():
        values[:, run.trajectory.names.index(name.replace("__", "."))] = column
    return replace(run, trajectory=Trajectory(time=run.trajectory.time, names=run.trajectory.names, values=values))


def test_energy_given_and_taken_are_the_work_on_the_struts_up_and_down() -> None:
    """A force of 100 N on a strut that goes out by 30 mm and back in by 10 mm; nothing else acts."""
    run = made_up_run(enabled=False)
    time = run.trajectory.time
    travel = np.interp(time, [0.0, 1.0, 2.0], [0.0, 0.03, 0.02])
    found = ride(altered(run, strut_fl__travel=travel, force_fl=np.full_like(time, 100.0)))
    assert found.energy_spent == pytest.approx(3.0)
    assert found.energy_taken == pytest.approx(1.0)


# ------------------------------------------------------------------ in the loop
@pytest.fixture(scope="module")
def runs(dist: Path) -> dict[str, Run]:
    return {name: simulate(read_scenario(name)) for name in ("bump", "bump-lqr", "bump-full-car")}


@pytest.fixture(scope="module")
def rides(runs: dict[str, Run]) -> dict[str, Ride]:
    return {name: ride(run) for name, run in runs.items()}


def test_the_half_car_settles_heave_and_pitch_but_not_roll_which_the_full_car_does(rides: dict[str, Ride]) -> None:
    passive, half, full = rides.values()
    heave, roll, pitch = range(3)
    for controlled in (half, full):  # measured: 0.44, 0.78
        assert np.all(controlled.settled[[heave, pitch]] < 0.8 * passive.settled[[heave, pitch]])
    assert half.settled[roll] == pytest.approx(passive.settled[roll], rel=0.01)
    assert full.settled[roll] < 0.6 * passive.settled[roll]  # measured: 0.55


def test_given_less_taken_is_the_work_of_the_actuators_in_the_energy_books(
    runs: dict[str, Run], rides: dict[str, Ride]
) -> None:
    for name, run in runs.items():
        net = rides[name].energy_spent - rides[name].energy_taken
        assert net == pytest.approx(balance(car_of(run.parameters), run.trajectory).actuators, abs=1e-12)
    assert rides["bump"].energy_spent == rides["bump"].energy_taken == 0.0


def test_the_report_of_a_run_with_counterpart_has_the_table_and_the_command_prints_it(
    runs: dict[str, Run], rides: dict[str, Ride], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("bump-full-car", "bump"):
        (tmp_path / name).mkdir()
        write_run(runs[name], tmp_path / name)
    assert main(["ride", str(tmp_path / "bump-full-car"), str(tmp_path / "bump")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "| | unit | bump-full-car | bump |"
    expected = table([rides["bump-full-car"], rides["bump"]])
    for line, (words, unit, values) in zip(lines[2:], expected, strict=True):
        assert line == f"| {words} | {unit} | {values[0]:.3g} | {values[1]:.3g} |"
    assert "<h2>Ride</h2>" not in write_report(tmp_path / "bump").read_text()
    (tmp_path / "bump").rename(tmp_path / "bump-full-car" / COUNTERPART)
    page = write_report(tmp_path / "bump-full-car").read_text()
    section = page.split("<h2>Ride</h2>")[1].split("</section>")[0]
    assert len(re.findall("<tr><td>", section)) == len(ROWS)
    assert "This run: controller on (full-car design, finite horizon, T = 2.3 s, from" in section
    assert "Counterpart: controller off." in section
