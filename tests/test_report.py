"""Report of a small made-up run: its numbers, that it repeats to the byte, and what it refuses."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from made_up_run import CAR, EVERYTHING, ROAD_NAMES, made_up_run

from analysis import report, run_figures, tyres
from analysis.errors import InputError
from analysis.findings import Finding
from analysis.trajectory import Run, Trajectory, write_run
from fmu_src.quantities import PARAMETERS, STATES, TABLE, TYRE_FORCES

FINDING = Finding(
    claim="d(T + U)/dt <= 0 & nothing else",
    equation="(3.1)",
    measured=1.0,
    expected=1.25,
    tolerance=0.5,
    unit="m/s2",
    source="trajectory.csv",
)


def written(run: Run, folder: Path, *, counterpart: Run | None = None, findings: Any = None) -> Path:
    """This run as a run folder."""
    folder.mkdir(exist_ok=True)
    write_run(run, folder)
    if counterpart:
        (folder / "counterpart").mkdir()
        write_run(counterpart, folder / "counterpart")
    if findings is not None:
        (folder / "findings.json").write_text(json.dumps(findings), encoding="utf-8")
    return folder


class Page(HTMLParser):
    """Elements, their attributes and the text of a page; stumbles over elements that are not closed in order."""

    VOID = ("meta", "img", "br")

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.open: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a run that has everything, with a hostile title."""
    title = "<script>alert('1')</script> & <img src=http://example.org/x>"
    findings = [FINDING.as_json(), {**FINDING.as_json(), "measured": float("nan"), "holds": True}]
    run, counterpart = made_up_run(title=title), made_up_run(enabled=True)
    folder = written(run, tmp_path_factory.mktemp("runs") / "full", counterpart=counterpart, findings=findings)
    return report.write_report(folder)


# ------------------------------------------------------------------ numbers
def test_static_loads_carry_the_car() -> None:
    run = made_up_run()
    loads = tyres.static_loads(run)
    mass = sum(PARAMETERS[name].start for name in ("m", "m11", "m12", "m21", "m22", "m2"))
    assert loads.sum() == pytest.approx(9.81 * mass)
    assert loads[0] == pytest.approx(9.81 * (870.0 * 1.5 / 5.0 + 30.0)) and loads[0] == loads[1]
    shifted = tyres.tyre_loads(run) - run.trajectory.columns([q.name for q in TYRE_FORCES])
    np.testing.assert_allclose(shifted, np.tile(loads, (201, 1)))


def test_loss_of_contact_is_timed_between_the_samples() -> None:
    time = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    assert tyres.time_below_zero(time, np.array([3.0, -1.0, -1.0, 1.0, 0.0])) == pytest.approx(0.25 + 1.0 + 1.0)
    assert tyres.time_below_zero(time, -np.ones(5)) == 5.0
    assert tyres.time_below_zero(time, np.zeros(5)) == 0.0


def test_extremes_are_signed_and_timed() -> None:
    trajectory = Trajectory(
        time=np.array([0.0, 1.0, 2.0]), names=("body.roll",), values=np.array([[1e-3], [-5e-3], [2e-3]])
    )
    found = report.extreme(trajectory, TABLE["body.roll"])
    assert (found.largest, found.time, found.end, found.unit) == pytest.approx((-5.0, 1.0, 2.0, "mrad"))


@pytest.mark.parametrize(
    ("latex", "html"),
    [
        (r"z", "z"),
        (r"\dot{z}_{11}", "z\u0307<sub>11</sub>"),
        (r"\ddot{\psi}_2", "ψ\u0308<sub>2</sub>"),
        (r"J_{z\psi_2}", "J<sub>zψ<sub>2</sub></sub>"),
    ],
)
def test_symbols_are_read_as_html(latex: str, html: str) -> None:
    assert report.symbol_html(latex) == f"<var>{html}</var>"


def test_no_symbol_of_the_table_is_left_in_latex() -> None:
    assert not [q.name for q in TABLE.values() if set(report.symbol_html(q.symbol)) & set("\\{}_")]


# ------------------------------------------------------------------ the page
def test_the_page_stands_alone_and_a_hostile_title_stays_text(full: Path) -> None:
    page = Page(full)
    assert full.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert page.text.count("<script>alert('1')</script> & <img src=http://example.org/x>") == 2  # title, heading
    assert not page.all("script") and not page.all("link")
    addresses = [a[key] for _, a in page.elements for key in ("src", "href", "srcset", "action") if key in a]
    assert len(addresses) == len(page.all("figure")) == 9
    for address in addresses:
        head, _, data = str(address).partition(",")
        assert head == "data:image/svg+xml;base64"
        ElementTree.fromstring(base64.b64decode(data))


def test_verdicts_are_words_and_follow_from_the_numbers(full: Path) -> None:
    text = Page(full).text
    assert "1 of 2 claims hold." in text
    assert text.count("✓ holds") == 1 and text.count("✗ does not hold") == 1  # the file says that nan holds
    assert FINDING.claim in text and "m/s²" in text


def test_the_page_says_what_was_simulated_and_how_to_repeat_it(full: Path) -> None:
    text = Page(full).text
    summary = "half-sine bump, 10 mm high and 0.5 m long · 10 m/s · 0 s to 2 s in steps of 10 ms"
    assert f"{summary} · coupling gauss-seidel · controller off" in text
    assert "python -m analysis simulate RUN/run.json -o NEW" in text
    assert "5ha256" in text and "9u1d" in text and "numpy 2.4.6" in text
    assert "not the paper's" in text and "pulls as well as pushes" in text
    for q in (*STATES, *(PARAMETERS[name] for name in CAR + ROAD_NAMES)):
        assert q.text in text
    assert "whether the profile lies in the track of the front left wheel" in text  # words of a switch


def test_a_lost_contact_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_figures, "render", lambda subject: b"")
    run = made_up_run()
    assert "lost" not in Page(report.write_report(written(run, tmp_path / "kept"))).text
    run.trajectory.values[100:111, EVERYTHING.index("tyre_rr.force")] = -1e5
    text = Page(report.write_report(written(run, tmp_path / "lost"))).text
    assert "−9.796e+041lost" in text.replace("\n", "")  # smallest load, at 1 s
    assert text.count("kept") == 3 and "lost for 120 ms in all" in text  # ten steps, and 98 % of one on both sides


def test_a_run_alone_is_enough_and_little_of_it(tmp_path: Path) -> None:
    folder = written(made_up_run(names=("body.heave", "wheel_fl.heave", "wheel_fr.heave")), tmp_path / "run")
    text = Page(report.write_report(folder)).text
    assert [path.name for path in (folder / "figures").iterdir()] == ["figure-03-front-wheels.svg"]
    assert "Not drawn: Car rotation angles; not recorded: body.roll, body.pitch." in text
    assert "certify RUN" in text and "not been checked" in text and "no counterpart" in text
    assert "tyre forces were not all recorded" in text and "body roll, left side up" not in text


def test_a_single_row_is_a_run(tmp_path: Path) -> None:
    run = made_up_run(names=("h_fl", "h_fr", "h_rl", "h_rr", "axle_r.roll"))
    first = replace(run.trajectory, time=run.trajectory.time[:1], values=run.trajectory.values[:1])
    assert report.write_report(written(replace(run, trajectory=first), tmp_path / "run")).is_file()


def test_the_same_run_gives_the_same_page_and_nothing_besides(tmp_path: Path) -> None:
    run = made_up_run(names=("axle_r.roll",))
    pages = [report.write_report(written(run, tmp_path / name)).read_bytes() for name in ("one", "two")]
    assert pages[0] == pages[1]
    assert {path.name for path in (tmp_path / "one").iterdir()} == {
        "trajectory.csv",
        "run.json",
        "figures",
        "report.html",
    }


@pytest.mark.parametrize(
    ("findings", "said"),
    [
        ({"claim": "x"}, "wanted a list of findings"),
        ([FINDING.as_json(), 7], "finding 2: wanted an object, got 7"),
        ([{**FINDING.as_json(), "measured": "1.0"}], "finding 1: measured: wanted a number, got '1.0'"),
        ([{**FINDING.as_json(), "claim": None}], "finding 1: claim: wanted a text, got None"),
    ],
)
def test_bad_findings_are_named_and_an_older_report_stays(tmp_path: Path, findings: Any, said: str) -> None:
    folder = written(made_up_run(names=("axle_r.roll",)), tmp_path / "run", findings=findings)
    (folder / "report.html").write_text("older")
    with pytest.raises(InputError, match=said):
        report.write_report(folder)
    assert (folder / "report.html").read_text() == "older"


def test_bad_records_are_named(tmp_path: Path) -> None:
    run = made_up_run(names=tuple(q.name for q in TYRE_FORCES))
    del run.record["parameters"]["vehicle"]["m"]
    with pytest.raises(InputError, match=r"run\.json: parameters: wanted a number for m, got none"):
        report.write_report(written(run, tmp_path / "run"))
    run.record["parameters"]["vehicle"] = [1]
    with pytest.raises(InputError, match=r"run\.json: parameters: vehicle: wanted an object, got \[1\]"):
        report.write_report(written(run, tmp_path / "run"))
