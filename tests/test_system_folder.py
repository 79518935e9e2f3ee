"""The master takes a system packed or unpacked: the same bits, the same refusals, nothing from outside of it."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

from analysis.cosimulation import simulate
from analysis.errors import InputError
from analysis.scenario import Scenario, read_scenario
from analysis.trajectory import Run

SHORT = Scenario(name="short", stop_time=0.01)
Packer = Callable[[Path], Path]


@pytest.fixture
def unpacked(system: Path, tmp_path: Path) -> Path:
    with zipfile.ZipFile(system) as archive:
        archive.extractall(tmp_path / "system")
    return tmp_path / "system"


def as_it_is(folder: Path) -> Path:
    return folder


def packed(folder: Path) -> Path:
    return Path(shutil.make_archive(str(folder), "zip", folder)).rename(folder.with_suffix(".ssp"))


packed_or_not = pytest.mark.parametrize("pack", [as_it_is, packed])


def assert_same(a: Run, b: Run) -> None:
    np.testing.assert_array_equal(a.trajectory.values, b.trajectory.values)
    assert a.record == b.record


def test_an_unpacked_system_gives_the_same_bits_and_is_left_as_it_was(system: Path, unpacked: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in unpacked.rglob("*")}
    scenario = replace(read_scenario("bump-lqr"), stop_time=0.6)
    assert_same(simulate(scenario, unpacked), simulate(scenario, system))
    assert {path: path.stat().st_mtime_ns for path in unpacked.rglob("*")} == before


@packed_or_not
def test_a_system_with_output_connectors_of_its_own_is_run(system: Path, unpacked: Path, pack: Packer) -> None:
    (unpacked / "Complete.ssd").replace(unpacked / "SystemStructure.ssd")
    assert_same(simulate(SHORT, pack(unpacked)), simulate(SHORT, system))


@packed_or_not
def test_a_system_that_waits_for_inputs_of_its_own_is_refused(unpacked: Path, pack: Packer) -> None:
    structure = unpacked / "SystemStructure.ssd"
    text = structure.read_text(encoding="utf-8")
    wire = 'startElement="road" startConnector="h_fl"'
    begin = '<ssd:System name="VehicleOnRoad">'
    own = '<ssd:Connectors><ssd:Connector name="h" kind="input"/></ssd:Connectors>'
    assert text.count(wire) == text.count(begin) == 1
    line = text[: text.index(wire)].count("\n") + 1
    structure.write_text(text.replace(wire, 'startConnector="h"').replace(begin, begin + own), encoding="utf-8")
    with pytest.raises(InputError, match=rf"ssd:{line}: the system's own h has no source: wanted a system that needs"):
        simulate(SHORT, pack(unpacked))


@packed_or_not
@pytest.mark.parametrize("source", ["../Vehicle7DOF.fmu", "/Vehicle7DOF.fmu", "resources/../../Vehicle7DOF.fmu"])
def test_a_source_that_leads_out_of_the_system_is_refused(
    dist: Path, unpacked: Path, pack: Packer, source: str
) -> None:
    shutil.copy(dist / "Vehicle7DOF.fmu", unpacked.parent)
    structure = unpacked / "SystemStructure.ssd"
    text = structure.read_text(encoding="utf-8").replace("resources/Vehicle7DOF.fmu", source)
    structure.write_text(text, encoding="utf-8")
    system = pack(unpacked)
    with pytest.raises(InputError) as refusal:
        simulate(SHORT, system)
    at = f"{system / 'SystemStructure.ssd'}:{text[: text.index(source)].count(chr(10)) + 1}: "
    assert (
        str(refusal.value)
        == f"{at}component 'vehicle': wanted the path of an FMU in the archive as source, got {source!r}"
    )


def test_a_link_that_leads_out_of_the_system_is_refused_and_one_within_it_is_followed(
    system: Path, dist: Path, unpacked: Path
) -> None:
    fmu = unpacked / "resources" / "Vehicle7DOF.fmu"
    fmu.rename(unpacked / "elsewhere.fmu")
    fmu.symlink_to("../elsewhere.fmu")
    assert_same(simulate(SHORT, unpacked), simulate(SHORT, system))
    fmu.unlink()
    fmu.symlink_to(dist / "Vehicle7DOF.fmu")
    with pytest.raises(InputError, match=r"links that lead elsewhere: resources/Vehicle7DOF\.fmu"):
        simulate(SHORT, unpacked)


def test_a_component_may_have_any_name(system: Path, unpacked: Path) -> None:
    """PythonFMU's library ends the process if such a name gets into a path."""
    structure = unpacked / "SystemStructure.ssd"
    text = structure.read_text(encoding="utf-8").replace('"vehicle"', '"../Jürgens #1 (50%)"')
    structure.write_text(text, encoding="utf-8")
    named, plain = simulate(SHORT, unpacked), simulate(SHORT, system)
    np.testing.assert_array_equal(named.trajectory.values, plain.trajectory.values)


def test_a_component_of_any_name_may_be_refused(unpacked: Path) -> None:
    """Its name is in the message, which FMI takes for a format of printf."""
    structure = unpacked / "SystemStructure.ssd"
    text = structure.read_text(encoding="utf-8").replace('"vehicle"', '"car 100%s%n"')
    structure.write_text(text, encoding="utf-8")
    code = (
        "import sys; from pathlib import Path\n"
        "from analysis.cosimulation import simulate\nfrom analysis.scenario import Scenario\n"
        "try: simulate(Scenario(name='x', stop_time=0.01, parameters={'m21': 21.0}), Path(sys.argv[1]))\n"
        "except Exception as error: print(error, flush=True)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, unpacked], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "it said: car 100%s%n: initialization: m21 = 21.0 kg, m22 = 22.0 kg: wanted equal masses" in done.stdout


@pytest.mark.parametrize("name", ["a#1", "50%", "Jürgen", "it's"])
def test_a_temporary_folder_that_the_library_cannot_bear_is_refused(
    system: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / name).mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / name))
    with pytest.raises(InputError, match="set TMPDIR to a plain one"):
        simulate(SHORT, system)


@pytest.mark.parametrize(
    ("kind", "end", "name", "lacking"),
    [
        ("output", "start", "A", r"road\.A \(output\)"),  # a parameter of its FMU
        ("input", "end", "tyre_fl.load", r"vehicle\.tyre_fl\.load \(input\)"),  # not there at all
        ("input", "end", "m", r"vehicle\.m \(input\)"),
    ],
)
def test_connectors_that_are_not_what_the_fmu_says_are_refused(
    unpacked: Path, kind: str, end: str, name: str, lacking: str
) -> None:
    structure = unpacked / "SystemStructure.ssd"
    text = structure.read_text(encoding="utf-8")
    for place in (f'name="h_fl" kind="{kind}"', f'{end}Connector="h_fl"'):
        assert text.count(place) == 1
        text = text.replace(place, place.replace("h_fl", name))
    structure.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=f"its FMUs lack these of its connectors: {lacking}$"):
        simulate(SHORT, unpacked)


@packed_or_not
@pytest.mark.parametrize("name", ["resources/Vehicle7DOF.fmu", "SystemStructure.ssd"])
def test_a_file_that_is_missing_is_named(unpacked: Path, pack: Packer, name: str) -> None:
    (unpacked / name).unlink()
    with pytest.raises(InputError, match=rf"{Path(name).name}.*cannot be read as"):
        simulate(SHORT, pack(unpacked))


def test_a_folder_that_is_no_system_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"SystemStructure\.ssd: cannot be read as a system structure"):
        simulate(SHORT, tmp_path)
