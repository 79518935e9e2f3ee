"""Both sides of a comparison: our master's run, and that of a tool that we did not write, in a process of its own."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from fmpy.ssp.ssd import read_ssd
from small_master import Recording, Ways, read_recording, run

from analysis.cosimulation import simulate
from analysis.reference import closed_loop
from analysis.scenario import Scenario
from fmu_src.quantities import STATES

FOREIGN = Path(__file__).parent / "foreign"
STOP, STEP = 5.0, 1e-3
COUNT = round(STOP / STEP)
SAME = 1e-9  # relative: the same algorithm; what is left is round-off
STATE_NAMES = tuple(f"vehicle.{q.name}" for q in STATES)
Value = float | str | bool
Items = tuple[tuple[str, Value], ...]
Runner = Callable[..., Recording]

# all kinds of parameters away from their defaults, as .ssv files hold them
LATE: dict[str, dict[str, Value]] = {
    "road": {"t_start": 0.1, "profile": "bump", "excite_fr": False},
    "vehicle": {"road_sampling": "start"},
    "controller": {"t_on": 0.05, "activation": "at t_on", "horizon": "infinite", "enabled": True},
}
LATE_ITEMS: Items = tuple(item for values in LATE.values() for item in values.items())


@cache
def ours(
    system: Path, coupling: str = "jacobi", stop: float = STOP, parameters: Items = (), start: Items = ()
) -> Recording:
    """Our master's run."""
    scenario = Scenario(name="x", coupling=coupling, stop_time=stop, parameters=dict(parameters))
    scenario = replace(scenario, start={name: float(value) for name, value in start})
    trajectory = simulate(scenario, system).trajectory
    names = [f"{e.name}.{c.name}" for e in read_ssd(system).system.elements for c in e.connectors if c.kind == "output"]
    rows = trajectory.columns([name.partition(".")[2] for name in names])
    return Recording(trajectory.time, tuple(names), rows)


@cache
def small(system: Path, ways: Ways, count: int = COUNT) -> Recording:
    return run(system, ways, count)


def call(*command: object, cwd: Path, environment: Mapping[str, str] | None = None) -> str:
    """Run a program to a good end and return what it said."""
    words = [str(word) for word in command]
    environment = {**(os.environ if environment is None else environment), "TMPDIR": str(cwd)}
    done = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True, timeout=150)
    said = done.stdout + done.stderr
    end = signal.Signals(-done.returncode).name if done.returncode < 0 else done.returncode
    assert done.returncode == 0, f"{' '.join(words)} ended with {end}:\n{said[-3000:]}"
    return said


def ecos(folder: Path, preload: str, *options: object) -> None:
    """Call `ecos simulate` in this folder, into which it writes SYSTEM.csv; it calls `unzip`."""
    program = folder / "ecos"
    shutil.copy(Path(sysconfig.get_path("purelib"), "ecospy", "binaries", "ecos"), program)
    program.chmod(0o755)
    environment = {
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),  # this Python's own library
        "LD_PRELOAD": preload,
        "LD_LIBRARY_PATH": str(Path(sys.prefix, "lib")),  # libtbb.so.12
    }
    call(program, "simulate", *options, cwd=folder, environment=environment)


def runner(folder: Path) -> Runner:
    """Runs a script of tests/foreign; RESULT among its arguments stands for the file that is read back."""

    def go(script: str, *arguments: object) -> Recording:
        result = folder / "result"
        words = [result if word == "RESULT" else word for word in arguments]
        call(sys.executable, FOREIGN / script, *words, cwd=folder)
        return read_recording(result)

    return go


def error(found: Recording) -> float:
    """Worst state against the system integrated as one, over its maximum."""
    times = np.union1d(0.0, found.time)  # it sets out from the first of them
    expected = closed_loop(Scenario(name="x"), times)[-len(found.time) :]
    return float((np.abs(found.columns(STATE_NAMES) - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())
