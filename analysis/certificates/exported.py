"""A CSV that any tool wrote from our FMUs, made a run of a given car: names, units, gaps and printed digits judged."""

from __future__ import annotations

import csv
import re
from decimal import Decimal
from itertools import chain
from pathlib import Path

import numpy as np

from fmu_src.quantities import STATES, TABLE

from ..errors import InputError
from ..methods.polynomials import Array
from ..scenario import Scenario
from ..trajectory import Run, Trajectory, parsed

GAP = 1.5  # times the median step; more between two rows is a gap
_NAME = re.compile(r"\s*(?:(?:vehicle|road|controller)\.)?(.*?)\s*(?:\[(.*)\])?\s*")


def read_export(path: Path, scenario: Scenario) -> tuple[Run, dict[str, Array]]:
    """The run of the scenario's car and road in this file, and what its columns' digits leave open.

    Raises InputError naming row and column of what cannot be one: gaps, times that do not rise, what is no number,
    columns that are missing or in another unit.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    names = [_name(cell, path) for cell in (rows[0] if rows else [])]
    if missing := [q.name for q in STATES if q.name not in names]:
        raise InputError(f"{path}: row 1: wanted all 14 states, but {', '.join(missing)} are missing")
    trajectory = parsed(chain([names], rows[1:]), path)
    _refuse_gaps(trajectory, path)
    known = [(i, name) for i, name in enumerate(names) if name in TABLE]
    rounding = {name: _rounding([row[i] for row in rows[1:]]) for i, name in known}
    parameters = {"scenario": scenario.parameters}
    record = {"scenario": scenario.as_json(), "parameters": parameters, "fmus": {}}
    return Run(trajectory=trajectory, record=record), rounding


def _name(cell: str, path: Path) -> str:
    """Our name of a column, without the component's name and the unit before and behind it."""
    match = _NAME.fullmatch(cell)
    name, unit = (match[1], match[2]) if match else (cell, None)
    wanted = "s" if name == "time" else TABLE[name].unit if name in TABLE else None
    if unit is not None and wanted is not None and unit != wanted:
        raise InputError(f"{path}: row 1, column {name!r}: wanted the unit {wanted}, got {unit}; convert it first")
    return name


def _refuse_gaps(trajectory: Trajectory, path: Path) -> None:
    steps = np.diff(trajectory.time)
    if not steps.size:
        raise InputError(f"{path}: wanted at least two rows of numbers, got one")
    longest, usual = int(np.argmax(steps)), float(np.median(steps))
    if steps[longest] > GAP * usual:
        raise InputError(
            f"{path}: row {longest + 3}, column 'time': a gap of {steps[longest]:g} s, wanted steps of {usual:g} s"
        )


def _rounding(cells: list[str]) -> Array:
    """Half a unit of the last digit (N,) that a column's format prints, whether it fixes decimals or digits."""
    values = [Decimal(cell.strip()) for cell in cells]
    used = [value.normalize() for value in values if value]
    if not used:
        return np.zeros(len(values))
    digits = max(len(value.as_tuple().digits) for value in used)
    finest = min(value.adjusted() + 1 - len(value.as_tuple().digits) for value in used)
    last = [max(finest, value.adjusted() + 1 - digits) if value else finest for value in values]
    return np.array([0.5 * 10.0**exponent for exponent in last])
