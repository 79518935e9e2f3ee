"""Shared by all tests: a seeded generator, the default car, its Lagrangian twin, and the built FMUs."""

from __future__ import annotations

import shutil
import sys
import sysconfig
import venv
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import analysis  # noqa: F401  (before numpy: it sets the number of threads)

# isort: split
import lagrangian
import numpy as np
import pytest

from fmu_src.vehicle.parameters import Car

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20261122)


@pytest.fixture(scope="session")
def car() -> Car:
    """A car with every parameter away from zero and from symmetry that the model allows."""
    return Car(m11=28.0, m12=33.0, bp1=90.0, bp2=70.0)


@pytest.fixture(scope="session")
def lagrange(car: Car) -> Callable[..., Any]:
    """The same car's accelerations from the energies."""
    return lagrangian.accelerations(asdict(car))


@pytest.fixture(scope="session")
def dist() -> Path:
    """Folder of the built FMUs; `build.py test` builds them before the tests run."""
    folder = ROOT / "dist"
    assert (folder / "VehicleOnRoad.ssp").is_file(), "build the FMUs first: python3 build.py build"
    return folder


@pytest.fixture(scope="session")
def system(dist: Path) -> Path:
    return dist / "VehicleOnRoad.ssp"


@pytest.fixture
def foreign(tmp_path: Path) -> Callable[..., Any]:
    """Runs a script of tests/foreign and reads its recording back."""
    from foreign_runs import runner

    return runner(tmp_path)


@pytest.fixture
def compiled(tmp_path: Path) -> Callable[..., Path]:
    """Compiles a C source of tests/foreign; returns the program, or the library that the options make of it."""
    from foreign_runs import FOREIGN, call

    def compile(source: str, *options: object) -> Path:
        if not sys.platform.startswith("linux") or not (compiler := shutil.which("cc")):
            pytest.skip("no C compiler on this machine (or no Linux): C hosts are not tested here")
        program = tmp_path / Path(source).stem
        strict = ("-std=c11", "-O2", "-Wall", "-Wextra", "-Werror")
        call(compiler, *strict, "-o", program, FOREIGN / source, *options, cwd=tmp_path)
        return program

    return compile


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
