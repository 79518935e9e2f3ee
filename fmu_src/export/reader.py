"""What an FMU says of itself, for those who write about it: names, variables, words."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

from ..quantities import TABLE


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A row of the table of variables, as it is read; the symbol is LaTeX."""

    name: str
    symbol: str
    causality: str
    unit: str
    start: str
    limits: str
    words: str


@dataclass(frozen=True, slots=True)
class Description:
    """modelDescription.xml of an FMU."""

    root: Element

    @property
    def model(self) -> str:
        return self.root.attrib["modelName"]

    @property
    def about(self) -> dict[str, str]:
        """The attributes of the whole (modelName, license, ...) and its capabilities (canGetAndSetFMUstate, ...)."""
        return {**self.root.attrib, **{k: v for part in self.root.iter("CoSimulation") for k, v in part.attrib.items()}}

    @property
    def variables(self) -> list[Variable]:
        return [_variable(each) for each in self.root.iter("ScalarVariable")]

    @property
    def inputs(self) -> list[str]:
        return [v.name for v in self.variables if v.causality == "input"]


def describe(fmu: Path) -> Description:
    """Read the description out of an FMU."""
    with zipfile.ZipFile(fmu) as archive:
        return Description(fromstring(archive.read("modelDescription.xml")))


def _variable(variable: Element) -> Variable:
    """The row of a ScalarVariable; symbol and words without it come from the table of quantities, where it has it."""
    name, kind = variable.attrib["name"], variable[0]
    known = TABLE.get(name) or TABLE.get(name.partition(".")[2])  # in a container the component's name comes first
    return Variable(
        name=name,
        symbol=known.symbol if known else "",
        causality=variable.get("causality", "local"),
        unit=kind.get("unit", "").replace(".", "·").replace("2", "²"),
        start=_number(kind.get("start", "")),
        limits=_limits(kind, excluded=known is not None and known.positive),
        words=known.text if known else variable.get("description", ""),
    )


def _limits(kind: Element, *, excluded: bool) -> str:
    low, high = _number(kind.get("min", "")), _number(kind.get("max", ""))
    if low and high:
        return f"{low} … {high}"
    if low:
        return f"> {low}" if excluded else f"≥ {low}"
    return f"≤ {high}" if high else ""


def _number(text: str) -> str:
    """A number to six digits; a start value that is not one stays as it is."""
    try:
        return f"{float(text):.6g}".replace("-", "−")
    except ValueError:
        return text
