"""Units of connectors and FMUs: what is converted, what is refused, and that SI systems pay nothing for it."""

from __future__ import annotations

import math
import re
import shutil
import zipfile
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
from fmpy import read_model_description
from foreign_systems import NS, SSC, variant
from lxml import etree

import build
from analysis.cosimulation import simulate
from analysis.errors import InputError
from analysis.scenario import Scenario
from analysis.units import SAME, Conversion, Unit, conversion, unit
from analysis.wiring import Port, conversions, read_wiring
from fmu_src import quantities
from fmu_src.quantities import CORNERS

SHIPPED = build.SYSTEM / "SystemStructure.ssd"
TEXT = SHIPPED.read_text(encoding="utf-8")
DEG = math.pi / 180
UNITS = {
    "mm": {"m": "1", "factor": "0.001"},
    "mm/s": {"m": "1", "s": "-1", "factor": "0.001"},
    "deg": {"rad": "1", "factor": repr(DEG)},
    "deg/s": {"rad": "1", "s": "-1", "factor": repr(DEG)},
    "kg": {"kg": "1"},
}


# ------------------------------------------------------------------ one unit and another
@pytest.mark.parametrize(
    ("start", "end", "names"),
    [
        ({"m": 1, "factor": 1e-3}, {"m": 1}, ("mm", "m")),
        ({"rad": 1}, {"rad": 1, "factor": DEG}, ("rad", "deg")),
        ({"kg": 1, "m": 1, "s": -2, "factor": 1e3}, {"kg": 1, "m": 1, "s": -2}, ("kN", "N")),
        ({"K": 1, "offset": 273.15}, {"K": 1}, ("degC", "K")),
        ({"K": 1, "factor": 5 / 9, "offset": 459.67 * 5 / 9}, {"K": 1, "offset": 273.15}, ("degF", "degC")),
        ({"m": 1, "s": -1, "factor": 1 / 3.6}, {"m": 1, "s": -1}, ("km/hour", "m/s")),
    ],
)
def test_conversions_are_those_of_pint(start: dict[str, float], end: dict[str, float], names: tuple[str, str]) -> None:
    there, back = (conversion(unit("a", a), unit("b", b)) for a, b in ((start, end), (end, start)))
    assert there is not None and back is not None
    for x in (-40.0, 0.0, 1.0, 273.15):
        expected = pint.get_application_registry().Quantity(x, names[0]).to(names[1]).magnitude
        assert there.factor * x + there.offset == pytest.approx(expected, rel=1e-12, abs=1e-12)
        assert back.factor * (there.factor * x + there.offset) + back.offset == pytest.approx(x, abs=1e-10)
        assert unit("a", start).from_si(unit("a", start).to_si(x)) == pytest.approx(x, abs=1e-10)


def test_the_same_by_another_name_costs_nothing_and_other_dimensions_cannot_be_converted() -> None:
    newton = {"kg": 1, "m": 1, "s": -2}
    assert conversion(unit("N", newton), unit("newton", newton)) == SAME
    assert conversion(unit("N.m", {**newton, "m": 2}), unit("N", newton)) is None
    assert conversion(unit("rad/s", {"rad": 1, "s": -1}), unit("1/s", {"s": -1})) is None
    assert conversion(Unit("furlong"), Unit("furlong")) == SAME
    assert conversion(Unit("furlong"), unit("m", {"m": 1})) is None


@pytest.mark.parametrize("base", [{"m": "one"}, {"m": "1.5"}, {"factor": "0"}, {"factor": "inf"}, {"offset": "nan"}])
def test_a_base_unit_that_is_none_is_refused(base: dict[str, str]) -> None:
    with pytest.raises(ValueError, match="unit 'x': wanted"):
        unit("x", base)


# ------------------------------------------------------------------ a system in other units
def put_units(root: etree._Element, component: str, units: dict[str, str]) -> None:
    """Put other units to the connectors of a component, and define them."""
    (definitions,) = root.iterfind("ssd:Units", NS)
    for real in root.iterfind(f".//ssd:Component[@name='{component}']//ssc:Real", NS):
        real.set("unit", units.get(real.get("unit", ""), real.get("unit", "")))
    for name in units.values():
        made = etree.SubElement(definitions, f"{{{SSC}}}Unit", name=name)
        etree.SubElement(made, f"{{{SSC}}}BaseUnit", UNITS[name])


def rewritten(folder: Path, changes: dict[str, list[tuple[str, str]]]) -> Path:
    """A copy of the package with other text in some of its files."""
    package = folder / "fmu_src"
    shutil.copytree(build.PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    for name, replacements in changes.items():
        text = (package / name).read_text(encoding="utf-8")
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        (package / name).write_text(text, encoding="utf-8")
    return package


@pytest.fixture(scope="module")
def foreign_units(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The system with a road in mm (its amplitude, too) and a controller that takes angles in degrees."""
    folder = tmp_path_factory.mktemp("units")
    first = '    "s": {"s": 1},\n'
    defined = (first, first + "".join(f"    {name!r}: {base!r},\n" for name, base in UNITS.items()))
    in_mm = [
        ('"h_{}", "m"', '"h_{}", "mm"'),
        ('"dh_{}", "m/s"', '"dh_{}", "mm/s"'),
        ('"bow_{}",\n    "m"', '"bow_{}",\n    "mm"'),
        ('name="A", unit="m"', 'name="A", unit="mm"'),
        ('profile", start=0.01)', 'profile", start=10.0)'),
    ]
    turned = "[radians(x) if q.unit in ('deg', 'deg/s') else x for q, x in zip(self.inputs, self.u)]"
    in_degrees = [
        ("from pathlib import Path\n", "from math import radians\nfrom pathlib import Path\n"),
        ("self._law(self.time, self.u)", f"self._law(self.time, {turned})"),
    ]
    road = rewritten(folder / "road", {"quantities.py": [defined, *in_mm]})
    changes = {"quantities.py": [defined, ('unit="rad"', 'unit="deg"')], "controller/lqr_controller.py": in_degrees}
    controller = rewritten(folder / "controller", changes)
    build.build_fmu("RoadExcitation", road, folder / "RoadExcitation.fmu")
    build.build_fmu("LqrController", controller, folder / "LqrController.fmu")

    def edit(root: etree._Element) -> None:
        put_units(root, "road", {"m": "mm", "m/s": "mm/s"})
        put_units(root, "controller", {"rad": "deg", "rad/s": "deg/s"})

    made = variant(dist / "VehicleOnRoad.ssp", folder / "connectors.ssp", edit)
    with zipfile.ZipFile(made) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    contents |= {f"resources/{fmu.name}": fmu.read_bytes() for fmu in folder.glob("*.fmu")}
    build.write_archive(folder / "system.ssp", contents)
    return folder / "system.ssp"


@pytest.mark.parametrize(("coupling", "sampling"), [("gauss-seidel", "end"), ("jacobi", "start")])
def test_a_system_in_mm_and_degrees_moves_as_the_one_in_si_units(
    dist: Path, foreign_units: Path, coupling: str, sampling: str
) -> None:
    """Its parameters are set and recorded in SI units, and so is its trajectory."""
    scenario = Scenario(
        name="x", coupling=coupling, stop_time=0.7, parameters={"road_sampling": sampling, "A": 0.02, "t_on": 0.1}
    )
    si, other = simulate(scenario, dist / "VehicleOnRoad.ssp"), simulate(scenario, foreign_units)
    assert other.trajectory.names == si.trajectory.names
    largest = np.abs(si.trajectory.values).max(axis=0)
    assert np.count_nonzero(largest) == len(largest)
    gaps = np.abs(other.trajectory.values - si.trajectory.values).max(axis=0)
    assert (gaps <= 1e-12 * np.maximum(largest, 1e-3)).all()
    assert other.record["parameters"] == si.record["parameters"]


def moved(system: Path) -> np.ndarray[Any, Any]:
    return simulate(Scenario(name="x", stop_time=0.1), system).trajectory.values


def test_connectors_in_other_units_than_their_fmus_change_nothing(dist: Path, tmp_path: Path) -> None:
    def edit(root: etree._Element) -> None:
        put_units(root, "vehicle", {"m": "mm", "rad": "deg"})

    other = variant(dist / "VehicleOnRoad.ssp", tmp_path / "other.ssp", edit)
    np.testing.assert_array_equal(moved(other), moved(dist / "VehicleOnRoad.ssp"))


def test_the_shipped_system_is_wired_without_any_conversion(dist: Path) -> None:
    wiring = read_wiring(SHIPPED)
    fmus: dict[Port, Unit] = {}
    for name, source in wiring.sources.items():
        variables = read_model_description(str(dist / Path(source).name)).modelVariables
        fmus |= {Port(name, v.name): unit_of(v.unit) for v in variables if v.type == "Real"}
    assert set(conversions(wiring, fmus)[0].values()) == {SAME}
    assert set(conversions(wiring, {})[0].values()) == {SAME}


def unit_of(name: str) -> Unit:
    return unit(name, quantities.UNITS[name])


# ------------------------------------------------------------------ what an .ssd can say
def wired(folder: Path, *changes: tuple[str, str]) -> dict[Port, Conversion]:
    """The conversions of the shipped structure with other text in it, and FMUs that say no units."""
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "system.ssd").write_text(text, encoding="utf-8")
    found, faults = conversions(read_wiring(folder / "system.ssd"), {})
    if faults:
        raise InputError("\n".join(faults))
    return found


HEIGHT = '<ssd:Connector name="h_fl" kind="output"><ssc:Real unit="{}"/>'.format
DEFINED = ("<ssd:Units>", '<ssd:Units><ssc:Unit name="{}"><ssc:BaseUnit {}/></ssc:Unit>'.format)
MILLIMETRES = (DEFINED[0], DEFINED[1]("mm", 'm="1" factor="0.001"'))
IN_MM = (HEIGHT("m"), HEIGHT("mm"))
WIRE = '<ssd:Connection startElement="road" startConnector="h_fl" endElement="vehicle" endConnector="h_fl"'


def test_where_the_fmus_say_no_unit_the_connectors_do(tmp_path: Path) -> None:
    found = wired(tmp_path, MILLIMETRES, IN_MM)
    assert found.pop(Port("vehicle", "h_fl")) == Conversion(0.001, 0.0)
    assert set(found.values()) == {SAME}


def test_a_connection_can_forbid_the_conversion(tmp_path: Path) -> None:
    found = wired(tmp_path, MILLIMETRES, IN_MM, (WIRE, WIRE + ' suppressUnitConversion="true"'))
    assert set(found.values()) == {SAME}


@pytest.mark.parametrize(
    ("changes", "where", "words"),
    [
        (
            [(DEFINED[0], DEFINED[1]("kg", 'kg="1"')), (HEIGHT("m"), HEIGHT("kg"))],
            WIRE,
            r"wanted vehicle\.h_fl at its connector in a unit that can be made of 'kg' \(of road\.h_fl .*\), got 'm'",
        ),
        ([(HEIGHT("m"), HEIGHT("mm"))], HEIGHT("mm"), r"road\.h_fl: wanted a unit of the file's Units .*, got 'mm'"),
        ([(DEFINED[0], DEFINED[1]("mm", 'm="one"'))], '<ssc:Unit name="mm"', "unit 'mm': wanted numbers"),
        (
            [(DEFINED[0], DEFINED[1]("mm", 'm="1" factor="0"'))],
            '<ssc:Unit name="mm"',
            "unit 'mm': wanted a finite factor",
        ),
        (
            [(WIRE + "/>", WIRE + '><ssc:LinearTransformation factor="2"/></ssd:Connection>')],
            WIRE,
            r"vehicle\.h_fl: wanted a connection without a transformation",
        ),
    ],
)
def test_what_cannot_be_converted_is_refused_with_its_line(
    tmp_path: Path, changes: list[tuple[str, str]], where: str, words: str
) -> None:
    with pytest.raises(InputError) as refusal:
        wired(tmp_path, *changes)
    text = (tmp_path / "system.ssd").read_text(encoding="utf-8")
    line = text[: text.index(where)].count("\n") + 1
    assert re.fullmatch(rf".*system\.ssd:{line}: {words}.*", str(refusal.value))


def test_all_connections_that_cannot_be_converted_are_named_fmus_included(dist: Path, tmp_path: Path) -> None:
    """Four heights in kg at the road's connectors: against its FMU and against the car's connectors."""

    def edit(root: etree._Element) -> None:
        put_units(root, "road", {"m/s": "kg"})

    other = variant(dist / "VehicleOnRoad.ssp", tmp_path / "other.ssp", edit)
    with pytest.raises(InputError) as refusal:
        simulate(Scenario(name="x", stop_time=0.1), other)
    lines = str(refusal.value).split("\n")
    assert len(lines) == 8
    for corner in CORNERS:
        at = rf".*other\.ssp/SystemStructure\.ssd:\d+: wanted (road|vehicle)\.dh_{corner} at its connector in a unit"
        assert len([line for line in lines if re.match(at, line)]) == 2


def test_faults_of_all_kinds_are_named_at_once(dist: Path, tmp_path: Path) -> None:
    """In the structure alone, between it and its FMUs, in a file, in units: who mends one wants to know the rest."""

    def edit(root: etree._Element) -> None:
        put_units(root, "road", {"m/s": "kg"})  # four rates, at their connectors and at those of the car
        (connections,) = root.iterfind(".//ssd:Connections", NS)
        twice = next(c for c in connections if c.get("endConnector") == "force_rl")
        again = deepcopy(twice)
        again.set("startConnector", "force_rr")
        connections.append(again)
        (connector,) = root.iterfind(".//ssd:Component[@name='road']//ssd:Connector[@name='bow_fl']", NS)
        wire = next(c for c in connections if c.get("startConnector") == "bow_fl")
        connector.set("name", "bow_xx")
        wire.set("startConnector", "bow_xx")
        (controller,) = root.iterfind(".//ssd:Component[@name='controller']", NS)
        controller.set("source", "resources/Nothing.fmu")

    other = variant(dist / "VehicleOnRoad.ssp", tmp_path / "other.ssp", edit)
    with pytest.raises(InputError) as refusal:
        simulate(Scenario(name="x", stop_time=0.1), other)
    lines = str(refusal.value).split("\n")
    kinds = [
        r".*:\d+: vehicle\.force_rl has two sources",
        r"controller: Nothing\.fmu cannot be read as an FMU: .*",
        r".*: its FMUs lack these of its connectors: road\.bow_xx \(output\)",
        *[r".*:\d+: wanted .* in a unit that can be made of .*"] * 8,
    ]
    assert len(lines) == len(kinds)
    assert all(re.fullmatch(kind, line) for kind, line in zip(kinds, lines, strict=True)), lines
