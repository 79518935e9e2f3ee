"""CSVs as other tools write them from our FMUs, through `check FILE.csv`: honest ones pass, other cars' do not."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from foreign_runs import FOREIGN, call, ecos
from foreign_systems import with_parameters

from analysis.__main__ import main

PASSIVE: dict[str, Any] = {"controller": {"enabled": False}}
OTHER: dict[str, Any] = {**PASSIVE, "vehicle": {"b1": 1212.0}}  # 1 %
STOP, STEP = 0.4, 1e-3


def check(path: Path, *options: str) -> int:
    return main(["check", str(path), "--road-class", "exact", "--parameters", "bump", *options])


def off(file: Path) -> float:
    """Distance of a row from the proved tube, over what is allowed: the largest that was found."""
    findings = json.loads(file.with_suffix(".findings.json").read_text())
    (found,) = (f["measured"] for f in findings if f["claim"].startswith("no row is proved to be of another motion"))
    return float(found)


def fmpy(dist: Path, folder: Path, *start: object) -> Path:
    """fmpy's command line on the container."""
    step = ("--stop-time", STOP, "--output-interval", STEP, "--output-file", "fmpy.csv")
    fmu = dist / "VehicleOnRoad.fmu"
    call(Path(sys.executable).parent / "fmpy", "simulate", fmu, *step, "--start-values", *start, cwd=folder)
    return folder / "fmpy.csv"


def libcosim(system: Path, folder: Path) -> Path:
    """libcosim's own log of the vehicle."""
    call(sys.executable, FOREIGN / "log_libcosimpy.py", system, round(STOP / STEP), folder, cwd=folder)
    (path,) = folder.glob("vehicle_*.csv")
    return path


def test_fmpys_command_line(dist: Path, tmp_path: Path) -> None:
    path = fmpy(dist, tmp_path, "enabled", "false")
    assert main(["check", str(path), "--road-class", "curv:45"]) == 0
    assert check(path) == 0
    assert off(path) == pytest.approx(0.33, rel=0.1)
    findings = json.loads((tmp_path / "fmpy.findings.json").read_text())
    assert findings and all(f["holds"] and "fmpy.csv, row" in f["source"] for f in findings[:-1])


def test_fmpys_command_line_with_another_car(dist: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = fmpy(dist, tmp_path, "enabled", "false", "b1", "1212")
    assert check(path) == 1
    assert off(path) == pytest.approx(3.2, rel=0.1)
    assert "fmpy.csv, row 107, column der(wheel_fl.heave), largest" in capsys.readouterr().out


def test_a_controlled_run_is_not_judged_and_says_why(
    dist: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert check(fmpy(dist, tmp_path, "enabled", "true")) == 1
    assert "nothing is proved: the actuators act" in capsys.readouterr().out
    assert json.loads((tmp_path / "fmpy.findings.json").read_text()) == []


def test_libcosims_log(system: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It has the heights that the car was given a step ago: no heights of its rows."""
    path = libcosim(with_parameters(system, tmp_path / "x.ssp", "x", PASSIVE), tmp_path)
    assert check(path) == 0
    assert off(path) == pytest.approx(0.33, rel=0.1)
    assert main(["check", str(path), "--road-class", "curv:45"]) == 2
    assert "variable 'h_fl' is not in the trajectory" in capsys.readouterr().err


def test_libcosims_log_names_its_car(system: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert check(libcosim(with_parameters(system, tmp_path / "x.ssp", "x", OTHER), tmp_path)) == 2
    assert "row 2, column 'b1': wanted 1200.0" in capsys.readouterr().err


def test_ecos_csv(system: Path, tmp_path: Path, preload: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It has the parameters of all FMUs, and inputs beside the outputs that feed them."""
    with_parameters(system, tmp_path / "x.ssp", "x", PASSIVE)
    options = ("--path", "x.ssp", "--stopTime", STOP, "--stepSize", STEP, "--parameterSet", "x")
    ecos(tmp_path, preload, *options)
    assert check(tmp_path / "x.csv") == 0
    assert off(tmp_path / "x.csv") == pytest.approx(0.32, rel=0.1)
    text = (tmp_path / "x.csv").read_text()
    (tmp_path / "x.csv").write_text(text.replace(", bump", ", sine"))
    assert check(tmp_path / "x.csv") == 2
    assert "row 2, column 'profile': wanted 'bump', got 'sine'" in capsys.readouterr().err
