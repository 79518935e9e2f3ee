"""Scenarios: what to simulate, read from TOML (or from the run.json of an earlier run) and checked in full.

    title = "…"
    [simulation]   start_time, stop_time, step [s]; coupling = "gauss-seidel" | "jacobi"; record = ["body.heave", …]
    [parameters]   any parameter of the FMUs; each goes to every FMU that has it
    [start]        start values of the car's states, "body.heave" = 0.01, …

A real value is a number in SI units, or a string with its unit: "36 km/h", "20 ms", "1 deg".
"""

from __future__ import annotations

import contextlib
import math
import re
import reprlib
import tomllib
from collections.abc import Collection
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fmu_src.controller.law import SNAP, control_parameters
from fmu_src.controller.lqr_controller import LqrController
from fmu_src.quantities import PARAMETERS, STATES, Choice, ParameterError, Quantity
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

from .errors import InputError
from .trajectory import RECORD, read_record

BUILT_IN = Path(__file__).resolve().parents[1] / "fmu_src" / "system" / "scenarios"
MAX_STEPS = 10_000_000  # of a run; more is a mistyped step rather than a wish
TIMES_PER_STEP = 1000  # that doubles must tell apart, for communication points that are evenly spaced

_COMPONENTS = (RoadExcitation, Vehicle7DOF, LqrController)
_REALS = {name: PARAMETERS[name] for c in _COMPONENTS for name in c.reals}
_CHOICES = {choice.name: choice for c in _COMPONENTS for choice in c.choices}
_SWITCHES = {name for c in _COMPONENTS for name in c.switches}
_START = {q.name: q for q in STATES}
_COUPLING = Choice(name="coupling", values=("gauss-seidel", "jacobi"), text="order of exchange between the FMUs")
_TIMES = {
    "start_time": Quantity(name="start_time", unit="s", symbol="t_0", text="start of the simulation"),
    "stop_time": Quantity(name="stop_time", unit="s", symbol="t_1", text="end of the simulation", start=5.0),
    "step": Quantity(name="step", unit="s", symbol="H", text="communication step", start=1e-3, positive=True),
}
_KEYS: dict[str, Collection[str]] = {
    "": ("title", "simulation", "parameters", "start"),
    "simulation": (*_TIMES, "coupling", "record"),
    "parameters": (*_REALS, *_CHOICES, *_SWITCHES),
    "start": _START,
}
# A number and a product of powers of units. Pint reads whole expressions: it would compute 9**9**9, and passes over
# what it cannot read.
_POWER = r"[a-zA-Zµμ°_]+(?:\d{1,2}|(?:\^|\*\*)-?\d{1,2}|[²³])?"
_WITH_UNIT = re.compile(
    rf" *([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?) *({_POWER}(?: *[*/.·] *{_POWER}| +{_POWER})*) *", re.ASCII
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A simulation to run; SI units. `record` empty: all outputs of all components."""

    name: str
    title: str = ""
    start_time: float = 0.0
    stop_time: float = 5.0
    step: float = 1e-3
    coupling: str = "gauss-seidel"
    record: tuple[str, ...] = ()
    parameters: dict[str, float | str | bool] = field(default_factory=dict)
    start: dict[str, float] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def built_in_scenarios() -> list[str]:
    """Names of the scenarios that come with the project."""
    return sorted(path.stem for path in BUILT_IN.glob("*.toml"))


def names_a_folder(name_or_path: str) -> bool:
    """Whether this names a folder, as of a run; a built-in scenario's name is that scenario's: write ./NAME."""
    return name_or_path not in built_in_scenarios() and Path(name_or_path).is_dir()


def read_scenario(name_or_path: str) -> Scenario:
    """A built-in scenario by name, a .toml file, or the run.json of an earlier run.

    Raises InputError with all faults, each with file, line, what was wanted and what was got.
    """
    path = BUILT_IN / f"{name_or_path}.toml"
    if name_or_path not in built_in_scenarios():
        path = Path(name_or_path)
    if path.suffix == ".json":
        return _checked(read_record(path)["scenario"], path, "", flat=True)
    try:
        text = path.read_text(encoding="utf-8")
    except IsADirectoryError:
        inside = f"; {path / RECORD} is one" if (path / RECORD).is_file() else ""
        raise InputError(f"{path}: wanted a scenario, got a folder{inside}") from None
    except FileNotFoundError:
        known = ", ".join(built_in_scenarios())
        raise InputError(f"{name_or_path}: no such file, and no built-in scenario; known are: {known}") from None
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, or a path with a null character
        raise InputError(f"{path}: cannot be read: {error}") from error
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: also an integer of thousands of digits
        raise InputError(f"{path}: not TOML: {error}") from error
    return _checked(data, path, text, flat=False)


def _checked(data: Any, path: Path, text: str, *, flat: bool) -> Scenario:
    """A Scenario from plain data; `flat`: the layout of run.json, where the simulation's keys stand at the top."""
    check = _Check(path, text)
    check.keys("", data, ("name", "title", *_KEYS["simulation"], "parameters", "start") if flat else _KEYS[""])
    sections = {key: check.table(data, key) for key in ("simulation", "parameters", "start")}
    if flat:
        sections["simulation"] = {key: data[key] for key in _KEYS["simulation"] if key in data}
    for section, table in sections.items():
        check.keys(section, table, _KEYS[section])
    simulation = sections["simulation"]
    times = {key: check.real("simulation", q, simulation.get(key, q.start)) for key, q in _TIMES.items()}
    parameters = {key: check.parameter(key, value) for key, value in sections["parameters"].items()}
    coupling = check.choice("simulation", _COUPLING, simulation.get("coupling", _COUPLING.start))
    sampling = {"gauss-seidel": "end", "jacobi": "start"}[coupling]  # the road is stepped before the car, or with it
    if parameters.setdefault("road_sampling", sampling) != sampling:
        got = parameters["road_sampling"]
        check.fault(
            "parameters", "road_sampling", f"road_sampling = {got!r}: coupling = {coupling!r} wants {sampling!r}"
        )
    scenario = Scenario(
        name=check.name(data.get("name", path.resolve().parent.name)) if flat else path.stem,
        title=check.string("", "title", data.get("title", path.stem)),
        coupling=coupling,
        record=check.record(simulation.get("record", [])),
        parameters=parameters,
        start={key: check.real("start", _START[key], v) for key, v in sections["start"].items() if key in _START},
        **times,
    )
    check.span(scenario)
    check.control(scenario)
    check.conclude()
    return scenario


class _Check:
    """Collects the faults of one file, each with its line."""

    def __init__(self, path: Path, text: str) -> None:
        self.path, self.lines, self.faults = path, text.split("\n"), list[str]()

    def fault(self, section: str, key: str, what: str) -> None:
        line = _line_of(self.lines, section, key)
        self.faults.append(f"{self.path}{f':{line}' if line else ''}: {what}")

    def conclude(self) -> None:
        if self.faults:
            raise InputError("\n".join(self.faults))

    def table(self, data: Any, key: str) -> dict[str, Any]:
        value = data.get(key, {})
        if not isinstance(value, dict):
            self.fault("", key, f"{key}: wanted a table [{key}], got {_shown(value)}")
            return {}
        return value

    def keys(self, section: str, table: dict[str, Any], known: Collection[str]) -> None:
        for key in table:
            if key not in known:
                where = f"in [{section}]" if section else "at the top level"
                dotted = next((name for name in known if name.startswith(f"{key}.")), None)
                hint = f" (write {dotted!r} in quotes)" if dotted else ""
                self.fault(section, key, f"unknown key {key!r} {where}{hint}; known are: {', '.join(known)}")

    def name(self, value: Any) -> str:
        """A run's name, which is also the name of a folder."""
        if not isinstance(value, str) or value in ("", "..") or value != Path(value).name or not value.isprintable():
            self.fault("", "name", f"name = {_shown(value)}: wanted the name of a file or folder")
        return str(value)

    def string(self, section: str, key: str, value: Any) -> str:
        if not isinstance(value, str):
            self.fault(section, key, f"{key} = {_shown(value)}: wanted a string")
            return ""
        return value

    def choice(self, section: str, choice: Choice, value: Any) -> str:
        if fault := choice.fault(value if isinstance(value, str) else _shown(value)):
            self.fault(section, choice.name, fault)
            return choice.start
        return str(value)

    def real(self, section: str, q: Quantity, value: Any) -> float:
        try:
            number = _in_si(value, q.unit)
        except ValueError as error:
            wanted = (
                f"in {q.unit} (a number, or a string like '{q.start:g} {q.unit}')" if q.unit != "1" else "(a number)"
            )
            self.fault(section, q.name, f"{q.name} = {_shown(value)}: wanted {q.text} {wanted}, {error}")
            return math.nan
        if fault := q.fault(number):
            self.fault(section, q.name, fault)
        return number

    def parameter(self, key: str, value: Any) -> float | str | bool:
        if key in _REALS:
            return self.real("parameters", _REALS[key], value)
        if key in _CHOICES:
            return self.choice("parameters", _CHOICES[key], value)
        if key in _SWITCHES and not isinstance(value, bool):
            self.fault("parameters", key, f"{key} = {_shown(value)}: wanted true or false")
        return bool(value)

    def record(self, value: Any) -> tuple[str, ...]:
        if not (isinstance(value, list | tuple) and all(isinstance(name, str) for name in value)):
            self.fault("simulation", "record", f"record = {_shown(value)}: wanted a list of variable names")
            return ()
        for name in dict.fromkeys(name for name in value if value.count(name) > 1):
            self.fault("simulation", "record", f"record: {name!r} stands there {value.count(name)} times: wanted once")
        return tuple(value)

    def span(self, s: Scenario) -> None:
        if any(q.fault(getattr(s, key)) for key, q in _TIMES.items()):
            return  # said already
        latest = max(abs(s.start_time), abs(s.stop_time))
        if not s.stop_time > s.start_time:
            self.fault(
                "simulation",
                "stop_time",
                f"stop_time = {s.stop_time!r} s: wanted more than start_time = {s.start_time!r} s",
            )
        elif (s.stop_time - s.start_time) / s.step > MAX_STEPS:
            self.fault(
                "simulation",
                "step",
                f"step = {s.step!r} s: wanted at most {MAX_STEPS} steps to stop_time = {s.stop_time!r} s",
            )
        elif s.step < TIMES_PER_STEP * math.ulp(latest):
            self.fault(
                "simulation",
                "step",
                f"step = {s.step!r} s: wanted at least {TIMES_PER_STEP * math.ulp(latest):.1g} s, "
                f"{TIMES_PER_STEP} times what a double resolves at t = {latest!r} s",
            )

    def control(self, s: Scenario) -> None:
        """Whether control lasts a step and ever acts; what else may be wrong the controller says in its own words."""
        with contextlib.suppress(ParameterError):
            p = control_parameters(s.parameters)
            if p.enabled and p.end - p.begin < s.step - SNAP:
                self.fault(
                    "parameters",
                    "T",
                    f"T = {p.end!r} s: wanted at least a step of {s.step!r} s of control, begun at {p.begin:g} s",
                )
            elif not self.faults and (fault := p.fault_of_start(s.start_time)):
                self.fault("parameters", "T", fault)


def _shown(value: Any) -> str:
    """A value as a message quotes it: on one line, short, and no deeper than a few levels."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python writes no integers of thousands of digits
        return f"({type(value).__name__})"


def _in_si(value: Any, unit: str) -> float:
    """A number in the given SI unit, from a number or a string with a unit. Raises ValueError saying what was got."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"got {type(value).__name__}")
    if not isinstance(value, str):
        try:
            return float(value)
        except OverflowError:
            raise ValueError("got a number beyond all doubles") from None
    match = _WITH_UNIT.fullmatch(value)
    if not match:
        raise ValueError("got a string that is not a number with a unit")
    if match[2] == unit:
        return float(match[1])
    import pint  # takes a moment to import, and most scenarios are in SI units

    registry = pint.get_application_registry()
    try:
        got = registry.Quantity(float(match[1]), registry.parse_units(_pint_unit(match[2])))
        return float(got.to(_pint_unit(unit)).magnitude)
    except Exception as error:  # pint's own, and for products such as dB*dB its failing assertions
        raise ValueError(f"got the unit {match[2]!r}: {error}") from error


def _pint_unit(unit: str) -> str:
    """An FMI unit such as N.s/m or kg.m2 as pint writes it."""
    return re.sub(r"([a-zA-Z]+)(\d+)", r"\1**\2", re.sub("[.·]", "*", unit))


def _line_of(lines: list[str], section: str, key: str) -> int | None:
    """Line (from 1) on which a key of a section is set, or else on which the section begins."""
    name = rf"""["']?{re.escape(key)}["']?"""
    setting, dotted = re.compile(rf"\s*{name}\s*[.=]"), re.compile(rf"\s*{section}\s*(\.\s*{name}\s*[.=]|=)")
    current, begin = "", None
    for number, line in enumerate(lines, start=1):
        if header := re.match(r"\s*\[+\s*([\w.-]+)\s*\]", line):
            current = header[1]
            begin = number if section and current == section else begin
            found = current == f"{section}.{key}" if section else current.split(".")[0] == key
        else:
            found = bool(setting.match(line) if current == section else section and not current and dotted.match(line))
        if found:
            return number
    return begin
