"""A run on disk: trajectory.csv (time and variables, repr floats) and run.json (all that repeats it)."""

from __future__ import annotations

import contextlib
import csv
import json
import math
import shutil
import sys
import tempfile
from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_src.quantities import PARAMETERS

from .errors import InputError

Array = NDArray[np.float64]
CSV, RECORD, FINDINGS, CERTIFICATE = "trajectory.csv", "run.json", "findings.json", "certificate.json"
COUNTERPART, OTHER_DESIGN = "counterpart", "other-design"  # folders of the runs beside a run, see `beside.py`
REPORT, FIGURES, MODAL_ENERGIES = "report.html", "figures", "modal-energies.csv"
OF_A_RUN = {CSV, RECORD, FINDINGS, CERTIFICATE, COUNTERPART, OTHER_DESIGN, REPORT, FIGURES, MODAL_ENERGIES}


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
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(("time", *trajectory.names))
        for t, row in zip(trajectory.time.tolist(), trajectory.values, strict=True):
            file.write(",".join(map(repr, [t, *row.tolist()])) + "\n")


def read_csv(path: Path) -> Trajectory:
    """Read a trajectory. Raises InputError naming row and column of what cannot be a trajectory."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return parsed(csv.reader(file), path)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from error


def parsed(rows: Iterator[list[str]], path: Path) -> Trajectory:
    """A trajectory from the cells of its rows, header first. Raises InputError as `read_csv` does."""
    header = next(rows, [])
    if header[:1] != ["time"]:
        raise InputError(f"{path}: row 1: wanted a header that begins with 'time', got {header[:3] or 'nothing'}")
    if twice := next((name for name, times in Counter(header).items() if times > 1), None):
        raise InputError(f"{path}: row 1: column {twice!r} stands there twice")
    cells = array("d")
    for number, row in enumerate(rows, start=2):
        cells.extend(_numbers(row, number, header, path))
    table = np.array(cells).reshape(-1, len(header))
    if not len(table):
        raise InputError(f"{path}: wanted at least one row of numbers below the header, got none")
    time = table[:, 0]
    late = np.flatnonzero(time[1:] <= time[:-1])
    if late.size:
        before, t = time[late[0] : late[0] + 2].tolist()
        raise InputError(f"{path}: row {late[0] + 3}, column 'time': wanted more than {before!r} s, got {t!r} s")
    return Trajectory(time=time.copy(), names=tuple(header[1:]), values=table[:, 1:].copy())


def _numbers(row: list[str], number: int, header: list[str], path: Path) -> list[float]:
    if len(row) != len(header):
        raise InputError(f"{path}: row {number}: wanted {len(header)} columns as in the header, got {len(row)}")
    numbers = []
    for name, text in zip(header, row, strict=True):
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not math.isfinite(value):
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
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read as the record of a run: {error}") from error
    missing = {"scenario", "parameters", "fmus"} - set(record if isinstance(record, dict) else ())
    if missing:
        raise InputError(f"{path}: wanted the record of a run, but {', '.join(sorted(missing))} is missing")
    tables = {key: record[key] for key in ("scenario", "parameters", "fmus")}
    for section in ("parameters", "fmus"):
        if isinstance(record[section], dict):
            tables |= {f"{section}: {name}": table for name, table in record[section].items()}
    if fault := next(
        (f"{key}: wanted an object, got {t!r:.60}" for key, t in tables.items() if type(t) is not dict), ""
    ):
        raise InputError(f"{path}: {fault}")
    _check_parameters(record["parameters"], path)
    return record


def _check_parameters(parameters: dict[str, dict[str, Any]], path: Path) -> None:
    """Numbers where numbers belong, and one value for one name: what `Run.parameters` takes for granted."""
    found: dict[str, Any] = {}
    for component, values in parameters.items():
        for name, value in values.items():
            where = f"{path}: parameters: {component}: {name} = {value!r:.60}"
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if name in PARAMETERS and not (number and abs(value) <= sys.float_info.max):
                raise InputError(f"{where}: wanted a finite number")
            if found.setdefault(name, value) != value:
                raise InputError(f"{where}: wanted {found[name]!r:.60}, as in another component")


def read_run(folder: Path) -> Run:
    """Read a run folder back, bit for bit."""
    if not folder.is_dir():
        raise InputError(f"{folder}: wanted a run folder (with {RECORD} and {CSV}), got no folder there")
    if not any((folder / name).exists() for name in (RECORD, CSV)):
        raise InputError(f"{folder}: wanted a run folder (with {RECORD} and {CSV}), got a folder with neither")
    return Run(trajectory=read_csv(folder / CSV), record=read_record(folder / RECORD))


@contextlib.contextmanager
def new_run_folder(target: Path) -> Iterator[Path]:
    """A folder to fill, which takes the place of `target` when all went well and vanishes when not.

    An older run at `target` is replaced; a folder that is not a run is refused with InputError.
    """
    with contextlib.ExitStack() as stack:
        try:
            place = target.resolve()
            if place.exists():
                _refuse_others(place, target)
            for folder in reversed(place.parents):  # the innermost is removed first
                if not folder.exists():
                    stack.callback(_remove_if_empty, folder)
            place.parent.mkdir(parents=True, exist_ok=True)
            part = Path(tempfile.mkdtemp(prefix=f".{place.name[:40]}-", dir=place.parent))
            stack.callback(shutil.rmtree, part, ignore_errors=True)
            new, older = part / "new" / place.name, part / "older"
            new.mkdir(parents=True)
        except (OSError, RuntimeError) as error:  # RuntimeError: a loop of links
            raise InputError(f"{target}: no run can be written there: {error}") from error
        yield new
        try:
            if place.exists():
                place.rename(older)
            new.rename(place)
        except OSError as error:
            raise InputError(f"{target}: the run cannot be put there: {error}") from error
        finally:
            if older.exists() and not place.exists():
                older.rename(place)


def _refuse_others(folder: Path, target: Path) -> None:
    """Raise InputError unless the folder is empty or holds a run and nothing else at its top."""
    held = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else [""]
    if not held:
        return
    try:
        read_record(folder / RECORD)
    except InputError as error:
        raise InputError(f"{target}: is there already and is not a run folder; it is left alone") from error
    if foreign := sorted(set(held) - OF_A_RUN):
        raise InputError(f"{target}: holds {', '.join(foreign)}, not of a run; it is left alone: move that first")


def _remove_if_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):
        folder.rmdir()
