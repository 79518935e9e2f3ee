"""The closed loop of VehicleOnRoad.ssp in tools that we did not write, against our own master; docs/interop.md has the
table. Each tool runs in a process of its own, so that a crash, also one at its exit, is seen as one."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd
from fmpy.validation import validate_fmu
from foreign_systems import parameter_set, reordered, with_own_output, with_parameters, write_plan
from small_master import Recording, Ways, deviation, read_recording, run

from analysis.cosimulation import simulate
from analysis.reference import closed_loop
from analysis.scenario import Scenario
from build import write_archive
from fmu_src.export.container import container_contents
from fmu_src.quantities import STATES

FOREIGN = Path(__file__).parent / "foreign"
PROGRAMS = Path(sys.executable).parent
STOP, STEP = 5.0, 1e-3
COUNT = round(STOP / STEP)
SAME = 1e-9  # relative: the same algorithm; what is left is round-off
STATE_NAMES = tuple(f"vehicle.{q.name}" for q in STATES)
Value = float | str | bool
Items = tuple[tuple[str, Value], ...]

# all kinds of parameters away from their defaults, as .ssv files hold them
LATE: dict[str, dict[str, Value]] = {
    "road": {"t_start": 0.1, "profile": "bump", "excite_fr": False},
    "vehicle": {"road_sampling": "start"},
    "controller": {"t_on": 0.05, "activation": "at t_on", "horizon": "infinite", "enabled": True},
}
LATE_ITEMS: Items = tuple(item for values in LATE.values() for item in values.items())


# ---------------------------------------------------------------------------------------------------- both sides
@pytest.fixture(scope="session")
def system(dist: Path) -> Path:
    return dist / "VehicleOnRoad.ssp"


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


Runner = Callable[..., Recording]


@pytest.fixture
def foreign(tmp_path: Path) -> Runner:
    """Runs a script of tests/foreign; RESULT among its arguments stands for the file that is read back."""

    def go(script: str, *arguments: object) -> Recording:
        result = tmp_path / "result"
        words = [result if word == "RESULT" else word for word in arguments]
        call(sys.executable, FOREIGN / script, *words, cwd=tmp_path)
        return read_recording(result)

    return go


def error(found: Recording) -> float:
    """Worst state against the system integrated as one, over its maximum."""
    times = np.union1d(0.0, found.time)  # it sets out from the first of them
    expected = closed_loop(Scenario(name="x"), times)[-len(found.time) :]
    return float((np.abs(found.columns(STATE_NAMES) - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())


def test_the_small_master_is_our_master_to_the_bit(system: Path) -> None:
    """A comparison of a foreign master with the small one is one with ours, but for the way that is named."""
    expected = ours(system)
    np.testing.assert_array_equal(small(system, Ways()).columns(expected.names), expected.rows)


# ---------------------------------------------------------------------------------------------------- fmpy
def test_fmpy_runs_the_ssp_and_starts_all_inputs_at_zero(system: Path, foreign: Runner) -> None:
    """Its rows carry the time of the step's start. The road's rate is not 0 at the start; nothing else differs."""
    found = foreign("run_fmpy_ssp.py", system, STOP, STEP, "RESULT")
    assert found.time[0] == 0.0
    found = found.later(STEP)
    assert deviation(found, small(system, Ways(initial="zero")).between(1)) < SAME  # measured: 6.7e-10 (bow), 2e-14
    gap = deviation(found, ours(system).between(1), STATE_NAMES)
    assert 1e-3 < gap < 5e-3  # measured: 2.9e-3


def test_fmpy_agrees_with_our_jacobi_where_all_starts_at_zero(system: Path, foreign: Runner, tmp_path: Path) -> None:
    late = tmp_path / "late.ssv"
    late.write_text(parameter_set("late", {"road.t_start": 0.1, "controller.t_start": 0.1}))
    found = foreign("run_fmpy_ssp.py", system, 0.7, STEP, "RESULT", late).later(STEP)
    expected = ours(system, stop=0.7, parameters=(("t_start", 0.1),))
    assert deviation(found, expected.between(1)) < SAME


def test_fmpys_first_step_keeps_the_coupling_order(system: Path, foreign: Runner) -> None:
    """Control forces are held over a step: order 1."""
    coarse = error(foreign("run_fmpy_ssp.py", system, 0.7, 2e-3, "RESULT").later(2e-3))
    fine = error(foreign("run_fmpy_ssp.py", system, 0.7, 1e-3, "RESULT").later(1e-3))
    assert coarse / fine == pytest.approx(2.0, abs=0.25)


# ---------------------------------------------------------------------------------------------------- libcosim
def test_libcosim_runs_the_ssp_as_our_jacobi(system: Path, foreign: Runner) -> None:
    found = foreign("run_libcosimpy.py", system, COUNT, "RESULT")
    assert deviation(found, ours(system).between(1)) < SAME  # measured: 2.7e-10 (bow)
    assert deviation(found, ours(system).between(1), STATE_NAMES) < 1e-13  # measured: 2.8e-15


def test_libcosim_takes_the_first_parameter_set_of_each_component(
    system: Path, foreign: Runner, tmp_path: Path
) -> None:
    late = with_parameters(system, tmp_path / "late.ssp", "late", LATE)
    expected = ours(system, stop=0.6, parameters=LATE_ITEMS)
    assert deviation(foreign("run_libcosimpy.py", late, 600, "RESULT"), expected.between(1)) < SAME


def test_ecco_with_steps_of_one_length_is_jacobi(system: Path, foreign: Runner) -> None:
    found = foreign("run_ecco.py", system, STOP, "RESULT", STEP, STEP, STEP, 1e-4)
    assert deviation(found, ours(system).between(1)) < SAME


def test_ecco_spends_its_steps_where_power_is_exchanged(system: Path, foreign: Runner) -> None:
    """Errors fall with the tolerance; a third of the steps halves the error of the fixed step."""
    runs = [foreign("run_ecco.py", system, STOP, "RESULT", STEP, 1e-4, 5e-3, tol) for tol in (1e-3, 1e-5)]
    loose, tight = (error(found) for found in runs)
    assert tight < 0.5 * error(ours(system)) < loose < 0.1  # measured: 0.0076, 0.0156, 0.031
    assert all(len(found.time) < COUNT / 3 for found in runs)  # measured: 1266, 1461
    assert np.diff(runs[1].time).min() < 5e-4


# ---------------------------------------------------------------------------------------------------- Ecos
def test_ecos_runs_the_ssp_as_our_jacobi_and_renews_outputs_for_new_inputs(system: Path, foreign: Runner) -> None:
    found = foreign("run_ecospy.py", system, COUNT, "RESULT")
    assert deviation(found, ours(system), STATE_NAMES) < SAME  # measured: 1.8e-14
    assert deviation(found, small(system, Ways(after="refresh"))) < SAME  # measured: 6.7e-10 (bow)


def test_ecos_takes_parameters_and_start_values_of_a_named_set(system: Path, foreign: Runner, tmp_path: Path) -> None:
    sets = {**LATE, "vehicle": {**LATE["vehicle"], "body.heave": 0.01}}
    late = with_parameters(system, tmp_path / "late.ssp", "late", sets)
    expected = ours(system, stop=0.6, parameters=LATE_ITEMS, start=(("body.heave", 0.01),))
    assert deviation(foreign("run_ecospy.py", late, 600, "RESULT", "late"), expected, STATE_NAMES) < SAME


def test_ecos_leaves_a_copy_of_the_system_behind_and_the_others_nothing(
    system: Path, foreign: Runner, tmp_path: Path
) -> None:
    foreign("run_libcosimpy.py", system, 1, "RESULT")
    foreign("run_fmpy_ssp.py", system, 2 * STEP, STEP, "RESULT")
    assert [path.name for path in tmp_path.iterdir()] == ["result"]
    foreign("run_ecospy.py", system, 1, "RESULT")
    assert [path.name[:8] for path in sorted(tmp_path.iterdir())] == ["ecos_ssp", "result"]


# ---------------------------------------------------------------------------------------------------- refusals
RUNAWAY: dict[str, dict[str, Value]] = {"vehicle": {"b1": 1e9}, "controller": {"enabled": False}}


def test_libcosim_stops_at_a_refused_step_and_quotes_the_fmu(system: Path, foreign: Runner, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"(?s)ended with 1:.*vehicle: step .*finite numbers"):
        foreign("run_libcosimpy.py", with_parameters(system, tmp_path / "x.ssp", "x", RUNAWAY), 5, "RESULT")


def test_ecos_goes_on_after_a_refused_step_and_finds_the_last_good_state(
    system: Path, foreign: Runner, tmp_path: Path
) -> None:
    runaway = with_parameters(system, tmp_path / "x.ssp", "x", RUNAWAY)
    states = foreign("run_ecospy.py", runaway, 5, "RESULT", "x").columns(STATE_NAMES)
    assert np.isfinite(states).all()
    assert (states[2:] == states[2]).all() and (states[1] != states[0]).any()


def test_ecos_goes_on_after_a_refused_start_and_nothing_crashes(system: Path, foreign: Runner, tmp_path: Path) -> None:
    """It ignores fmi2Fatal; the FMU, having raised once, must stay quiet and safe."""
    refused = with_parameters(system, tmp_path / "x.ssp", "x", {"vehicle": {"m21": 20.0}})
    assert not foreign("run_ecospy.py", refused, 5, "RESULT", "x").columns(STATE_NAMES).any()


# ---------------------------------------------------------------------------------------------------- containers
def fmucontainer(system: Path, folder: Path) -> dict[str, Any]:
    """Make folder/VehicleOnRoad.fmu with the command fmucontainer; returns the assembly that it dumps."""
    shutil.copy(system, folder / "VehicleOnRoad.ssp")
    call(PROGRAMS / "fmucontainer", "-container", "VehicleOnRoad.ssp", "-dump-json", cwd=folder)
    assembly: dict[str, Any] = json.loads((folder / "VehicleOnRoad-dump.json").read_text())
    return assembly


def run_container(foreign: Runner, fmu: Path, system: Path) -> Recording:
    """Names back to those of the system: the container has the FMUs' file names in lower case."""
    found = foreign("run_fmu.py", fmu, STOP, "RESULT")
    owner = {Path(e.source).stem.lower(): e.name for e in read_ssd(system).system.elements}
    names = [name.partition(".") for name in found.names]
    return Recording(found.time, tuple(f"{owner[fmu]}.{variable}" for fmu, _, variable in names), found.rows)


def test_fmucontainer_makes_an_fmu_that_is_our_jacobi_to_the_bit(system: Path, foreign: Runner, tmp_path: Path) -> None:
    fmucontainer(system, tmp_path)
    found = run_container(foreign, tmp_path / "VehicleOnRoad.fmu", system)
    assert len(found.names) == 30  # what is connected; of an .ssp it shows nothing else
    np.testing.assert_array_equal(found.rows, ours(system).columns(found.names))


@pytest.mark.parametrize("sampling", ["start", "end"])
def test_fmucontainer_sequential_is_our_gauss_seidel_to_the_bit(
    system: Path, foreign: Runner, tmp_path: Path, sampling: str
) -> None:
    """Its option -sequential does not reach an .ssp, nor a .json that says otherwise: the dumped .json is edited."""
    assembly = fmucontainer(system, tmp_path)
    of = {Path(name).name: name for name in assembly["fmu"]}
    order = [of[Path(e.source).name] for e in read_ssd(system).system.elements]
    start = [[of["Vehicle7DOF.fmu"], "road_sampling", sampling]]
    assembly |= {"name": "Sequential.fmu", "fmu": order, "sequential": True, "start": start}
    (tmp_path / "Sequential.json").write_text(json.dumps(assembly))
    call(PROGRAMS / "fmucontainer", "-container", "Sequential.json", cwd=tmp_path)
    found = run_container(foreign, tmp_path / "Sequential.fmu", system)
    expected = ours(system, "gauss-seidel", parameters=(("road_sampling", sampling),))
    np.testing.assert_array_equal(found.rows, expected.columns(found.names))


@pytest.mark.parametrize("model", ["RoadExcitation", "Vehicle7DOF", "LqrController"])
def test_fmutool_finds_the_fmus_compliant(dist: Path, model: str, tmp_path: Path) -> None:
    said = call(PROGRAMS / "fmutool", "-input", dist / f"{model}.fmu", "-check", cwd=tmp_path)
    assert "compliant with FMI-2.0" in said and "No semantic error" in said


@pytest.fixture(scope="session")
def container(system: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    fmu = tmp_path_factory.mktemp("container") / "VehicleOnRoad.fmu"
    write_archive(fmu, container_contents(system))
    return fmu


def test_fmpys_container_passes_on_one_pair_of_components_after_another(
    system: Path, container: Path, foreign: Runner, tmp_path: Path
) -> None:
    """The controller's forces are read after its inputs are set: as if it were stepped after the car, the road last."""
    found = foreign("run_fmu.py", container, STOP, "RESULT")
    np.testing.assert_array_equal(found.rows, small(system, Ways(after="chain")).columns(found.names))
    road_last = reordered(system, tmp_path / "road_last.ssp", ("vehicle", "controller", "road"))
    assert deviation(found, ours(road_last, "gauss-seidel"), STATE_NAMES) < SAME
    assert error(found) < 0.4 * error(ours(system))  # measured: 0.0049, 0.0156


def test_fmpys_container_is_a_valid_fmu_with_all_parameters(system: Path, container: Path) -> None:
    assert validate_fmu(str(container)) == []
    start = {**dict(LATE_ITEMS), "vehicle.body.heave": 0.01}
    found = fmpy.simulate_fmu(
        str(container), stop_time=0.3, output_interval=STEP, start_values=start, output=["road.h_fl", "road.h_fr"]
    )
    assert np.argmax(found["road.h_fl"] > 0) == 101
    assert not found["road.h_fr"].any()
    assert container_contents(system) == container_contents(system)


# ---------------------------------------------------------------------------------------------------- without Python
@pytest.fixture(scope="session")
def preload() -> str:
    """The library of this Python, for hosts that have none."""
    name = str(sysconfig.get_config_var("INSTSONAME"))
    folders = [sysconfig.get_config_var("LIBDIR"), Path(sys.base_prefix, "lib")]
    found = [path for folder in folders if (path := Path(str(folder), name)).is_file()]
    assert found, f"{name} is in none of {folders}; Debian has it in libpython3, other Pythons with --enable-shared"
    return str(found[0])


@pytest.fixture(scope="session")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a virtual environment in which nothing is installed."""
    folder = tmp_path_factory.mktemp("bare")
    venv.create(folder, with_pip=False)
    return folder / "bin"


@pytest.fixture
def compiled(tmp_path: Path) -> Callable[..., Path]:
    def compile(source: str, *options: object) -> Path:
        if not sys.platform.startswith("linux") or not (compiler := shutil.which("cc")):
            pytest.skip("no C compiler on this machine (or no Linux): C hosts are not tested here")
        program = tmp_path / Path(source).stem
        strict = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Werror")
        call(compiler, *strict, "-o", program, FOREIGN / source, *options, cwd=tmp_path)
        return program

    return compile


@pytest.mark.parametrize("linked", [False, True], ids=["preloaded", "linked"])
def test_a_c_program_runs_the_fmus_to_the_bit_on_a_bare_python(
    system: Path, tmp_path: Path, compiled: Callable[..., Path], preload: str, bare: Path, linked: bool
) -> None:
    link = ["-Wl,--no-as-needed", preload, f"-Wl,-rpath,{Path(preload).parent}"] if linked else []
    host = compiled("c_host.c", "-I", Path(fmpy.__file__).parent / "c-code", *link, "-ldl")
    plan, names = write_plan(system, tmp_path / "unpacked", COUNT)
    asks = (
        "import importlib.util, sys; packages = ('numpy', 'scipy', 'control', 'fmpy', 'pythonfmu', 'fmu_src')\n"
        "print(sys.prefix, [p for p in packages if importlib.util.find_spec(p)], sys.argv)"
    )
    environment = {"PATH": str(bare), "LD_PRELOAD": "" if linked else preload, "PYTHON_SAYS": asks}
    said = call(host, plan, tmp_path / "result", cwd=tmp_path, environment=environment)
    assert said.split()[:2] == [str(bare.parent), "['pythonfmu']"]  # the FMUs' own copy, in their resources
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
    assert deviation(read_recording(tmp_path / "result"), ours(system).between(1)) < SAME


def test_the_command_line_of_ecos_runs_the_ssp(system: Path, tmp_path: Path, preload: str, bare: Path) -> None:
    """A C++ program; it calls `unzip`, writes six decimals, and stops a step early where the sum of steps passes it."""
    program = tmp_path / "ecos"
    shutil.copy(Path(sysconfig.get_path("purelib"), "ecospy", "binaries", "ecos"), program)
    program.chmod(0o755)
    environment = {
        "PATH": os.pathsep.join([str(bare), str(Path(shutil.which("unzip") or "").parent)]),
        "LD_PRELOAD": preload,
        "LD_LIBRARY_PATH": str(Path(sys.prefix, "lib")),  # libtbb.so.12
    }
    options = ("--path", system, "--stopTime", 0.6, "--stepSize", STEP)
    call(program, "simulate", *options, cwd=tmp_path, environment=environment)
    header, *lines = (tmp_path / "VehicleOnRoad.csv").read_text().splitlines()
    names = [name.strip().removesuffix("[REAL]").replace("::", ".", 1) for name in header.split(",")]
    rows = np.array([[float(x) for x in line.split(",")[:3]] for line in lines])
    assert len(lines) in (600, 601)
    columns = [names.index(name) for name in STATE_NAMES]
    states = np.array([[line.split(",")[i] for i in columns] for line in lines], dtype=np.float64)
    expected = ours(system, stop=0.6)
    np.testing.assert_allclose(rows[:, 1], expected.time[: len(lines)], atol=1e-9)
    np.testing.assert_allclose(states, expected.columns(STATE_NAMES)[: len(lines)], atol=1e-6)


# ---------------------------------------------------------------------------------------------------- why it is so
@pytest.mark.parametrize(
    ("connected", "script", "words"),
    [
        (True, "run_libcosimpy.py", "No such node (<xmlattr>.endElement)"),
        (True, "run_ecospy.py", "No element named: vehicle"),
        (False, "run_fmpy_ssp.py", "start_p"),
    ],
)
def test_the_system_has_no_connectors_of_its_own_because_no_way_suits_all_tools(
    system: Path, tmp_path: Path, foreign: Runner, connected: bool, script: str, words: str
) -> None:
    """Should this fail after an upgrade of the tool, the .ssp can do better."""
    other = with_own_output(system, tmp_path / "other.ssp", connected=connected)
    step = (STEP,) if script == "run_fmpy_ssp.py" else ()
    with pytest.raises(AssertionError) as refusal:
        foreign(script, other, 1, *step, "RESULT")
    assert words in str(refusal.value)
