"""Base of the three slaves: variables declared from the table, fast access by value reference, XML, refusals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from typing import ClassVar
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Boolean, DefaultExperiment, Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real, String
from pythonfmu.enums import Fmi2Status

from .quantities import PARAMETERS, UNITS, Choice, ParameterError, Quantity, refuse

RELEASED = "2026-11-22T00:00:00Z"  # of the version in pyproject.toml, not of the build: same sources, same bytes


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
        self._register()

    def _register(self) -> None:
        self._cells: list[tuple[list, int]] = []
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
        self._cells.append((cells, index))

    # ------------------------------------------------------------------ what a subclass does
    def configure(self) -> None:
        """Read the parameters; raise ParameterError with every fault."""

    def begin(self) -> None:
        """Take the state from start values and inputs at `self.time`."""

    def advance(self, t: float, step: float) -> None:
        """Make a step from t to t + step [s]; raise StepError, with the state untouched, if that cannot be done."""
        raise NotImplementedError

    def feed_through(self) -> None:
        """Renew those outputs that depend on inputs directly."""

    def parameters(self) -> dict[str, float]:
        """Real parameters by name."""
        return dict(zip(self.reals, self.p, strict=True))

    # ------------------------------------------------------------------ FMI calls
    def get_real(self, vrs: list[int]) -> list[float]:
        """Values by reference; all outputs at once take no loop."""
        if self._stale:
            self._refresh()
        if vrs == self._output_refs:
            return self.y
        cells = self._cells
        return [float(where[i]) for where, i in (cells[vr] for vr in vrs)]

    def set_real(self, vrs: list[int], values: Sequence[float]) -> None:
        """Set values by reference; all inputs at once take no loop."""
        self._stale = True
        if vrs == self._input_refs:
            self.u[:] = values
            return
        cells = self._cells
        for vr, value in zip(vrs, values, strict=True):
            where, i = cells[vr]
            where[i] = value

    def setup_experiment(self, start_time: float, *_: object) -> None:
        """Take the start time [s]."""
        self.time = start_time

    def exit_initialization_mode(self) -> None:
        """Check all parameters and start values; refuse with every fault named."""
        try:
            refuse(q.fault(x) for q, x in zip(self.outputs[: self.settable], self.y, strict=False))
            self.configure()
            self.begin()
            self.feed_through()
        except ParameterError:
            self._failed = True
            raise
        self._running, self._stale = True, False

    def do_step(self, current_time: float, step_size: float) -> bool:
        """One communication step; False (fmi2Discard) and a message in the log where it is refused."""
        if self._failed:
            return False
        try:
            self.advance(current_time, step_size)
        except StepError as refusal:
            self.log(f"{self.instance_name}: {refusal}", Fmi2Status.error, "logStatusError")
            return False
        self.time = current_time + step_size
        self._stale = False
        return True

    def _refresh(self) -> None:
        """Outputs for changed inputs; before the end of initialization also for changed parameters and start values."""
        if self._failed:
            return
        if not self._running:
            try:
                self.configure()
            except ParameterError:
                return  # said at the end of initialization, when the host has set all it wants to set
            self.begin()
        self.feed_through()
        self._stale = False

    # ------------------------------------------------------------------ model description
    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """PythonFMU's description, completed: units, limits, exact start values, UTC date, structure."""
        root = super().to_xml(model_options or {})
        root.set("generationDateAndTime", RELEASED)
        root.find("CoSimulation").set("needsExecutionTool", "false")
        described = {q.name: q for q in (*self.inputs, *self.outputs, *(PARAMETERS[name] for name in self.reals))}
        for variable in root.iter("ScalarVariable"):
            real = variable.find("Real")
            if real is not None:
                _describe(real, described[variable.get("name", "")])
        root.insert(list(root).index(root.find("LogCategories")), self._units(described.values()))
        self._structure(root.find("ModelStructure"))
        return root

    @staticmethod
    def _units(quantities: Iterable[Quantity]) -> Element:
        definitions = Element("UnitDefinitions")
        for unit in dict.fromkeys(q.unit for q in quantities):
            exponents = {base: str(power) for base, power in UNITS[unit].items()}
            SubElement(SubElement(definitions, "Unit", name=unit), "BaseUnit", exponents)
        return definitions

    def _structure(self, structure: Element) -> None:
        """Outputs and InitialUnknowns with the dependencies that are true of them."""
        structure.clear()
        index = {v.name: str(i) for i, v in enumerate(self.vars.values(), start=1)}
        known = (*self.outputs[: self.settable], *self.inputs)
        outputs, initial = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
        for i, q in enumerate(self.outputs):
            depends = self.dependencies.get(q.name, ())
            SubElement(outputs, "Unknown", index=index[q.name], dependencies=" ".join(index[n] for n in depends))
            if i >= self.settable:
                at_start = [index[k.name] for k in known if k in self.outputs or k.name in depends]
                SubElement(initial, "Unknown", index=index[q.name], dependencies=" ".join(sorted(at_start, key=int)))


def _describe(real: Element, q: Quantity) -> None:
    real.set("unit", q.unit)
    low = 0.0 if q.positive else q.low
    for name, limit in (("min", low), ("max", q.high)):
        if abs(limit) < float("inf"):
            real.set(name, repr(limit))
    if q.nominal != 1.0:
        real.set("nominal", repr(q.nominal))
    if "start" in real.attrib:
        real.set("start", repr(float(q.start)))
