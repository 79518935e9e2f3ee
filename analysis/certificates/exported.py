"""A CSV that any tool wrote from our FMUs, made a run of a given car: names, units, gaps and printed digits judged.

Headers are understood as fmpy (`vehicle.body.heave`, `body.heave`), libcosim (`Time`, everything of one FMU) and Ecos
(`time` second, `vehicle::body.heave[REAL]`, everything of all FMUs) write them, or with a unit in brackets.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import fields
from decimal import Decimal
from itertools import chain, pairwise
from pathlib import Path

import numpy as np

from fmu_src.quantities import (
    ACCELERATIONS,
    FORCES,
    PARAMETERS,
    ROAD,
    ROAD_HEIGHTS,
    STATES,
    STRUT_TRAVELS,
    TABLE,
    TYRE_FORCES,
)
from fmu_src.road.profiles import HARMONICS, PROFILE
from fmu_src.vehicle.parameters import Car

from ..errors import InputError
from ..methods.polynomials import Array
from ..scenario import Scenario
from ..trajectory import Run, Trajectory, parsed

SAMPLING, BY_DEFAULT = "road_sampling", "start"  # as the FMU has it, and with it most masters
GAP = 1.5  # times the median step; more between two rows is a gap
PRINTED = (5e-6, 5e-7)  # relative and absolute: six digits or six decimals of a parameter, fewer than any tool prints
LOGGED = "StepCount"  # a column of every log of libcosim's, which holds all variables of one FMU, also its inputs
TYPES = ("REAL", "INT", "BOOL", "STR")  # that Ecos prints where others print units
_NAME = re.compile(
    r"\s*(?:(?P<owner>vehicle|road|controller|vehicle7dof|roadexcitation|lqrcontroller)(?:\.|::))?"
    r"(?P<name>.*?)\s*(?:\[(?P<unit>.*)\])?\s*"
)
_CAR = {f.name for f in fields(Car)}
_PROFILE = {"A", "Lambda", "v0", "tau0", "t_start", *HARMONICS}  # its a and b are the car's
_TEXTS = {"profile": "road", SAMPLING: "vehicle"}
_OWNED = {
    "vehicle": {q.name for q in (*STATES, *ACCELERATIONS, *STRUT_TRAVELS, *TYRE_FORCES)} | _CAR,
    "road": {q.name for q in ROAD} | _PROFILE,
    "controller": {q.name for q in FORCES},
}


def read_export(path: Path, scenario: Scenario) -> tuple[Run, dict[str, Array]]:
    """The run of the scenario's car and road in this file, and what its columns' digits leave open.

    The road within steps is the file's, where it has a column `road_sampling`, and else the scenario's.
    Raises InputError naming row and column of what cannot be one: gaps, times that do not rise, what is no number,
    columns that are missing or in another unit, parameters other than the scenario's.
    """
    rows, header, names = _table(path)
    if LOGGED in header:  # the car's log, in which the road is what was passed on a step ago
        names = ["" if name in {q.name for q in ROAD} else name for name in names]
    if missing := [name for name in ("time", *(q.name for q in STATES)) if name not in names]:
        raise InputError(f"{path}: row 1: wanted time and all 14 states, but {', '.join(missing)} are missing")
    where = [names.index("time"), *(i for i, name in enumerate(names) if name and name != "time")]
    names, cells = [names[i] for i in where], list(_picked(rows, where, path))
    trajectory = parsed(chain([names], cells), path)
    _refuse_gaps(trajectory, path)
    _refuse_another(trajectory, scenario, path)
    rounding = {name: _rounding([row[i] for row in cells]) for i, name in enumerate(names) if name != "time"}
    rounding["time"] = _late([row[0] for row in cells])
    own = _texts(rows)
    if own.get("profile", profile := scenario.parameters.get("profile", PROFILE.start)) != profile:
        raise InputError(f"{path}: row 2, column 'profile': wanted {profile!r}, got {own['profile']!r}")
    defaults = {name: PARAMETERS[name].start for name in _CAR | _PROFILE}
    parameters = {"scenario": {**defaults, **scenario.parameters, **own}}
    record = {"scenario": scenario.as_json(), "parameters": parameters, "fmus": {}}
    return Run(trajectory=trajectory, record=record), rounding


def read_heights(path: Path) -> tuple[Array, Array]:
    """Times (N,) [s] and heights (N, 4) [m] under the wheels of a road's or a run's CSV.

    Raises InputError naming row and column of what cannot be one, unless it begins at t = 0, and for a log of the car,
    in which the road is what was passed on a step ago.
    """
    rows, header, names = _table(path)
    wanted = ["time", *(q.name for q in ROAD_HEIGHTS)]
    if LOGGED in header and STATES[0].name in names:
        raise InputError(
            f"{path}: row 1: a log of the car, whose heights are of the step before; wanted the road's own"
        )
    if missing := [name for name in wanted if name not in names]:
        raise InputError(f"{path}: row 1: wanted {', '.join(wanted)}, but {', '.join(missing)} are missing")
    cells = _picked(rows, [names.index(name) for name in wanted], path)
    trajectory = parsed(chain([wanted], cells), path)
    if trajectory.time[0] != 0.0 or len(trajectory.time) < 2:
        raise InputError(
            f"{path}: row 2, column 'time': wanted 0 s, where the car rests, and further rows, got "
            f"{trajectory.time[0]:g} s and {len(trajectory.time)} in all"
        )
    return trajectory.time, trajectory.columns(wanted[1:])


def _table(path: Path) -> tuple[list[list[str]], list[str], list[str]]:
    """All rows, the header, and what its cells are called here."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    header = rows[0] if rows else []
    return rows, header, [_name(cell, path) for cell in header]


def _name(cell: str, path: Path) -> str:
    """Our name of a column, without component and unit; "" for what is not ours, or an input's copy of an output."""
    match = _NAME.fullmatch(cell)
    owner, name, unit = match.group("owner", "name", "unit") if match else (None, cell, None)
    if name.lower() == "time" and owner is None:
        name = "time"
    elif name not in TABLE or not any(name in owned for by, owned in _OWNED.items() if by in (owner or by)):
        return ""  # "controller" is in "lqrcontroller"
    wanted = "s" if name == "time" else TABLE[name].unit
    if unit is not None and unit not in (wanted, *TYPES):
        raise InputError(f"{path}: row 1, column {name!r}: wanted the unit {wanted}, got {unit}; convert it first")
    return name


def _texts(rows: list[list[str]]) -> dict[str, str]:
    """Profile and sampling of the road, if the file names them."""
    found = {}
    for cell, value in zip(rows[0], rows[1], strict=True):
        owner, name = _NAME.fullmatch(cell).group("owner", "name")  # type: ignore[union-attr]
        if name in _TEXTS and (owner or _TEXTS[name]).startswith(_TEXTS[name]):
            found[name] = value.strip()
    return found


def _picked(rows: list[list[str]], where: Sequence[int], path: Path) -> Iterator[list[str]]:
    """The cells of our columns of all rows below the header."""
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(rows[0]):
            wanted = f"wanted {len(rows[0])} columns as in the header, got {len(row)}"
            raise InputError(f"{path}: row {number}: {wanted}")
        yield [row[i] for i in where]


def _refuse_another(trajectory: Trajectory, scenario: Scenario, path: Path) -> None:
    """Refuse a file that itself says that its car or road is not the scenario's."""
    relative, absolute = PRINTED
    for name in sorted((_CAR | _PROFILE) & set(trajectory.names)):
        wanted = float(scenario.parameters.get(name, PARAMETERS[name].start))
        for number, got in enumerate(trajectory[name].tolist(), start=2):
            if not math.isclose(got, wanted, rel_tol=relative, abs_tol=absolute):
                raise InputError(
                    f"{path}: row {number}, column {name!r}: wanted {wanted!r}, as the car and road of "
                    f"{scenario.name} have it, got {got!r}; give those of the file with --parameters"
                )


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


def _late(cells: list[str]) -> Array:
    """The same (N,) of times [s], but none where they rise by one exact step, which only the last may cut short."""
    steps = [b - a for a, b in pairwise(Decimal(cell.strip()) for cell in cells)]
    return np.zeros(len(cells)) if len(set(steps[:-1])) <= 1 else _rounding(cells)
