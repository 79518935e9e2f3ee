"""What the .ssp holds beside the FMUs: its structures, and parameter sets (SSP 1.0) for the default and each scenario.

SystemStructure.ssd is written so that tools agree on it whatever they make of several sets at one component: libcosim
takes the first, Ecos the one that is named to it, SSP 1.0 has later ones override earlier ones. The default set, which
is complete, therefore stands first and last. Complete.ssd, a variant that only tools with all of SSP 1.0 look for, has
what the others cannot bear: connectors of the system itself, and start values of the car's states.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath

from lxml import etree

from ..controller.lqr_controller import LqrController
from ..quantities import TABLE, UNITS
from ..road.road_excitation import RoadExcitation
from ..slave import Slave
from ..vehicle.vehicle7dof import SAMPLING, Vehicle7DOF

Value = float | str | bool
Sets = Mapping[str, Mapping[str, Value]]  # name of a set -> values by the names of variables

SSD, SSC, SSV = (
    f"http://ssp-standard.org/SSP1/SystemStructure{what}" for what in ("Description", "Common", "ParameterValues")
)
SPACES = {"ssd": SSD, "ssc": SSC}
DEFAULT, START = "default", "start"
_MODELS: dict[str, type[Slave]] = {model.__name__: model for model in (RoadExcitation, Vehicle7DOF, LqrController)}


def system_files(structure: bytes, scenarios: Sets, titles: Mapping[str, str]) -> dict[str, bytes]:
    """The structures and the parameter sets, by their names in the archive.

    structure : SystemStructure.ssd without bindings.  scenarios : parameters and start values, SI units; each goes to
    every component that has it.  titles : a line on each scenario.
    """
    shipped, complete = etree.fromstring(structure), etree.fromstring(structure)
    files: dict[str, bytes] = {}
    for component in shipped.iterfind(".//ssd:Component", SPACES):
        name, model = component.get("name", ""), _MODELS[PurePosixPath(component.get("source", "")).stem]
        sets = {DEFAULT: defaults(model), START: start_values(model)}
        sets |= {scenario: _own(model, values) for scenario, values in scenarios.items()}
        sets = {each: values for each, values in sets.items() if values}
        files |= {_path(each, name): _parameter_set(each, v, titles.get(each, "")) for each, v in sets.items()}
        _bind(component, [each for each in sets if each != START] + [DEFAULT])
        (same,) = complete.iterfind(f".//ssd:Component[@name='{name}']", SPACES)
        _bind(same, [each for each in (DEFAULT, START) if each in sets])
    complete.set("name", f"{complete.get('name')}, complete")
    _expose_outputs(complete)
    return {"SystemStructure.ssd": _written(shipped.getroottree()), "Complete.ssd": _written(complete), **files}


# ------------------------------------------------------------------ values
def defaults(model: type[Slave]) -> dict[str, Value]:
    """Every parameter of a component at its default."""
    return {
        **{name: TABLE[name].start for name in model.reals},
        **{choice.name: choice.start for choice in model.choices},
        **dict.fromkeys(model.switches, True),
    }


def start_values(model: type[Slave]) -> dict[str, Value]:
    """The start values of a component's states."""
    return {q.name: q.start for q in model.outputs[: model.settable]}


def _own(model: type[Slave], values: Mapping[str, Value]) -> dict[str, Value]:
    """Those of the values that this component has, but for the sampling, which goes with a master's coupling."""
    known = {**defaults(model), **start_values(model)}
    return {name: value for name, value in values.items() if name in known and name != SAMPLING.name}


# ------------------------------------------------------------------ XML
def _path(each: str, component: str) -> str:
    return f"resources/{each}.{component}.ssv"


def _parameter_set(name: str, values: Mapping[str, Value], title: str) -> bytes:
    """An .ssv file; every number as repr, with its unit, which is defined at the end."""
    about = {"version": "1.0", "name": name, **({"description": title} if title else {})}
    root = etree.Element(f"{{{SSV}}}ParameterSet", about, nsmap={"ssv": SSV, "ssc": SSC})
    parameters = etree.SubElement(root, f"{{{SSV}}}Parameters")
    for variable, value in values.items():
        parameter = etree.SubElement(parameters, f"{{{SSV}}}Parameter", name=variable)
        if isinstance(value, bool):
            etree.SubElement(parameter, f"{{{SSV}}}Boolean", value=str(value).lower())
        elif isinstance(value, str):
            etree.SubElement(parameter, f"{{{SSV}}}String", value=value)
        else:
            etree.SubElement(parameter, f"{{{SSV}}}Real", value=repr(value), unit=TABLE[variable].unit)
    if used := list(dict.fromkeys(real.get("unit", "") for real in root.iter(f"{{{SSV}}}Real"))):
        units = etree.SubElement(root, f"{{{SSV}}}Units")
        for unit in used:
            exponents = {base: str(power) for base, power in UNITS[unit].items()}
            etree.SubElement(etree.SubElement(units, f"{{{SSC}}}Unit", name=unit), f"{{{SSC}}}BaseUnit", exponents)
    return _written(root)


def _bind(component: etree._Element, sets: list[str]) -> None:
    bindings = etree.Element(f"{{{SSD}}}ParameterBindings")
    for each in sets:
        source = _path(each, component.get("name", ""))
        etree.SubElement(bindings, f"{{{SSD}}}ParameterBinding", source=source)
    component.insert(1, bindings)  # after the connectors


def _expose_outputs(root: etree._Element) -> None:
    """Every output of every component as an output of the system, under its own name."""
    (system,), (connections,) = root.iterfind("ssd:System", SPACES), root.iterfind(".//ssd:Connections", SPACES)
    exposed = etree.Element(f"{{{SSD}}}Connectors")
    for component, connector in _outputs(system):
        exposed.append(etree.fromstring(etree.tostring(connector)))
        ends = {"startElement": component, "startConnector": connector.get("name", "")}
        etree.SubElement(connections, f"{{{SSD}}}Connection", {**ends, "endConnector": connector.get("name", "")})
    system.insert(0, exposed)


def _outputs(system: etree._Element) -> Iterator[tuple[str, etree._Element]]:
    for component in system.iterfind(".//ssd:Component", SPACES):
        for connector in component.iterfind("ssd:Connectors/ssd:Connector[@kind='output']", SPACES):
            yield component.get("name", ""), connector


def _written(xml: etree._Element | etree._ElementTree) -> bytes:
    """A file of this element, or of this tree, which has the comment before its root as well."""
    etree.indent(xml)
    return etree.tostring(xml, xml_declaration=True, encoding="UTF-8", pretty_print=True)
