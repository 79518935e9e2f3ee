"""A small FMI 2.0 host on top of fmpy: statuses instead of exceptions, variables by name, the log kept."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import byref, c_double, c_uint, c_void_p
from pathlib import Path
from typing import Any

from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

from analysis.component import callbacks, logs

OK, WARNING, DISCARD, ERROR, FATAL = range(5)


class Host:
    """One instance of an unpacked FMU; every method returns the status of its call, or the value that it got."""

    def __init__(self, folder: Path, name: str = "") -> None:
        description = read_model_description(folder, validate=False)
        self.reference = {v.name: v.valueReference for v in description.modelVariables}
        self.outputs = [v.name for v in description.modelVariables if v.causality == "output"]
        self.inputs = [v.name for v in description.modelVariables if v.causality == "input"]
        identifier = description.coSimulation.modelIdentifier
        self.log: list[str] = []
        logs[id(self.log)] = self.log
        self.fmu = FMU2Slave(
            guid=description.guid,
            modelIdentifier=identifier,
            unzipDirectory=str(folder),
            instanceName=name or identifier,
        )
        self.fmu.instantiate(callbacks=callbacks(id(self.log)), loggingOn=True)

    def status(self, function: str, *arguments: Any) -> int:
        """Call fmi2<function> on the instance."""
        try:
            getattr(self.fmu, f"fmi2{function}")(self.fmu.component, *arguments)
        except FMICallException as failure:
            return int(failure.status)
        return OK

    def start(self, time: float = 0.0, **values: float) -> int:
        """Set up, set start values, initialize."""
        self.status("SetupExperiment", 0, 0.0, time, 0, 0.0)
        if values:
            assert self.set(values) == OK
        self.status("EnterInitializationMode")
        return self.status("ExitInitializationMode")

    def set(self, values: dict[str, float]) -> int:
        return self.set_real([self.reference[name] for name in values], list(values.values()))

    def set_real(self, references: Sequence[int], values: Sequence[float]) -> int:
        return self._tried(self.fmu.setReal, list(references), list(values))

    @staticmethod
    def _tried(function: Callable[..., None], *arguments: Any) -> int:
        try:
            function(*arguments)
        except FMICallException as failure:
            return int(failure.status)
        return OK

    def tried(self, method: str, *arguments: Any) -> int:
        """Call a method of fmpy's instance."""
        return self._tried(getattr(self.fmu, method), *arguments)

    def set_string(self, reference: int, text: str) -> int:
        return self._tried(self.fmu.setString, [reference], [text])

    def set_boolean(self, reference: int, value: bool) -> int:
        return self._tried(self.fmu.setBoolean, [reference], [value])

    def get(self, *names: str) -> list[float]:
        return list(self.fmu.getReal([self.reference[name] for name in names or self.outputs]))

    def step(self, t: float, h: float) -> int:
        return self.status("DoStep", t, h, 1)

    def state(self) -> Any:
        return self.fmu.getFMUState()

    def restore(self, state: Any) -> int:
        return self.status("SetFMUstate", state)

    def to_bytes(self, state: Any) -> bytes:
        return bytes(self.fmu.serializeFMUState(state))

    def from_bytes(self, data: bytes) -> Any:
        state = c_void_p()
        self.fmu.fmi2DeSerializeFMUstate(self.fmu.component, data, len(data), byref(state))
        return state

    def real(self, reference: int) -> tuple[int, float]:
        """Status and value of one reference."""
        value = c_double(0.0)
        status = self.status("GetReal", (c_uint * 1)(reference), 1, byref(value))
        return status, value.value

    def free(self) -> None:
        self.fmu.freeInstance()
        del logs[id(self.log)]
