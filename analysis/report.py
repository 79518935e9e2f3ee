"""The report of a run: one self-contained page of HTML, made from the files in the run's folder."""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from fmu_src.controller.lqr_controller import LqrController
from fmu_src.quantities import CORNER_WORDS, PARAMETERS, STATES, TYRE_FORCES, Quantity
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

from . import run_figures
from .errors import InputError
from .figures import READING, readable
from .files import write_whole
from .findings import Finding
from .ride import BAND, lacking, ride, table
from .run_figures import is_controlled
from .run_words import control_words, summary
from .trajectory import COUNTERPART, FIGURES, FINDINGS, OTHER_DESIGN, RECORD, REPORT, Run, Trajectory, read_run
from .tyres import static_loads, time_below_zero, tyre_loads

TEMPLATE = "report.html"
WORDS = {
    name: text
    for component in (RoadExcitation, Vehicle7DOF, LqrController)
    for name, text in [*component.switches.items(), *((choice.name, choice.text) for choice in component.choices)]
}
GREEK = {"psi": "ψ", "varphi": "φ", "Lambda": "Λ", "lambda": "λ", "tau": "τ", "Delta": "Δ", "beta": "β", "sigma": "σ"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Extreme:
    """A state's largest absolute value, when it is reached [s], and the value at the end, in the unit given."""

    quantity: Quantity
    unit: str
    largest: float
    time: float
    end: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TyreLoad:
    """A tyre's static and smallest total load [N], when that is reached [s], and how long [s] contact is lost."""

    words: str
    static: float
    smallest: float
    time: float
    lost: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A row of the table of all parameters; the symbol is HTML."""

    component: str
    name: str
    symbol: str
    value: str
    unit: str
    text: str


@dataclass(frozen=True, slots=True)
class RideTable:
    """How runs ride: for each a heading and its control in words, and rows of words, unit and one number for each."""

    headings: list[str]
    controls: list[str]
    rows: list[tuple[str, str, list[float]]]


def write_report(run_folder: Path) -> Path:
    """Draw the figures of a run into its folder and write report.html there; returns its path.

    Raises InputError where a file of the run cannot be used.
    """
    run = read_run(run_folder)
    _check_record(run.record, run_folder / RECORD)
    others = {name: read_run(run_folder / name) for name in (COUNTERPART, OTHER_DESIGN) if (run_folder / name).is_dir()}
    for name, other in others.items():
        _check_record(other.record, run_folder / name / RECORD)
    counterpart = others.get(COUNTERPART)
    findings = read_findings(run_folder / FINDINGS)
    certified = run_figures.certified(run_folder)
    drawn = run_figures.draw_all(run, counterpart, run_folder, others.get(OTHER_DESIGN))
    entries = [*drawn, *run_figures.energies(run_folder), *certified]
    page = _template().render(
        title=run.record["scenario"].get("title") or run.record["scenario"].get("name") or "A run",
        summary=summary(run),
        findings=findings,
        states=[extreme(run.trajectory, q) for q in STATES if q.name in run.trajectory.names],
        tyres=tyre_table(run),
        stop=float(run.trajectory.time[-1]),
        figures=[(entry, _as_data(run_folder / FIGURES / entry.file)) for entry in entries],
        left_out=run_figures.left_out(run, counterpart),
        counterpart=counterpart is not None,
        certified=bool(certified),
        rides=ride_table(run, others.values()),
        parameters=parameter_table(run),
        band=BAND,
        fmus=run.record["fmus"],
        versions=run.record.get("versions", {}),
    )
    target = run_folder / REPORT
    write_whole(target, page.encode())
    return target


def _template() -> Any:
    loader = FileSystemLoader(Path(__file__).resolve().parent)
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(number=readable, symbol=symbol_html, unit=unit_text)
    return environment.get_template(TEMPLATE)


def _check_record(record: dict[str, Any], path: Path) -> None:
    for key in ("scenario", "parameters", "fmus"):
        if not isinstance(record[key], dict):
            raise InputError(f"{path}: {key}: wanted an object, got {record[key]!r:.60}")
    for key in ("parameters", "fmus"):
        for component, values in record[key].items():
            if not isinstance(values, dict):
                raise InputError(f"{path}: {key}: {component}: wanted an object, got {values!r:.60}")


def read_findings(path: Path) -> list[Finding] | None:
    """The findings in this file; None if there is no such file. Raises InputError for what is not a finding."""
    if not path.is_file():
        return None
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as findings: {error}") from error
    if not isinstance(entries, list):
        raise InputError(f"{path}: wanted a list of findings, got {entries!r:.60}")
    return [_finding(entry, f"{path}: finding {number}") for number, entry in enumerate(entries, start=1)]


def _finding(entry: Any, where: str) -> Finding:
    """A finding from its JSON; the verdict follows from the numbers again, not from the file."""
    if not isinstance(entry, dict):
        raise InputError(f"{where}: wanted an object, got {entry!r:.60}")
    for field in fields(Finding):
        kind = (int, float) if field.type == "float" else str
        if not isinstance(entry.get(field.name), kind):
            wanted = "a number" if field.type == "float" else "a text"
            raise InputError(f"{where}: {field.name}: wanted {wanted}, got {entry.get(field.name)!r:.60}")
    return Finding(**{field.name: entry[field.name] for field in fields(Finding)})


def _as_data(path: Path) -> str:
    """A figure as a data address: as an image of its own, its ids cannot meet those of another."""
    return "data:image/svg+xml;base64," + base64.b64encode(path.read_bytes()).decode()


# ------------------------------------------------------------------ what the page says
def ride_table(run: Run, others: Iterable[Run]) -> RideTable | None:
    """The table that compares a run with those beside it, the passive car first; None without any, or where columns
    were not recorded."""
    runs = sorted([run, *others], key=lambda each: (is_controlled(each), each.parameters.get("design") == "full-car"))
    if len(runs) < 2 or any(lacking(each) for each in runs):
        return None
    headings = [_heading(each) + (" (this run)" if each is run else "") for each in runs]
    return RideTable(headings, [control_words(each) for each in runs], table([ride(each) for each in runs]))


def _heading(run: Run) -> str:
    if not is_controlled(run):
        return "No control"
    return f"{run.parameters.get('design', 'unknown')} design".capitalize()


def extreme(trajectory: Trajectory, q: Quantity) -> Extreme:
    """What there is to say of one state, in the unit in which it is read."""
    unit, factor = READING[q.unit]
    values = factor * trajectory[q.name]
    row = int(np.argmax(np.abs(values)))
    at = float(trajectory.time[row])
    return Extreme(quantity=q, unit=unit, largest=float(values[row]), time=at, end=float(values[-1]))


def tyre_table(run: Run) -> list[TyreLoad]:
    """One row for each tyre; none if a tyre force was not recorded."""
    if not {q.name for q in TYRE_FORCES} <= set(run.trajectory.names):
        return []
    time, table = run.trajectory.time, []
    for words, static, load in zip(CORNER_WORDS, static_loads(run), tyre_loads(run).T, strict=True):
        row = int(np.argmin(load))
        lost = time_below_zero(time, load)
        table.append(TyreLoad(words=words, static=static, smallest=load[row], time=time[row], lost=lost))
    return table


def parameter_table(run: Run) -> list[Parameter]:
    """Every parameter of every component, as recorded."""
    table = []
    for component, values in run.record["parameters"].items():
        for name, value in values.items():
            q = PARAMETERS.get(name)
            table.append(
                Parameter(
                    component=component,
                    name=name,
                    symbol=symbol_html(q.symbol) if q else "",
                    value=exact(value),
                    unit=unit_text(q.unit) if q else "",
                    text=q.text if q else WORDS.get(name, ""),
                )
            )
    return table


# ------------------------------------------------------------------ how it is written
def exact(value: float | str | bool) -> str:
    """A parameter's value such that reading it gives the same bits."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (int, float)):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return str(value)


def symbol_html(latex: str) -> str:
    r"""HTML of the LaTeX of a symbol in the table: Greek letters, \dot and \ddot on one letter, indices."""
    text = re.sub(r"\\([A-Za-z]+)", lambda m: GREEK.get(m[1], m[0]), html.escape(latex))
    text = re.sub(r"\\(d+)ot\{(\w)\}", lambda m: m[2] + {"d": "\u0307", "dd": "\u0308"}[m[1]], text)
    text = re.sub(r"_(\w)", r"<sub>\1</sub>", text)
    text = re.sub(r"_\{(.*)\}", r"<sub>\1</sub>", text)
    return f"<var>{text}</var>"


def unit_text(unit: str) -> str:
    """A unit as it is read: N.s/m -> N·s/m, m/s2 -> m/s²."""
    return unit.replace(".", "·").replace("2", "²")
