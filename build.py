#!/usr/bin/env python3
"""Build the FMUs, run a scenario, run the tests: `python3 build.py run | test | build | bench | clean`.

Needs only a Python >= 3.11 with pip: it sets up `.venv` with pinned packages by itself, then goes on inside it.
(This file shadows PyPA's `build` package in this folder; to make a wheel use `pip wheel .`)
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
STAMP = ENVIRONMENT / "installed.json"
DIST = ROOT / "dist"
PACKAGE = ROOT / "fmu_src"
SYSTEM = PACKAGE / "system"
LEFT_OUT = ("__pycache__", "designs", "export", "system")  # of the package, in an FMU: not needed while it steps
DESIGNS = "controller/designs"  # of the package: the default controllers, which go into the controller's resources
CURE = PACKAGE / "export" / "library.py"  # what is done to PythonFMU's library

# FMU (also the name of its class) -> the module that holds the class
MODELS = {
    "RoadExcitation": "road.road_excitation",
    "Vehicle7DOF": "vehicle.vehicle7dof",
    "LqrController": "controller.lqr_controller",
}
ENTRY = '''"""Slave script of {model}.fmu; the hash in its name keeps it apart from other versions in a process."""

import sys

from {package}.{module} import {model} as _{model}

_references = []


class {model}(_{model}):
    """{model}, content {identity}."""

    identity = "{identity}"

    def _set_up(self, **kwargs):
        # At each instantiation PythonFMU's loader gives up a reference to this module's dictionary which it never
        # took; without this line the module is empty after a few instances.
        _references.append(globals())
        # It also puts the resources in front of the path anew, where they are already.
        if sys.path.count(kwargs["resources"]) > 1:
            sys.path.remove(kwargs["resources"])
        super()._set_up(**kwargs)


# And it runs this script anew, and keeps the class: all instances have the first one.
{model} = globals().setdefault("_first", {model})
'''


# ---------------------------------------------------------------------------------------------------- environment
def environment_python() -> Path:
    return ENVIRONMENT / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def enter_environment(extras: list[str]) -> None:
    """Set up `.venv` if it is missing or stale, then continue this very command inside it."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wanted = [
        str(ROOT),
        settings["project"],
        settings["build-system"],
        (ROOT / "constraints.txt").read_text(encoding="utf-8"),
    ]
    key = hashlib.sha256(json.dumps(wanted).encode()).hexdigest()
    installed = json.loads(STAMP.read_text()) if STAMP.is_file() else {}
    if installed.get("key") != key or not set(extras) <= set(installed["extras"]):
        if Path(sys.prefix) == ENVIRONMENT:
            sys.exit("pyproject.toml or constraints.txt have changed: call this command with the system's python3")
        _install(sorted({*extras, *installed.get("extras", [])}))
        STAMP.write_text(json.dumps({"key": key, "extras": sorted({*extras, *installed.get("extras", [])})}))
    if Path(sys.prefix) != ENVIRONMENT:
        sys.exit(_become([str(environment_python()), str(Path(__file__).resolve()), *sys.argv[1:]]))


def _become(command: list[str]) -> int:
    """Go on as this command, so that signals reach it; where a process cannot, run it and return its status."""
    if os.name != "nt":
        sys.stdout.flush()
        os.execv(command[0], command)
    return subprocess.call(command)


def _install(extras: list[str]) -> None:
    print("Setting up .venv with the pinned packages (once; about a minute) ...", file=sys.stderr, flush=True)
    try:
        venv.create(ENVIRONMENT, clear=True, with_pip=True)
        pip = [str(environment_python()), "-m", "pip"]
    except subprocess.CalledProcessError:  # Debian without python3-venv has no ensurepip; this Python's own pip will do
        venv.create(ENVIRONMENT, clear=True, with_pip=False)
        pip = [sys.executable, "-m", "pip", "--python", str(environment_python())]
    project = f"{ROOT}[{','.join(extras)}]" if extras else str(ROOT)
    command = [*pip, "install", "--disable-pip-version-check", "-c", str(ROOT / "constraints.txt"), "-e", project]
    if not sys.stderr.isatty():
        command.append("--quiet")
    if subprocess.call(command):
        shutil.rmtree(ENVIRONMENT, ignore_errors=True)
        sys.exit("pip could not install the packages (see above): is there a network to a package index?")


# ---------------------------------------------------------------------------------------------------- FMUs
def build() -> None:
    """Build the FMUs, their cross-check sets, the .ssp that wires them and the container, unless up to date."""
    beside = ("build.py", "constraints.txt", "LICENSE", "analysis/scenario.py", "pyproject.toml")
    fresh = _content_hash([PACKAGE, *(ROOT / name for name in beside)])
    stamp = DIST / "sources.sha256"
    made = [DIST / "VehicleOnRoad.ssp", DIST / "VehicleOnRoad.fmu", *(DIST / f"{model}.fmu" for model in MODELS)]
    if stamp.is_file() and stamp.read_text() == fresh and all(path.is_file() for path in made):
        return
    print(f"Building the FMUs in {DIST} ...", file=sys.stderr, flush=True)
    from fmu_src.export.container import container_contents
    from fmu_src.export.cross_check import write_cross_check

    DIST.mkdir(exist_ok=True)
    stamp.unlink(missing_ok=True)
    shutil.rmtree(DIST / "cross-check", ignore_errors=True)
    for model in MODELS:
        build_fmu(model, PACKAGE, DIST / f"{model}.fmu")
        write_cross_check(DIST / f"{model}.fmu", DIST / "cross-check")
    fmus = {f"resources/{model}.fmu": (DIST / f"{model}.fmu").read_bytes() for model in MODELS}
    write_archive(DIST / "VehicleOnRoad.ssp", {**system_contents(), **fmus})
    write_archive(DIST / "VehicleOnRoad.fmu", container_contents(DIST / "VehicleOnRoad.ssp"))
    stamp.write_text(fresh)


def system_contents() -> dict[str, bytes]:
    """What the .ssp holds beside the FMUs: structures, and a parameter set for the default and for each scenario."""
    from analysis.scenario import built_in_scenarios, read_scenario
    from fmu_src.export.system import system_files

    scenarios = {name: read_scenario(name) for name in built_in_scenarios()}
    values = {name: {**s.parameters, **s.start} for name, s in scenarios.items()}
    titles = {name: s.title for name, s in scenarios.items()}
    return system_files((SYSTEM / "SystemStructure.ssd").read_bytes(), values, titles)


def build_fmu(model: str, package: Path, target: Path) -> None:
    """Export one model of the package with pythonfmu; the same sources give the same bytes.

    The package goes into the resources under a name that carries the hash of its content, with a slave script whose
    name carries it too: a host process can then hold two versions, and one that goes by the guid keeps them apart.
    Documentation and reference results (of a run of the FMU just made) are added at the end and have no part in it.
    """
    from pythonfmu import FmuBuilder

    from fmu_src.export.contents import extra_entries
    from fmu_src.export.library import cured

    identity = _identity(model, package)
    name = f"fmu_src_{identity[:12]}"
    with tempfile.TemporaryDirectory(prefix="build_fmu_") as temporary:
        folder = Path(temporary)
        shutil.copytree(package, folder / name, ignore=shutil.ignore_patterns(*LEFT_OUT))
        script = folder / f"{model.lower()}_{identity[:12]}.py"
        script.write_text(ENTRY.format(model=model, module=MODELS[model], package=name, identity=identity))
        files: list[Path] = [folder / name]
        files += [Path(shutil.copy(design, folder)) for design in _designs(model, package)]
        try:
            made = FmuBuilder.build_FMU(script, folder / "made", project_files=files)
        finally:
            sys.path.remove(str(folder))  # left there by the builder
        with zipfile.ZipFile(made) as archive:
            contents = {entry: archive.read(entry) for entry in archive.namelist()}
        contents |= {entry: cured(data) for entry, data in contents.items() if entry.startswith("binaries/linux64/")}
        write_archive(made, contents)
        contents |= extra_entries(made)
    write_archive(target, contents)


def _designs(model: str, package: Path) -> list[Path]:
    """The files of designs that the FMU holds, so that as shipped it needs no numeric library.

    They are sources: what a numeric library makes of the equations differs in its last digits from machine to machine.
    """
    return sorted((package / DESIGNS).iterdir()) if model == "LqrController" else []


def renew_designs() -> None:
    """Design the default controllers anew; wanted when the default car, or the way they are designed, has changed."""
    from fmu_src.controller.design import design, store
    from fmu_src.controller.fullcar import FullCar
    from fmu_src.controller.halfcar import HalfCar

    for car in (HalfCar(), FullCar()):
        store(design(car, infinite=True, span=float("inf")), PACKAGE / DESIGNS)


def _identity(model: str, package: Path) -> str:
    """Hash of all that acts in an FMU: our code and designs, the slave script, PythonFMU and how it is changed."""
    import pythonfmu

    parts = [model, ENTRY, _content_hash([package], LEFT_OUT), _content_hash([*_designs(model, package), CURE])]
    parts += [_content_hash([Path(pythonfmu.__file__).parent], ("__pycache__", "tests"))]
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()[:32]


def write_archive(target: Path, contents: dict[str, bytes]) -> None:
    """A zip archive with sorted entries and fixed times, complete or not there at all."""
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=".build_") as folder:
        part = Path(folder) / target.name
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in sorted(contents):
                entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
                entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
                archive.writestr(entry, contents[name])
        part.replace(target)


def _content_hash(paths: list[Path], left_out: tuple[str, ...] = ("__pycache__",)) -> str:
    digest = hashlib.sha256()
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            name = file.relative_to(path.parent)
            if file.is_file() and not set(left_out) & set(name.parts):
                digest.update(name.as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()


# ---------------------------------------------------------------------------------------------------- commands
def run(scenario: str, out: Path | None) -> int:
    """Co-simulate a scenario, check it, and write the report."""
    build()
    where = ["-o", str(out)] if out else []
    return _become([sys.executable, "-m", "analysis", "run", scenario, *where])


def test(arguments: list[str]) -> int:
    """Lint, types, import contracts, tests: all that the continuous integration runs."""
    build()
    tools = environment_python().parent
    for tool, *options in (
        ["ruff", "check", "."],
        ["ruff", "format", "--check", "."],
        ["mypy"],
        ["lint-imports"],
        ["pytest", "-n", "auto", *arguments],
    ):
        print("$", tool, *options, flush=True)
        if status := subprocess.call([str(tools / tool), *options], cwd=ROOT):
            return status
    return 0


def bench() -> int:
    """Time the default closed loop beside the alternatives."""
    build()
    return _become([sys.executable, str(ROOT / "benchmarks" / "closed_loop.py")])


def clean() -> int:
    """Remove what was built and installed here; run folders stay."""
    caches = [".mypy_cache", ".ruff_cache", ".pytest_cache", ".hypothesis", ".import_linter_cache"]
    for path in [DIST, ENVIRONMENT, *(ROOT / cache for cache in caches)]:
        shutil.rmtree(path, ignore_errors=True)
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    verb = verbs.add_parser("run", help="co-simulate a scenario, check it, write the report; default: the paper's bump")
    verb.add_argument("scenario", nargs="?", default="bump", help="a built-in scenario, a .toml file, or a run.json")
    verb.add_argument("-o", "--out", type=Path, help="run folder (default: runs/SCENARIO, replaced if it is a run)")
    verbs.add_parser("test", help="lint, types, import contracts, tests; further arguments go to pytest")
    for name, what in (
        ("build", "build dist/*.fmu and the .ssp"),
        ("bench", "benchmarks"),
        ("clean", "remove .venv, dist, caches"),
    ):
        verbs.add_parser(name, help=what)
    options, further = parser.parse_known_args()
    if further and options.verb != "test":
        parser.error(f"unrecognized arguments: {' '.join(further)}")

    if options.verb == "clean":
        return clean()
    enter_environment(extras=["interop", "test"] if options.verb == "test" else [])
    match options.verb:
        case "run":
            return run(options.scenario, options.out)
        case "test":
            return test(further)
        case "bench":
            return bench()
        case _:
            build()
            return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("interrupted; the next call will take up where this one was stopped")
