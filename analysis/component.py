"""One FMU in the master's hands: unpacked, loaded, initialized, and its log. With the master, all that touches fmpy."""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.logging import addLoggerProxy

from .errors import CosimError, InputError
from .units import BASE, Unit, unit

WARNING = 1  # highest fmi2Status that lets a simulation go on
STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
Value = float | str | bool

# int f(fmi2Component, const fmi2ValueReference[], size_t, fmi2Real[]); kept under the interpreter lock, which a
# PythonFMU component would take again anyway, and without fmpy's checks of every argument
Access = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
Step = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)


logs: dict[int, list[str]] = {}  # messages of each living component, by the environment its callbacks carry


@fmi2CallbackLoggerTYPE
def _logger(environment: int, _name: bytes, status: int, _category: bytes, message: bytes) -> None:
    """The one logger of this process: fmpy's proxy, which fills in the arguments of a message, keeps only one."""
    if status > WARNING and environment in logs:
        logs[environment].append(" ".join(message.decode("utf-8", "replace").split()))


def callbacks(environment: int) -> Any:
    """Callbacks of an instance whose messages go to `logs[environment]`."""
    made = fmi2CallbackFunctions()
    made.logger = _logger
    made.allocateMemory = defaultCallbacks.allocateMemory
    made.freeMemory = defaultCallbacks.freeMemory
    made.componentEnvironment = environment
    addLoggerProxy(ctypes.byref(made))
    return made


class Component:
    """An instantiated FMU. `variables`: by name, as in its model description; `units`: of those that have one."""

    def __init__(self, name: str, archive: Path, folder: Path) -> None:
        self.name, self.log = name, list[str]()
        if "%" in folder.as_uri().replace("%20", ""):  # the library decodes nothing else, and ends the process
            raise InputError(
                f"{folder}: wanted a folder for FMUs without special characters; set TMPDIR to a plain one"
            )
        try:
            self.sha256 = hashlib.sha256(archive.read_bytes()).hexdigest()
            extract(archive, folder)
            description = read_model_description(folder, validate=False)
            self.units = _units(description)
        except Exception as error:  # fmpy raises bare Exceptions; zipfile and the system their own
            raise InputError(f"{name}: {archive.name} cannot be read as an FMU: {error}") from error
        if description.coSimulation is None:
            raise InputError(f"{name}: {archive.name} has no co-simulation interface")
        self.guid = description.guid
        self.variables = {v.name: v for v in description.modelVariables}
        logs[id(self.log)] = self.log
        try:
            self.fmu = FMU2Slave(
                guid=description.guid,
                modelIdentifier=description.coSimulation.modelIdentifier,
                unzipDirectory=str(folder),
                instanceName=name,
            )
            self.fmu.instantiate(callbacks=callbacks(id(self.log)), loggingOn=True)
        except Exception as error:
            del logs[id(self.log)]
            raise CosimError(f"{name}: {archive.name} cannot be loaded: {error}{self._said()}") from error
        self.get_real = Access(_address(self.fmu, "fmi2GetReal"))
        self.set_real = Access(_address(self.fmu, "fmi2SetReal"))
        self.do_step = Step(_address(self.fmu, "fmi2DoStep"))
        self.pointer = ctypes.c_void_p(self.fmu.component)
        self._usable = True

    def named(self, causality: str) -> list[str]:
        """Names of the real variables of this causality, in the FMU's order."""
        return [v.name for v in self.variables.values() if v.causality == causality and v.type == "Real"]

    def has(self, name: str) -> bool:
        """Whether the FMU has a real variable of this name."""
        return name in self.variables and self.variables[name].type == "Real"

    def references(self, names: Sequence[str]) -> Any:
        """C array of their value references."""
        return (ctypes.c_uint * len(names))(*(self.variables[name].valueReference for name in names))

    def set_parameters(self, values: dict[str, Value]) -> None:
        """Set those of the values (SI) whose names this FMU has as parameters or start values, by their types."""
        setters = {"Real": self.fmu.setReal, "Boolean": self.fmu.setBoolean, "String": self.fmu.setString}
        for name, value in values.items():
            if name in self.variables and self.variables[name].causality in ("parameter", "output"):
                variable = self.variables[name]
                if name in self.units:
                    value = self.units[name].from_si(float(value))
                self.call(setters[variable.type], [variable.valueReference], [value])

    def parameters(self) -> dict[str, Value]:
        """Present values of all parameters, SI units."""
        getters = {"Real": self.fmu.getReal, "Boolean": self.fmu.getBoolean, "String": self.fmu.getString}
        found: dict[str, Value] = {}
        for v in self.variables.values():
            if v.causality == "parameter":
                (value,) = self.call(getters[v.type], [v.valueReference])
                if v.name in self.units:
                    value = self.units[v.name].to_si(value)
                found[v.name] = (
                    value.decode() if isinstance(value, bytes) else bool(value) if v.type == "Boolean" else value
                )
        return found

    def call(self, function: Callable[..., Any], *arguments: Any, **keywords: Any) -> Any:
        """Call a method of fmpy's; a status above warning becomes a CosimError that quotes the FMU's log."""
        try:
            return function(*arguments, **keywords)
        except Exception as error:  # fmpy raises FMICallException, and bare Exceptions
            self._usable = False
            raise CosimError(f"{self.name}: {str(error).rstrip('.')}{self._said()}") from error

    def fail(self, doing: str, t: float, status: int) -> NoReturn:
        """Raise CosimError for a status that a direct call returned."""
        self._usable = False
        word = STATUS[status] if status < len(STATUS) else "illegal"
        raise CosimError(f"{self.name}: {doing} at t = {t:g} s: status {status} ({word}){self._said()}")

    def _said(self) -> str:
        own = [message for message in self.log if not message.startswith("Fatal py exception")] or self.log
        return f"; it said: {' | '.join(own[-3:])}" if own else "; it said nothing"

    def free(self) -> None:
        """Terminate, unless a call has failed (a second failure can end a PythonFMU host), and free the instance."""
        if self._usable:
            self.fmu.terminate()
        self.fmu.freeInstance()
        del logs[id(self.log)]


def _units(description: Any) -> dict[str, Unit]:
    """The units of those variables that have one; a difference (relativeQuantity) knows no offset."""
    bases = {u.name: u.baseUnit for u in description.unitDefinitions}
    found = {}
    for v in description.modelVariables:
        name = v.unit or (v.declaredType.unit if v.declaredType else None)
        if v.type == "Real" and name:
            base = bases.get(name)
            attributes = None if base is None else {key: getattr(base, key) for key in (*BASE, "factor", "offset")}
            found[v.name] = unit(name, attributes)
            if v.relativeQuantity:
                found[v.name] = replace(found[v.name], offset=0.0)
    return found


def _address(fmu: Any, function: str) -> int:
    return ctypes.cast(getattr(fmu.dll, function), ctypes.c_void_p).value or 0
