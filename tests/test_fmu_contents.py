"""What the FMUs hold beside code and description: whole, readable, true of the FMU, and the same bytes anywhere."""

from __future__ import annotations

import io
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import pytest
import pythonfmu
from conftest import ROOT
from fmpy.cross_check.validate_vendor_repo import validate_test_fmu
from lxml import etree
from PIL import Image
from pythonfmu import deploy

import build
from fmu_src.controller.law import ControlParameters
from fmu_src.controller.lqr_controller import LqrController
from fmu_src.export import formulas, reference
from fmu_src.quantities import PARAMETERS, STATES
from fmu_src.road.profiles import RoadParameters, road
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.slave import Slave
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

SLAVES: dict[str, type[Slave]] = {s.__name__: s for s in (RoadExcitation, Vehicle7DOF, LqrController)}
LS_REF = "extra/org.fmi-standard.fmi-ls-ref"
DOCUMENTS = {
    "model.png",
    "documentation/index.html",
    "documentation/externalDependencies.txt",
    "documentation/fmi-ls-ref.txt",
    "documentation/licenses/license.txt",
    "documentation/licenses/pythonfmu.txt",
    f"{LS_REF}/fmi-ls-manifest.xml",
}
every_model = pytest.mark.parametrize("model", build.MODELS)


def contents(dist: Path, model: str) -> dict[str, bytes]:
    with zipfile.ZipFile(dist / f"{model}.fmu") as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def table(csv: bytes) -> Any:
    """A structured array of a CSV after the rules of the FMI Cross-Check."""
    return np.genfromtxt(io.BytesIO(csv), delimiter=",", names=True, deletechars="", encoding="utf-8")


def xml(data: bytes) -> Any:
    return etree.fromstring(data)


# ------------------------------------------------------------------ the archive
@every_model
def test_every_entry_is_there_and_none_that_is_not_needed(dist: Path, model: str) -> None:
    names = set(contents(dist, model))
    wanted = DOCUMENTS | {f"{LS_REF}/{model}_ref.csv"}
    assert wanted <= names
    assert (f"{LS_REF}/{model}_in.csv" in names) == bool(SLAVES[model].inputs)
    assert ("resources/requirements.txt" in names) == (model == "LqrController")
    top = {"modelDescription.xml", "model.png", "binaries", "documentation", "extra", "resources"}
    assert {PurePosixPath(name).parts[0] for name in names} == top
    assert not [name for name in names if {"export", "system", "__pycache__"} & set(PurePosixPath(name).parts)]


@every_model
def test_names_are_plain_and_no_entry_is_a_link(dist: Path, model: str) -> None:
    with zipfile.ZipFile(dist / f"{model}.fmu") as archive:
        entries = archive.infolist()
    names = [entry.filename for entry in entries]
    assert names == sorted(set(names))
    for name in names:
        assert name.isascii() and "\\" not in name and not name.startswith("/") and ".." not in name.split("/")
    assert {entry.external_attr for entry in entries} == {0o644 << 16}
    assert {entry.date_time for entry in entries} == {(1980, 1, 1, 0, 0, 0)}


# ------------------------------------------------------------------ picture and pages
@every_model
def test_the_picture_shows_something(dist: Path, model: str) -> None:
    with Image.open(io.BytesIO(contents(dist, model)["model.png"])) as image:
        assert (image.format, image.size) == ("PNG", (600, 400))
        assert set(image.info) <= {"dpi"}  # no date, no software
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
    drawn = (pixels < 245).any(axis=1)
    assert 0.05 < drawn.mean() < 0.7
    assert len(np.unique(pixels // 32, axis=0)) > 30  # of many colours
    edge = drawn.reshape(400, 600)
    assert not (edge[0].any() or edge[-1].any() or edge[:, 0].any() or edge[:, -1].any())  # nothing runs off the sheet


def test_pictures_do_not_depend_on_the_users_style() -> None:
    from matplotlib import rc_context

    from fmu_src.export import drawing, road_drawing

    plain = drawing.png(road_drawing.draw)
    with rc_context({"font.size": 20.0, "savefig.dpi": 50.0, "figure.facecolor": "black", "lines.linewidth": 9.0}):
        assert drawing.png(road_drawing.draw) == plain


@every_model
def test_the_page_is_whole_and_asks_for_nothing_from_outside(dist: Path, model: str) -> None:
    page = contents(dist, model)["documentation/index.html"].decode()
    root = xml(page.encode())  # HTML that is also XML: every element is closed
    assert page.startswith("<!DOCTYPE html>")
    assert root.findtext("head/title") == root.findtext("body/h1") == model
    outward = {"href", "src", "srcset", "data", "action", "poster", "background"}
    references = [(e.tag, value) for e in root.iter(etree.Element) for key, value in e.attrib.items() if key in outward]
    assert [(tag, value[:22]) for tag, value in references] == [("img", "data:image/png;base64,")]
    assert not re.search(r"https?:|url\(|@import|<script|<link", page)
    assert not re.search(r"[$\\{}]", "".join(root.find("body").itertext())), "a formula was left as LaTeX"
    headings = [h.text for h in root.iter("h2")]
    assert headings == [
        "What it is", "Equations", "Sign conventions", "Variables", "Use in a tool", "Limits", "Reference",
    ]  # fmt: skip
    assert "Bertolino–Bakša stability at nonlinear vibrations of motor vehicles" in page


@every_model
def test_the_page_has_every_variable_of_the_slave(dist: Path, model: str) -> None:
    slave = SLAVES[model]
    root = xml(contents(dist, model)["documentation/index.html"])
    rows = {row[0].findtext("code"): row for row in root.iter("tr") if row[0].tag == "td"}
    reals = [*slave.inputs, *slave.outputs, *(PARAMETERS[name] for name in slave.reals)]
    assert set(rows) == {q.name for q in reals} | {c.name for c in slave.choices} | set(slave.switches)
    for q in reals:
        symbol, causality, unit, start, limits, words = ("".join(cell.itertext()) for cell in rows[q.name][1:])
        assert symbol == "".join(xml(f"<i>{formulas.formula(q.symbol)}</i>".encode()).itertext())
        assert unit == q.unit.replace(".", "·").replace("2", "²")
        assert words == q.text
        if causality == "parameter":
            assert float(start.replace("−", "-")) == q.start
        assert (limits == "> 0") == q.positive
    for choice in slave.choices:
        assert all(value in rows[choice.name][-1].text for value in choice.values)


def test_formulas() -> None:
    assert formulas.formula(r"\ddot z_{11}^2") == "<i>z\u0308</i><sub>11</sub><sup>2</sup>"
    assert formulas.formula(r"\dot{\psi}_2 - x'") == "<i>ψ\u0307</i><sub>2</sub> − <i>x</i>′"
    assert formulas.formula(r"\cos^2\psi") == "cos<sup>2</sup>\u2009<i>ψ</i>"
    assert formulas.with_formulas("a $b$ c") == 'a <span class="m"><i>b</i></span> c'
    with pytest.raises(ValueError, match="nosuch"):
        formulas.formula(r"\nosuch x")


@every_model
def test_texts_say_what_is_needed(dist: Path, model: str) -> None:
    files = contents(dist, model)
    assert files["documentation/licenses/license.txt"] == (ROOT / "LICENSE").read_bytes()
    assert b"NTNU" in files["documentation/licenses/pythonfmu.txt"]
    needs = files["documentation/externalDependencies.txt"].decode("ascii")
    for word in (
        "CPython 3.10",
        "LD_PRELOAD",
        "PYTHONHOME",
        "sys.base_prefix",
        "_Py_NoneStruct",
        "glibc 2.32",
        "SIGTERM",
    ):
        assert word in needs
    assert ("scipy>=" in needs) == (model == "LqrController")
    assert "control>=" not in needs


WITHOUT_NUMPY = """
import sys
sys.modules.update(dict.fromkeys(("numpy", "scipy", "control")))
from fmu_src.controller.lqr_controller import LqrController
from fmu_src.quantities import PARAMETERS

def needs(design, *changed, feedback="states"):
    c = LqrController(instance_name="c", resources=sys.argv[1])
    c.chosen[2], c.chosen[4] = design, feedback
    for name in changed:
        c.p[c.reals.index(name)] += 1.0 if name == "seed" else 1.0 + 0.01 * PARAMETERS[name].start
    try:
        c.exit_initialization_mode()
    except RuntimeError as refusal:
        assert "not installed" in str(refusal), refusal
        return True
    return False

pairs = {"m21": ["m22"], "m22": ["m21"]}  # the car takes no others
for design in ("half-car", "full-car"):
    print(*(name for name in LqrController.reals if needs(design, name, *pairs.get(name, []))))
print(needs("half-car", "sample_time", feedback="estimate"), needs("full-car", "sample_time", "force_limit"))
"""


def test_just_what_is_said_to_need_other_packages_needs_them(dist: Path, tmp_path: Path) -> None:
    files = contents(dist, "LqrController")
    said = " ".join(files["documentation/externalDependencies.txt"].decode().split())
    for name in ("lqr_design.json", "lqr_design_full_car.json"):
        (tmp_path / name).write_bytes(files[f"resources/{name}"])
    command = [sys.executable, "-c", WITHOUT_NUMPY, str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    half_car, full_car, rest = (line.split() for line in done.stdout.splitlines())
    for design, needing in (("half-car", half_car), ("full-car", full_car)):
        (listed,) = re.findall(f'design = "{design}" with another value of (.*?);', said)
        assert sorted(listed.split(", ")) == sorted(needing)
    assert rest == ["True", "False"] and 'feedback = "estimate"' in said


def test_pythonfmu_deploy_installs_what_other_designs_need(dist: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    installed: list[str] = []

    def pip(command: list[str], **_: object) -> None:
        assert command[1:5] == ["-m", "pip", "install", "-r"]
        installed.extend(Path(command[5]).read_text().split())

    monkeypatch.setattr(deploy.subprocess, "run", pip)
    deploy.deploy(dist / "LqrController.fmu")
    assert [re.match(r"\w+", line)[0] for line in installed] == ["numpy", "scipy"]  # type: ignore[index]
    modules = [Path(build.PACKAGE, "controller", name).read_text() for name in ("design.py", "riccati.py")]
    imported = set(re.findall(r"^ +(?:import|from) (\w+)", "\n".join(modules), re.MULTILINE))
    assert imported == {"numpy", "scipy"}


# ------------------------------------------------------------------ the reference experiment
@every_model
def test_the_manifest_tells_of_files_that_are_there(dist: Path, model: str) -> None:
    files = contents(dist, model)
    manifest = xml(files[f"{LS_REF}/fmi-ls-manifest.xml"])
    assert manifest.tag == "fmiReferences"
    assert manifest.get("{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    roles = {}
    for related in manifest:
        source = os.path.normpath(f"{LS_REF}/{related.get('source')}").replace(os.sep, "/")
        assert source in files
        roles[related.get("role")] = source
    experiment = xml(files[roles["experiment"]]).find("Experiment")
    assert float(experiment.get("stopTime")) == reference.STOP
    assert {e.tag: f"{LS_REF}/{e.get('source')}" for e in experiment} == {
        "References": roles["result"],
        **({"Stimuli": roles["other"]} if SLAVES[model].inputs else {}),
    }
    named = set(re.findall(r"\w+\.csv", files["documentation/fmi-ls-ref.txt"].decode()))
    assert named - {"result.csv"} == {PurePosixPath(name).name for name in files if name.endswith(".csv")}


@every_model
def test_a_fresh_run_gives_the_reference_results(dist: Path, model: str) -> None:
    files = contents(dist, model)
    wanted = table(files[f"{LS_REF}/{model}_ref.csv"])
    got = table(reference.results(dist / f"{model}.fmu", files.get(f"{LS_REF}/{model}_in.csv")))
    assert wanted.dtype.names == got.dtype.names == ("time", *(q.name for q in SLAVES[model].outputs))
    for name in got.dtype.names:
        np.testing.assert_allclose(got[name], wanted[name], rtol=1e-12, atol=1e-12 * np.abs(wanted[name]).max())


def test_the_reference_results_show_what_their_words_say(dist: Path) -> None:
    results = {model: table(contents(dist, model)[f"{LS_REF}/{model}_ref.csv"]) for model in build.MODELS}
    heights = road(RoadParameters()).heights
    wheels = results["RoadExcitation"]
    for row in wheels[::50]:
        np.testing.assert_allclose([row[name] for name in ("h_fl", "h_fr", "h_rl", "h_rr")], heights(row["time"]))
    assert all(wheels[f"h_{corner}"].max() > 0.0099 for corner in ("fl", "fr", "rl", "rr"))
    car = results["Vehicle7DOF"]
    assert all(np.abs(car[q.name]).max() > 0.05 * q.nominal for q in STATES)
    forces, begin = results["LqrController"], ControlParameters().begin
    before = forces["time"] < begin - 1e-6
    for corner in ("fl", "fr", "rl", "rr"):
        assert not forces[f"force_{corner}"][before].any()
        assert forces[f"force_{corner}"][~before].any()


# ------------------------------------------------------------------ the set for the FMI Cross-Check
@every_model
def test_the_cross_check_accepts_the_set(dist: Path, model: str) -> None:
    (place,) = (dist / "cross-check").glob(f"fmus/2.0/cs/*/PythonFMU/*/{model}")
    assert validate_test_fmu(str(place)) == []
    inputs = {f"{model}_in.csv"} if SLAVES[model].inputs else set()
    assert {file.name for file in place.iterdir()} == inputs | {
        f"{model}.fmu", f"{model}_ref.csv", f"{model}_ref.opt", "README.txt",
    }  # fmt: skip
    assert (place / f"{model}.fmu").read_bytes() == (dist / f"{model}.fmu").read_bytes()
    for csv in place.glob("*.csv"):
        assert csv.stat().st_size <= 1_000_000
        time = table(csv.read_bytes())["time"]
        assert (time[0], time[-1]) == (0.0, reference.STOP)
        assert csv.read_text().startswith('"time","')


# ------------------------------------------------------------------ the same bytes
ELSEWHERE = """
import sys, time
from pathlib import Path
import build, fmu_src
assert Path(fmu_src.__file__).is_relative_to(Path.cwd()), fmu_src.__file__
now = time.time
time.time = lambda: now() + 1e8  # three years later
for model in build.MODELS:
    build.build_fmu(model, build.PACKAGE, Path(sys.argv[1]) / f"{model}.fmu")
"""


def test_another_folder_at_another_time_gives_the_same_bytes(dist: Path, tmp_path: Path) -> None:
    """The sources copied elsewhere, built by a user with another home, style, time zone, language and processor."""
    copy, made = tmp_path / "else where" / "sources", tmp_path / "made"
    for folder in (copy, made):
        folder.mkdir(parents=True)
    shutil.copytree(ROOT / "fmu_src", copy / "fmu_src", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("build.py", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    (copy / "matplotlibrc").write_text("font.size: 20\naxes.facecolor: black\nsavefig.dpi: 30\n")
    user = {"HOME": str(tmp_path), "TZ": "Pacific/Kiritimati", "LC_ALL": "C", "PYTHONHASHSEED": "7"}
    user |= {"OPENBLAS_CORETYPE": "Nehalem"}  # rounds the products of matrices in another way
    command = [sys.executable, "-c", ELSEWHERE, str(made)]
    done = subprocess.run(command, cwd=copy, env={**os.environ, **user}, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    for model in build.MODELS:
        assert contents(made, model) == contents(dist, model)  # says which entry differs, if one does
        assert (made / f"{model}.fmu").read_bytes() == (dist / f"{model}.fmu").read_bytes()


def test_the_guid_is_that_of_all_that_acts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A host may take what has the same guid for the same: our code, stored designs, PythonFMU with its libraries."""
    package, library = tmp_path / "fmu_src", tmp_path / "pythonfmu"
    shutil.copytree(build.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(Path(pythonfmu.__file__).parent, library)
    guids = {model: build._identity(model, package) for model in build.MODELS}
    monkeypatch.setattr(pythonfmu, "__file__", str(library / "__init__.py"))

    def changed() -> list[str]:
        return [model for model, guid in guids.items() if build._identity(model, package) != guid]

    assert changed() == []
    design = package / build.DESIGNS / "lqr_design.json"
    for path, models in (
        (design, ["LqrController"]),
        (package / "vehicle" / "equations.py", list(build.MODELS)),
        (library / "resources" / "binaries" / "linux64" / "libpythonfmu-export.so", list(build.MODELS)),
        (library / "fmi2slave.py", list(build.MODELS)),
    ):
        kept = path.read_bytes()
        path.write_bytes(kept + b" ")
        assert changed() == models, path
        path.write_bytes(kept)


def test_all_that_the_fmus_state_decides_whether_they_are_built_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their requirements.txt speaks of pyproject.toml."""
    looked_at: list[Path] = []

    def content_hash(paths: list[Path]) -> str:
        looked_at.extend(paths)
        return "same"

    monkeypatch.setattr(build, "DIST", tmp_path)
    monkeypatch.setattr(build, "_content_hash", content_hash)
    for name in ("VehicleOnRoad.ssp", "VehicleOnRoad.fmu", *(f"{model}.fmu" for model in build.MODELS)):
        (tmp_path / name).touch()
    (tmp_path / "sources.sha256").write_text("same")
    build.build()
    assert {ROOT / "pyproject.toml", ROOT / "LICENSE", build.PACKAGE} <= set(looked_at)
