"""The parameter sets and structures that the .ssp is shipped with: valid, true of FMUs and scenarios, and taken."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy import read_model_description
from foreign_runs import SAME, STATE_NAMES, Items, Runner, ours
from foreign_systems import NS, SSC, SSV, variant
from lxml import etree
from small_master import deviation

from analysis.scenario import built_in_scenarios, read_scenario
from analysis.wiring import read_wiring
from build import MODELS, system_contents
from fmu_src.quantities import STATES, UNITS

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"  # those of SSP 1.0
COMPONENTS = {"road": "RoadExcitation", "vehicle": "Vehicle7DOF", "controller": "LqrController"}
SCENARIOS = built_in_scenarios()
SPACES = {**NS, "ssv": SSV}


@pytest.fixture(scope="module")
def contents(system: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(system) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def values(ssv: bytes) -> dict[str, float | str | bool]:
    """The values of a parameter set, by name."""
    read: dict[str, Any] = {"Real": float, "String": str, "Boolean": lambda text: {"true": True, "false": False}[text]}
    parameters = etree.fromstring(ssv).iterfind("ssv:Parameters/ssv:Parameter", SPACES)
    return {p.get("name", ""): read[etree.QName(p[0]).localname](p[0].get("value")) for p in parameters}


def bound(ssd: bytes, component: str) -> list[str]:
    """Sources of the sets that a component has, in their order."""
    path = f".//ssd:Component[@name='{component}']/ssd:ParameterBindings/ssd:ParameterBinding"
    return [binding.get("source", "") for binding in etree.fromstring(ssd).iterfind(path, NS)]


# ------------------------------------------------------------------ what is shipped
def test_every_file_of_the_ssp_is_valid(contents: dict[str, bytes]) -> None:
    kinds = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}
    schemas = {suffix: etree.XMLSchema(etree.parse(str(SCHEMAS / name))) for suffix, name in kinds.items()}
    found = {name: schemas[suffix] for name in contents if (suffix := Path(name).suffix) in schemas}
    assert set(contents) == {*found, *(f"resources/{model}.fmu" for model in MODELS)}
    for name, schema in found.items():
        assert schema.validate(etree.fromstring(contents[name])), (name, schema.error_log)


@pytest.mark.parametrize("name", ["SystemStructure.ssd", "Complete.ssd"])
def test_experiment_and_both_vendors_annotations_are_those_of_the_default_scenario(
    contents: dict[str, bytes], name: str
) -> None:
    """OMSimulator, which is not run here, reads the step from its own; in the namespace and place of its schema."""
    oms = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
    osp = "http://opensimulationplatform.com/SSP/OSPAnnotations"
    root, bump = etree.fromstring(contents[name]), read_scenario("bump")
    (experiment,) = root.iterfind("ssd:DefaultExperiment", NS)
    assert [float(experiment.get(k, "")) for k in ("startTime", "stopTime")] == [bump.start_time, bump.stop_time]
    found = []
    for place, vendor in (("ssd:System", "org.openmodelica"), ("ssd:DefaultExperiment", "com.opensimulationplatform")):
        found += root.findall(f"{place}/ssd:Annotations/ssc:Annotation[@type='{vendor}']", NS)
    theirs, ospes = found
    path = f"{{{oms}}}Annotations/{{{oms}}}SimulationInformation/{{{oms}}}FixedStepMaster"
    assert [float(master.get("stepSize", "")) for master in theirs.iterfind(path)] == [bump.step]
    assert [float(each.get("baseStepSize", "")) for each in ospes.iter(f"{{{osp}}}FixedStepAlgorithm")] == [bump.step]


def test_the_same_sources_give_the_same_files(contents: dict[str, bytes]) -> None:
    assert system_contents() == {name: data for name, data in contents.items() if not name.endswith(".fmu")}


def test_every_number_of_a_set_has_a_unit_that_the_set_defines_as_the_table_does(contents: dict[str, bytes]) -> None:
    for name in contents:
        if name.endswith(".ssv"):
            root = etree.fromstring(contents[name])
            used = {real.get("unit", "") for real in root.iter(f"{{{SSV}}}Real")}
            bases = {str(u.get("name")): u.find("ssc:BaseUnit", NS) for u in root.iter(f"{{{SSC}}}Unit")}
            defined = {
                unit: {str(k): int(v) for k, v in base.items()} for unit, base in bases.items() if base is not None
            }
            assert defined == {unit: UNITS[unit] for unit in used}


@pytest.mark.parametrize("component", COMPONENTS)
def test_the_default_set_is_what_the_fmu_says_of_all_its_parameters(
    contents: dict[str, bytes], dist: Path, component: str
) -> None:
    variables = read_model_description(str(dist / f"{COMPONENTS[component]}.fmu")).modelVariables
    read: dict[str, Any] = {"Real": float, "String": str, "Boolean": lambda text: text == "true"}
    expected = {v.name: read[v.type](v.start) for v in variables if v.causality == "parameter"}
    assert values(contents[f"resources/default.{component}.ssv"]) == expected
    units = {
        p.get("name"): p[0].get("unit")
        for p in etree.fromstring(contents[f"resources/default.{component}.ssv"]).iter(f"{{{SSV}}}Parameter")
    }
    assert units == {v.name: v.unit for v in variables if v.causality == "parameter"}


def test_the_default_stands_first_and_last_and_every_set_is_bound(contents: dict[str, bytes]) -> None:
    shipped, complete = contents["SystemStructure.ssd"], contents["Complete.ssd"]
    for component in COMPONENTS:
        sources = bound(shipped, component)
        assert sources[0] == sources[-1] == f"resources/default.{component}.ssv"
        assert bound(complete, component)[0] == sources[0]
    files = {source for ssd in (shipped, complete) for c in COMPONENTS for source in bound(ssd, c)}
    assert files == {name for name in contents if name.endswith(".ssv")}


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_sets_of_a_scenario_are_its_parameters_at_each_component_that_has_them(
    contents: dict[str, bytes], scenario: str
) -> None:
    wanted = {**read_scenario(scenario).parameters, **read_scenario(scenario).start}
    del wanted["road_sampling"]  # goes with the coupling
    found: dict[str, Any] = {}
    for component in COMPONENTS:
        default = values(contents[f"resources/default.{component}.ssv"])
        own = {name: value for name, value in wanted.items() if name in default}
        name = f"resources/{scenario}.{component}.ssv"
        assert (values(contents[name]) if name in contents else {}) == own
        found |= own
    assert found == wanted


def test_the_complete_structure_has_the_same_wires_start_values_and_all_outputs(
    contents: dict[str, bytes], tmp_path: Path
) -> None:
    wirings = []
    for name in ("SystemStructure.ssd", "Complete.ssd"):
        (tmp_path / name).write_bytes(contents[name])
        wirings.append(read_wiring(tmp_path / name))
    assert (wirings[0].sources, wirings[0].feeds) == (wirings[1].sources, wirings[1].feeds)
    assert values(contents["resources/start.vehicle.ssv"]) == {q.name: q.start for q in STATES}
    assert bound(contents["Complete.ssd"], "vehicle")[1:] == ["resources/start.vehicle.ssv"]
    root = etree.fromstring(contents["Complete.ssd"])
    own = [c.get("name") for c in root.iterfind("ssd:System/ssd:Connectors/ssd:Connector", NS)]
    outputs = [c.get("name") for c in root.iterfind(".//ssd:Component//ssd:Connector[@kind='output']", NS)]
    ends = [c.get("endConnector") for c in root.iterfind(".//ssd:Connection", NS) if c.get("endElement") is None]
    assert own == outputs == ends


# ------------------------------------------------------------------ what tools take of it
def parameters_of(scenario: str) -> Items:
    return tuple((k, v) for k, v in read_scenario(scenario).parameters.items() if k != "road_sampling")


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_ecos_runs_each_scenario_by_its_name(system: Path, foreign: Runner, scenario: str) -> None:
    expected = ours(system, stop=0.6, parameters=parameters_of(scenario))
    assert deviation(foreign("run_ecospy.py", system, 600, "RESULT", scenario), expected, STATE_NAMES) < SAME


def test_libcosim_runs_the_scenario_whose_set_is_moved_to_the_front(
    system: Path, foreign: Runner, tmp_path: Path
) -> None:
    def move(root: etree._Element) -> None:
        for binding in root.findall(".//ssd:ParameterBinding", NS):
            if "/sine." in binding.get("source", ""):
                bindings = binding.getparent()
                assert bindings is not None
                bindings.insert(0, binding)

    sine = variant(system, tmp_path / "sine.ssp", move)
    expected = ours(system, stop=0.6, parameters=parameters_of("sine"))
    assert deviation(foreign("run_libcosimpy.py", sine, 600, "RESULT"), expected.between(1)) < SAME
    assert deviation(expected, ours(system, stop=0.6), STATE_NAMES) > 0.1
