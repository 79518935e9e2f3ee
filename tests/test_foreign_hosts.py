"""Hosts that are not Python, compiled here or brought by a tool, against our own master; README says what they need."""

from __future__ import annotations

import subprocess
import sysconfig
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from foreign_runs import COUNT, STATE_NAMES, STEP, call, ecos, ours
from foreign_systems import write_plan
from small_master import deviation, read_recording


@pytest.mark.parametrize("linked", [False, True], ids=["preloaded", "linked"])
def test_a_c_program_runs_the_fmus_to_the_bit_on_a_bare_python(
    system: Path, tmp_path: Path, compiled: Callable[..., Path], preload: str, bare: Path, linked: bool
) -> None:
    link = ["-Wl,--no-as-needed", preload, f"-Wl,-rpath,{Path(preload).parent}"] if linked else []
    host = compiled("c_host.c", "-I", Path(fmpy.__file__).parent / "c-code", *link, "-ldl")
    plan, names = write_plan(system, tmp_path / "unpacked", COUNT)
    asks = (
        "import importlib.util, signal, sys; packages = ('numpy', 'scipy', 'control', 'fmpy', 'pythonfmu', 'fmu_src')\n"
        "print(sys.prefix, [p for p in packages if importlib.util.find_spec(p)], end=' ')\n"
        "print(signal.getsignal(signal.SIGINT).__name__, signal.getsignal(signal.SIGTERM).name, flush=True)"
    )
    environment = {"PATH": str(bare), "LD_PRELOAD": "" if linked else preload, "PYTHON_SAYS": asks}
    said = call(host, plan, tmp_path / "result", cwd=tmp_path, environment=environment)
    assert said.split()[:2] == [str(bare.parent), "['pythonfmu']"]  # the FMUs' own copy, in their resources
    assert said.split()[2:4] == ["default_int_handler", "SIG_DFL"]  # README says what becomes of Ctrl-C
    rows = np.fromfile(tmp_path / "result").reshape(-1, len(names))
    np.testing.assert_array_equal(rows, ours(system).columns(names))


def test_without_the_library_a_c_program_is_told_what_is_missing(
    system: Path, tmp_path: Path, compiled: Callable[..., Path]
) -> None:
    host = compiled("c_host.c", "-I", Path(fmpy.__file__).parent / "c-code", "-ldl")
    plan, _ = write_plan(system, tmp_path / "unpacked", 1)
    done = subprocess.run([host, plan, tmp_path / "result"], env={}, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "undefined symbol: _Py" in done.stderr


def test_libcosims_c_library_runs_the_ssp_from_a_c_program(
    system: Path, tmp_path: Path, compiled: Callable[..., Path], preload: str, bare: Path
) -> None:
    folder = Path(sysconfig.get_path("purelib"), "libcosimpy", "libcosimc")
    host = compiled("cosim_host.c", folder / "libcosimc.so", f"-Wl,-rpath,{folder}")
    environment = {"PATH": str(bare), "LD_PRELOAD": preload}
    call(host, system, COUNT, "result", cwd=tmp_path, environment=environment)
    assert deviation(read_recording(tmp_path / "result"), ours(system).between(1)) < 1e-13  # measured: 7.1e-15


def test_the_command_line_of_ecos_runs_the_ssp(system: Path, tmp_path: Path, preload: str) -> None:
    """A C++ program; it calls `unzip`, writes six decimals, and stops a step early where the sum of steps passes it."""
    ecos(tmp_path, preload, "--path", system, "--stopTime", 0.6, "--stepSize", STEP)
    header, *lines = (tmp_path / "VehicleOnRoad.csv").read_text().splitlines()
    names = [name.strip().removesuffix("[REAL]").replace("::", ".", 1) for name in header.split(",")]
    rows = np.array([[float(x) for x in line.split(",")[:3]] for line in lines])
    assert len(lines) in (600, 601)
    columns = [names.index(name) for name in STATE_NAMES]
    states = np.array([[line.split(",")[i] for i in columns] for line in lines], dtype=np.float64)
    expected = ours(system, stop=0.6)
    np.testing.assert_allclose(rows[:, 1], expected.time[: len(lines)], atol=1e-9)
    np.testing.assert_allclose(states, expected.columns(STATE_NAMES)[: len(lines)], atol=1e-6)
