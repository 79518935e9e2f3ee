"""Hosts that leave as programs do, through their exit handlers, end well; with PythonFMU's own library they may not."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import fmpy
import pytest
import pythonfmu
from foreign_runs import call
from foreign_systems import write_plan

import build
from fmu_src.export.library import FAULTY, PLACE, RETURN, cured

BINARIES = Path(pythonfmu.__file__).parent / "resources" / "binaries"
ORIGINAL = BINARIES / "linux64" / "libpythonfmu-export.so"
TIMES = 10  # each host, each way

# loads all, unloads all, loads all again, and leaves them loaded: libraries are finalized by dlclose and by exit
PYTHON_HOST = """
import sys
from pathlib import Path
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Slave

def begun(folder):
    md = read_model_description(folder, validate=False)
    identifier = md.coSimulation.modelIdentifier
    fmu = FMU2Slave(guid=md.guid, modelIdentifier=identifier, unzipDirectory=folder, instanceName=identifier)
    fmu.instantiate()
    fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu

for unload in (True, False):
    fmus = [begun(folder) for folder in sys.argv[1:]]
    for fmu in fmus:
        fmu.doStep(0.0, 1e-3)
        fmu.terminate()
    for fmu in fmus:
        fmu.freeInstance() if unload else fmu.fmi2FreeInstance(fmu.component)
"""
# in the C host, which unloads them: said when Python is finalized
GOODBYE = "import atexit; atexit.register(print, 'finalized', flush=True)"
Command = tuple[list[object], dict[str, str]]


@pytest.mark.parametrize("model", build.MODELS)
def test_the_fmus_hold_pythonfmus_libraries_but_for_one_byte_of_the_one_for_linux(dist: Path, model: str) -> None:
    original = ORIGINAL.read_bytes()
    with zipfile.ZipFile(dist / f"{model}.fmu") as archive:
        shipped = archive.read(f"binaries/linux64/{model}.so")
        windows = archive.read(f"binaries/win64/{model}.dll")
    assert len(shipped) == len(original)
    changed = {at: (old, new) for at, (old, new) in enumerate(zip(original, shipped, strict=True)) if old != new}
    assert changed == {PLACE: (0xE9, RETURN[0])}, f"is this another PythonFMU? see {cured.__module__}"
    assert original[PLACE - 4 : PLACE] == bytes.fromhex("f30f1efa")  # endbr64, with which a function begins
    assert windows == (BINARIES / "win64" / "pythonfmu-export.dll").read_bytes()


def test_a_library_that_is_not_known_is_left_as_it_is_and_that_is_said() -> None:
    for other in (ORIGINAL.read_bytes() + b"\0", cured(ORIGINAL.read_bytes()), b""):
        with pytest.warns(UserWarning, match=r"not the one of version 0\.7\.0 .* may abort a host at its very end"):
            assert cured(other) is other
    assert len(FAULTY) == 64


@pytest.fixture
def poison(compiled: Callable[..., Path]) -> Path:
    """A library that, preloaded, makes every use of freed memory a crash, or nearly every."""
    return compiled("poison.c", "-shared", "-fPIC")


@pytest.fixture
def folders(system: Path, tmp_path: Path) -> list[Path]:
    """The FMUs, unpacked, beside a plan for the C host."""
    write_plan(system, tmp_path / "unpacked", 20)
    return [path.parents[2] for path in sorted((tmp_path / "unpacked").glob("*/binaries/linux64/*.so"))]


@pytest.fixture(params=["python", "c"])
def host(
    request: pytest.FixtureRequest, folders: list[Path], compiled: Callable[..., Path], preload: str, bare: Path
) -> Command:
    """A program that runs all FMUs and leaves by exit, and the environment that it wants."""
    if request.param == "python":
        return [sys.executable, "-I", "-c", PYTHON_HOST, *folders], dict(os.environ)
    program = compiled("c_host.c", "-I", Path(fmpy.__file__).parent / "c-code", "-ldl")
    plan = folders[0].parent / "plan.txt"
    return [program, plan, "result"], {"PATH": str(bare), "LD_PRELOAD": preload, "PYTHON_SAYS": GOODBYE}


def preloading(library: Path, environment: Mapping[str, str]) -> dict[str, str]:
    return {**environment, "LD_PRELOAD": f"{library} {environment.get('LD_PRELOAD', '')}"}


def test_hosts_end_well_also_where_freed_memory_is_poisoned(host: Command, poison: Path, tmp_path: Path) -> None:
    command, plain = host
    for environment in [plain, preloading(poison, plain)] * TIMES:
        said = call(*command, cwd=tmp_path, environment=environment)
        assert said == ("finalized\n" if "PYTHON_SAYS" in plain else "")  # once, by whichever FMU has begun it


def test_with_pythonfmus_own_library_they_crash_where_freed_memory_is_poisoned(
    host: Command, folders: list[Path], poison: Path, tmp_path: Path
) -> None:
    """So the test above would see the fault. (If this one fails, the cure may not be needed any more.)"""
    for folder in folders:
        (library,) = folder.glob("binaries/linux64/*.so")
        shutil.copy(ORIGINAL, library)
    command, environment = host
    words = [str(word) for word in command]
    done = subprocess.run(
        words, cwd=tmp_path, env=preloading(poison, environment), capture_output=True, text=True, timeout=60
    )
    assert done.returncode == -signal.SIGSEGV, done.stdout + done.stderr
