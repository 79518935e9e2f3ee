"""The model description: what PythonFMU writes, completed with units, limits, exact start values and structure."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement

from .quantities import PARAMETERS, UNITS, Quantity

if TYPE_CHECKING:
    from .slave import Slave

RELEASED = "2026-11-22T00:00:00Z"  # of the version in pyproject.toml, not of the build: same sources, same bytes
LOG_CATEGORIES = {"logStatusError": "Refused calls and steps, with names, values, units and times."}
CAPABILITIES = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}


def completed(root: Element, slave: Slave) -> Element:
    """The description of a slave, from the one that PythonFMU wrote."""
    root.set("generationDateAndTime", RELEASED)
    _element(root, "CoSimulation").attrib.update(CAPABILITIES)
    described = {q.name: q for q in (*slave.inputs, *slave.outputs, *(PARAMETERS[name] for name in slave.reals))}
    for variable in root.iter("ScalarVariable"):
        real = variable.find("Real")
        if real is not None:
            _describe(real, described[variable.get("name", "")])
    root.insert(list(root).index(_element(root, "LogCategories")), _units(described.values()))
    _structure(_element(root, "ModelStructure"), slave)
    return root


def _element(root: Element, tag: str) -> Element:
    found = root.find(tag)
    assert found is not None, tag
    return found


def _describe(real: Element, q: Quantity) -> None:
    real.set("unit", q.unit)
    low = 0.0 if q.positive else q.low
    for name, limit in (("min", low), ("max", q.high)):
        if abs(limit) < float("inf"):
            real.set(name, repr(limit))
    real.set("nominal", repr(q.nominal))
    if "start" in real.attrib:
        real.set("start", repr(float(q.start)))


def _units(quantities: Iterable[Quantity]) -> Element:
    definitions = Element("UnitDefinitions")
    for unit in dict.fromkeys(q.unit for q in quantities):
        exponents = {base: str(power) for base, power in UNITS[unit].items()}
        SubElement(SubElement(definitions, "Unit", name=unit), "BaseUnit", exponents)
    return definitions


def _structure(structure: Element, slave: Slave) -> None:
    """Outputs with the inputs that they depend on within a step; unknowns at the start with all that they depend on."""
    structure.clear()
    index = {v.name: i for i, v in enumerate(slave.vars.values(), start=1)}
    given = [q.name for q in slave.outputs[: slave.settable]]
    given += [*slave.reals, *(choice.name for choice in slave.choices), *slave.switches]
    outputs, initial = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
    for i, q in enumerate(slave.outputs):
        through = [index[name] for name in slave.dependencies.get(q.name, ())]
        _unknown(outputs, index[q.name], through)
        if i >= slave.settable:
            _unknown(initial, index[q.name], through + [index[name] for name in slave.initially.get(q.name, given)])


def _unknown(parent: Element, index: int, dependencies: list[int]) -> None:
    SubElement(parent, "Unknown", index=str(index), dependencies=" ".join(map(str, sorted(dependencies))))
