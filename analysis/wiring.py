"""The wiring of a system, read from its SystemStructure.ssd (SSP 1.0): what feeds which input, and in which units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath

from lxml import etree

from .errors import InputError
from .units import SAME, Conversion, Unit, conversion, unit

_NS = {
    "ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription",
    "ssc": "http://ssp-standard.org/SSP1/SystemStructureCommon",
}
_TRANSFORMATIONS = ("Linear", "BooleanMapping", "IntegerMapping", "EnumerationMapping")


@dataclass(frozen=True, slots=True)
class Port:
    """One variable of one component, or ("") of the system itself."""

    component: str
    variable: str

    def __str__(self) -> str:
        return f"{self.component}.{self.variable}" if self.component else f"the system's own {self.variable}"


@dataclass(frozen=True, slots=True)
class Wiring:
    """Components with their FMU files, in the order in which they are stepped, and the source of each input."""

    sources: dict[str, str]  # component -> path of its FMU inside the archive
    feeds: dict[Port, Port]  # input -> the output that feeds it; in the order of the connectors, which is the FMU's
    places: dict[Port, str]  # input -> file and line of its connection
    units: dict[Port, Unit]  # of those connectors that say one
    unconverted: frozenset[Port]  # inputs whose connection says suppressUnitConversion


def read_wiring(path: Path, shown: Path | None = None) -> Wiring:
    """Read a SystemStructure.ssd, which faults call `shown`. Raises InputError with every fault, each with its line."""
    wiring, faults = examine(path, shown or path)
    if faults:
        raise InputError("\n".join(faults))
    return wiring


def examine(path: Path, shown: Path) -> tuple[Wiring, list[str]]:
    """The wiring of a SystemStructure.ssd as far as it can be made out, and every fault in it, with its line.

    Outputs of the system itself may be connected, and are left alone; an input of its own has no source here. Raises
    InputError for a file that cannot be read as a system structure.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.parse(str(path), parser).getroot()
    except (OSError, etree.XMLSyntaxError) as error:
        raise InputError(f"{shown}: cannot be read as a system structure: {error}") from error
    components = list(root.iterfind(".//ssd:Component", _NS))
    faults = [] if components else [f"{shown}: wanted at least one component, got none"]
    found = {c: _component_faults(c, components) for c in components}
    faults += [f"{shown}:{c.sourceline}: {fault}" for c, each in found.items() for fault in each]
    connectors = _connectors(root, components, shown, faults)
    kinds = {port: connector.get("kind", "") for port, connector in connectors.items()}
    units = _units(root, connectors, shown, faults)
    connections = _connections(root, kinds, shown, faults)
    inputs = [port for port, kind in kinds.items() if kind == "input" and port.component]
    fed = [port for port in inputs if port in connections]
    faults += [
        f"{shown}:{connectors[port].sourceline}: the input {port} has no source" for port in inputs if port not in fed
    ]
    wiring = Wiring(
        sources={c.get("name", ""): c.get("source", "") for c, each in found.items() if not each},
        feeds={port: _end(connections[port], "start") for port in fed},
        places={port: f"{shown}:{connections[port].sourceline}" for port in fed},
        units=units,
        unconverted=frozenset(p for p in fed if connections[p].get("suppressUnitConversion") in ("true", "1")),
    )
    return wiring, faults


def conversions(wiring: Wiring, fmus: Mapping[Port, Unit]) -> tuple[dict[Port, Conversion], list[str]]:
    """For each input what takes its source's numbers to its own, and every fault.

    `fmus`: units of the FMUs' variables that have one. A connector in another unit than its FMU's variable changes
    nothing as long as it can be converted; it stands in where the FMU says none, and where neither does numbers pass.
    """
    faults: list[str] = []
    found = {}
    for end, start in wiring.feeds.items():
        own, drawn = "in its FMU", "at its connector"
        said = [(start, own, fmus), (start, drawn, wiring.units), (end, drawn, wiring.units), (end, own, fmus)]
        chain = [(f"{port} {where}", us[port]) for port, where, us in said if port in us]
        chain = [] if end in wiring.unconverted else chain
        faults += [
            f"{wiring.places[end]}: wanted {to} in a unit that can be made of {a.name!r} (of {of}), got {b.name!r}"
            for (of, a), (to, b) in pairwise(chain)
            if conversion(a, b) is None
        ]
        found[end] = (conversion(chain[0][1], chain[-1][1]) if chain else None) or SAME
    return found, faults


def _connectors(
    root: etree._Element, components: list[etree._Element], shown: Path, faults: list[str]
) -> dict[Port, etree._Element]:
    """The connectors of the components and of the system itself; those that stand there twice join the faults."""
    connectors: dict[Port, etree._Element] = {}
    for name, element in [*((c.get("name", ""), c) for c in components), ("", root.find("ssd:System", _NS))]:
        for connector in () if element is None else element.iterfind("ssd:Connectors/ssd:Connector", _NS):
            port = Port(name, connector.get("name", ""))
            if port in connectors:
                faults.append(f"{shown}:{connector.sourceline}: the connector {port} stands there twice")
            connectors.setdefault(port, connector)
    return connectors


def _units(
    root: etree._Element, connectors: dict[Port, etree._Element], shown: Path, faults: list[str]
) -> dict[Port, Unit]:
    """The units of the connectors, from the definitions in the file; what is wrong with them joins the faults."""
    defined: dict[str, Unit | None] = {}  # None: at fault, which is said once
    for definition in root.iterfind("ssd:Units/ssc:Unit", _NS):
        name, base = definition.get("name", ""), definition.find("ssc:BaseUnit", _NS)
        try:
            defined[name] = unit(name, None if base is None else {str(k): str(v) for k, v in base.attrib.items()})
        except ValueError as error:
            faults.append(f"{shown}:{definition.sourceline}: {error}")
            defined[name] = None
    found = {}
    for port, connector in connectors.items():
        real = connector.find("ssc:Real", _NS)
        said = real.get("unit", "") if real is not None else ""
        if said:
            if said not in defined:
                known = ", ".join(defined) or "none"
                faults.append(
                    f"{shown}:{connector.sourceline}: {port}: wanted a unit of the file's Units ({known}), got {said!r}"
                )
            if (known_unit := defined.get(said)) is not None:
                found[port] = known_unit
    return found


def _connections(
    root: etree._Element, kinds: dict[Port, str], shown: Path, faults: list[str]
) -> dict[Port, etree._Element]:
    """The connections by where they end; what is wrong with them joins the faults."""
    connections: dict[Port, etree._Element] = {}
    for connection in root.iterfind(".//ssd:Connection", _NS):
        start, end = _end(connection, "start"), _end(connection, "end")
        found = [_source_fault(start, kinds), _port_fault(end, "input" if end.component else "output", kinds)]
        found.append(f"{end} has two sources" if end in connections else None)
        found.append(f"{end}: wanted a connection without a transformation" if _transforms(connection) else None)
        faults += [f"{shown}:{connection.sourceline}: {fault}" for fault in found if fault]
        connections.setdefault(end, connection)
    return connections


def _end(connection: etree._Element, which: str) -> Port:
    return Port(connection.get(f"{which}Element", ""), connection.get(f"{which}Connector", ""))


def _transforms(connection: etree._Element) -> bool:
    return any(connection.find(f"ssc:{kind}Transformation", _NS) is not None for kind in _TRANSFORMATIONS)


def _component_faults(component: etree._Element, components: list[etree._Element]) -> list[str]:
    """A source becomes a path, which may not lead out of the folder that the archive is unpacked into."""
    name, source = component.get("name", ""), component.get("source", "")
    first = next(c for c in components if c.get("name", "") == name)
    inside = source and not PurePosixPath(source).is_absolute() and ".." not in PurePosixPath(source).parts
    return [
        *([] if name else ["a component has no name"]),
        *([] if first is component else [f"component {name!r} stands there twice, first in line {first.sourceline}"]),
        *(
            []
            if inside
            else [f"component {name!r}: wanted the path of an FMU in the archive as source, got {source!r}"]
        ),
    ]


def _source_fault(port: Port, kinds: dict[Port, str]) -> str | None:
    if not port.component and kinds.get(port) == "input":
        return f"{port} has no source: wanted a system that needs no inputs"
    return _port_fault(port, "output", kinds)


def _port_fault(port: Port, wanted: str, kinds: dict[Port, str]) -> str | None:
    if port in kinds:
        return None if kinds[port] == wanted else f"{port} is not an {wanted} but has the kind {kinds[port]!r}"
    return f"{port} is not an {wanted}: there is no such component, or it has no such connector"
