"""Which runs and files are judged, which are refused and with what reason, and what is falsified where."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported_runs import NAMES, halved, run_of, tampered
from test_exports import check_file, exported

from analysis.certificates.run_certificates import certified_findings
from analysis.report import read_findings
from analysis.scenario import built_in_scenarios, read_scenario
from analysis.trajectory import Run
from fmu_src.vehicle.parameters import Car

ACTING = "the actuators act, and the proof is of the car without them"
HARDWARE: list[dict[str, Any]] = [
    {"sample_time": 5e-3, "actuator_lag": 0.01},
    {"force_limit": 50.0},
    {"actuators": "semi-active"},
]


@pytest.fixture(scope="module")
def bump() -> Run:
    return run_of("bump")


# ---------------------------------------------------------------------------------------------------- runs
@pytest.mark.parametrize("name", [name for name in built_in_scenarios() if read_scenario(name).parameters["enabled"]])
def test_runs_of_the_papers_time_varying_control_are_not_judged_and_say_why(name: str) -> None:
    """Those without control are judged, all of them, and hold: `test_exports.py`."""
    assert certified_findings(run_of(name, stop_time=0.35)) == ([], ACTING)


@pytest.mark.parametrize("hardware", HARDWARE, ids=[next(iter(h)) for h in HARDWARE])
def test_neither_is_hardware_once_it_acts(hardware: dict[str, Any]) -> None:
    """Until the controller begins, the car is the passive one, and judged."""
    parameters = {"activation": "at t_on", "t_on": 0.1, **hardware}
    assert certified_findings(run_of("bump-full-car", stop_time=0.2, parameters=parameters)) == ([], ACTING)
    before, reason = certified_findings(run_of("bump-full-car", stop_time=0.05, parameters=parameters))
    assert reason == "" and before and all(f.holds for f in before)


@pytest.mark.parametrize("stop", [0.25, 0.32])
def test_a_run_that_ends_on_a_corner_of_the_road_under_tyres_with_dampers_is_honest(stop: float) -> None:
    """Its last row's accelerations are those of the road's rate behind the corner."""
    run = run_of("bump", stop_time=stop, parameters={"bp1": 300.0, "bp2": 300.0})
    findings, reason = certified_findings(run)
    assert reason == "" and all(f.holds for f in findings), [f.line for f in findings]


@pytest.mark.parametrize(("sampling", "least"), [("end", 100.0), ("start", 2.0)])
def test_a_damper_one_per_cent_off_is_falsified_however_the_fmus_were_coupled(sampling: str, least: float) -> None:
    coupling = {"end": "gauss-seidel", "start": "jacobi"}[sampling]
    honest, other = (
        run_of("bump", coupling=coupling, parameters={"road_sampling": sampling, "b1": b1})
        for b1 in (Car().b1, 1.01 * Car().b1)
    )
    assert all(f.holds for f in certified_findings(honest)[0])
    *_, rows, _ = certified_findings(replace(other, record=honest.record))[0]
    assert not rows.holds and rows.measured > least
    assert "row 107, column der(wheel_fl.heave)" in rows.source and "the first row out" in rows.source


@pytest.mark.parametrize(("state", "row"), [("body.roll", 5), ("body.pitch", -1)])
def test_a_shift_of_any_angle_from_any_row_on_is_found_there(bump: Run, state: str, row: int) -> None:
    def shift(states: np.ndarray[Any, Any]) -> None:
        states[row:, NAMES.index(state)] += 2e-4

    *_, rows, _ = certified_findings(tampered(bump, shift))[0]
    assert not rows.holds and f"column {state}" in rows.source
    assert f"the first row out: {row % len(bump.trajectory.time) + 2}" in rows.source


# ---------------------------------------------------------------------------------------------------- files
@pytest.mark.parametrize(
    ("row", "column", "cell", "said"),
    [
        (0, 0, "time [ms]", "column 'time': wanted the unit s, got ms"),
        (0, 4, "wheel.heave", "wanted time and all 14 states, but wheel_fl.heave are missing"),
        (0, 0, "seconds", "but time are missing"),
        (0, 2, "vehicle.body.heave", "but body.roll are missing"),
        (0, 15, "vehicle.body.heave", "row 1: column 'body.heave' stands there twice"),
        (7, 14, "-inf", "row 8, column 'der(axle_r.roll)'"),
        (7, 14, "1,5", "row 8, column 'der(axle_r.roll)'"),
        (1, 1, "m", "row 2, column 'body.heave'"),  # a row of units
        (7, 15, "", "row 8, column 'b1'"),
        (7, 15, "1212", "row 8, column 'b1': wanted 1200.0, as the car and road of bump have it, got 1212.0"),
    ],
)
def test_what_is_no_export_of_this_car_is_refused_with_row_and_column(
    bump: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str], row: int, column: int, cell: str, said: str
) -> None:
    path = exported(bump, tmp_path / "a.csv", "{:.9e}")
    rows = [[*cells, "b1" if k == 0 else "1200"] for k, cells in enumerate(csv.reader(path.read_text().splitlines()))]
    rows[row][column] = cell
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    assert check_file(path) == 2
    assert said in capsys.readouterr().err


def test_cut_rows_and_empty_files_are_refused(bump: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = exported(bump, tmp_path / "a.csv")
    whole = path.read_text()
    path.write_text(whole[: whole.rindex(",")] + "\n")
    assert check_file(path) == 2
    assert "row 452: wanted 15 columns as in the header, got 14" in capsys.readouterr().err
    for little, said in (("", "are missing"), (whole.splitlines()[0] + "\n", "at least one row of numbers")):
        path.write_text(little)
        assert check_file(path) == 2
        assert said in capsys.readouterr().err


def test_a_file_without_the_forces_of_a_controller_that_is_on_is_not_judged(
    bump: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = exported(bump, tmp_path / "a.csv")
    assert check_file(path, "--parameters", "bump-lqr") == 1
    assert "the controller is on, but force_fl, force_fr, force_rl, force_rr are not" in capsys.readouterr().out


def test_the_findings_of_a_file_lie_beside_it_as_those_of_a_run(bump: Run, tmp_path: Path) -> None:
    for run, holds in ((bump, True), (tampered(bump, halved), False)):
        check_file(exported(run, tmp_path / "a.csv"))
        found = read_findings(tmp_path / "a.findings.json")
        assert found and [f.holds for f in found] == [holds] * len(found)


def test_a_file_of_a_controlled_run_without_its_forces_is_not_judged_at_all(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is no row of another motion that is wrong with it: nothing is known of the forces."""
    path = exported(run_of("bump-lqr", stop_time=0.6), tmp_path / "a.csv")
    assert check_file(path, "--parameters", "bump-lqr") == 1
    said = capsys.readouterr().out
    assert "the controller is on, but force_fl, force_fr, force_rl, force_rr are not recorded" in said
    assert read_findings(tmp_path / "a.findings.json") == [] and "FAIL" not in said


def test_what_is_said_between_the_rows_is_said_until_the_last_row(bump: Run) -> None:
    """And which part of the tolerance is proved of the exact motion, which the run's own."""
    *_, between = certified_findings(bump)[0]
    last = f"until t = {bump.trajectory.time[-1]:g} s"
    assert last in between.claim and last in between.source
    assert "all t" not in between.claim + between.source
    proved, own = (float(between.source.split(word)[1].split(",")[0]) for word in (" s: ", "tolerance, "))
    assert between.tolerance == pytest.approx(proved + own, rel=1e-2) and own > 0.0
