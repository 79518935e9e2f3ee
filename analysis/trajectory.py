"""A run on disk: trajectory.csv (time and variables, repr floats) and run.json (all that repeats it)."""

from __future__ import annotations

import contextlib
import csv
import json
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

Array = NDArray[np.float64]
CSV, RECORD, FINDINGS, COUNTERPART = "trajectory.csv", "run.json", "findings.json", "counterpart"


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """Sampled variables of a run: time (n,) [s]; values (n, m) in SI units; names (m) as in the FMUs."""

    time: Array
    names: tuple[str, ...]
    values: Array

    def __getitem__(self, name: str) -> Array:
        """The column (n,) of one variable. Raises InputError for a name that was not recorded."""
        if name not in self.names:
            raise InputError(f"variable {name!r} is not in the trajectory; recorded are: {', '.join(self.names)}")
        return self.values[:, self.names.index(name)]

    def columns(self, names: tuple[str, ...] | list[str]) -> Array:
        """Several columns, (n, len(names))."""
        return np.column_stack([self[name] for name in names])


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A trajectory with its record: scenario, every parameter, FMU hashes, versions, step, method."""

    trajectory: Trajectory
    record: dict[str, Any]

    @property
    def parameters(self) -> dict[str, float | str | bool]:
        """Every parameter of every component by name (components that share a name share the value)."""
        return {name: value for values in self.record["parameters"].values() for name, value in values.items()}

    def reals(self, *names: str) -> list[float]:
        """Real parameters by name, SI units. Raises InputError naming those that the record lacks."""
        known = self.parameters
        lacking = [name for name in names if not isinstance(known.get(name), int | float)]
        if lacking:
            raise InputError(f"{RECORD}: parameters: wanted a number for {', '.join(lacking)}, got none")
        return [float(known[name]) for name in names]


def write_csv(trajectory: Trajectory, path: Path) -> None:
    """Write time and variables; every double is written so that reading gives the same bits."""
    header = ",".join(("time", *trajectory.names))
    table = np.column_stack([trajectory.time, trajectory.values]).tolist()
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(header + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in table)


def read_csv(path: Path) -> Trajectory:
    """Read a trajectory. Raises InputError naming row and column of what cannot be a trajectory."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    if not rows or rows[0][:1] != ["time"]:
        raise InputError(
            f"{path}: row 1: wanted a header that begins with 'time', got {rows[0][:3] if rows else 'nothing'}"
        )
    names = tuple(rows[0][1:])
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{path}: row 1: column {twice!r} stands there twice")
    if len(rows) < 2:
        raise InputError(f"{path}: wanted at least one row of numbers below the header, got none")
    table = np.array([_numbers(row, number, rows[0], path) for number, row in enumerate(rows[1:], start=2)])
    late = np.flatnonzero(np.diff(table[:, 0]) <= 0)
    if late.size:
        row, t = int(late[0]) + 3, table[late[0] + 1, 0]
        raise InputError(f"{path}: row {row}, column 'time': wanted more than {table[late[0], 0]!r} s, got {t!r} s")
    return Trajectory(time=table[:, 0].copy(), names=names, values=table[:, 1:].copy())


def _numbers(row: list[str], number: int, header: list[str], path: Path) -> list[float]:
    if len(row) != len(header):
        raise InputError(f"{path}: row {number}: wanted {len(header)} columns as in the header, got {len(row)}")
    numbers = []
    for name, text in zip(header, row, strict=True):
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise InputError(f"{path}: row {number}, column {name!r}: wanted a finite number, got {text!r}")
        numbers.append(value)
    return numbers


def write_run(run: Run, folder: Path) -> None:
    """Write trajectory.csv and run.json into an existing folder."""
    write_csv(run.trajectory, folder / CSV)
    (folder / RECORD).write_text(json.dumps(run.record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def read_record(path: Path) -> dict[str, Any]:
    """Read a run.json. Raises InputError where it is not one."""
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as the record of a run: {error}") from error
    missing = {"scenario", "parameters", "fmus"} - set(record if isinstance(record, dict) else ())
    if missing:
        raise InputError(f"{path}: wanted the record of a run, but {', '.join(sorted(missing))} is missing")
    return record


def read_run(folder: Path) -> Run:
    """Read a run folder back, bit for bit."""
    if not folder.is_dir():
        raise InputError(f"{folder}: wanted a run folder (with {RECORD} and {CSV}), got no folder there")
    return Run(trajectory=read_csv(folder / CSV), record=read_record(folder / RECORD))


@contextlib.contextmanager
def new_run_folder(target: Path) -> Iterator[Path]:
    """A folder to fill, which takes the place of `target` when all went well and vanishes when not.

    An older run at `target` is replaced; a folder that is not a run is refused with InputError.
    """
    if target.exists() and not (target.is_dir() and ((target / RECORD).is_file() or not any(target.iterdir()))):
        raise InputError(f"{target}: is there already and is not a run folder (no {RECORD} in it); it is left alone")
    target.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    try:
        yield part
        part.chmod(0o755)
        if target.exists():
            shutil.rmtree(target)
        part.rename(target)
    finally:
        shutil.rmtree(part, ignore_errors=True)
