"""Base of the three slaves: variables from the table, fast access by reference, refusals, the whole state."""

from __future__ import annotations

import ctypes
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from functools import partial
from math import isfinite
from typing import Any, ClassVar
from xml.etree.ElementTree import Element

from pythonfmu import (
    Boolean,
    DefaultExperiment,
    Fmi2Causality,
    Fmi2Initial,
    Fmi2Slave,
    Fmi2Variability,
    Integer,
    Real,
    String,
)
from pythonfmu.enums import Fmi2Status

from .description import LOG_CATEGORIES, completed
from .quantities import PARAMETERS, Choice, ParameterError, Quantity, refuse


class StepError(Exception):
    """A step that cannot be made; the message names what, where and when."""


class Slave(Fmi2Slave):
    """A component with real inputs `u`, real outputs `y` and parameters, all in the order of the class tables.

    A subclass says what it has (class tables) and what it does: `configure` reads the parameters, `begin` sets the
    state at the start time, `advance` makes a step, `feed_through` renews the outputs after inputs have changed.
    """

    inputs: ClassVar[tuple[Quantity, ...]] = ()
    outputs: ClassVar[tuple[Quantity, ...]] = ()
    settable: ClassVar[int] = 0  # the first so many outputs are states, with start values that a host may set
    reals: ClassVar[tuple[str, ...]] = ()
    choices: ClassVar[tuple[Choice, ...]] = ()
    switches: ClassVar[dict[str, str]] = {}  # Boolean parameters, true by default: name -> words
    dependencies: ClassVar[dict[str, tuple[str, ...]]] = {}  # output -> inputs that it depends on within a step
    guid: object
    identity: ClassVar[str] = ""  # hash of the code, set by the slave script of an exported FMU

    log_categories = LOG_CATEGORIES
    author = "Bertolino–Bakša stability of motor vehicles: the developers"
    license = "MIT"
    copyright = "© the developers"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=5.0, step_size=1e-3)

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        if self.identity:
            self.guid = self.identity
        self.u = [q.start for q in self.inputs]
        self.y = [q.start for q in self.outputs]
        self.p = [PARAMETERS[name].start for name in self.reals]
        self.chosen = [c.start for c in self.choices]
        self.on = [True for _ in self.switches]
        self.time = 0.0
        self._stale = True  # outputs are older than inputs, parameters or start values
        self._running = False
        self._failed = False
        self._reals: dict[int, tuple[list[float], int]] = {}  # where the value of each reference lies
        self._register()

    def _register(self) -> None:
        parameter = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.fixed}
        for i, q in enumerate(self.inputs):
            self._declare(Real, q, self.u, i, causality=Fmi2Causality.input)
        for i, q in enumerate(self.outputs):
            initial = Fmi2Initial.exact if i < self.settable else Fmi2Initial.calculated
            self._declare(Real, q, self.y, i, causality=Fmi2Causality.output, initial=initial)
        for i, name in enumerate(self.reals):
            self._declare(Real, PARAMETERS[name], self.p, i, **parameter)
        for i, choice in enumerate(self.choices):
            self._declare(String, choice, self.chosen, i, **parameter)
        for i, (name, text) in enumerate(self.switches.items()):
            self._declare(Boolean, Choice(name=name, values=("true", "false"), text=text), self.on, i, **parameter)
        nu, ny = len(self.inputs), len(self.outputs)
        self._input_refs = list(range(nu))
        self._output_refs = list(range(nu, nu + ny))

    def _declare(self, kind: type, what: Quantity | Choice, cells: list, index: int, **attributes: object) -> None:
        getter, setter = partial(cells.__getitem__, index), partial(cells.__setitem__, index)
        variable = kind(what.name, description=what.description, getter=getter, setter=setter, **attributes)
        self.register_variable(variable)
        if kind is Real:
            self._reals[variable.value_reference] = (cells, index)

    # ------------------------------------------------------------------ what a subclass does
    def configure(self) -> None:
        """Read the parameters; raise ParameterError with every fault."""

    def begin(self) -> None:
        """Take the state from start values and inputs at `self.time`."""

    def advance(self, t: float, step: float) -> None:
        """Make a step from t to t + step [s], step > 0; raise StepError if that cannot be done."""
        raise NotImplementedError

    def feed_through(self) -> None:
        """Renew those outputs that depend on inputs directly."""

    def memory(self) -> list[Any]:
        """What the component remembers beyond its variables and its time, as plain data; lists in it never change."""
        return []

    def recall(self, memory: list[Any]) -> None:
        """Take back what `memory` gave."""

    def parameters(self) -> dict[str, float]:
        """Real parameters by name."""
        return dict(zip(self.reals, self.p, strict=True))

    # ------------------------------------------------------------------ FMI calls: values
    def get_real(self, vrs: list[int]) -> list[float]:
        """Values by reference; all outputs at once take no loop."""
        if self._stale:
            self._refresh()
        if vrs == self._output_refs:
            return self.y
        try:
            return [cells[i] for cells, i in map(self._reals.__getitem__, vrs)]
        except KeyError:
            return [float(value) for value in self._read(vrs, Real)]

    def get_integer(self, vrs: list[int]) -> list[int]:
        return [int(value) for value in self._read(vrs, Integer)]

    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return [bool(value) for value in self._read(vrs, Boolean)]

    def get_string(self, vrs: list[int]) -> list[str]:
        return [str(value) for value in self._read(vrs, String)]

    def set_real(self, vrs: list[int], values: Sequence[float]) -> None:
        """Set values by reference; all inputs at once take no loop."""
        if vrs == self._input_refs:
            self._stale = True
            self.u[:] = values
        else:
            self._write(vrs, values, Real)

    def set_integer(self, vrs: list[int], values: Sequence[int]) -> None:
        self._write(vrs, values, Integer)

    def set_boolean(self, vrs: list[int], values: Sequence[bool]) -> None:
        self._write(vrs, values, Boolean)

    def set_string(self, vrs: list[int], values: Sequence[str]) -> None:
        self._write(vrs, values, String)

    def _read(self, vrs: list[int], kind: type) -> list[Any]:
        unknown = [vr for vr in vrs if not isinstance(self.vars.get(vr), kind)]
        if unknown:
            self._refuse(f"reading {kind.__name__} variables: there are none of value reference {unknown}")
            return [0] * len(vrs)
        return [self.vars[vr].getter() for vr in vrs]

    def _write(self, vrs: list[int], values: Sequence[Any], kind: type) -> None:
        faults = [fault for vr, value in zip(vrs, values, strict=True) if (fault := self._unsettable(vr, value, kind))]
        if faults:
            self._refuse("; ".join(faults))
            return
        self._stale = True
        for vr, value in zip(vrs, values, strict=True):
            self.vars[vr].setter(value)

    def _unsettable(self, vr: int, value: object, kind: type) -> str | None:
        """Why this variable cannot be set to this value now; None if it can."""
        variable: Any = self.vars.get(vr)
        known = isinstance(variable, kind)
        if not known:
            return f"setting {kind.__name__} variables: there is none of value reference {vr}"
        if variable.causality == Fmi2Causality.input:
            return None
        if variable.causality == Fmi2Causality.output and variable.initial != Fmi2Initial.exact:
            return f"setting {variable.name} = {value!r}: it is an output"
        if self._running:
            return f"setting {variable.name} = {value!r}: wanted before the end of initialization"
        return None

    # ------------------------------------------------------------------ FMI calls: time
    def setup_experiment(self, start_time: float, *_: object) -> None:
        """Take the start time [s]."""
        self.time = start_time

    def exit_initialization_mode(self) -> None:
        """Check all parameters and start values; refuse with every fault named."""
        if self._failed or self._running:
            return
        try:
            refuse([q.fault(x) for q, x in zip(self.outputs[: self.settable], self.y, strict=False)])
            refuse(None if isfinite(x) else f"{q.name} = {x!r} {q.unit}" for q, x in self._inputs())
            refuse([] if isfinite(self.time) else [f"start time = {self.time!r} s: wanted a finite time"])
            self.configure()
            self.begin()
            self.feed_through()
            refuse(None if isfinite(x) else f"{q.name} = {x!r} {q.unit} at the start" for q, x in self._outputs())
        except (ParameterError, ArithmeticError, ValueError) as error:
            self._refuse(f"initialization: {error}")
            return
        self._running, self._stale = True, False

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One communication step; where it is refused False (fmi2Discard), a message, and the last good state."""
        if self._failed:
            return False
        if not self._running:
            return self._discard("a step was asked for outside of initialized time")
        kept = (self.memory(), self.y[:], self.time)
        try:
            self._check_step(current_time, step_size)
            if step_size > 0.0:
                self.advance(current_time, step_size)
            elif self._stale:
                self.feed_through()
            if not isfinite(sum(self.y)):
                refuse(None if isfinite(x) else f"{q.name} = {x!r} {q.unit}" for q, x in self._outputs())
        except (StepError, ArithmeticError, ValueError) as error:
            memory, self.y[:], self.time = kept
            self.recall(memory)
            what = f"step of {step_size:g} s from t = {current_time:g} s: {error}"
            return self._discard(f"{what}; the state at t = {self.time:g} s is kept")
        self.time, self._stale = current_time + step_size, False
        return True

    def terminate(self) -> None:
        """No steps from now on."""
        self._running = False

    def _check_step(self, t: float, step: float) -> None:
        if not (isfinite(t) and 0.0 <= step < float("inf")):
            raise StepError("wanted a finite time and a step >= 0")
        if not isfinite(sum(self.u)):
            faults = [f"{q.name} = {x!r} {q.unit}" for q, x in self._inputs() if not isfinite(x)]
            if faults:
                raise StepError(f"wanted finite inputs, got {', '.join(faults)}")

    def _inputs(self) -> Iterable[tuple[Quantity, float]]:
        return zip(self.inputs, self.u, strict=True)

    def _outputs(self) -> Iterable[tuple[Quantity, float]]:
        return zip(self.outputs, self.y, strict=True)

    def _refresh(self) -> None:
        """Outputs for changed inputs; before the end of initialization also for changed parameters and start values.

        Where they cannot be had (parameters at fault, inputs not finite) the last good ones stay: what is wrong is said
        at the end of initialization or at the next step, when the host has set all that it wants to set.
        """
        if self._failed:
            return
        memory, y = self.memory() if self._running else None, self.y[:]
        try:
            if not self._running:
                self.configure()
                self.begin()
            self.feed_through()
            good = isfinite(sum(self.y))
        except (ParameterError, ArithmeticError, ValueError):
            good = False
        if good:
            self._stale = False
        else:
            self.y[:] = y
            if memory is not None:
                self.recall(memory)

    # ------------------------------------------------------------------ refusals
    def _discard(self, why: str) -> bool:
        self.log(f"{self.instance_name}: {why}", Fmi2Status.error, "logStatusError")
        return False

    def _refuse(self, why: str) -> None:
        """Refuse a call that has no status of its own: by an exception, the only way PythonFMU leaves, and only once.

        At an exception PythonFMU gives up its references to the instance, to its class and to its log, and once more
        when the instance is freed; without the references that are added here the second time frees them under use.
        """
        self.log(f"{self.instance_name}: {why}", Fmi2Status.error, "logStatusError")
        if not self._failed:
            self._failed = True
            for held in (self, type(self), self.log_queue):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(held))
            raise RuntimeError(why)

    # ------------------------------------------------------------------ FMI calls: state
    def _get_fmu_state(self) -> dict[str, Any]:
        """The whole state as plain data: variables, time, phase and memory."""
        return {
            "identity": self.identity,
            "cells": [self.u[:], self.y[:], self.p[:], self.chosen[:], self.on[:]],
            "phase": [self.time, self._stale, self._running, self._failed],
            "memory": self.memory() if self._running else None,
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Return to a state of this or another instance of the same code."""
        try:
            if self._failed or state["identity"] != self.identity:
                raise ValueError("another FMU's, or this instance has failed")
            self.u[:], self.y[:], self.p[:], self.chosen[:], self.on[:] = state["cells"]
            self.time, self._stale, self._running, self._failed = state["phase"]
            if self._running:
                self.recall(state["memory"])
                self.configure()
        except (LookupError, TypeError, ValueError) as error:
            self._refuse(f"setting the state: wanted one that this FMU has given, got {error!r}")

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        """JSON: doubles as repr, so that they come back bit for bit."""
        return json.dumps(state, default=asdict).encode()

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        """The state from its bytes (JSON, doubles as repr); of bytes that are none, a state that will be refused."""
        try:
            data = json.loads(state)
        except (ValueError, RecursionError):
            return {}
        return data if isinstance(data, dict) else {}

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """PythonFMU's description, completed."""
        return completed(super().to_xml(model_options or {}), self)
