"""Base of the three slaves: time, steps, and the whole state, over the variables."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict
from math import isfinite
from typing import Any
from xml.etree.ElementTree import Element

from .description import completed
from .interrupts import unbroken, unbroken_function
from .quantities import PARAMETERS, ParameterError, Quantity, refuse
from .variables import Variables

SNAP = 1e-9  # relative to a second, or to the time: what a sum of steps may be off


class StepError(Exception):
    """A step that cannot be made; the message names what, where and when."""


class Slave(Variables):
    """A component. A subclass says what it has (the tables of `Variables`) and what it does:

    `configure` reads the parameters, `begin` sets the state at the start time, `advance` makes a step, `feed_through`
    renews the outputs after inputs have changed, `memory` and `recall` carry what it remembers.
    """

    # ------------------------------------------------------------------ what a subclass does
    def configure(self) -> None:
        """Read the parameters; raise ParameterError with every fault."""

    def begin(self) -> None:
        """Take the state from start values and inputs at `self.time`."""

    def advance(self, t: float, step: float) -> None:
        """Make a step from t to t + step [s], step > 0; raise StepError if that cannot be done."""
        raise NotImplementedError

    def jump(self, t: float) -> None:
        """Go to a time t [s] other than that at which the last step ended; raise StepError if that cannot be done.

        What has a state cannot: it would miss what happens between.
        """
        raise StepError(f"wanted a step from t = {self.time!r} s, which was reached, got one from {t!r} s")

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

    # ------------------------------------------------------------------ FMI calls: time
    @unbroken
    def setup_experiment(self, start_time: float, *_: object) -> None:
        """Take the start time [s]."""
        self.time = start_time

    @unbroken
    def exit_initialization_mode(self) -> None:
        """Check all parameters and start values; refuse with every fault named."""
        if self.failed or self._running:
            return
        faults = [q.fault(x) for q, x in zip(self.outputs[: self.settable], self.y, strict=False)]
        faults += [None if isfinite(x) else f"{q.name} = {x!r} {q.unit}" for q, x in self._inputs()]
        faults += [PARAMETERS[name].fault(x) for name, x in self.parameters().items()]
        faults += [choice.fault(value) for choice, value in zip(self.choices, self.chosen, strict=True)]
        faults += [None if isfinite(self.time) else f"start time = {self.time!r} s: wanted a finite time"]
        try:
            self.configure()
            refuse(faults)
            self.begin()
            self.feed_through()
            refuse(None if isfinite(x) else f"{q.name} = {x!r} {q.unit} at the start" for q, x in self._outputs())
        except ParameterError as error:
            self._refuse("initialization: " + "; ".join(dict.fromkeys([*filter(None, faults), *error.faults])))
            return
        except Exception as error:  # of whatever kind: it must not reach the library unprepared (see `_refuse`)
            self._refuse("initialization: " + "; ".join([*filter(None, faults), repr(error)]))
            return
        except BaseException as interrupt:  # what it has begun may take long, or not bear being begun anew
            self._say(f"initialization: {interrupt!r}; it is not at its end", interrupt)
            return
        self._running, self._stale = True, False

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One communication step; where it is refused False (fmi2Discard), a message, and the last good state.

        An interrupt that strikes in it refuses it. It must not strike when the step is made: nothing is called then.
        """
        kept = None
        try:
            if self.failed:
                return False
            if not self._running:
                self._say("a step was asked for outside of initialized time")
                return False
            kept = (self.memory(), self.y[:], self.time)
            self._check_step(current_time, step_size)
            if abs(current_time - self.time) > SNAP * max(1.0, abs(current_time)):
                self.jump(current_time)
            if step_size > 0.0:
                self.advance(current_time, step_size)
            elif self._stale:
                self.feed_through()
            if not isfinite(sum(self.y)):
                refuse(None if isfinite(x) else f"{q.name} = {x!r} {q.unit}" for q, x in self._outputs())
            self.time, self._stale = current_time + step_size, False
            return True
        except BaseException as error:  # of whatever kind: the step is refused, and the component as it was before
            if kept:
                memory, self.y[:], self.time = kept
                self.recall(memory)
            what = f"step of {step_size:g} s from t = {current_time:g} s: {str(error) or repr(error)}"
            self._say(f"{what}; the state at t = {self.time:g} s is kept", error)
            return False

    @unbroken
    def enter_initialization_mode(self) -> None:
        """Nothing to do."""

    @unbroken
    def terminate(self) -> None:
        """No steps from now on."""
        self._running = False

    def _check_step(self, t: float, step: float) -> None:
        if not (step >= 0.0 and isfinite(t + step)):
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
        if self.failed:
            return
        memory, y, good = self.memory() if self._running else None, self.y[:], False
        try:
            if not self._running:
                self.configure()
                self.begin()
            self.feed_through()
            good = isfinite(sum(self.y))
        except Exception:  # said at the end of initialization or at the next step, see above
            pass
        finally:
            if not good:
                self.y[:] = y
                if memory is not None:
                    self.recall(memory)
        self._stale = not good

    # ------------------------------------------------------------------ FMI calls: state
    @unbroken
    def _get_fmu_state(self) -> dict[str, Any]:
        """The whole state as plain data: variables, time, phase and memory."""
        return {
            "identity": self.identity,
            "cells": [self.u[:], self.y[:], self.p[:], self.chosen[:], self.on[:]],
            "phase": [self.time, self._stale, self._running],
            "failed": self.failed,
            "memory": self.memory() if self._running else None,
        }

    @unbroken
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Return to a state of this or another instance of the same code."""
        try:
            if state["identity"] != self.identity:
                raise ValueError("another FMU's")
            if self.failed or state["failed"]:
                raise ValueError(
                    "that of an instance that has failed" if state["failed"] else "this instance has failed"
                )
            self.u[:], self.y[:], self.p[:], self.chosen[:], self.on[:] = state["cells"]
            self.time, self._stale, self._running = state["phase"]
            if self._running:
                self.recall(state["memory"])
                self.configure()
        except Exception as error:  # of whatever kind
            self._refuse(f"setting the state: wanted one that this FMU has given, got {error!r}")

    @staticmethod
    @unbroken_function
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        """JSON (doubles as repr, so that they come back bit for bit) behind its SHA-256, by which damage is seen."""
        text = json.dumps(state, default=asdict).encode()
        return hashlib.sha256(text).digest() + text

    @staticmethod
    @unbroken_function
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        """The state from its bytes; of bytes that `_fmu_state_to_bytes` has not made, one that will be refused."""
        digest, text = state[:32], state[32:]
        return dict(json.loads(text)) if hashlib.sha256(text).digest() == digest else {}

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """PythonFMU's description, completed."""
        return completed(super().to_xml(model_options or {}), self)
