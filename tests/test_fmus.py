"""The FMUs as files: valid, the same bytes from the same sources, and alive in a host that has nothing of ours."""

from __future__ import annotations

import csv
import hashlib
import os
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
from conftest import ROOT
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from foreign_runs import call

import build
from analysis.scenario import read_scenario
from fmu_src.quantities import TABLE

MODELS = list(build.MODELS)


@pytest.mark.parametrize("model", MODELS)
def test_fmpy_finds_no_problem(dist: Path, model: str) -> None:
    assert validate_fmu(str(dist / f"{model}.fmu")) == []


@pytest.mark.parametrize("model", MODELS)
def test_the_same_sources_give_the_same_bytes(dist: Path, model: str, tmp_path: Path) -> None:
    build.build_fmu(model, build.PACKAGE, tmp_path / f"{model}.fmu")
    digests = {hashlib.sha256((f / f"{model}.fmu").read_bytes()).hexdigest() for f in (dist, tmp_path)}
    assert len(digests) == 1


def test_version_and_default_experiment_are_those_of_the_project_and_of_the_default_scenario(dist: Path) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bump = read_scenario("bump")
    for model in MODELS:
        description = read_model_description(str(dist / f"{model}.fmu"))
        experiment = description.defaultExperiment
        assert description.version == project["version"]
        times = [float(x) for x in (experiment.startTime, experiment.stopTime, experiment.stepSize)]
        assert times == [bump.start_time, bump.stop_time, bump.step]


def test_the_ssp_holds_the_very_fmus(dist: Path) -> None:
    with zipfile.ZipFile(dist / "VehicleOnRoad.ssp") as archive:
        for model in MODELS:
            assert archive.read(f"resources/{model}.fmu") == (dist / f"{model}.fmu").read_bytes()


def test_every_variable_has_the_unit_and_words_of_the_table(dist: Path) -> None:
    for model in MODELS:
        for v in read_model_description(str(dist / f"{model}.fmu")).modelVariables:
            if v.type == "Real":
                assert (v.unit, v.description) == (TABLE[v.name].unit, TABLE[v.name].description)
                if v.start is not None:
                    assert float(v.start) == TABLE[v.name].start


@pytest.fixture(scope="session")
def bare_environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual environment that has fmpy (with what it needs) and nothing else; returns its folder of programs."""
    folder = tmp_path_factory.mktemp("fmpy_only")
    venv.create(folder, with_pip=False)
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    command = [sys.executable, "-m", "pip", "--python", str(programs / "python"), "install", "--quiet"]
    subprocess.run([*command, "-c", str(ROOT / "constraints.txt"), "fmpy"], check=True, capture_output=True)
    return programs


@pytest.mark.parametrize(("model", "variable"), [("Vehicle7DOF", "body.heave"), ("RoadExcitation", "h_fl")])
def test_fmpys_own_command_line_simulates_it(
    dist: Path, bare_environment: Path, tmp_path: Path, model: str, variable: str
) -> None:
    out = tmp_path / "out.csv"
    command = [bare_environment / "fmpy", "simulate", dist / f"{model}.fmu", "--output-file", out]
    call(*command, cwd=tmp_path)
    with out.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[-1]["time"]) == pytest.approx(5.0)
    assert variable in rows[0]
    if model == "RoadExcitation":
        assert max(float(row[variable]) for row in rows) == pytest.approx(0.01, rel=1e-2)  # fmpy samples coarsely


def test_a_perturbed_start_can_be_driven_from_fmpy_alone(dist: Path, bare_environment: Path, tmp_path: Path) -> None:
    """A foreign host in an isolated Python: start value in, decaying motion out, and the code is the FMU's own copy."""
    code = (
        "import sys, fmpy\n"
        "r = fmpy.simulate_fmu(sys.argv[1], stop_time=4.0, start_values={'body.heave': 0.02}, output=['body.heave'])\n"
        "names = [n for n in sys.modules if n.startswith('fmu_src')]\n"
        "assert names and all(n.startswith('fmu_src_') for n in names), names\n"
        "assert not any(m in sys.modules for m in ('scipy', 'control', 'matplotlib'))\n"
        "print(r['body.heave'][0], abs(r['body.heave'][-1]))\n"
    )
    command = [str(bare_environment / "python"), "-I", "-c", code, str(dist / "Vehicle7DOF.fmu")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    first, last = map(float, done.stdout.split()[-2:])
    assert first == 0.02
    assert last < 1e-4


def test_many_instances_in_one_process_live_and_die(dist: Path) -> None:
    """PythonFMU's loader gives up a reference too many at each instantiation; the slave script makes up for it."""
    code = (
        "import sys\n"
        "from dataclasses import replace\n"
        "from analysis.cosimulation import simulate\n"
        "from analysis.scenario import read_scenario\n"
        "short = replace(read_scenario('bump'), stop_time=0.005)\n"
        "runs = [simulate(short).trajectory.values.tobytes() for _ in range(40)]\n"
        "assert len(set(runs)) == 1\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
