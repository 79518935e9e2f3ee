"""Variants of the system for foreign masters: other parameters, another order, connectors of its own; plans for C."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.ssp.ssd import read_ssd
from lxml import etree

Value = float | str | bool
SSD, SSC, SSV = (
    f"http://ssp-standard.org/SSP1/SystemStructure{what}" for what in ("Description", "Common", "ParameterValues")
)
NS = {"ssd": SSD, "ssc": SSC}


def variant(
    system: Path, target: Path, edit: Callable[[etree._Element], None], more: Mapping[str, str] | None = None
) -> Path:
    """The system with an edited structure and further files."""
    with zipfile.ZipFile(system) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    root = etree.fromstring(contents["SystemStructure.ssd"])
    edit(root)
    contents["SystemStructure.ssd"] = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    contents |= {name: text.encode() for name, text in (more or {}).items()}
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in contents.items():
            archive.writestr(name, data)
    return target


def parameter_set(name: str, values: Mapping[str, Value]) -> str:
    """The text of an .ssv file."""

    def parameter(variable: str, value: Value) -> str:
        kind = {bool: "Boolean", str: "String"}.get(type(value), "Real")
        text = str(value).lower() if isinstance(value, bool) else value
        return f'<ssv:Parameter name="{variable}"><ssv:{kind} value="{text}"/></ssv:Parameter>'

    rows = "".join(parameter(variable, value) for variable, value in values.items())
    return (
        f'<?xml version="1.0"?><ssv:ParameterSet xmlns:ssv="{SSV}" version="1.0" name="{name}">'
        f"<ssv:Parameters>{rows}</ssv:Parameters></ssv:ParameterSet>"
    )


def with_parameters(system: Path, target: Path, name: str, sets: Mapping[str, Mapping[str, Value]]) -> Path:
    """The system with a parameter set of this name bound to its components."""

    def bind(root: etree._Element) -> None:
        for component in root.iterfind(".//ssd:Component", NS):
            if component.get("name") not in sets:
                continue
            for old in component.findall("ssd:ParameterBindings", NS):
                component.remove(old)
            bindings = etree.Element(f"{{{SSD}}}ParameterBindings")
            source = f"resources/{name}_{component.get('name')}.ssv"
            etree.SubElement(bindings, f"{{{SSD}}}ParameterBinding", source=source)
            component.insert(1, bindings)  # after the connectors

    files = {f"resources/{name}_{c}.ssv": parameter_set(name, values) for c, values in sets.items()}
    return variant(system, target, bind, files)


def reordered(system: Path, target: Path, order: tuple[str, ...]) -> Path:
    """The system with its components listed in another order."""

    def sort(root: etree._Element) -> None:
        elements = root.find(".//ssd:Elements", NS)
        assert elements is not None
        elements[:] = sorted(elements, key=lambda c: order.index(str(c.get("name"))))

    return variant(system, target, sort)


def with_own_output(system: Path, target: Path, *, connected: bool) -> Path:
    """The system with the body's heave as an output connector of its own."""

    def add(root: etree._Element) -> None:
        top, connections = root.find("ssd:System", NS), root.find(".//ssd:Connections", NS)
        assert top is not None and connections is not None
        connectors = etree.Element(f"{{{SSD}}}Connectors")
        connector = etree.SubElement(connectors, f"{{{SSD}}}Connector", name="heave", kind="output")
        etree.SubElement(connector, f"{{{SSC}}}Real", unit="m")
        top.insert(0, connectors)
        if connected:
            ends = {"startElement": "vehicle", "startConnector": "body.heave", "endConnector": "heave"}
            etree.SubElement(connections, f"{{{SSD}}}Connection", ends)

    return variant(system, target, add)


def write_plan(system: Path, folder: Path, count: int, step: float = 1e-3) -> tuple[Path, tuple[str, ...]]:
    """Unpack the system and write a plan for foreign/c_host.c; returns it, and the names of the columns it makes."""
    with zipfile.ZipFile(system) as archive:
        archive.extractall(folder)
    ssd = read_ssd(system)
    names: list[str] = []
    found = {}
    for c in ssd.system.elements:
        where = extract(str(folder / c.source), str(folder / c.name))
        description = read_model_description(where)
        found[c.name] = where, description, {v.name: v.valueReference for v in description.modelVariables}
        names += [f"{c.name}.{v.name}" for v in description.modelVariables if v.causality == "output"]
    lines = [f"run 0.0 {step!r} {count}"]
    for name, (where, d, references) in found.items():
        lines.append(f"fmu {where} {d.coSimulation.modelIdentifier} {d.guid}")
        lines += [f"output {v.valueReference}" for v in d.modelVariables if v.causality == "output"]
        lines += [
            f"input {references[k.endConnector]} {names.index(f'{k.startElement}.{k.startConnector}')}"
            for k in ssd.system.connections
            if k.endElement == name
        ]
    plan = folder / "plan.txt"
    plan.write_text("\n".join(lines) + "\n")
    return plan, tuple(names)
