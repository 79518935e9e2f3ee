"""The closed loop as one FMU, by tools that we did not write, against our own master; docs/interop.md has the table."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import sys
import zipfile
from pathlib import Path, PurePosixPath
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.ssp.ssd import read_ssd
from fmpy.validation import validate_fmu
from foreign_runs import LATE_ITEMS, SAME, STATE_NAMES, STEP, STOP, Runner, call, error, ours, small
from foreign_systems import reordered
from lxml import etree
from small_master import Recording, Ways, deviation

from build import write_archive
from fmu_src.export.container import container_contents

PROGRAMS = Path(sys.executable).parent


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
    assert deviation(found, ours(system)) == pytest.approx(2.2e-1, rel=0.1)
    assert deviation(found, ours(system), STATE_NAMES) == pytest.approx(1.1e-2, rel=0.1)
    assert error(found) == pytest.approx(4.9e-3, rel=0.1)


def test_fmpys_container_is_a_valid_fmu_with_all_parameters(system: Path, container: Path) -> None:
    assert validate_fmu(str(container)) == []
    unknowns = fmpy.read_model_description(str(container)).initialUnknowns
    assert len(unknowns) == 31
    assert all(u.dependencies is None for u in unknowns)  # FMI: on all, parameters included
    start = {**dict(LATE_ITEMS), "vehicle.body.heave": 0.01}
    found = fmpy.simulate_fmu(
        str(container), stop_time=0.3, output_interval=STEP, start_values=start, output=["road.h_fl", "road.h_fr"]
    )
    assert np.argmax(found["road.h_fl"] > 0) == 101
    assert not found["road.h_fr"].any()
    assert container_contents(system) == container_contents(system)


def test_fmpys_container_takes_the_steps_that_it_says_and_no_others(container: Path, tmp_path: Path) -> None:
    description = fmpy.read_model_description(str(container))
    folder = fmpy.extract(str(container), str(tmp_path / "unpacked"))
    kind = description.coSimulation
    assert (kind.canHandleVariableCommunicationStepSize, kind.canGetAndSetFMUstate) == (False, False)
    assert float(description.defaultExperiment.stepSize) == STEP
    for step, taken in ((STEP, True), (2 * STEP, True), (0.5 * STEP, False), (1.5 * STEP, False), (0.0, False)):
        fmu = FMU2Slave(
            guid=description.guid,
            modelIdentifier=kind.modelIdentifier,
            unzipDirectory=folder,
            instanceName="loop",
        )
        fmu.instantiate()
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        with contextlib.nullcontext() if taken else pytest.raises(FMICallException):
            fmu.doStep(0.0, step)
        fmu.freeInstance()


def test_fmpys_container_has_picture_page_and_licences(container: Path) -> None:
    with zipfile.ZipFile(container) as archive:
        names = set(archive.namelist())
        page = archive.read("documentation/index.html").decode()
        licences = {n: archive.read(n).decode() for n in names if n.startswith("documentation/licenses/")}
        assert archive.read("model.png").startswith(b"\x89PNG")
    root = etree.fromstring(page.encode())
    assert not re.search(r"https?:|url\(|@import|<script|<link|href", page)
    rows = [row[0].findtext("code") for row in root.iter("tr") if row[0].tag == "td"]
    assert rows == [v.name for v in fmpy.read_model_description(str(container)).modelVariables]
    assert "documentation/externalDependencies.txt" in names
    assert {PurePosixPath(name).name for name in licences} == {"license.txt", "pythonfmu.txt", "fmpy.txt"}
    assert "Dassault" in licences["documentation/licenses/fmpy.txt"]
    for name in re.findall("<code>(resources/.*?)</code>", page):
        assert name in names
