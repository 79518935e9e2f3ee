"""Exported trajectories: what is no motion of this car is falsified, honest runs are not, and bad files are refused."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.__main__ import main
from analysis.bertolino_baksa.balls import NotProvedError
from analysis.car import car_form, road_signal
from analysis.certificates.exact_car import energy_norm
from analysis.certificates.exported import _rounding
from analysis.certificates.run_certificates import _motions, certified_findings
from analysis.certificates.unknown_roads import road_class
from analysis.cosimulation import simulate
from analysis.errors import InputError
from analysis.reference import road_parameters
from analysis.report import read_findings
from analysis.scenario import built_in_scenarios, read_scenario
from analysis.trajectory import Run, write_csv
from fmu_src.quantities import ROAD_HEIGHTS, STATES
from fmu_src.vehicle.parameters import Car

NAMES = [q.name for q in STATES]
STOP = 0.45


def run_of(name: str, **changes: Any) -> Run:
    scenario = read_scenario(name)
    parameters = {**scenario.parameters, **changes.pop("parameters", {})}
    return simulate(replace(scenario, **{"stop_time": STOP, "parameters": parameters, **changes}))


@pytest.fixture(scope="module")
def bump() -> Run:
    return run_of("bump")


def tampered(run: Run, change: Callable[[np.ndarray[Any, Any]], None]) -> Run:
    """The run with its states (N, 14) changed in place."""
    where = [run.trajectory.names.index(name) for name in NAMES]
    values, states = run.trajectory.values.copy(), run.trajectory.columns(NAMES)
    change(states)
    values[:, where] = states
    return replace(run, trajectory=replace(run.trajectory, values=values))


# ---------------------------------------------------------------------------------------------------- honest runs
@pytest.mark.parametrize("name", built_in_scenarios())
def test_each_scenario_is_judged_or_has_a_reason(name: str) -> None:
    """Under actuators, the paper's time-varying gain among them, the car is another: nothing is claimed of it."""
    findings, reason = certified_findings(run_of(name, stop_time=0.35))
    if read_scenario(name).parameters["enabled"]:
        assert (findings, reason) == ([], "the actuators act, and the proof is of the car without them")
    else:
        (rows, between) = findings
        assert reason == "" and between.holds and rows.holds and 1e-6 < rows.measured < 0.5


HARDWARE: list[dict[str, Any]] = [
    {"sample_time": 5e-3, "actuator_lag": 0.01},
    {"force_limit": 50.0},
    {"actuators": "semi-active"},
]


@pytest.mark.parametrize("hardware", HARDWARE, ids=[next(iter(h)) for h in HARDWARE])
def test_neither_is_hardware_judged_once_it_acts(hardware: dict[str, Any]) -> None:
    """Until the controller begins, the car is the passive one, and judged."""
    parameters = {"activation": "at t_on", "t_on": 0.1, **hardware}
    assert "actuators act" in certified_findings(run_of("bump-full-car", stop_time=0.2, parameters=parameters))[1]
    before, _ = certified_findings(run_of("bump-full-car", stop_time=0.05, parameters=parameters))
    assert len(before) == 2 and all(f.holds for f in before)


@pytest.mark.parametrize("coupling", ["jacobi", "gauss-seidel"])
def test_neither_are_runs_that_begin_late_and_off_rest(coupling: str) -> None:
    """From 0.13 s on, between two corners of the bump, from a start that is a motion of its own."""
    parameters = {"road_sampling": "start" if coupling == "jacobi" else "end"}
    start = {"body.roll": 0.01, "der(wheel_fl.heave)": 0.2}
    run = run_of("bump", start_time=0.13, start=start, coupling=coupling, parameters=parameters)
    (rows, between), _ = certified_findings(run)
    assert rows.holds and between.holds


def test_what_is_proved_between_the_rows_is_sharp(bump: Run) -> None:
    """The bound for all times over what a ten times finer grid finds: above it, and by less than 1 %."""
    t, x = bump.trajectory.time, bump.trajectory.columns(NAMES)
    found, norm = _motions(bump, t, x[0], np.zeros(14)), energy_norm(Car())
    _, e, _ = found.at(np.linspace(0.0, STOP, 6001))
    assert 1.0 <= found.largest_error(norm) / norm(e.T).max() < 1.01


# ---------------------------------------------------------------------------------------------------- tampered runs
def shifted(states: np.ndarray[Any, Any]) -> None:
    states[300:, NAMES.index("axle_r.roll")] += 2e-4


def halved(states: np.ndarray[Any, Any]) -> None:
    states *= 0.5


@pytest.mark.parametrize("change", [shifted, halved])
def test_tampered_runs_are_falsified(bump: Run, change: Callable[[Any], None]) -> None:
    (rows, _), _ = certified_findings(tampered(bump, change))
    assert not rows.holds
    if change is shifted:
        assert "column axle_r.roll" in rows.source and "the first row out: 302" in rows.source


@pytest.mark.parametrize(("sampling", "least"), [("end", 100.0), ("start", 2.0)])
def test_another_car_than_the_record_says_is_falsified(sampling: str, least: float) -> None:
    """b1 + 1 %, whether our master or another's order couples the FMUs; the row and the column are named."""
    coupling = {"end": "gauss-seidel", "start": "jacobi"}[sampling]
    honest, other = (
        run_of("bump", coupling=coupling, parameters={"road_sampling": sampling, "b1": b1})
        for b1 in (Car().b1, 1.01 * Car().b1)
    )
    assert certified_findings(honest)[0][0].holds
    (rows, _), _ = certified_findings(replace(other, record=honest.record))
    assert not rows.holds and rows.measured > least
    assert "row 107, column der(wheel_fl.heave)" in rows.source and "the first row out" in rows.source


def test_a_shift_within_the_tolerance_is_not(bump: Run) -> None:
    """What falsifies is the size of the change, not that there is one."""
    size = 1e-7 * np.abs(bump.trajectory["axle_r.roll"]).max()

    def little(states: np.ndarray[Any, Any]) -> None:
        states[300:, NAMES.index("axle_r.roll")] += size

    assert certified_findings(tampered(bump, little))[0][0].holds


def test_runs_of_which_nothing_is_said_have_a_reason(bump: Run) -> None:
    assert "actuators" in certified_findings(run_of("bump-lqr"))[1]
    early = replace(bump, trajectory=replace(bump.trajectory, time=bump.trajectory.time - 0.1))
    assert "before the road is known" in certified_findings(early)[1]
    large = tampered(bump, lambda states: states.__setitem__(0, 3.0))
    findings, reason = certified_findings(large)
    assert findings == [] and reason
    with pytest.raises(NotProvedError):
        _motions(large, large.trajectory.time, np.full(14, 3.0), np.zeros(14))


# ---------------------------------------------------------------------------------------------------- unknown roads
@pytest.mark.parametrize("form", ["curv:45", "lip:0.7"])
def test_rows_and_bound_on_a_class_of_roads(bump: Run, form: str) -> None:
    """The bump is of both classes: its bound for the class is above its own, and its rows are not falsified."""
    roads = road_class(form)
    (rows, between), reason = certified_findings(bump, roads=roads)
    assert reason == "" and rows.holds and between.holds
    assert not certified_findings(tampered(bump, halved), roads=road_class("curv:45"))[0][0].holds


def everywhere(run: Run, form: str) -> tuple[object, object]:
    t, heights = run.trajectory.time, run.trajectory.columns([q.name for q in ROAD_HEIGHTS])
    road = fitted_road(t, heights, np.spacing(heights), road_class(form))
    return on_all_roads(_motions(run, t, np.zeros(14), np.zeros(14), road), road), road


def test_every_road_of_the_class_is_in_what_is_proved(bump: Run) -> None:
    """Roads through the same heights, with parabolas of |h''| = 45 - 39.5 m/s² between rows, signs by chance or near
    the wheels' own frequency: x stays within `off` of the fitted road's motion, and x - x_lin within its bound.
    """
    found, _ = everywhere(bump, "curv:45")
    form, signal, norm = car_form(Car(), order=1), road_signal(road_parameters(bump.parameters)), energy_norm(Car())
    rng, steps, parts = np.random.default_rng(4), 400, 16
    fine = np.linspace(0.0, 1e-3 * steps, parts * steps + 1)
    k = np.minimum(np.arange(len(fine)) // parts, steps - 1)
    signs = np.stack(
        [rng.choice([-1.0, 1.0], (4, steps)), np.tile(np.sign(np.sin(0.075 * np.arange(steps))), (4, 1))], 2
    )
    bows = 2.75 * ((fine - 1e-3 * k) * (1e-3 * (k + 1) - fine))[:, None]
    inputs = np.stack([signal(fine)] * 2, axis=2)
    inputs[:4] += signs[:, k] * bows  # their rates do nothing: the default car's tyres have no dampers
    x = lin = np.zeros((14, 2))
    rows = [(x, lin)]
    h = 2e-3 / parts
    for at in range(0, parts * steps, 2):
        slopes = [(0.0 * x, 0.0 * lin)]
        for part, i in ((0.0, at), (0.5, at + 1), (0.5, at + 1), (1.0, at + 2)):
            y, z = x + part * h * slopes[-1][0], lin + part * h * slopes[-1][1]
            slopes.append((form.rate(y, inputs[:, i]), form.A @ z + form.B @ inputs[:, i]))
        x, lin = (
            v + h / 6.0 * (slopes[1][n] + 2.0 * (slopes[2][n] + slopes[3][n]) + slopes[4][n])
            for n, v in enumerate((x, lin))
        )
        rows.append((x, lin))
    motion = np.array(rows)  # (N, 2, 14, 2)
    expected, _, proved = found.motions.at(fine[::2])
    for one in np.moveaxis(motion, 3, 0):
        assert (np.abs(one[:, 0] - expected) <= found.off + proved + 1e-9).all()
        assert norm((one[:, 0] - one[:, 1]).T).max() < found.largest_error(norm)
    assert np.abs(motion[:, 0] - expected[:, :, None]).max() > 1e-4  # the roads are not all the same


def test_a_coarser_class_proves_less_and_one_that_the_heights_leave_is_refused(bump: Run) -> None:
    norm = energy_norm(Car())
    bounds = [everywhere(bump, form)[0].largest_error(norm) for form in ("curv:40", "curv:80")]
    assert bounds[0] < bounds[1]
    with pytest.raises(InputError, match=r"rise faster than 0\.5 m/s"):
        everywhere(bump, "lip:0.5")


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


@pytest.mark.parametrize(("state", "row"), [("body.roll", 5), ("body.pitch", -1)])
def test_a_shift_of_any_angle_from_any_row_on_is_found_there(bump: Run, state: str, row: int) -> None:
    def shift(states: np.ndarray[Any, Any]) -> None:
        states[row:, NAMES.index(state)] += 2e-4

    (rows, _), _ = certified_findings(tampered(bump, shift))
    assert not rows.holds and f"column {state}" in rows.source
    assert f"the first row out: {row % len(bump.trajectory.time) + 2}" in rows.source


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
        (0, 0, "time [ms]", "column 'time': wanted the unit s, got ms"),
        (0, 4, "wheel.heave", "wanted time and all 14 states, but wheel_fl.heave are missing"),
        (0, 0, "seconds", "but time are missing"),
        (0, 2, "vehicle.body.heave", "but body.roll are missing"),
        (0, 15, "vehicle.body.heave", "row 1: column 'body.heave' stands there twice"),
        (7, 14, "", "row 8, column 'der(axle_r.roll)'"),
        (7, 14, "-inf", "row 8, column 'der(axle_r.roll)'"),
        (7, 14, "1,5", "row 8, column 'der(axle_r.roll)'"),
        (1, 1, "m", "row 2, column 'body.heave'"),  # a row of units
        (7, 15, "", "row 8, column 'b1'"),
        (7, 15, "1212", "row 8, column 'b1': wanted 1200.0, as the car and road of bump have it, got 1212.0"),
    ],
)
def test_what_is_no_export_is_refused(
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
        assert found is not None and [f.holds for f in found] == [holds, holds]


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


def test_the_run_command_writes_what_is_proved(bump: Run, tmp_path: Path) -> None:
    write_csv(bump.trajectory, tmp_path / "a.csv")
    assert check_file(tmp_path / "a.csv", "--parameters", "bump") == 0
