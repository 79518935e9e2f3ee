"""2,000 random sequences of FMI calls, legal and illegal order, any values: no crash, no hang, no silent nan."""

from __future__ import annotations

from math import isfinite
from pathlib import Path

import pytest
from fmpy import extract
from host import OK, Host
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, initialize, invariant, rule

import build

ANY = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from([0.0, 1e-3, 0.01, 1.0, 1e300, -1e300, 5e-324])
STEPS = st.sampled_from([0.0, 1e-9, 1e-3, 1e-3, 1e-3, 0.01, 0.3, 5.0, 1e6, 1e300]) | ANY
STRINGS = [
    "end",
    "start",
    "bump",
    "fourier",
    "infinite",
    "full-car",
    "semi-active",
    "estimate",
    "at t_on",
    "",
    "ψ",
    "%s%n",
]
HARDWARE = ["sample_time", "actuator_lag", "force_limit", "valve_damping", "t_on", "T", "seed"]
TIMES = st.sampled_from([0.0, 1e-3, 0.25, 100.0, -5.0]) | ANY


UNPACKED: dict[str, Path] = {}


@pytest.fixture(scope="module", autouse=True)
def unpacked(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    for model in build.MODELS:
        UNPACKED[model] = Path(extract(dist / f"{model}.fmu", tmp_path_factory.mktemp("fuzz") / model))


class AnyCalls(RuleBasedStateMachine):
    """One instance of one of the FMUs, and states that it or an earlier moment of it gave."""

    states: Bundle[tuple[bytes, bool]] = Bundle("states")

    @initialize(model=st.sampled_from(list(build.MODELS)), start=st.booleans())
    def instantiate(self, model: str, start: bool) -> None:
        self.host, self.initialized = Host(UNPACKED[model]), start
        if start:
            assert self.host.start() == OK

    def teardown(self) -> None:
        self.host.free()

    @rule(time=TIMES)
    def setup_experiment(self, time: float) -> None:
        self.host.status("SetupExperiment", 0, 0.0, time, 0, 0.0)

    @rule(call=st.sampled_from(["EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset"]))
    def change_phase(self, call: str) -> None:
        done = self.host.status(call) == OK and not any("initialization:" in message for message in self.host.log)
        kept = self.initialized and call == "EnterInitializationMode"
        self.initialized = done and (call == "ExitInitializationMode" or kept)  # after Terminate it echoes, too

    @rule(t=TIMES, h=STEPS)
    def step(self, t: float, h: float) -> None:
        self.host.step(t, h)

    @rule(values=st.lists(ANY, min_size=16, max_size=16))
    def set_all_inputs(self, values: list[float]) -> None:
        if self.host.inputs:
            self.host.set(dict(zip(self.host.inputs, values, strict=False)))

    @rule(references=st.lists(st.integers(0, 90), max_size=5), data=st.data())
    def set_anything(self, references: list[int], data: st.DataObject) -> None:
        self.host.set_real(references, [data.draw(ANY) for _ in references])

    @rule(reference=st.integers(0, 90), text=st.sampled_from(STRINGS))
    def set_a_string(self, reference: int, text: str) -> None:
        self.host.set_string(reference, text)

    @rule(reference=st.integers(0, 90), value=st.booleans())
    def set_a_boolean(self, reference: int, value: bool) -> None:
        self.host.set_boolean(reference, value)

    @rule(name=st.sampled_from(HARDWARE), value=st.sampled_from([0.0, 0.003, 0.01, 50.0]))
    def set_hardware(self, name: str, value: float) -> None:
        if name in self.host.reference:
            self.host.set({name: value})

    @rule(reference=st.integers(0, 90), value=st.integers(-(2**31), 2**31 - 1))
    def set_an_integer(self, reference: int, value: int) -> None:
        self.host.tried("setInteger", [reference], [value])

    @rule(reference=st.integers(0, 90) | st.just(2**31))
    def get_anything(self, reference: int) -> None:
        self.host.real(reference)
        for kind in ("Integer", "Boolean", "String"):
            self.host.tried(f"get{kind}", [reference])

    @rule(target=states)
    def get_state(self) -> tuple[bytes, bool]:
        return self.host.to_bytes(self.host.state()), self.initialized

    @rule(state=states)
    def set_state(self, state: tuple[bytes, bool]) -> None:
        data, initialized = state
        if self.host.restore(self.host.from_bytes(data)) == OK:
            self.initialized = initialized

    @invariant()
    def outputs_are_never_silently_not_finite(self) -> None:
        values = dict(zip(self.host.outputs, self.host.get(), strict=True))
        if self.initialized:  # before, start values echo what was set
            assert all(map(isfinite, values.values())), values


AnyCalls.TestCase.settings = settings(
    max_examples=2000,
    stateful_step_count=12,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)
TestAnyCalls = AnyCalls.TestCase
