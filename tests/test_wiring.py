"""Wiring and layout: the system that is shipped, systems that cannot be, and where each number lies in the table."""

from __future__ import annotations

import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.errors import InputError
from analysis.layout import lay_out
from analysis.wiring import Port, read_wiring
from fmu_src.controller.lqr_controller import LqrController
from fmu_src.quantities import UNITS
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.slave import Slave
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

ROOT = Path(__file__).resolve().parents[1]
SHIPPED = ROOT / "fmu_src" / "system" / "SystemStructure.ssd"
TEXT = SHIPPED.read_text(encoding="utf-8")
SPACES = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
}
COMPONENTS: dict[str, type[Slave]] = {"road": RoadExcitation, "vehicle": Vehicle7DOF, "controller": LqrController}
CONNECTION = (
    '<ssd:Connection startElement="{}" startConnector="{}" endElement="vehicle" endConnector="force_{}"/>'.format
)
WIRE = CONNECTION("controller", "force_rl", "rl")


# ------------------------------------------------------------------ the system that is shipped
@pytest.mark.parametrize("name", COMPONENTS)
def test_a_component_has_exactly_the_variables_units_and_causalities_of_its_fmu(name: str) -> None:
    component = ElementTree.fromstring(TEXT).find(f".//ssd:Component[@name='{name}']", SPACES)
    assert component is not None
    assert component.get("source") == f"resources/{COMPONENTS[name].__name__}.fmu"
    units = {c.get("name"): c.find("ssc:Real", SPACES) for c in component.iterfind(".//ssd:Connector", SPACES)}
    found = [
        (c.get("name"), c.get("kind"), unit.get("unit") if (unit := units[c.get("name")]) is not None else None)
        for c in component.iterfind(".//ssd:Connector", SPACES)
    ]
    inputs = [(q.name, "input", q.unit) for q in COMPONENTS[name].inputs]
    assert found == inputs + [(q.name, "output", q.unit) for q in COMPONENTS[name].outputs]


def test_its_units_are_defined_as_in_the_table() -> None:
    used = {real.get("unit") for real in ElementTree.fromstring(TEXT).iter(f"{{{SPACES['ssc']}}}Real")}
    found = {}
    for unit in ElementTree.fromstring(TEXT).iterfind("ssd:Units/ssc:Unit", SPACES):
        base = unit.find("ssc:BaseUnit", SPACES)
        assert base is not None
        found[unit.get("name")] = {key: int(power) for key, power in base.items()}
    assert found == {name: UNITS[name] for name in UNITS if name in used}


def test_every_input_is_fed_by_the_output_of_its_name_and_unit() -> None:
    wiring = read_wiring(SHIPPED)
    for end, start in wiring.feeds.items():
        (fed,) = [q for q in COMPONENTS[end.component].inputs if q.name == end.variable]
        assert [q for q in COMPONENTS[start.component].outputs if q.name == start.variable] == [fed]
    assert list(wiring.sources) == ["road", "vehicle", "controller"]


def test_inputs_come_in_the_order_of_their_fmu_which_it_then_takes_without_a_loop() -> None:
    wiring = read_wiring(SHIPPED)
    for name, fmu in COMPONENTS.items():
        assert [p.variable for p in wiring.feeds if p.component == name] == [q.name for q in fmu.inputs]


def test_the_shipped_system_needs_no_gathering_under_gauss_seidel() -> None:
    wiring = read_wiring(SHIPPED)
    feeds = {name: [start for end, start in wiring.feeds.items() if end.component == name] for name in COMPONENTS}
    outputs = {name: [q.name for q in fmu.outputs] for name, fmu in COMPONENTS.items()}
    layout = lay_out(outputs, feeds, list(COMPONENTS), "gauss-seidel")
    assert all(map(layout.stretch, COMPONENTS))


# ------------------------------------------------------------------ systems that cannot be
def line_of(text: str, part: str) -> int:
    return text[: text.index(part)].count("\n") + 1


def refused(folder: Path, text: str) -> list[tuple[int, str]]:
    """Line (0: none) and words of each fault."""
    path = folder / "system.ssd"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refusal:
        read_wiring(path)
    parsed = [re.fullmatch(r".*system\.ssd(?::(\d+))?: (.+)", line) for line in str(refusal.value).split("\n")]
    return [(int(match[1] or 0), match[2]) for match in parsed if match]


@pytest.mark.parametrize(
    ("old", "new", "where", "words"),
    [
        (WIRE, "", '<ssd:Connector name="force_rl" kind="input"', "the input vehicle.force_rl has no source"),
        (WIRE, WIRE + "\n" + CONNECTION("road", "h_fl", "rl"), CONNECTION("road", "h_fl", "rl"), "has two sources"),
        (WIRE, CONNECTION("controller", "body.heave", "rl"), None, "body.heave is not an output but .*'input'"),
        (WIRE, CONNECTION("driver", "force_rl", "rl"), None, "driver.force_rl is not an output: there is no such"),
        (WIRE, CONNECTION("road", "h_f1", "rl"), None, "road.h_f1 is not an output: there is no such"),
        (WIRE, WIRE + WIRE.replace('"force_rl"/', '"body.roll"/'), None, "body.roll is not an input but .*'output'"),
        (WIRE, WIRE + WIRE.replace('"vehicle"', '"driver"'), None, "driver.force_rl is not an input: there is no such"),
        (WIRE, WIRE + "<ssd:Connection/>", None, "not an output"),
        ('name="controller"', 'name="road"', 'name="road" type="application/x-fmu-sharedlibrary" source="resources/L',
         r"component 'road' stands there twice, first in line \d+"),
        ('name="controller"', 'name=""', 'name="" type', "a component has no name"),
        ('<ssd:Connector name="force_rl" kind="input">', '<ssd:Connector name="force_rl" kind="output"/>'
         '<ssd:Connector name="force_rl" kind="input">', None, "the connector vehicle.force_rl stands there twice"),
        ("resources/Lqr", "/resources/Lqr", "/resources/Lqr", "wanted the path of an FMU in the archive as source"),
        ("resources/Lqr", "../Lqr", "../Lqr", "wanted the path of an FMU in the archive as source"),
        ('source="resources/LqrController.fmu"', "", '"controller" type', "wanted the path of an FMU .* got ''"),
    ],
)  # fmt: skip
def test_a_fault_is_refused_with_its_line(tmp_path: Path, old: str, new: str, where: str | None, words: str) -> None:
    assert TEXT.count(old) == 1
    text = TEXT.replace(old, new)
    found = refused(tmp_path, text)
    line = line_of(text, where or new)
    assert [said for at, said in found if at == line and re.search(words, said)], found


def test_every_fault_is_listed_at_once(tmp_path: Path) -> None:
    text = TEXT.replace('endConnector="h_', 'endConnector="x_')
    found = refused(tmp_path, text)
    assert len([said for _, said in found if "is not an input" in said]) == 4
    assert len([said for _, said in found if "has no source" in said]) == 4
    assert all(line for line, _ in found)


@pytest.mark.parametrize("text", ["", "<", "<a/>", "PK\x03\x04", TEXT[:2000], "<a>&undefined;</a>"])
def test_what_is_no_system_structure_is_refused_with_the_file(tmp_path: Path, text: str) -> None:
    assert refused(tmp_path, text)


def test_a_missing_structure_is_refused_with_the_file(tmp_path: Path) -> None:
    for path in (tmp_path / "none.ssd", tmp_path):
        with pytest.raises(InputError, match=f"{path.name}: cannot be read as a system structure"):
            read_wiring(path)


BOMB = '<!ENTITY a0 "boom">' + "".join(f'<!ENTITY a{n + 1} "{f"&a{n};" * 20}">' for n in range(12))


@pytest.mark.parametrize(
    "place", ['<ssd:Component name="road"', "<ssd:Elements>", 'source="resources/Vehicle7DOF.fmu"']
)
@pytest.mark.parametrize("what", ["bomb", "file", "network", "outer"])
def test_entities_are_not_expanded(tmp_path: Path, what: str, place: str) -> None:
    """In a process of its own: an expansion would neither end nor let itself be interrupted."""
    (tmp_path / "secret").write_text(f'<ssd:Component xmlns:ssd="{SPACES["ssd"]}" name="../TOP-SECRET"/>')
    entities = {
        "bomb": f"{BOMB}<!ENTITY e '&a12;'>",
        "file": f'<!ENTITY e SYSTEM "{(tmp_path / "secret").as_uri()}">',
        "network": '<!ENTITY e SYSTEM "http://192.0.2.1/e">',
        "outer": f'<!ENTITY % p SYSTEM "{(tmp_path / "secret").as_uri()}"> %p;',
    }
    spoilt = f"{place}&e;" if place.endswith(">") else f'{place[:-1]}&e;"'
    declared = f"<!DOCTYPE ssd:SystemStructureDescription [{entities[what]}]>\n<!-- The closed"
    (tmp_path / "system.ssd").write_text(TEXT.replace(place, spoilt).replace("<!-- The closed", declared))
    program = "from analysis.wiring import *; w = read_wiring(Path('system.ssd')); print((w.sources, w.feeds))"
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r}); {program}"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=30)
    said = done.stdout + done.stderr.splitlines()[-1] if done.returncode else done.stdout
    assert "SECRET" not in done.stdout + done.stderr
    assert said.count("boom") < 10
    expected = read_wiring(SHIPPED)
    assert "InputError: system.ssd:" in said or repr((expected.sources, expected.feeds)) in said


# ------------------------------------------------------------------ where each number lies
@st.composite
def systems(draw: st.DrawFn) -> tuple[dict[str, list[str]], dict[str, list[Port]], str]:
    """Components with their outputs and the sources of their inputs, in the order of stepping; the coupling."""
    outputs = {name: [f"y{k}" for k in range(draw(st.integers(0, 4)))] for name in "abcde"[: draw(st.integers(1, 5))]}
    ports = [Port(name, variable) for name, variables in outputs.items() for variable in variables]
    sources = st.lists(st.sampled_from(ports), max_size=6) if ports else st.just([])
    return outputs, {name: draw(sources) for name in outputs}, draw(st.sampled_from(["gauss-seidel", "jacobi"]))


@given(system=systems())
def test_every_position_points_at_the_column_of_the_source_in_the_right_row(
    system: tuple[dict[str, list[str]], dict[str, list[Port]], str],
) -> None:
    outputs, feeds, coupling = system
    layout = lay_out(outputs, feeds, list(outputs), coupling)
    ports = [Port(name, variable) for name, variables in outputs.items() for variable in variables]
    assert sorted(layout.columns.values()) == list(range(layout.width))
    assert set(layout.columns) == set(ports)
    row = sorted(ports, key=layout.columns.__getitem__)
    memory = [("old", port) for port in row] + [("new", port) for port in row]
    stepped: set[str] = set()
    for name in outputs:
        for position, source in zip(layout.inputs[name], feeds[name], strict=True):
            fresh = coupling == "gauss-seidel" and source.component in stepped
            assert memory[layout.width + position] == ("new" if fresh else "old", source)
        stepped.add(name)


@given(system=systems())
def test_the_outputs_of_a_component_follow_each_other_in_their_order(
    system: tuple[dict[str, list[str]], dict[str, list[Port]], str],
) -> None:
    outputs, feeds, coupling = system
    layout = lay_out(outputs, feeds, list(outputs), coupling)
    for name, variables in outputs.items():
        columns = [layout.columns[Port(name, variable)] for variable in variables]
        assert all(after == before + 1 for before, after in pairwise(columns))


@given(system=systems(), coupling=st.sampled_from(["gauss-seidel", "jacobi"]))
def test_a_chain_needs_no_gathering(
    system: tuple[dict[str, list[str]], dict[str, list[Port]], str], coupling: str
) -> None:
    outputs = system[0]
    feeds: dict[str, list[Port]] = {name: [] for name in outputs}
    for before, after in pairwise(outputs):
        feeds[after] = [Port(before, variable) for variable in outputs[before]]
    layout = lay_out(outputs, feeds, list(outputs), coupling)
    assert all(map(layout.stretch, outputs))


def test_blocks_are_put_in_the_order_in_which_their_reader_wants_them() -> None:
    outputs = {"a": ["x", "y"], "b": ["z"], "c": ["u"]}
    x, y, z, u = Port("a", "x"), Port("a", "y"), Port("b", "z"), Port("c", "u")
    layout = lay_out(outputs, {"a": [], "b": [u, x, y, z], "c": [y, x]}, ["a", "b", "c"], "jacobi")
    assert sorted(layout.columns, key=layout.columns.__getitem__) == [u, x, y, z]
    assert [layout.stretch(name) for name in outputs] == [True, True, False]
