"""The wiring of a system, read from its SystemStructure.ssd (SSP 1.0): which output feeds which input."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from lxml import etree

from .errors import InputError

_NS = {"ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription"}


@dataclass(frozen=True, slots=True)
class Port:
    """One variable of one component."""

    component: str
    variable: str


@dataclass(frozen=True, slots=True)
class Wiring:
    """Components with their FMU files, in the order in which they are stepped, and the source of each input."""

    sources: dict[str, str]  # component -> path of its FMU inside the archive
    feeds: dict[Port, Port]  # input -> the output that feeds it; in the order of the connectors, which is the FMU's


def read_wiring(path: Path) -> Wiring:
    """Read a SystemStructure.ssd. Raises InputError with every fault, each with its line."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.parse(str(path), parser).getroot()
    except (OSError, etree.XMLSyntaxError) as error:
        raise InputError(f"{path}: cannot be read as a system structure: {error}") from error
    components = list(root.iterfind(".//ssd:Component", _NS))
    connectors = {
        Port(component.get("name", ""), connector.get("name", "")): connector
        for component in components
        for connector in component.iterfind("ssd:Connectors/ssd:Connector", _NS)
    }
    kinds = {port: connector.get("kind", "") for port, connector in connectors.items()}
    faults = [] if components else [f"{path}: wanted at least one component, got none"]
    faults += [f"{path}:{c.sourceline}: {fault}" for c in components for fault in _component_faults(c, components)]
    feeds: dict[Port, Port] = {}
    for connection in root.iterfind(".//ssd:Connection", _NS):
        start = Port(connection.get("startElement", ""), connection.get("startConnector", ""))
        end = Port(connection.get("endElement", ""), connection.get("endConnector", ""))
        found = [_port_fault(start, "output", kinds), _port_fault(end, "input", kinds)]
        found.append(f"{end.component}.{end.variable} has two sources" if end in feeds else None)
        faults += [f"{path}:{connection.sourceline}: {fault}" for fault in found if fault]
        feeds.setdefault(end, start)
    inputs = [port for port, kind in kinds.items() if kind == "input"]
    faults += [
        f"{path}:{connectors[port].sourceline}: the input {port.component}.{port.variable} has no source"
        for port in inputs
        if port not in feeds
    ]
    if faults:
        raise InputError("\n".join(faults))
    return Wiring({c.get("name", ""): c.get("source", "") for c in components}, {port: feeds[port] for port in inputs})


def _component_faults(component: etree._Element, components: list[etree._Element]) -> list[str]:
    """Names and sources become paths: neither may lead out of the folder that the archive is unpacked into."""
    name, source = component.get("name", ""), component.get("source", "")
    first = next(c for c in components if c.get("name", "") == name)
    inside = source and not PurePosixPath(source).is_absolute() and ".." not in PurePosixPath(source).parts
    return [
        *([] if name not in ("", "..") and PurePosixPath(name).name == name else [f"a component is called {name!r}"]),
        *([] if first is component else [f"component {name!r} stands there twice, first in line {first.sourceline}"]),
        *(
            []
            if inside
            else [f"component {name!r}: wanted the path of an FMU in the archive as source, got {source!r}"]
        ),
    ]


def _port_fault(port: Port, wanted: str, kinds: dict[Port, str]) -> str | None:
    where = f"{port.component}.{port.variable}"
    if port in kinds:
        return None if kinds[port] == wanted else f"{where} is not an {wanted} but has the kind {kinds[port]!r}"
    return f"{where} is not an {wanted}: there is no such component, or it has no such connector"
