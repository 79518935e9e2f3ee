"""The wiring of a system, read from its SystemStructure.ssd (SSP 1.0): which output feeds which input."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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
    feeds: dict[Port, Port]  # input -> the output that feeds it


def read_wiring(path: Path) -> Wiring:
    """Read a SystemStructure.ssd. Raises InputError with every fault of its connections."""
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        root = etree.parse(str(path), parser).getroot()
    except (OSError, etree.XMLSyntaxError) as error:
        raise InputError(f"{path}: cannot be read as a system structure: {error}") from error
    sources = {c.get("name", ""): c.get("source", "") for c in root.iterfind(".//ssd:Component", _NS)}
    kinds = {
        Port(component.get("name", ""), connector.get("name", "")): connector.get("kind")
        for component in root.iterfind(".//ssd:Component", _NS)
        for connector in component.iterfind("ssd:Connectors/ssd:Connector", _NS)
    }
    feeds: dict[Port, Port] = {}
    faults = [] if sources else [f"{path}: wanted at least one component, got none"]
    for connection in root.iterfind(".//ssd:Connection", _NS):
        start = Port(connection.get("startElement", ""), connection.get("startConnector", ""))
        end = Port(connection.get("endElement", ""), connection.get("endConnector", ""))
        for port, kind in ((start, "output"), (end, "input")):
            if kinds.get(port) != kind:
                faults.append(f"{path}:{connection.sourceline}: {port.component}.{port.variable} is not an {kind}")
        if end in feeds:
            faults.append(f"{path}:{connection.sourceline}: {end.component}.{end.variable} has two sources")
        feeds[end] = start
    unfed = [port for port, kind in kinds.items() if kind == "input" and port not in feeds]
    faults += [f"{path}: the input {port.component}.{port.variable} has no source" for port in unfed]
    if faults:
        raise InputError("\n".join(faults))
    return Wiring(sources, feeds)
