"""The report of a run: one self-contained page of HTML, made from the files in the run's folder."""

from __future__ import annotations

import base64
import html
import json
import re
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from fmu_src.controller.lqr_controller import LqrController
from fmu_src.quantities import CORNER_WORDS, CORNERS, PARAMETERS, STATES, TYRE_FORCES, Quantity
from fmu_src.road.profiles import HARMONICS
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

from . import run_figures
from .errors import InputError
from .figures import READING, readable
from .files import write_whole
from .findings import Finding
from .ride import BAND, lacking, ride, table
from .trajectory import COUNTERPART, FINDINGS, RECORD, Run, Trajectory, read_run
from .tyres import static_loads, time_below_zero, tyre_loads

REPORT = "report.html"
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
    """How runs ride: a heading for each, and rows of words, unit and one number for each."""

    headings: list[str]
    rows: list[tuple[str, str, list[float]]]


def write_report(run_folder: Path) -> Path:
    """Draw the figures of a run into its folder and write report.html there; returns its path.

    Raises InputError where a file of the run cannot be used.
    """
    run = read_run(run_folder)
    _check_record(run.record, run_folder / RECORD)
    there = run_folder / COUNTERPART
    counterpart = read_run(there) if there.is_dir() else None
    if counterpart:
        _check_record(counterpart.record, there / RECORD)
    findings = read_findings(run_folder / FINDINGS)
    certified = run_figures.certified(run_folder)
    entries = [*run_figures.draw_all(run, counterpart, run_folder), *certified]
    page = _template().render(
        title=run.record["scenario"].get("title") or run.record["scenario"].get("name") or "A run",
        summary=summary(run),
        findings=findings,
        states=[extreme(run.trajectory, q) for q in STATES if q.name in run.trajectory.names],
        tyres=tyre_table(run),
        stop=float(run.trajectory.time[-1]),
        figures=[(entry, _as_data(run_folder / run_figures.FOLDER / entry.file)) for entry in entries],
        left_out=run_figures.left_out(run, counterpart),
        counterpart=counterpart is not None,
        certified=bool(certified),
        rides=ride_columns(run, counterpart),
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
def summary(run: Run) -> str:
    """The scenario in one line: road, speed, times, coupling, control."""
    scenario = run.record["scenario"]
    (v0,) = run.reals("v0")
    times = f"{run.trajectory.time[0]:g} s to {run.trajectory.time[-1]:g} s"
    if isinstance(scenario.get("step"), (int, float)):
        times += f" in steps of {1e3 * scenario['step']:g} ms"
    coupling = f"coupling {scenario.get('coupling', 'not recorded')}"
    return " · ".join((road_words(run), f"{v0:g} m/s", times, coupling, control_words(run)))


def control_words(run: Run) -> str:
    """Whether the controller is on, with which horizon, and from when."""
    if not run_figures.is_controlled(run):
        return "controller off"
    known = run.parameters
    horizon = f"{known.get('horizon', 'unknown')} horizon"
    if known.get("horizon") == "finite":
        horizon += ", T = {:g} s".format(*run.reals("T"))
    begin = "the come-down of the last wheel"
    if known.get("activation") == "at t_on":
        begin = "t = {:g} s".format(*run.reals("t_on"))
    words = [f"{known['design']} design"] if "design" in known else []
    return f"controller on ({', '.join([*words, horizon, *hardware_words(run)])}, from {begin})"


def hardware_words(run: Run) -> list[str]:
    """What stands between the law and the struts, if anything does."""
    known, found = run.parameters, []
    if known.get("actuators") == "semi-active":
        found.append("semi-active")
    if known.get("feedback") == "estimate":
        found.append("from estimates")
    for name, factor, text in (
        ("force_limit", 1.0, "forces up to {:g} N"),
        ("actuator_lag", 1e3, "lag {:g} ms"),
        ("sample_time", 1e3, "samples every {:g} ms"),
    ):
        if known.get(name):
            found.append(text.format(factor * run.reals(name)[0]))
    return found


def ride_columns(run: Run, counterpart: Run | None) -> RideTable | None:
    """The table that compares a run with its counterpart; None without one, or where columns were not recorded."""
    if counterpart is None or lacking(run) or lacking(counterpart):
        return None
    both = [run, counterpart]
    return RideTable([control_words(each) for each in both], table([ride(each) for each in both]))


def road_words(run: Run) -> str:
    """The road in words, and under which wheels it is uneven if not under all."""
    known = run.parameters
    profile = known.get("profile", "not recorded")
    if profile == "flat":
        return "flat road"
    A, Lambda = run.reals("A", "Lambda")
    names = [name for name in HARMONICS if known.get(name)]
    series = zip(names, run.reals(*names), strict=True)
    what = {
        "bump": f"half-sine bump, {1e3 * A:g} mm high and {Lambda / 2:g} m long",
        "sine": f"endless sine road, amplitude {1e3 * A:g} mm, wave length {Lambda:g} m",
        "fourier": f"Fourier series on {Lambda:g} m, " + ", ".join(f"{name} = {1e3 * a:g} mm" for name, a in series),
        "step": f"step of {1e3 * A:g} mm",
    }.get(str(profile), f"road profile {profile}")
    under = [words for corner, words in zip(CORNERS, CORNER_WORDS, strict=True) if known.get(f"excite_{corner}", True)]
    return what if len(under) == len(CORNERS) else f"{what}, under {', '.join(under) or 'no wheel'} only"


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
