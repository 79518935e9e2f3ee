"""The command line from outside: files in, files out, exit status, one line for bad input, and no litter."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fmu_src.controller.lqr_controller import LqrController
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

ROOT = Path(__file__).resolve().parents[1]
COMPONENTS = {"road": RoadExcitation, "vehicle": Vehicle7DOF, "controller": LqrController}
SHORT = '[simulation]\nstop_time = "200 ms"\n[parameters]\nv0 = "36 km/h"\n'
LONG = "[simulation]\nstop_time = 1000\n"
ANALYSIS = ["-W", "error", "-m", "analysis"]


# Where a shell has started the tests in the background, Ctrl-C is ignored by them and by all that they start.
HEED_CTRL_C = (
    "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); sys.argv[0] = sys.executable; "
    "os.execv(sys.executable, sys.argv)"
)


def start(folder: Path, *arguments: str, stderr: int = subprocess.PIPE) -> subprocess.Popen[str]:
    """The command in this folder, with a folder for temporary files beside it."""
    temporary = folder.parent / f"{folder.name}-tmp"
    temporary.mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, "-c", HEED_CTRL_C, *ANALYSIS, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)},
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        encoding="utf-8",
    )


def command(folder: Path, *arguments: str, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
    """The command, ended; no temporary file of ours may outlive it, whatever its status."""
    process = start(folder, *arguments)
    try:
        out, err = process.communicate(timeout=timeout)
    finally:
        process.kill()
    assert list((folder.parent / f"{folder.name}-tmp").iterdir()) == []
    assert "Traceback" not in err, err
    return subprocess.CompletedProcess(arguments, process.returncode, out, err)


def below(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder as `simulate` writes it; tests that change it take a copy."""
    folder = tmp_path_factory.mktemp("honest") / "work"
    folder.mkdir()
    (folder / "short.toml").write_text(SHORT)
    done = command(folder, "simulate", "short.toml", "-o", "runs/short")
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"runs/short: written\n", done.stdout)
    assert below(folder) == {"short.toml", "runs", "runs/short", "runs/short/trajectory.csv", "runs/short/run.json"}
    return folder / "runs" / "short"


@pytest.fixture
def work(tmp_path: Path, honest: Path) -> Path:
    """A folder of one's own with a copy of the run, and a short and a long scenario."""
    folder = tmp_path / "work"
    shutil.copytree(honest, folder / "run")
    (folder / "short.toml").write_text(SHORT)
    (folder / "long.toml").write_text(LONG)
    return folder


def change_record(run: Path, change: Callable[[dict[str, Any]], object]) -> None:
    record = json.loads((run / "run.json").read_text(encoding="utf-8"))
    change(record)
    (run / "run.json").write_text(json.dumps(record), encoding="utf-8")


def change_column(run: Path, name: str, change: Callable[[int, float], float]) -> None:
    """Put another number into each row (counted from 1 below the header) of a column."""
    header, *rows = csv.reader((run / "trajectory.csv").read_text(encoding="utf-8").splitlines())
    column = header.index(name)
    for number, row in enumerate(rows, start=1):
        row[column] = repr(change(number, float(row[column])))
    (run / "trajectory.csv").write_text("".join(",".join(row) + "\n" for row in [header, *rows]), encoding="utf-8")


# ------------------------------------------------------------------ honest work
def test_a_run_holds_every_output_of_every_fmu_at_every_communication_point(honest: Path) -> None:
    header, *rows = csv.reader((honest / "trajectory.csv").read_text(encoding="utf-8").splitlines())
    assert header == ["time", *(q.name for fmu in COMPONENTS.values() for q in fmu.outputs)]
    assert [float(row[0]) for row in rows] == [n * 1e-3 for n in range(201)]


def test_a_run_records_all_that_repeats_it(honest: Path) -> None:
    record = json.loads((honest / "run.json").read_text(encoding="utf-8"))
    assert record["scenario"]["parameters"] == {"v0": 10.0, "road_sampling": "end"}
    for name, fmu in COMPONENTS.items():
        known = {*fmu.reals, *fmu.switches, *(choice.name for choice in fmu.choices)}
        assert set(record["parameters"][name]) == known
        archive = (ROOT / "dist" / f"{fmu.__name__}.fmu").read_bytes()
        assert record["fmus"][name]["sha256"] == hashlib.sha256(archive).hexdigest()
    assert {"python", "fmpy", "pythonfmu", "numpy"} <= set(record["versions"])
    assert "gauss-seidel" in record["method"]
    assert "0.001" in record["method"]


def test_repeating_a_run_from_its_run_json_gives_the_same_bytes(work: Path) -> None:
    done = command(work, "simulate", "run/run.json", "-o", "again")
    assert done.returncode == 0, done.stderr
    for name in ("trajectory.csv", "run.json"):
        assert (work / "again" / name).read_bytes() == (work / "run" / name).read_bytes()


def test_an_honest_run_passes_the_check_and_gets_its_findings(work: Path) -> None:
    done = command(work, "check", "run")
    assert done.returncode == 0
    assert done.stderr.startswith(
        "averaging: not compared with the run, or not all: the road changes its form until 0.32 s"
    )
    findings = json.loads((work / "run" / "findings.json").read_text(encoding="utf-8"))
    assert [finding["holds"] for finding in findings] == [True] * len(done.stdout.splitlines())
    assert all(line.startswith("holds: ") for line in done.stdout.splitlines())
    assert below(work / "run") == {"trajectory.csv", "run.json", "findings.json"}


@pytest.mark.parametrize(("state", "step"), [("body.heave", 1e-3), ("axle_r.roll", float("inf"))])
def test_a_run_that_was_tampered_with_fails_the_check_whatever_step_its_record_says(
    work: Path, state: str, step: float
) -> None:
    change_record(work / "run", lambda record: record["scenario"].update(step=step))
    change_column(work / "run", state, lambda row, value: value + 2e-4 * (row > 120))
    done = command(work, "check", "run")
    assert done.returncode == 1
    assert re.search(rf"^FAILS: the run is a motion .*column {re.escape(state)}", done.stdout, re.MULTILINE)
    findings = json.loads((work / "run" / "findings.json").read_text(encoding="utf-8"))
    assert not all(finding["holds"] for finding in findings)


def test_every_verb_explains_itself(tmp_path: Path) -> None:
    overview = command(tmp_path, "--help")
    assert overview.returncode == 0
    verbs = re.findall(r"^    ([\w-]+) ", overview.stdout, re.MULTILINE)
    assert {"run", "simulate", "check", "report"} <= set(verbs)
    for verb in verbs:
        told = command(tmp_path, verb, "--help")
        assert (told.returncode, told.stderr) == (0, "")
        assert told.stdout.startswith(f"usage: python -m analysis {verb}")


# ------------------------------------------------------------------ bad input
def write(name: str, text: str) -> Callable[[Path], object]:
    return lambda work: (work / name).write_text(text)


def nothing(_: Path) -> None:
    pass


BAD: dict[str, tuple[Callable[[Path], object], str, str]] = {
    "no such scenario": (nothing, "simulate bumb -o out", "bumb: no such file, .* known are: bump"),
    "folder as scenario": (nothing, "simulate run -o out", r"run: wanted a scenario, got a folder; run/run"),
    "broken toml": (write("x.toml", "[a"), "simulate x.toml -o out", r"x\.toml: not TOML"),
    "wrong unit": (write("x.toml", "parameters.v0 = '1 kg'"), "simulate x.toml -o out", r"x\.toml:1: v0 = '1 kg'"),
    "no steps": (write("x.toml", "simulation.step = 0"), "run x.toml -o out", r"x\.toml:1: step = 0\.0 s"),
    "no variable": (write("x.toml", "simulation.record = ['v']"), "simulate x.toml -o out", "record: .*'v'.*body"),
    "masses": (write("x.toml", "parameters.m21 = 23"), "simulate x.toml -o out", r"vehicle: .*m21 = 23\.0 kg.*m22"),
    "horizon": (write("x.toml", "parameters.T = 0.1"), "simulate x.toml -o out", r"controller: .*T = 0\.1 s.*0\.32 s"),
    "file as out": (nothing, "simulate long.toml -o short.toml", r"short\.toml: .* not a run folder"),
    "out below file": (nothing, "simulate long.toml -o short.toml/out", r"short\.toml/out: no run can be written"),
    "no run": (nothing, "check none", "none: wanted a run folder"),
    "no run to report": (nothing, "report none", "none: wanted a run folder"),
    "no run within": (nothing, "check .", r"\.: wanted a run folder .* got a folder with neither"),
    "no certificate": (nothing, "verify none.json", r"none\.json: cannot be read: No such file"),
    "folder as certificate": (nothing, "verify run", "run: wanted a certificate, got a folder$"),
    "run for certificate": (write("run/certificate.json", "{"), "verify run", r"folder; run/certificate\.json is one"),
    "certificate to folder": (nothing, "certify bump -o run", "-o run: .* got a folder"),
    "certificate nowhere": (nothing, "certify bump -o none/c.json", r"-o none/c\.json: there is no folder none"),
    "no such scan": (nothing, "resonances --scan foo", "--scan foo: wanted one of speed"),
    "no table": (lambda w: (w / "run/trajectory.csv").unlink(), "check run", r"run/trajectory\.csv: cannot be read"),
    "text in table": (write("run/trajectory.csv", "time,m\n0,1\n1,x\n"), "check run", "row 3, column 'm': .* got 'x'"),
    "states missing": (write("run/trajectory.csv", "time,m\n0,1\n1,1\n"), "check run", "the run cannot be checked"),
    "no record": (write("run/run.json", "{"), "check run", r"run/run\.json: cannot be read"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_bad_input_gives_one_line_and_status_2_and_leaves_nothing(work: Path, what: str) -> None:
    prepare, line, words = BAD[what]
    prepare(work)
    before = below(work)
    done = command(work, *line.split(), timeout=30.0)
    assert (done.returncode, done.stdout) == (2, "")
    (said,) = done.stderr.splitlines()
    assert re.match(f"error: .*{words}", said), said
    assert below(work) == before


def test_several_faults_give_a_line_each(work: Path) -> None:
    (work / "x.toml").write_text("[parameters]\nv0 = 'fast'\nprofile = 'wave'\nmass = 1\n")
    done = command(work, "simulate", "x.toml", "-o", "out")
    assert done.returncode == 2
    first, *others = done.stderr.splitlines()
    assert first.startswith("error: x.toml:")
    assert sorted(re.findall(r"x\.toml:(\d): ", done.stderr)) == ["2", "3", "4"]
    assert all(line.startswith("x.toml:") for line in others)


@pytest.mark.parametrize("line", ["", "dance", "simulate", "simulate bump", "check", "check a b"])
def test_a_misused_verb_gives_its_usage_and_status_2(tmp_path: Path, line: str) -> None:
    done = command(tmp_path, *line.split())
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("usage: python -m analysis")
    assert done.stderr.count("error:") == 1


@pytest.mark.parametrize("verb", ["simulate", "run"])
def test_a_folder_that_is_no_run_is_refused_before_the_simulation_and_left_alone(work: Path, verb: str) -> None:
    (work / "thesis").mkdir()
    (work / "thesis" / "chapter.tex").write_text("years of work")
    begun = time.monotonic()
    done = command(work, verb, "long.toml", "-o", "thesis", timeout=30.0)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"error: thesis: is there already and is not a run folder.*\n", done.stderr)
    assert time.monotonic() - begun < 10.0
    assert below(work / "thesis") == {"chapter.tex"}
    assert (work / "thesis" / "chapter.tex").read_text() == "years of work"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited here as Linux does it")
def test_a_run_that_does_not_fit_into_memory_ends_in_one_line(work: Path) -> None:
    (work / "vast.toml").write_text("[simulation]\nstop_time = 9999.0\n")
    limited = "import resource, runpy, sys; resource.setrlimit(resource.RLIMIT_AS, (3_000_000_000, -1)); "
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            limited + "runpy.run_module('analysis', run_name='__main__')",
            *"simulate vast.toml -o out".split(),
        ],
        cwd=work,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"error: not enough memory: Unable to allocate .*; wanted a longer step .*\n", done.stderr)
    assert not (work / "out").exists()


# ------------------------------------------------------------------ signals
def seen(terminal: int, wanted: bytes) -> str:
    """What appears on the terminal until it matches; all that appears before it closes if it never does."""
    text = b""
    while not re.search(wanted, text) and select.select([terminal], [], [], 30.0)[0]:
        try:
            text += os.read(terminal, 4096)
        except OSError:  # closed by the command
            break
    return text.decode()


@pytest.mark.parametrize("target", ["out", "run"])
@pytest.mark.parametrize(("sent", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_long_simulation_soon_and_leaves_nothing(
    work: Path, sent: signal.Signals, status: int, target: str
) -> None:
    """On a terminal, where the progress bar tells when the simulation has begun."""
    before = {name: (work / name).stat().st_mtime_ns for name in below(work)}
    terminal, its_end = os.openpty()
    termios.tcsetwinsize(its_end, (24, 100))
    process = start(work, "simulate", "long.toml", "-o", target, stderr=its_end)
    os.close(its_end)
    try:
        assert "steps" in seen(terminal, rb"[1-9]\d*/1000000 ")
        process.send_signal(sent)
        begun = time.monotonic()
        out, _ = process.communicate(timeout=10.0)
        assert time.monotonic() - begun < 5.0
        said = seen(terminal, b"Traceback")
    finally:
        process.kill()
        os.close(terminal)
    assert (process.returncode, out) == (status, ""), said
    assert "Traceback" not in said
    assert {name: (work / name).stat().st_mtime_ns for name in below(work)} == before
    assert list((work.parent / "work-tmp").iterdir()) == []
