"""The master: co-simulates the FMUs of a system with a fixed communication step, Gauss–Seidel or Jacobi.

Communication points are t_n = t_0 + n·H, never a running sum; a stop time that is no multiple is met by a short last
step. All numbers live in one table (`layout`): per step and FMU there is one setReal, one doStep and one getReal, by
pointer, and the table is the recording.
"""

from __future__ import annotations

import contextlib
import math
import platform
import signal
import tempfile
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from tqdm import tqdm

from .component import WARNING, Component
from .errors import InputError
from .layout import lay_out
from .scenario import Scenario
from .trajectory import Array, Run, Trajectory
from .units import SAME, Conversion, Unit
from .wiring import Port, Wiring, conversions, examine

DEFAULT_SYSTEM = Path(__file__).resolve().parents[1] / "dist" / "VehicleOnRoad.ssp"
CHUNK = 64  # steps between two looks at the progress bar and at Ctrl-C
DOUBLE = 8  # bytes


def simulate(scenario: Scenario, system: Path = DEFAULT_SYSTEM, *, progress: bool = False) -> Run:
    """Co-simulate a scenario on a system: an .ssp file, or a folder that one was unpacked into.

    Parameters and start values are the scenario's, whatever sets the system binds. What was unpacked here is removed
    afterwards. Raises InputError for a system or a variable that is not there and for a system that cannot be wired,
    CosimError, with the FMU's own words, where an FMU refuses. A progress bar appears on a terminal if asked for.
    """
    if not system.exists():
        raise InputError(f"{system}: no such file; build it with: python3 build.py build")
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="cosimulation_")))
        caught = stack.enter_context(_deferred_signals())
        loaded = _load(system, folder, stack)
        components = loaded.components
        table = _Table(loaded, scenario)
        _initialize(components, scenario)
        parameters = {name: c.parameters() for name, c in components.items()}
        trajectory = table.fill(caught, progress)
    record = {
        "format": 1,
        "scenario": scenario.as_json(),
        "parameters": parameters,
        "fmus": {
            name: {"file": Path(loaded.wiring.sources[name]).name, "sha256": c.sha256, "guid": c.guid}
            for name, c in components.items()
        },
        "versions": {
            "python": platform.python_version(),
            **{package: version(package) for package in ("bertolino-baksa", "pythonfmu", "fmpy", "numpy")},
        },
        "method": f"{scenario.coupling}, fixed step {scenario.step!r} s",
    }
    return Run(trajectory=trajectory, record=record)


@dataclass(frozen=True, slots=True)
class _System:
    """A system that can be run: its wiring, its instances, and what takes the numbers of sources to those of inputs."""

    wiring: Wiring
    components: dict[str, Component]
    units: dict[Port, Unit]
    conversions: dict[Port, Conversion]


def _load(system: Path, folder: Path, stack: contextlib.ExitStack) -> _System:
    """Instantiate the components of the system, unpacked into the folder; the stack frees them.

    Raises InputError with all that is wrong with structure, FMUs, connectors and units.
    """
    place = system
    if not system.is_dir():
        place = folder / "system"
        try:
            fmpy.extract(system, place)
        except Exception as error:  # fmpy raises bare Exceptions; zipfile its own
            raise InputError(f"{system}: cannot be unpacked: {error}") from error
    wiring, faults = examine(place / "SystemStructure.ssd", system / "SystemStructure.ssd")
    outside = [s for s in wiring.sources.values() if not (place / s).resolve().is_relative_to(place.resolve())]
    if outside:
        faults.append(f"{system}: wanted FMUs inside it, got links that lead elsewhere: {', '.join(outside)}")
    components: dict[str, Component] = {}
    for name, source in wiring.sources.items():
        if source not in outside:
            try:
                components[name] = Component(name, place / source, folder / "fmus" / str(len(components)))
            except InputError as error:
                faults.append(str(error))
                continue
            stack.callback(components[name].free)
    lacking = _lacking(wiring, components)
    if lacking:
        named = ", ".join(sorted(f"{port} ({kind})" for port, kind in lacking.items()))
        faults.append(f"{system}: its FMUs lack these of its connectors: {named}")
    fmus = {Port(name, v): unit for name, c in components.items() for v, unit in c.units.items()}
    found, unconvertible = conversions(wiring, {port: unit for port, unit in fmus.items() if port not in lacking})
    if faults or unconvertible:
        raise InputError("\n".join([*faults, *unconvertible]))
    return _System(wiring, components, {**wiring.units, **fmus}, found)


def _lacking(wiring: Wiring, components: dict[str, Component]) -> dict[Port, str]:
    """Connectors that are wired and that their FMUs, as far as they are there, do not have: which kind was wanted."""
    ends = [*((p, "input") for p in wiring.feeds), *((p, "output") for p in wiring.feeds.values())]
    return {
        p: kind
        for p, kind in ends
        if p.component in components and p.variable not in components[p.component].named(kind)
    }


def _initialize(components: dict[str, Component], scenario: Scenario) -> None:
    """Parameters, start values, start time; all components enter initialization mode."""
    for c in components.values():
        c.call(c.fmu.setupExperiment, startTime=scenario.start_time, stopTime=scenario.stop_time)
        c.set_parameters(scenario.parameters)
        if set(scenario.start) & set(c.named("output")):
            c.set_parameters(dict(scenario.start))
        c.call(c.fmu.enterInitializationMode)


@dataclass(frozen=True, slots=True)
class _Stage:
    """What one component needs within a step, ready for direct calls; addresses are those of the first new row."""

    component: Component
    inputs: Any  # C arrays of value references
    outputs: Any
    input_address: int
    output_address: int
    gathered: tuple[Array, Array] | None  # where the inputs are no stretch: a buffer for them, and their positions
    converted: tuple[Array, Array] | None  # where they come in other units: factors and offsets; then gathered, too


class _Table:
    """The rows of one run, and the loop that fills them."""

    def __init__(self, system: _System, scenario: Scenario) -> None:
        components, wiring = system.components, system.wiring
        self.components, self.units, self.scenario = components, system.units, scenario
        self.outputs = {name: c.named("output") for name, c in components.items()}
        self.recorded = self._recorded(scenario.record)
        self.inputs = {name: [p.variable for p in wiring.feeds if p.component == name] for name in components}
        feeds = {name: [wiring.feeds[Port(name, v)] for v in inputs] for name, inputs in self.inputs.items()}
        self.converted = {
            name: _arrays([system.conversions[Port(name, v)] for v in inputs]) for name, inputs in self.inputs.items()
        }
        self.layout = lay_out(self.outputs, feeds, list(components), scenario.coupling)
        span = scenario.stop_time - scenario.start_time
        self.whole = round(span / scenario.step)  # steps of full length
        self.rest = span - self.whole * scenario.step
        if abs(self.rest) <= 1e-9 * scenario.step + 4.0 * math.ulp(abs(scenario.start_time) + abs(scenario.stop_time)):
            self.rest = 0.0
        elif self.rest < 0.0:
            self.whole -= 1
            self.rest += scenario.step
        self.rows = np.zeros((1 + self.whole + (self.rest > 0.0), self.layout.width))

    def _recorded(self, wanted: Sequence[str]) -> list[Port]:
        """The variables to record; those that are no outputs join the list that is read from their component."""
        if not wanted:
            return [Port(name, variable) for name, variables in self.outputs.items() for variable in variables]
        found = []
        for variable in wanted:
            owners = [name for name, variables in self.outputs.items() if variable in variables]
            owners += [name for name, c in self.components.items() if c.has(variable)]
            if not owners:
                known = ", ".join(v for variables in self.outputs.values() for v in variables)
                raise InputError(f"record: no component has a real variable {variable!r}; outputs are: {known}")
            if variable not in self.outputs[owners[0]]:
                self.outputs[owners[0]].append(variable)
            found.append(Port(owners[0], variable))
        return found

    def fill(self, caught: list[int], progress: bool) -> Trajectory:
        """Run from start to stop, or until a signal has been caught."""
        s = self.scenario
        self._first_row()
        stages = [self._stage(name) for name in self.components]
        bar = tqdm(
            total=len(self.rows) - 1, unit=" steps", desc=s.name, disable=None if progress else True, leave=False
        )
        with bar:
            for first in range(0, self.whole, CHUNK):
                last = min(first + CHUNK, self.whole)
                _advance(stages, range(first, last), s.start_time, s.step, s.step, self.rows)
                bar.update(last - first)
                if caught:
                    raise KeyboardInterrupt
            if self.rest:
                _advance(stages, range(self.whole, self.whole + 1), s.start_time, s.step, self.rest, self.rows)
        time = s.start_time + s.step * np.arange(len(self.rows), dtype=np.float64)
        time[-1] = s.stop_time
        names = tuple(port.variable for port in self.recorded)
        return Trajectory(time=time, names=names, values=self._recorded_values())

    def _recorded_values(self) -> Array:
        """The recorded columns in SI units."""
        values = self.rows[:, [self.layout.columns[port] for port in self.recorded]]
        for column, port in enumerate(self.recorded):
            unit = self.units.get(port)
            if unit and (unit.factor, unit.offset) != (1.0, 0.0):
                values[:, column] = unit.factor * values[:, column] + unit.offset
        return values

    def _first_row(self) -> None:
        """Values at the start: twice around, so that the controller's forces reach the car's accelerations."""
        for _ in range(2):
            for name, c in self.components.items():
                if self.inputs[name]:
                    sources = [position % self.layout.width for position in self.layout.inputs[name]]
                    values = self.rows[0, sources]
                    if converted := self.converted[name]:
                        values = values * converted[0] + converted[1]
                    c.call(c.fmu.setReal, list(c.references(self.inputs[name])), values.tolist())
                self._read_first(name, c)
        for name, c in self.components.items():
            c.call(c.fmu.exitInitializationMode)
            self._read_first(name, c)

    def _read_first(self, name: str, c: Component) -> None:
        columns = [self.layout.columns[Port(name, v)] for v in self.outputs[name]]
        self.rows[0, columns] = c.call(c.fmu.getReal, list(c.references(self.outputs[name])))

    def _stage(self, name: str) -> _Stage:
        c, layout = self.components[name], self.layout
        positions = layout.inputs[name]
        new_row = self.rows.ctypes.data + layout.width * DOUBLE
        gathered, converted = None, self.converted[name]
        if positions and (converted or not layout.stretch(name)):
            gathered = np.empty(len(positions)), np.array(positions) + layout.width
        return _Stage(
            component=c,
            inputs=c.references(self.inputs[name]),
            outputs=c.references(self.outputs[name]),
            input_address=new_row + positions[0] * DOUBLE if positions else 0,
            output_address=new_row + layout.columns[Port(name, self.outputs[name][0])] * DOUBLE,
            gathered=gathered,
            converted=converted,
        )


def _arrays(found: list[Conversion]) -> tuple[Array, Array] | None:
    """Factors and offsets; None if nothing is to be converted."""
    if all(each == SAME for each in found):
        return None
    return np.array([each.factor for each in found]), np.array([each.offset for each in found])


def _advance(stages: list[_Stage], steps: range, start: float, step: float, length: float, rows: Array) -> None:
    """Make the steps k from t = start + k·step, of this length [s]: set inputs, step, get outputs of each component."""
    width = rows.shape[1]
    flat, stride = rows.reshape(-1), width * DOUBLE
    calls = [(s, s.component, s.component.pointer, len(s.inputs), len(s.outputs)) for s in stages]
    for k in steps:
        t, offset = start + k * step, k * stride
        for stage, c, pointer, n_in, n_out in calls:
            if n_in:
                address = stage.input_address + offset
                if stage.gathered is not None:
                    buffer, positions = stage.gathered
                    np.take(flat, positions + k * width, out=buffer)
                    if stage.converted is not None:
                        np.multiply(buffer, stage.converted[0], out=buffer)
                        np.add(buffer, stage.converted[1], out=buffer)
                    address = buffer.ctypes.data
                if (status := c.set_real(pointer, stage.inputs, n_in, address)) > WARNING:
                    c.fail("setting inputs", t, status)
            if (status := c.do_step(pointer, t, length, 1)) > WARNING:
                c.fail(f"step of {length:g} s", t, status)
            if (status := c.get_real(pointer, stage.outputs, n_out, stage.output_address + offset)) > WARNING:
                c.fail("reading outputs", t, status)


@contextlib.contextmanager
def _deferred_signals() -> Iterator[list[int]]:
    """Ctrl-C and SIGTERM are noted in the list and take effect on leaving.

    Raised at once, they would strike inside the Python code of an FMU, which would take them for its own failure.
    """
    caught: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield caught
        return
    heard = [n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) not in (signal.SIG_IGN, None)]
    previous = [signal.signal(number, lambda got, _: caught.append(got)) for number in heard]
    try:
        yield caught
    finally:
        for number, handler in zip(heard, previous, strict=True):
            signal.signal(number, handler)
        if caught:
            signal.raise_signal(caught[0])
