"""Exported trajectories: what is no motion of this car is falsified, honest runs are not, and bad files are refused."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported_runs import NAMES, STOP, halved, run_of, shifted, tampered

from analysis.__main__ import main
from analysis.bertolino_baksa.balls import NotProvedError
from analysis.car import car_form, road_signal
from analysis.certificates.exact_car import energy_norm
from analysis.certificates.exported import _late, _rounding, read_export
from analysis.certificates.printed_times import input_within, moved, steepest
from analysis.certificates.run_certificates import _motions, certified_findings
from analysis.certificates.unknown_roads import road_class
from analysis.errors import InputError
from analysis.reference import road_parameters
from analysis.scenario import built_in_scenarios, read_scenario
from analysis.trajectory import Run, write_csv
from fmu_src.vehicle.parameters import Car


@pytest.fixture(scope="module")
def bump() -> Run:
    return run_of("bump")


# ---------------------------------------------------------------------------------------------------- honest runs
@pytest.mark.parametrize(
    "name", [name for name in built_in_scenarios() if read_scenario(name).parameters["enabled"] is False]
)
def test_honest_runs_are_not_falsified(name: str) -> None:
    (authentic, rows, between), reason = certified_findings(run_of(name, stop_time=0.4))
    assert reason == ""
    assert rows.holds and 1e-6 < rows.measured < 0.5
    assert authentic.holds and between.holds


@pytest.mark.parametrize("coupling", ["jacobi", "gauss-seidel"])
def test_neither_are_runs_that_begin_late_and_off_rest(coupling: str) -> None:
    """From 0.13 s on, between two corners of the bump, from a start that is a motion of its own."""
    parameters = {"road_sampling": "start" if coupling == "jacobi" else "end"}
    start = {"body.roll": 0.01, "der(wheel_fl.heave)": 0.2}
    run = run_of("bump", start_time=0.13, start=start, coupling=coupling, parameters=parameters)
    findings, _ = certified_findings(run)
    assert len(findings) == 3 and all(finding.holds for finding in findings)


def test_what_is_proved_between_the_rows_is_sharp(bump: Run) -> None:
    """The bound for all times over what a ten times finer grid finds: above it, and by less than 1 %."""
    t, x = bump.trajectory.time, bump.trajectory.columns(NAMES)
    found, norm = _motions(bump, t, x[0], np.zeros(14)), energy_norm(Car())
    _, e, _ = found.at(np.linspace(0.0, STOP, 6001))
    assert 1.0 <= found.largest_error(norm) / norm(e.T).max() < 1.01


@pytest.mark.parametrize("roads", [None, "curv:45", "lip:0.72"])
def test_neither_is_one_in_which_states_rest(roads: str | None) -> None:
    """Both sides meet the bump at once: nothing rolls, though on other roads of the class it might."""
    run = run_of("bump", parameters={"tau0": 0.0})
    assert not np.any(run.trajectory["body.roll"])
    findings, reason = certified_findings(run, roads=road_class(roads) if roads else None)
    assert reason == "" and all(finding.holds for finding in findings)


# ---------------------------------------------------------------------------------------------------- tampered runs
@pytest.mark.parametrize("change", [shifted, halved])
def test_tampered_runs_are_falsified(bump: Run, change: Callable[[Any], None]) -> None:
    (authentic, rows, _), _ = certified_findings(tampered(bump, change))
    assert not authentic.holds and not rows.holds
    if change is shifted:
        assert "column axle_r.roll" in rows.source and "the first row out: 302" in rows.source


def test_another_car_than_the_record_says_is_falsified(bump: Run) -> None:
    other = run_of("bump", parameters={"b1": 1.01 * Car().b1})
    (_, rows, _), _ = certified_findings(replace(other, record=bump.record))
    assert not rows.holds and rows.measured > 100.0


def test_a_shift_within_the_tolerance_is_not(bump: Run) -> None:
    """What falsifies is the size of the change, not that there is one."""
    size = 1e-7 * np.abs(bump.trajectory["axle_r.roll"]).max()

    def little(states: np.ndarray[Any, Any]) -> None:
        states[300:, NAMES.index("axle_r.roll")] += size

    assert certified_findings(tampered(bump, little))[0][1].holds


def test_runs_of_which_nothing_is_said_have_a_reason(bump: Run) -> None:
    assert "actuators" in certified_findings(run_of("bump-lqr"))[1]
    early = replace(bump, trajectory=replace(bump.trajectory, time=bump.trajectory.time - 0.1))
    assert "before the road is known" in certified_findings(early)[1]
    large = tampered(bump, lambda states: states.__setitem__(0, 3.0))
    findings, reason = certified_findings(large)
    assert len(findings) == 1 and reason
    with pytest.raises(NotProvedError):
        _motions(large, large.trajectory.time, np.full(14, 3.0), np.zeros(14))


# ---------------------------------------------------------------------------------------------------- files
def exported(run: Run, path: Path, form: str = "{!r}", every: int = 1, header: str = "{}") -> Path:
    """As another tool writes it: its own digits, rows and header."""
    names = ["time", *(header.format(name) for name in NAMES)]
    rows = np.column_stack([run.trajectory.time, run.trajectory.columns(NAMES)])[::every].tolist()
    with path.open("w", newline="") as file:
        writer = csv.writer(file, quoting=csv.QUOTE_NONNUMERIC if form == "{!r}" else csv.QUOTE_MINIMAL)
        writer.writerows([names, *([repr(row[0]), *map(form.format, row[1:])] for row in rows)])
    return path


def check_file(path: Path, *options: str) -> int:
    return main(["check", str(path), "--road-class", "exact", *options])


@pytest.mark.parametrize(
    ("form", "every", "header"),
    [("{!r}", 1, "vehicle.{}"), ("{:.5e}", 5, "{}"), ("{:.4f}", 1, "{}"), ("{:.6g}", 1, "{}")],
)
def test_exports_of_other_tools_pass_and_tampered_ones_do_not(
    bump: Run, tmp_path: Path, form: str, every: int, header: str
) -> None:
    assert check_file(exported(bump, tmp_path / "a.csv", form, every, header)) == 0
    assert (
        check_file(exported(tampered(bump, halved), tmp_path / "b.csv", form, every, header), "--parameters", "bump")
        == 1
    )


def test_an_export_by_fmpy_goes_through_the_same_door(dist: Path, tmp_path: Path) -> None:
    """FMPy steps our vehicle alone on a flat road, from a start off rest, and writes its own CSV."""
    import fmpy
    from fmpy.util import write_csv as fmpy_writes

    result = fmpy.simulate_fmu(
        str(dist / "Vehicle7DOF.fmu"),
        stop_time=0.3,
        output_interval=1e-3,
        step_size=1e-3,
        start_values={"body.roll": 0.01, "axle_r.roll": -0.02},
        output=NAMES,
        fmi_type="CoSimulation",
    )
    fmpy_writes(str(tmp_path / "fmpy.csv"), result)
    flat = tmp_path / "flat.toml"
    flat.write_text('[parameters]\nprofile = "flat"\nenabled = false\n')
    assert check_file(tmp_path / "fmpy.csv", "--parameters", str(flat)) == 0
    assert check_file(tmp_path / "fmpy.csv", "--parameters", "bump") == 1


def test_another_car_or_road_in_run_json_is_falsified(bump: Run, tmp_path: Path) -> None:
    path = exported(bump, tmp_path / "a.csv")
    other = tmp_path / "other.toml"
    other.write_text('[parameters]\nb1 = 1300.0\nenabled = false\nprofile = "bump"\n')
    assert check_file(path, "--parameters", str(other)) == 1


@pytest.mark.parametrize(
    ("row", "column", "cell", "said"),
    [
        (7, 3, "nan", "row 8, column 'body.pitch'"),
        (7, 0, "0.005", "row 8, column 'time'"),  # twice
        (7, 0, "0.001", "row 8, column 'time'"),  # back
        (0, 2, "body.roll [deg]", "column 'body.roll': wanted the unit rad, got deg"),
        (0, 4, "wheel.heave", "are missing"),
        (7, 14, "", "row 8, column"),
    ],
)
def test_what_is_no_export_is_refused(
    bump: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str], row: int, column: int, cell: str, said: str
) -> None:
    path = exported(bump, tmp_path / "a.csv", "{:.9e}")
    rows = list(csv.reader(path.read_text().splitlines()))
    rows[row][column] = cell
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    assert check_file(path) == 2
    assert said in capsys.readouterr().err


def test_a_gap_a_class_and_options_of_a_run_are_refused(
    bump: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = exported(bump, tmp_path / "a.csv")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:100] + lines[103:]))
    assert check_file(path) == 2
    assert "row 101, column 'time': a gap of 0.004 s" in capsys.readouterr().err
    assert main(["check", str(path)]) == 2
    for wrong in ("curv", "curv:nan", "lip:-1", "smooth:3"):
        assert main(["check", str(path), "--road-class", wrong]) == 2
        assert "wanted exact, curv:H2" in capsys.readouterr().err
    assert main(["check", str(tmp_path), "--road-class", "exact"]) == 2


def test_the_digits_that_a_column_prints_are_seen() -> None:
    np.testing.assert_allclose(_rounding(["1.2500", "0.0300", "0"]), [0.5e-2, 0.5e-2, 0.5e-2])
    np.testing.assert_allclose(_rounding(["1.2345", "0.0301", "0"]), [0.5e-4, 0.5e-4, 0.5e-4])
    np.testing.assert_allclose(_rounding(["1.234e+02", "5.301e-05"]), [0.05, 0.5e-8])
    assert _rounding(["0.0", "0"]).tolist() == [0.0, 0.0]


def test_times_printed_to_a_few_digits_falsify_no_motion(
    bump: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows of the exact motion at k/300 s, their times printed to 1e-5 s."""
    monkeypatch.setattr("analysis.certificates.run_certificates.own_error", lambda run: 1e-9)
    t = np.arange(100) / 300.0
    x = _motions(bump, t, np.zeros(14), np.zeros(14)).at(t)[0]
    for change, holds in ((0.0, True), (2e-4, False)):
        path = tmp_path / "a.csv"
        x[60:, NAMES.index("axle_r.roll")] += change
        lines = [
            ",".join(["time", *NAMES]),
            *(f"{s:.5f}," + ",".join(map(repr, r)) for s, r in zip(t, x.tolist(), strict=True)),
        ]
        path.write_text("\n".join(lines))
        run, rounding = read_export(path, read_scenario("bump"))
        findings, reason = certified_findings(run, rounding)
        assert reason == "" and all(finding.holds for finding in findings) is holds
        exact, _ = certified_findings(run, {**rounding, "time": np.zeros(len(t))})
        assert not exact[1].holds


def test_how_far_a_motion_gets_in_a_little_time_is_bounded_and_nearly_so(bump: Run) -> None:
    """At rows between corners and at them, against the exact motion within that time."""
    form, late = car_form(Car(), order=1), np.full(120, 5e-5)
    t = np.linspace(1e-3, 0.4, 120).round(3)
    motion = _motions(bump, np.array([0.0, STOP]), np.zeros(14), np.zeros(14))
    x, signal = motion.at(t)[0], road_signal(road_parameters(bump.parameters))
    bound = moved(form, x, np.zeros_like(x), late, *input_within(signal, t, late))
    far = np.max([np.abs(motion.at(t + s)[0] - x) for s in np.linspace(-5e-5, 5e-5, 5)], axis=0)
    assert (far <= bound).all()
    assert 1.0 <= np.median(bound.max(axis=0) / far.max(axis=0)) < 1.5
    with pytest.raises(InputError, match="too coarse for this car"):
        moved(form, x, x, 1e3 * late, np.zeros((120, 8)), np.zeros((120, 8)))


def test_times_that_rise_by_one_step_are_exact() -> None:
    assert not _late(["0.0", "0.01", "0.02", "0.03", "0.035"]).any()
    np.testing.assert_allclose(_late(["0.00000", "0.00333", "0.00667", "0.01000", "0.01333"]), 0.5e-5)
    assert (_late(["0.0", "0.1", "0.2", "0.30000000000000004"]) <= 0.5e-16).all()
    with pytest.raises(InputError, match="column 'time'"):
        steepest(np.array([0.0, 0.1, 0.15]), np.full(3, 0.05), np.zeros((3, 4)), np.zeros((3, 4)), 1.0, curved=True)


def test_the_run_command_writes_what_is_proved(bump: Run, tmp_path: Path) -> None:
    write_csv(bump.trajectory, tmp_path / "a.csv")
    assert check_file(tmp_path / "a.csv", "--parameters", "bump") == 0
