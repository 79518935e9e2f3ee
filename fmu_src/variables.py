"""The variables of a slave: declared from the table, read and set by reference, refused where they must be."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar

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

from .access import Reader, Writer, reader, remember, writer
from .description import LOG_CATEGORIES
from .interrupts import Messages, again, keep, unbroken
from .quantities import PARAMETERS, TABLE, Choice, Quantity


class Variables(Fmi2Slave):
    """Real inputs `u`, real outputs `y` and parameters, all in the order of the class tables."""

    inputs: ClassVar[tuple[Quantity, ...]] = ()
    outputs: ClassVar[tuple[Quantity, ...]] = ()
    settable: ClassVar[int] = 0  # the first so many outputs are states, with start values that a host may set
    reals: ClassVar[tuple[str, ...]] = ()
    choices: ClassVar[tuple[Choice, ...]] = ()
    switches: ClassVar[dict[str, str]] = {}  # Boolean parameters, true by default: name -> words
    dependencies: ClassVar[dict[str, tuple[str, ...]]] = {}  # output -> inputs that it depends on within a step
    initially: ClassVar[dict[str, tuple[str, ...]]] = {}  # output -> start values and parameters; default: all
    guid: object
    log_queue: Any
    _get_log_queue: Any
    identity: ClassVar[str] = ""  # hash of the code, set by the slave script of an exported FMU

    log_categories = LOG_CATEGORIES
    author = "Bertolino–Bakša stability of motor vehicles: the developers"
    license = "MIT"
    version = "0.1.0"
    copyright = "© the developers"
    default_experiment = DefaultExperiment(start_time=0.0, stop_time=5.0, step_size=1e-3)

    def __init__(self, **kwargs: object) -> None:
        try:
            self._set_up(**kwargs)
        except Exception:
            raise
        except BaseException as interrupt:  # the library would end the host if this failed in a reset
            self._set_up(**kwargs)
            self.put_off(interrupt)

    def _set_up(self, **kwargs: object) -> None:
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
        self.failed = False  # it has raised an exception, and does nothing any more
        self._messages: Callable[[], Messages | None] = _nobody
        self._put_off: object = None  # an interrupt that is to strike after the present call
        self._reals: dict[int, tuple[list[float], int]] = {}  # where the value of each reference lies
        self._reading: dict[tuple[int, ...], Reader] = {}  # lists of references
        self._writing: dict[tuple[int, ...], Writer] = {}  # that have passed
        self._asked: list[int] = []  # the list that was read last,
        self._way: Reader = ([], tuple)  # and how
        self._register()
        messages = Messages(self)
        self._messages, self.log_queue = weakref.ref(messages), weakref.proxy(messages)
        # no Python code: the library calls this once, cannot bear that it fails, and then alone has the messages
        self._get_log_queue = [messages].pop

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

    def _declare(self, kind: type, what: Quantity | Choice, cells: list, index: int, **attributes: object) -> None:
        getter, setter = partial(cells.__getitem__, index), partial(cells.__setitem__, index)
        variable = kind(what.name, description=what.description, getter=getter, setter=setter, **attributes)
        self.register_variable(variable)
        if kind is Real:
            self._reals[variable.value_reference] = (cells, index)

    def get_real(self, vrs: list[int]) -> list[float]:
        """Values by reference."""
        try:
            if self._stale:
                self._refresh()
            if vrs != self._asked:  # mostly a host asks for the list of its last call
                self._way, self._asked = self._reading[(*vrs,)], [*vrs]
            cells, values = self._way
            return [*values(cells)]
        except KeyError:
            return self._first_reading(vrs)
        except BaseException as interrupt:
            self.put_off(interrupt)
            return self.get_real(vrs)

    def set_real(self, vrs: list[int], values: Sequence[float]) -> None:
        """Set values by reference."""
        try:
            stretch, order = self._writing[(*vrs,)]
            self._stale = True
            self.u[stretch] = order(values) if order else values
        except KeyError:
            self._first_writing(vrs, values)
        except BaseException as interrupt:
            self.put_off(interrupt)
            self.set_real(vrs, values)

    @unbroken
    def _first_reading(self, vrs: list[int]) -> list[float]:
        """Read by a list of references that is new, and remember how; it may be refused."""
        values = [float(value) for value in self._read(vrs, Real)]
        if vrs and not self.failed:
            remember(self._reading, vrs, reader([self._reals[vr] for vr in vrs]))
        return values

    @unbroken
    def _first_writing(self, vrs: list[int], values: Sequence[float]) -> None:
        """Write by a list of references that is new and, if all are inputs, remember how; it may be refused."""
        self._write(vrs, values, Real)
        if vrs and not self.failed and max(vrs) < len(self.u):
            remember(self._writing, vrs, writer(vrs, self.u))

    @unbroken
    def get_integer(self, vrs: list[int]) -> list[int]:
        return [int(value) for value in self._read(vrs, Integer)]

    @unbroken
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return [bool(value) for value in self._read(vrs, Boolean)]

    @unbroken
    def get_string(self, vrs: list[int]) -> list[str]:
        return [str(value) for value in self._read(vrs, String)]

    @unbroken
    def set_integer(self, vrs: list[int], values: Sequence[int]) -> None:
        self._write(vrs, values, Integer)

    @unbroken
    def set_boolean(self, vrs: list[int], values: Sequence[bool]) -> None:
        self._write(vrs, values, Boolean)

    @unbroken
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
        unit = f" {TABLE[variable.name].unit}" if kind is Real else ""
        said = f"{variable.name} = {value!r}{unit}"
        if variable.causality == Fmi2Causality.output and variable.initial != Fmi2Initial.exact:
            return f"setting {said}: it is an output"
        if self._running:
            return f"setting {said}: wanted before the end of initialization"
        return None

    def _refresh(self) -> None:
        """Renew the outputs after something was set."""
        raise NotImplementedError

    def _refuse(self, why: str) -> None:
        """Refuse a call that has no status of its own: by an exception, PythonFMU's only way, and only once."""
        self._say(why)
        if not self.failed:
            keep(self, type(self), self._messages())
            refusal = RuntimeError(printable(why))  # PythonFMU logs it, too
            self.failed = True  # at last: where an interrupt strikes before this, the refusal is made anew
            raise refusal

    def _say(self, why: str, cause: BaseException | None = None, status: Fmi2Status = Fmi2Status.error) -> None:
        """Log why something is refused; if the cause is an interrupt, it strikes again after this call."""
        self.log(printable(f"{self.instance_name}: {why}"), status, "logStatusError")
        if cause is not None and not isinstance(cause, Exception):
            self._put_off = again(cause, self.log_queue[-1])

    def put_off(self, interrupt: BaseException) -> None:
        """Let an interrupt strike after the present call; an exception of another kind is raised at once."""
        if isinstance(interrupt, Exception):
            raise interrupt
        words = f"{interrupt!r} fell into a call, which was completed; it goes on to the host"
        self._say(words, interrupt, Fmi2Status.warning)


def _nobody() -> None:
    """There are no messages yet."""


def printable(text: str) -> str:
    """The text as FMI wants a message to be: a format for printf, in which a bare % would end the host."""
    return text.replace("%", "%%")
