"""Certificates beside runs: what holds over time, what the figures show, definition 2.1 on an exported trajectory."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from made_up_run import made_up_run
from matplotlib.figure import Figure

from analysis.__main__ import _certify_shortly, main
from analysis.bertolino_baksa.adversary import _errors, furthest_starts, motions
from analysis.bertolino_baksa.certificate import Certificate, to_json
from analysis.bertolino_baksa.funnel import ends, funnel
from analysis.bertolino_baksa.proof import Proof
from analysis.car import car_form, road_signal
from analysis.certificates import adversary_points as adversary
from analysis.certificates import certificate_command, certified_run
from analysis.certificates.adversary_points import Points, adversary_points
from analysis.certificates.car_certificates import certify_car
from analysis.certificates.certificate_figures import (
    _delta_panel,
    _magnified_panel,
    _size_panel,
    _tube_panel,
    in_tube,
)
from analysis.certificates.directed import at_least
from analysis.cosimulation import simulate
from analysis.errors import InputError
from analysis.figures import described
from analysis.methods.linear_response import linear_response
from analysis.reference import car_of, road_parameters
from analysis.scenario import read_scenario
from analysis.trajectory import Run, read_run, write_run
from fmu_src.quantities import STATES

NAMES = [q.name for q in STATES]
HEAVE, AXLE_ROLL = STATES[0], STATES[6]
Made = tuple[Certificate, Proof]


@pytest.fixture(scope="module")
def made() -> Made:
    return certify_car(read_scenario("bump").parameters)


@pytest.fixture(scope="module")
def points(made: Made) -> list[Points]:
    return adversary_points(made[0])


@pytest.fixture
def at_hand(made: Made, points: list[Points], monkeypatch: pytest.MonkeyPatch) -> None:
    """What takes long was made before."""
    for module in (certificate_command, certified_run):
        monkeypatch.setattr(module, "certify_car", lambda parameters: made)
    for module in (adversary, certified_run):
        monkeypatch.setattr(module, "adversary_points", lambda certificate: points)


def run_of(name: str = "bump", **changes: Any) -> Run:
    return simulate(replace(read_scenario(name), **{"stop_time": 0.6, **changes}))


@pytest.fixture(scope="module")
def bump() -> Run:
    return run_of()


@pytest.fixture
def folder(bump: Run, tmp_path: Path) -> Path:
    (tmp_path / "run").mkdir()
    write_run(bump, tmp_path / "run")
    return tmp_path / "run"


# ---------------------------------------------------------------------------------------------------- over time
@pytest.mark.parametrize("which", range(3))
def test_motions_from_within_delta_stay_in_the_funnel_which_is_not_much_wider(made: Made, which: int) -> None:
    """Starts that go far, and others: inside at all times, the furthest within 10 % of it."""
    (certificate, proof), rng = made, np.random.default_rng(which)
    norm, table = certificate.claims[which].norm, certificate.claims[which].table
    delta = float(table[len(table) // 2, 1])
    size, bound = funnel(proof, norm, delta)
    form, signal = car_form(car_of({})), road_signal(road_parameters({}))
    far = furthest_starts(form, norm, delta, *_errors(form, signal, np.zeros(14), 0.5), 11)
    off = np.concatenate([far, rng.normal(size=(14, 20))], axis=1)
    times, x = zip(*motions(form, signal, off * delta / norm(off), 0.5, step=2.5e-4), strict=True)
    x_lin = linear_response(form.A, form.B, np.zeros(14), signal, np.array(times))
    cell = np.searchsorted(ends(proof), times, side="right") - 1
    e = np.moveaxis(np.array(x), 0, 1) - x_lin[:, :, None]  # (14, times, starts)
    assert (np.abs(e) <= bound[cell].T[:, :, None]).all()
    ratio = norm(e) / size[cell][:, None]
    assert 0.9 < ratio.max() <= 1.0


def test_without_a_start_the_funnel_is_the_floor(made: Made) -> None:
    certificate, proof = made
    for claim in certificate.claims:
        size, _ = funnel(proof, claim.norm, 0.0)
        assert size.max() <= claim.floor <= 1.002 * size.max()


# ---------------------------------------------------------------------------------------------------- figures
def test_an_adversary_stays_below_what_is_certified_and_near_it(points: list[Points]) -> None:
    for each in points:
        assert (each.ratio > 1.0).all()
        assert each.ratio[each.rows[:, 1] <= each.claim.largest_delta / 3.0].max() <= 1.10
        assert each.rows[-1, 1] == each.claim.largest_delta


def test_delta_is_drawn_as_a_stair_with_its_floor_and_the_points(points: list[Points]) -> None:
    ax = _delta_panel(points[0], Figure().subplots())
    stair, dots, floor, top = ax.get_lines()
    table = points[0].claim.table
    np.testing.assert_array_equal(stair.get_xdata()[:-1], table[:, 0])
    np.testing.assert_array_equal(stair.get_ydata(), [*table[:, 1], table[-1, 1]])
    assert stair.get_drawstyle() == "steps-post"  # a δ holds from its ε on, not before it
    np.testing.assert_array_equal(dots.get_xdata(), points[0].found)
    assert floor.get_xdata()[0] == points[0].claim.floor and top.get_ydata()[0] == table[-1, 1]


@pytest.mark.parametrize("start", [{}, {"body.roll": 0.02}])
def test_a_run_is_drawn_inside_its_tube(made: Made, bump: Run, start: dict[str, float]) -> None:
    run = run_of(start=start) if start else bump
    found = in_tube(run, *made)
    off, own = np.abs(found.off), 2e-7 * np.abs(found.linear).max(axis=0)
    assert (off <= found.tube).all() and (off <= found.bound + own).all()
    assert found.claim.norm(run.trajectory.columns(NAMES)[0]) < found.row[1]
    heave = _tube_panel(found, HEAVE, Figure().subplots()).get_lines()
    np.testing.assert_allclose(heave[1].get_ydata(), 1e3 * run.trajectory["body.heave"])
    roll = _magnified_panel(found, AXLE_ROLL, Figure().subplots())
    scale = np.abs(roll.get_lines()[0].get_ydata()).max() / off[:, 6].max()
    assert 1.0 <= np.abs(roll.get_lines()[0].get_ydata()).max() < 1000.0
    assert f"$10^{{{-round(np.log10(scale))}}}$ rad" in roll.get_ylabel()
    run_line = _size_panel(found, Figure().subplots()).get_lines()[1]
    assert run_line.get_ydata().max() == pytest.approx(found.claim.norm(found.off.T).max())


def test_the_bounds_end_with_the_last_piece(made: Made, bump: Run) -> None:
    late = replace(bump, trajectory=replace(bump.trajectory, time=10.0 * bump.trajectory.time))
    found = in_tube(late, *made)
    beyond = late.trajectory.time >= ends(made[1])[-1]
    assert beyond.any() and np.isnan(found.size[beyond]).all() and np.isfinite(found.size[~beyond]).all()


def test_a_figure_says_its_caption_and_others_are_refused() -> None:
    with pytest.raises(InputError, match="wanted a figure with title and description"):
        described(b"<svg xmlns='http://www.w3.org/2000/svg'/>", "a.svg")
    with pytest.raises(InputError, match="cannot be read as SVG"):
        described(b"<svg", "a.svg")


# ---------------------------------------------------------------------------------------------------- the command
@pytest.mark.usefixtures("at_hand")
def test_certify_puts_proof_and_figures_into_a_run_and_check_and_report_take_them_up(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["certify", str(folder)]) == 0
    assert "for all t >= 0" in capsys.readouterr().out
    for name in ("certified-tube.svg", "certified-delta.svg"):
        ElementTree.fromstring((folder / "figures" / name).read_bytes())
    assert main(["check", str(folder)]) == 0
    assert main(["report", str(folder)]) == 0
    page = (folder / "report.html").read_text()
    assert "certify RUN" not in page and page.count("Definition 2.1") == 2
    findings = [f for f in json.loads((folder / "findings.json").read_text()) if f["equation"] == "definition 2.1"]
    assert len(findings) == 3
    for f in findings:
        assert 0.99 * f["tolerance"] < 1.07 * f["measured"] < 1.08 * f["tolerance"]


def test_a_run_that_leaves_the_tube_is_found_out(made: Made, bump: Run, tmp_path: Path) -> None:
    path = tmp_path / "certificate.json"
    path.write_bytes(to_json(made[0]))
    values = bump.trajectory.values.copy()
    values[300:, bump.trajectory.names.index("axle_r.roll")] += 2e-4
    shifted = replace(bump, trajectory=replace(bump.trajectory, values=values))
    found, reason = certified_run.definition_findings(shifted, path)
    assert reason == "" and not any(f.holds for f in found)


def test_a_start_off_rest_is_judged_by_its_own_epsilon(made: Made, tmp_path: Path) -> None:
    path = tmp_path / "certificate.json"
    path.write_bytes(to_json(made[0]))
    found, _ = certified_run.definition_findings(run_of(start={"body.roll": 0.02}), path)
    assert all(f.holds and f.tolerance > 100.0 * made[0].claims[0].floor for f in found)
    far, reason = certified_run.definition_findings(run_of(start={"body.roll": 1.4}), path)
    assert far == [] and "off x_lin in the energy norm; wanted less than" in reason
    some, reason = certified_run.definition_findings(run_of(start={"body.roll": 0.0175}), path)
    assert "√J" in [f.unit for f in some] and all(f.holds for f in some)
    assert "off x_lin in the weighted sup norm" in reason and "energy" not in reason


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda record: record["parameters"]["vehicle"].update(b1=1212.0), "b1=1212.0"),
        (lambda record: record["parameters"]["road"].update(A=0.011), "A=0.011"),
    ],
)
def test_a_certificate_of_another_car_or_road_is_refused(
    made: Made, folder: Path, capsys: pytest.CaptureFixture[str], change: Callable[[Any], Any], said: str
) -> None:
    (folder / "certificate.json").write_bytes(to_json(made[0]))
    record = json.loads((folder / "run.json").read_text())
    for component in ("controller", "vehicle"):
        record["parameters"][component].pop("b1", None)
    record["parameters"]["vehicle"]["b1"] = 1200.0
    for component in ("controller", "road"):
        record["parameters"][component].pop("A", None)
    record["parameters"]["road"]["A"] = 0.01
    change(record)
    (folder / "run.json").write_text(json.dumps(record))
    assert main(["check", str(folder)]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.usefixtures("at_hand")
def test_certify_says_what_of_a_scenario_it_leaves_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (own := tmp_path / "own.toml").write_text('[start]\n"body.roll" = "1 deg"\n')
    for scenario, said in ((str(own), True), ("bump", False)):
        assert main(["certify", scenario]) == 0
        told = capsys.readouterr().err
        assert ("[start] is left out" in told, "certified without its controller" in told) == (said, said)


@pytest.mark.usefixtures("at_hand")
def test_certify_draws_delta_beside_the_certificate(made: Made, tmp_path: Path) -> None:
    assert main(["certify", "bump", "-o", str(tmp_path / "c.json")]) == 0
    title, caption = described((tmp_path / "c.svg").read_bytes(), "c.svg")
    assert "how far" in title and f"δ_max = {at_least(made[0].claims[0].largest_delta)}" in caption
    assert main(["certify", "bump", "-o", str(tmp_path / "c.svg")]) == 2


@pytest.mark.usefixtures("at_hand")
def test_a_run_is_certified_on_the_way_if_its_road_ends(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    endless = made_up_run()
    endless.record["parameters"]["road"]["profile"] = "sine"
    for run, said in ((endless, "the road has no end"), (made_up_run(enabled=True), "the actuators act")):
        _certify_shortly(run, folder)
        assert said in capsys.readouterr().err and not (folder / "certificate.json").exists()
    _certify_shortly(read_run(folder), folder)
    assert (folder / "certificate.json").is_file()


def test_runs_of_which_the_certificate_says_nothing_have_a_reason(
    bump: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late = replace(bump, trajectory=replace(bump.trajectory, time=bump.trajectory.time + 0.1))
    for run, said in (
        (made_up_run(enabled=True), "the actuators act"),
        (made_up_run(names=tuple(NAMES), enabled=True), "force_fl, force_fr, force_rl, force_rr are not recorded"),
        (made_up_run(names=("body.heave",)), "body.roll"),
        (late, "begins at t = 0.1 s"),
    ):
        assert said in certified_run.silent(run)
    assert certified_run.silent(bump) == ""
    write_run(late, tmp_path)
    assert main(["certify", str(tmp_path)]) == 1
    assert "no certificate: the run begins" in capsys.readouterr().out
    assert main(["certify", str(tmp_path), "--quick"]) == 2
