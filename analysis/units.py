"""Units of FMI 2.0 (UnitDefinitions) and SSP 1.0 (Units), and the conversions that a connection needs.

A number x in a unit is factor · x + offset in SI base units, of which the unit has the exponents; rad is one of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit by name; exponents: of BASE, None if they were not given, and the unit is like no other but itself."""

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0

    def to_si(self, x: float) -> float:
        return self.factor * x + self.offset

    def from_si(self, x: float) -> float:
        return (x - self.offset) / self.factor


@dataclass(frozen=True, slots=True)
class Conversion:
    """x -> factor · x + offset."""

    factor: float
    offset: float


SAME = Conversion(1.0, 0.0)


def unit(name: str, base: Mapping[str, Any] | None) -> Unit:
    """The unit with these attributes of a BaseUnit (strings or numbers). Raises ValueError saying what is wrong."""
    if base is None:
        return Unit(name)
    try:
        exponents = tuple(int(base.get(key, 0)) for key in BASE)
        factor, offset = float(base.get("factor", 1.0)), float(base.get("offset", 0.0))
    except ValueError as error:
        raise ValueError(f"unit {name!r}: wanted numbers in its BaseUnit: {error}") from error
    if not (factor and math.isfinite(factor) and math.isfinite(offset)):
        raise ValueError(f"unit {name!r}: wanted a finite factor other than 0 and a finite offset")
    return Unit(name, exponents, factor, offset)


def conversion(start: Unit, end: Unit) -> Conversion | None:
    """What takes numbers in one unit to the other; None if nothing can."""
    if start == end:
        return SAME
    if start.exponents is None or start.exponents != end.exponents:
        return None
    return Conversion(start.factor / end.factor, (start.offset - end.offset) / end.factor)
