"""The numbers of a ride: the weighting of ISO 2631-1, settling, tyres, energy; and the table of the loop's runs."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_run import EVERYTHING, made_up_run
from numpy.testing import assert_allclose
from scipy import signal

from analysis import run_figures
from analysis.__main__ import main
from analysis.beside import simulate_beside
from analysis.cosimulation import simulate
from analysis.energy import balance
from analysis.errors import InputError
from analysis.figures import readable
from analysis.reference import car_of
from analysis.report import write_report
from analysis.ride import Ride, body_period, ride, settling_time, table, weighted_acceleration, wk, wk_filter
from analysis.scenario import read_scenario
from analysis.trajectory import COUNTERPART, OTHER_DESIGN, Run, Trajectory, read_run, write_run
from analysis.tyres import static_loads
from fmu_src.vehicle.parameters import Car

# Wk in thousandths at the nominal third octaves from 0.1 Hz, as printed in table 3 of ISO 2631-1:1997.
PRINTED = """
0.1 31.2   0.125 48.6  0.16 79.0  0.2 121   0.25 182   0.315 263  0.4 352  0.5 418   0.63 459   0.8 477
1 482      1.25 484    1.6 494    2 531     2.5 631    3.15 804   4 967    5 1039    6.3 1054   8 1036
10 988     12.5 902    16 768     20 636    25 513     31.5 405   40 314   50 246    63 186     80 132
100 88.7   125 54.0    160 28.5   200 15.2  250 7.90   315 3.98   400 1.95
""".split()
TABLE_3 = {float(frequency): factor for frequency, factor in zip(PRINTED[::2], PRINTED[1::2], strict=True)}
FREQUENCIES = np.array([1.0, 2.0, 4.0, 5.0, 8.0, 16.0, 31.5])
STANDARD = np.array([float(TABLE_3[f]) / 1e3 for f in FREQUENCIES])


def test_the_weighting_is_that_of_the_table_of_the_standard() -> None:
    """Within half of the last digit printed, but at 16 Hz (768.7, printed 768); the filter of samples 1 ms apart is
    bent by its transform at high frequencies."""
    zeros, poles, gain = wk()
    _, analogue = signal.freqs_zpk(zeros, poles, gain, worN=2 * np.pi * np.array(list(TABLE_3)))
    digits = [10.0 ** -len(factor.partition(".")[2]) for factor in TABLE_3.values()]
    off = (1e3 * np.abs(analogue) - [float(factor) for factor in TABLE_3.values()]) / digits
    assert np.abs(off).max() < 0.75
    assert [f for f, each in zip(TABLE_3, off, strict=True) if abs(each) > 0.55] == [16.0]
    worn = [f for f in TABLE_3 if f <= 31.5]
    _, digital = signal.sosfreqz(wk_filter(1e-3), worN=worn, fs=1000.0)
    assert_allclose(np.abs(digital), np.abs(analogue)[: len(worn)], rtol=4e-3)


def test_a_steady_vibration_is_weighted_by_the_factor_of_its_frequency() -> None:
    time = np.arange(0.0, 60.0, 1e-3)
    for frequency, factor in zip(FREQUENCIES, STANDARD, strict=True):
        whole, running = weighted_acceleration(time, np.sin(2 * np.pi * frequency * time))
        assert whole == pytest.approx(factor / np.sqrt(2), rel=0.01)
        assert running == pytest.approx(factor / np.sqrt(2), rel=0.08)  # the start's transient included


@pytest.mark.parametrize("step", [1e-3, 5e-3, 8.3e-3, 1e-2])
def test_rows_up_to_10_ms_apart_hold_what_is_weighted_up_to_16_hz(step: float) -> None:
    """Against the closed form; the filter of samples 10 ms apart would be 7 % off at 16 Hz, linear rows 8 %."""
    time = np.linspace(0.0, 60.0, round(60.0 / step), endpoint=False)
    for frequency, factor in zip(FREQUENCIES, STANDARD, strict=True):
        if frequency <= 16.0:
            whole, _ = weighted_acceleration(time, np.sin(2 * np.pi * frequency * time))
            assert whole == pytest.approx(factor / np.sqrt(2), rel=0.01), frequency


def test_the_running_second_finds_a_burst_in_a_calm_ride() -> None:
    time = np.arange(0.0, 20.0, 1e-3)
    burst = np.where((time >= 10.0) & (time < 11.0), np.sin(2 * np.pi * 8.0 * time), 0.0)
    whole, running = weighted_acceleration(time, burst)
    assert running == pytest.approx(1.036 / np.sqrt(2), rel=0.02)
    assert whole == pytest.approx(running / np.sqrt(20.0), rel=0.02)


def test_a_short_last_row_is_left_out_of_the_weighting() -> None:
    time = np.arange(0.0, 5.0, 1e-3)
    a = np.sin(20 * time)
    late = np.append(time, time[-1] + 3e-4)
    assert weighted_acceleration(late, np.append(a, 1e6)) == weighted_acceleration(time, a)


def test_a_decaying_motion_settles_when_its_envelope_says_and_one_that_goes_on_does_not() -> None:
    time = np.linspace(0.0, 10.0, 100_001)
    assert settling_time(time, np.exp(-time), 0.8) == pytest.approx(np.log(20.0), abs=2e-4)
    assert np.isnan(settling_time(time, np.cos(time), 0.0))
    assert settling_time(time, np.zeros_like(time), 0.8) == 0.0


def test_a_motion_that_crosses_zero_at_the_end_has_not_settled() -> None:
    time = np.linspace(0.0, 5 * np.pi / 2, 10_001)
    assert np.isnan(settling_time(time, np.cos(time), 0.8))  # ends in a crossing, 0.05 s after its last 5 %
    ends = np.linspace(0.0, np.log(20.0) + 0.8, 10_001)
    assert settling_time(ends, np.exp(-ends), 0.79) == pytest.approx(np.log(20.0), abs=1e-3)
    assert np.isnan(settling_time(ends, np.exp(-ends), 0.81))


def test_the_rest_that_settling_wants_is_a_period_of_the_body(runs: dict[str, Run]) -> None:
    car = Car()
    assert body_period(car) == pytest.approx(2 * np.pi * np.sqrt(870.0 / 58e3))
    assert body_period(Car(c1=0.0, c2=0.0)) == np.inf
    run = runs["bump-lqr"]
    short = replace(run, trajectory=replace(
        run.trajectory, time=run.trajectory.time[:501], values=run.trajectory.values[:501]))  # fmt: skip
    assert np.all(np.isnan(ride(short).settled))
    assert np.all(np.isfinite(ride(run).settled))


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


def test_peaks_travel_and_tyre_loads_are_those_of_signals_of_known_size() -> None:
    """Heave only down, one strut only in; two tyres' loads swing about rest, one of them beyond it for a while."""
    run = made_up_run()
    time, rest = run.trajectory.time, static_loads(run)
    swing = np.sin(2 * np.pi * 5.0 * time)
    lifted = np.where(time < 0.5, -rest[3] - 1.0, 0.0)
    quiet = {f"tyre_{c}__force": np.zeros_like(time) for c in ("fl", "fr")}
    body = {"body__heave": -0.02 * time, "body__roll": 0.003 * time, "body__pitch": -0.004 * time}
    sizes = {"fl": -0.01, "fr": 0.0, "rl": 0.0, "rr": 0.0}
    travel = {f"strut_{corner}__travel": size * time for corner, size in sizes.items()}
    found = ride(altered(run, **quiet, **body, **travel, tyre_rl__force=0.2 * rest[2] * swing, tyre_rr__force=lifted))
    assert_allclose(found.peaks, [0.04, 0.006, 0.008])
    assert found.travel == pytest.approx(0.02)
    assert found.contact_lost == pytest.approx(0.5, abs=0.011)
    assert found.load_variation == pytest.approx(np.sqrt(0.49 / 2) * (1 + 1 / rest[3]), rel=1e-6)
    calm = ride(altered(run, **quiet, **body, **travel, tyre_rl__force=0.2 * rest[2] * swing, tyre_rr__force=0 * time))
    assert calm.load_variation == pytest.approx(0.2 / np.sqrt(2), rel=1e-3)
    assert calm.contact_lost == 0.0


def test_contact_lost_is_that_of_all_tyres_together() -> None:
    run = made_up_run()
    off = -static_loads(run).max() - np.ones_like(run.trajectory.time)
    found = ride(altered(run, **{f"tyre_{c}__force": off for c in ("fl", "fr", "rl", "rr")}))
    assert found.contact_lost == pytest.approx(4 * 2.0)


def test_each_row_of_the_table_has_the_number_that_its_words_say() -> None:
    numbers = Ride(
        settled=np.array([1.0, 2.0, 3.0]), peaks=np.array([4e-3, 5e-3, 6e-3]), weighted=7.0, transient=8.0,
        travel=9e-3, load_variation=0.10, contact_lost=11e-3, energy_spent=12.0, energy_taken=13.0,
    )  # fmt: skip
    assert [(words.partition(" ")[0], unit) for words, unit, _ in table([numbers])] == [
        ("heave", "s"), ("roll", "s"), ("pitch", "s"), ("largest", "mm"), ("largest", "mrad"), ("largest", "mrad"),
        ("heave", "m/s²"), ("the", "m/s²"), ("largest", "mm"), ("largest", "%"), ("contact", "ms"), ("energy", "J"),
        ("energy", "J"),
    ]  # fmt: skip
    assert_allclose([values[0] for *_, values in table([numbers])], np.arange(1.0, 14.0))
    words = [row[0] for row in table([numbers])]
    assert [w.split()[1] for w in words[3:6]] == ["heave", "roll", "pitch"]


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


def test_the_command_prints_the_table_of_runs(
    runs: dict[str, Run], rides: dict[str, Ride], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("bump-full-car", "bump"):
        (tmp_path / name).mkdir()
        write_run(runs[name], tmp_path / name)
    assert main(["ride", str(tmp_path / "bump-full-car"), str(tmp_path / "bump")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "| | unit | bump-full-car | bump |"
    (tmp_path / "short").mkdir()
    some = replace(runs["bump"].trajectory, time=runs["bump"].trajectory.time[:2001:20],
                   values=runs["bump"].trajectory.values[:2001:20])  # fmt: skip
    write_run(replace(runs["bump"], trajectory=some), tmp_path / "short")
    assert len(lines) == 2 + len(table([rides["bump"]]))  # runs that last alike need no note
    assert main(["ride", str(tmp_path / "bump"), str(tmp_path / "short")]) == 0
    said = capsys.readouterr().out
    assert "\nThe runs last 5, 2 s: r.m.s. values are over each one's own time.\n" in said
    assert "\nRows 0.02 s apart: the weighted acceleration lacks" in said
    inside = tmp_path / "bump" / "counterpart"
    inside.mkdir()
    write_run(runs["bump"], inside)
    assert main(["ride", str(inside)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "| | unit | bump/counterpart |"
    expected = table([rides["bump-full-car"], rides["bump"]])
    for line, (words, unit, values) in zip(lines[2:], expected, strict=True):
        assert line == f"| {words} | {unit} | {values[0]:.3g} | {values[1]:.3g} |"


@pytest.mark.parametrize("name", ["bump", "bump-lqr", "bump-full-car"])
def test_the_report_has_passive_half_car_and_full_car_side_by_side_whichever_was_run(
    name: str, runs: dict[str, Run], rides: dict[str, Ride], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_figures, "render", lambda subject: b"")
    write_run(runs[name], tmp_path)
    assert "<h2>Ride</h2>" not in write_report(tmp_path).read_text()
    scenario = replace(read_scenario(name), stop_time=1.0)
    simulate_beside(scenario, runs[name], tmp_path)
    for folder in (COUNTERPART, OTHER_DESIGN):  # what was simulated, and then, to save time, the like of it at hand
        p = read_run(tmp_path / folder).parameters
        alike = {"half-car": "bump-lqr", "full-car": "bump-full-car"}[str(p["design"])] if p["enabled"] else "bump"
        assert alike != name
        write_run(runs[alike], tmp_path / folder)
    page = write_report(tmp_path).read_text()
    section = page.split("<h2>Ride</h2>")[1].split("</section>")[0]
    headings = ["No control", "Half-car design", "Full-car design"]
    headings[list(runs).index(name)] += " (this run)"
    assert re.findall('<th class="n">(.+?)</th>', section) == headings
    cells = re.findall('<td class="n">(.+?)</td>', section)
    numbers = [readable(value, 3) for *_, values in table(list(rides.values())) for value in values]
    assert cells == numbers
    assert "controller on (full-car design, finite horizon, T = 2.3 s, from" in section


def test_a_run_beside_that_cannot_be_simulated_is_named_and_left_out(
    runs: dict[str, Run], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    never = replace(read_scenario("bump"), stop_time=0.01, parameters={"enabled": False, "T": 0.1})
    simulate_beside(never, runs["bump"], tmp_path)
    said = capsys.readouterr().err
    assert "(bump, control on)" in said and "(bump, full-car design)" in said
    assert not any(tmp_path.iterdir())


def test_the_verb_run_writes_the_runs_beside_it(dist: Path, tmp_path: Path) -> None:
    few = ["body.heave", "body.roll"]  # too few to be checked
    text = f"[simulation]\nstop_time = 0.4\nrecord = {json.dumps(few)}\n[parameters]\nenabled = false\n"
    (tmp_path / "short.toml").write_text(text)
    assert main(["run", str(tmp_path / "short.toml"), "-o", str(tmp_path / "run")]) == 0
    folders = [tmp_path / "run" / name for name in ("", COUNTERPART, OTHER_DESIGN)]
    found = [read_run(folder).parameters for folder in folders]
    assert [p["enabled"] for p in found] == [False, True, True]
    assert [p["design"] for p in found] == ["half-car", "half-car", "full-car"]
    assert (tmp_path / "run" / "report.html").is_file()
