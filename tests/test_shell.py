"""The FMUs as a host sees them: the whole state, time, refusals, and calls in any order with any values."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import weakref
from collections.abc import Callable, Iterator
from math import nextafter
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from fmpy import extract
from host import DISCARD, FATAL, OK, Host

import build
import fmu_src.variables
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

MODELS = list(build.MODELS)
H = 1e-3
Loader = Callable[[str], Host]


@pytest.fixture(scope="session")
def unpacked(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("unpacked")
    return {model: Path(extract(dist / f"{model}.fmu", folder / model)) for model in MODELS}


@pytest.fixture
def load(unpacked: dict[str, Path]) -> Iterator[Loader]:
    hosts: list[Host] = []

    def loader(model: str) -> Host:
        hosts.append(Host(unpacked[model]))
        return hosts[-1]

    yield loader
    for host in hosts:
        host.free()


def drive(host: Host, first: int, last: int, h: float = H) -> list[list[float]]:
    """Steps with inputs that change with time, made of what the host has."""
    rows = []
    for k in range(first, last):
        if host.inputs:
            assert host.set({name: 1e-3 * np.sin(k + i) for i, name in enumerate(host.inputs)}) == OK
        assert host.step(k * h, h) == OK, host.log
        rows.append(host.get())
    return rows


def begun(load: Loader, model: str) -> Host:
    host = load(model)
    if model == "LqrController":
        host.fmu.setReal([host.reference["t_on"]], [0.0])
        host.fmu.setString([host.reference["activation"]], ["at t_on"])
    elif model == "Vehicle7DOF":
        host.fmu.setString([host.reference["road_sampling"]], ["end"])
    assert host.start() == OK
    return host


@pytest.mark.parametrize("model", MODELS)
def test_restored_state_and_steps_give_the_same_bits_here_in_another_instance_and_from_bytes(
    load: Loader, model: str
) -> None:
    host = begun(load, model)
    drive(host, 0, 30)
    state = host.state()
    data = host.to_bytes(state)
    expected = drive(host, 30, 60)
    assert host.restore(state) == OK
    assert drive(host, 30, 60) == expected
    for restored in (load(model), begun(load, model)):  # just instantiated, and under way with other parameters
        assert restored.restore(restored.from_bytes(data)) == OK
        assert drive(restored, 30, 60) == expected
    host.fmu.freeFMUState(state)


@pytest.mark.parametrize("model", MODELS)
def test_a_state_crosses_to_another_process(
    load: Loader, model: str, unpacked: dict[str, Path], tmp_path: Path
) -> None:
    host = begun(load, model)
    drive(host, 0, 30)
    (tmp_path / "state").write_bytes(host.to_bytes(host.state()))
    expected = drive(host, 30, 40)
    code = (
        f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / 'tests')!r}]\n"
        "from pathlib import Path\nfrom test_shell import Host, drive\n"
        f"host = Host(Path({str(unpacked[model])!r}))\n"
        f"assert host.restore(host.from_bytes(Path({str(tmp_path / 'state')!r}).read_bytes())) == 0\n"
        "print(repr(drive(host, 30, 40)))\nhost.free()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == repr(expected)


@pytest.mark.parametrize("model", MODELS)
def test_reset_returns_to_the_fresh_instance(load: Loader, model: str) -> None:
    host, fresh = begun(load, model), load(model)
    drive(host, 0, 20)
    assert host.status("Reset") == OK
    assert host.start() == fresh.start() == OK
    assert drive(host, 0, 20) == drive(fresh, 0, 20)


@pytest.mark.parametrize("model", MODELS)
def test_a_step_of_length_zero_changes_nothing(load: Loader, model: str) -> None:
    with_zero, without = begun(load, model), begun(load, model)
    drive(with_zero, 0, 20)
    before = with_zero.get()
    for t in (20 * H, nextafter(20 * H, 1.0), 20 * H + 1e-12):  # as sums of steps are
        assert with_zero.step(t, 0.0) == OK
        assert with_zero.get() == before
    drive(without, 0, 20)
    assert drive(with_zero, 20, 30) == drive(without, 20, 30)


def test_steps_of_varying_length_tend_to_the_same_motion(load: Loader) -> None:
    """From a perturbed start on a flat road, where a communication step may have any length."""

    def reached(steps: list[float]) -> np.ndarray:
        host = load("Vehicle7DOF")
        assert host.start(**{"body.heave": 0.01, "body.roll": 0.01}) == OK
        t = 0.0
        for h in steps:
            assert host.step(t, h) == OK
            t += h
        return np.array(host.get()[:14])

    varied = [1e-3, 7e-3, 1e-5, 0.0, 2.5e-2, 3.33e-4, 1e-1, 1 - 0.133343]
    regular = reached([1e-3] * 1000)
    np.testing.assert_allclose(reached(varied), regular, atol=1e-7 * np.abs(regular).max())


def test_a_road_that_starts_late_is_the_same_road_later(load: Loader) -> None:
    late, early = load("RoadExcitation"), load("RoadExcitation")
    assert late.start(time=100.0, t_start=100.0) == early.start() == OK
    for k in range(400):
        assert late.step(100.0 + k * H, H) == early.step(k * H, H) == OK
        np.testing.assert_allclose(late.get(), early.get(), atol=2e-10)


def test_a_long_step_over_all_corners_arrives_at_the_right_road(load: Loader) -> None:
    jump, walk = load("RoadExcitation"), load("RoadExcitation")
    assert jump.start() == walk.start() == OK
    assert jump.step(0.0, 0.26) == OK
    for k in range(26):
        assert walk.step(k * 0.01, 0.01) == OK
    np.testing.assert_allclose(jump.get()[:8], walk.get()[:8], atol=1e-12)


def test_the_road_follows_a_jump_in_time_with_steps_of_no_length_too(load: Loader) -> None:
    jumping, there = load("RoadExcitation"), load("RoadExcitation")
    assert jumping.start() == there.start(time=0.01) == OK
    assert jumping.step(0.01, 0.0) == OK
    assert jumping.get() == there.get()
    assert jumping.step(0.01, H) == there.step(0.01, H) == OK
    assert jumping.get() == there.get()
    assert max(map(abs, jumping.get()[8:])) < 1e-6  # bows of a step of 1 ms, not of the way from 0


@pytest.mark.parametrize("model", ["Vehicle7DOF", "LqrController"])
@pytest.mark.parametrize(("t", "h"), [(7.0, H), (0.004, H), (7.0, 0.0)])
def test_what_has_a_state_refuses_to_jump_in_time(load: Loader, model: str, t: float, h: float) -> None:
    host, honest = begun(load, model), begun(load, model)
    assert drive(host, 0, 5) == drive(honest, 0, 5)
    assert host.step(t, h) == DISCARD
    assert f"wanted a step from t = 0.005 s, which was reached, got one from {t!r} s" in host.log[-1]
    host.set({name: 1e-3 * np.sin(5 + i) for i, name in enumerate(host.inputs)})
    assert host.step(5 * H + 1e-12, H) == OK  # as sums of steps are
    assert drive(honest, 5, 6)[0] == host.get()


# ------------------------------------------------------------------ refusals
@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_an_input_that_is_not_finite_is_refused_and_can_be_repaired(load: Loader, value: float) -> None:
    host, honest = begun(load, "Vehicle7DOF"), begun(load, "Vehicle7DOF")
    drive(host, 0, 10)
    drive(honest, 0, 10)
    before = host.get()
    assert host.set({"h_rl": value, "force_fr": value}) == OK
    assert host.get() == before
    assert host.step(10 * H, H) == DISCARD
    assert f"force_fr = {value!r} N, h_rl = {value!r} m" in host.log[-1]
    assert "t = 0.01 s" in host.log[-1]
    assert drive(host, 10, 20) == drive(honest, 10, 20)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    ("t", "h"), [(0.0, -1.0), (float("nan"), H), (0.0, float("inf")), (0.0, float("nan")), (1e308, 1e308)]
)
def test_impossible_steps_are_refused(load: Loader, model: str, t: float, h: float) -> None:
    host = begun(load, model)
    assert host.step(t, h) == DISCARD
    assert "finite time and a step >= 0" in host.log[-1]
    drive(host, 0, 5)


def test_a_step_that_would_never_end_is_refused(load: Loader) -> None:
    host = begun(load, "Vehicle7DOF")
    assert host.step(0.0, 1e9) == DISCARD
    assert "internal steps of h_max = 0.0005 s" in host.log[-1]


def test_a_step_that_is_found_out_at_its_very_end_is_undone(load: Loader) -> None:
    """The rate of the road at the end of a step is asked for by the outputs alone, when the state is a step ahead."""
    pair = [load("Vehicle7DOF"), load("Vehicle7DOF")]
    for host in pair:
        host.set_string(host.reference["road_sampling"], "end")
        assert host.start(bp1=100.0) == OK
    host, honest = pair
    assert drive(host, 0, 10) == drive(honest, 0, 10)
    before = host.get()
    assert host.set({"dh_fl": 1e308}) == OK
    assert host.step(10 * H, H) == DISCARD
    assert "wheel_fl.heave_acceleration = inf m/s2" in host.log[-1]
    assert host.get() == before
    assert drive(host, 10, 20) == drive(honest, 10, 20)


@pytest.mark.parametrize(
    ("model", "values", "said"),
    [
        ("Vehicle7DOF", {"m": -1.0, "c2": float("nan")}, "m = -1.0 kg: wanted a finite number > 0; c2 = nan N/m"),
        ("Vehicle7DOF", {"body.roll": 2.0}, "body.roll = 2.0 rad"),
        (  # faults of start values, of single parameters and of the whole car, all at once
            "Vehicle7DOF",
            {"body.roll": 3.0, "h_max": 0.0, "m": -1.0, "m21": 21.0},
            "body.roll = 3.0 rad: wanted a finite number in [-1.5708, 1.5708]; m = -1.0 kg: wanted a finite number > 0"
            "; h_max = 0.0 s: wanted a finite number > 0; m21 = 21.0 kg, m22 = 22.0 kg: wanted equal masses",
        ),
        ("LqrController", {"lambda": 0.0, "b1": 0.0, "b2": 0.0, "H1": 1e200}, "initialization: "),
        ("Vehicle7DOF", {"a": 0.0, "b": 0.0}, "wheelbase"),
        ("RoadExcitation", {"v0": 0.0}, "v0 = 0.0 m/s"),
        ("LqrController", {"T": 0.0}, "T = 0.0 s: wanted an end of control after its start"),
    ],
)
def test_bad_parameters_are_refused_at_the_end_of_initialization(
    load: Loader, model: str, values: dict[str, float], said: str
) -> None:
    host = load(model)
    assert host.start(**values) == FATAL
    assert any(said in message for message in host.log), host.log
    assert host.step(0.0, H) == DISCARD  # quiet and safe ever after
    assert host.set_real([0], [1.0]) == OK
    assert all(np.isfinite(host.get()))


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda h: h.set({"body.heave_acceleration": 1.0}), "body.heave_acceleration = 1.0 m/s2: it is an output"),
        (lambda h: h.set({"m": 900.0}), "m = 900.0 kg: wanted before the end of initialization"),
        (lambda h: h.set({"body.heave": 0.1}), "body.heave = 0.1 m: wanted before the end of initialization"),
        (lambda h: h.set_string(h.reference["road_sampling"], "end"), "road_sampling = 'end': wanted before"),
        (lambda h: h.set_real([4711], [1.0]), "none of value reference 4711"),
        (lambda h: h.real(4711)[0], "none of value reference [4711]"),
        (lambda h: h.set_real([h.reference["road_sampling"]], [1.0]), "setting Real variables: there is none"),
    ],
)
def test_what_may_not_be_set_or_read_is_refused_once_and_the_host_lives(
    load: Loader, act: Callable[[Host], int], said: str
) -> None:
    host = begun(load, "Vehicle7DOF")
    drive(host, 0, 3)
    assert act(host) == FATAL
    assert any(said in message for message in host.log), host.log
    for _ in range(3):
        assert act(host) == OK  # PythonFMU itself ends the process at a second exception
    assert host.step(3 * H, H) == DISCARD


@pytest.mark.parametrize("text", ["100%s%n", "50%d", "%", "%%"])
def test_a_message_is_no_format_whatever_is_quoted_in_it(unpacked: dict[str, Path], text: str) -> None:
    """A logger hands it to printf, with the value of a string and the instance's name in it."""
    code = (
        f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / 'tests')!r}]\n"
        "from pathlib import Path\nfrom host import Host\n"
        f"host = Host(Path({str(unpacked['RoadExcitation'])!r}), name='road ' + sys.argv[1])\n"
        "host.set_string(host.reference['profile'], sys.argv[1])\n"
        "print(host.start(), host.step(-1.0, 1e-3), host.step(0.0, -1.0))\n"
        "print(*host.log, sep='\\n', flush=True)\nhost.free()\n"
    )
    done = subprocess.run([sys.executable, "-c", code, text], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    statuses, first, second = done.stdout.splitlines()
    assert statuses == f"{FATAL} {DISCARD} {DISCARD}"
    assert first.startswith(f"road {text}: initialization: profile = {text!r}: wanted one of")
    assert second.startswith("Fatal py exception")


def test_nor_is_the_text_of_the_exception_by_which_a_call_is_refused() -> None:
    """PythonFMU logs that, too, where no Python logger comes before."""
    road = RoadExcitation(instance_name="road", resources="")
    road.set_string([len(road.outputs) + len(road.reals)], ["100%s%n"])
    with pytest.raises(RuntimeError, match="profile = '100%%s%%n': wanted one of"):
        road.exit_initialization_mode()


def test_a_state_of_another_fmu_and_garbage_are_refused(load: Loader) -> None:
    road = begun(load, "RoadExcitation")
    data = road.to_bytes(road.state())
    own = begun(load, "Vehicle7DOF")
    good = own.to_bytes(own.state())
    assert b'"phase": [0.0' in good
    damaged = [good[:-1], good[1:], good + b" ", good.replace(b'"phase": [0.0', b'"phase": [NaN')]
    for garbage in (data, b"", b"not json", b"{}", b"[" * 100_000, *damaged):
        host = begun(load, "Vehicle7DOF")
        assert host.restore(host.from_bytes(garbage)) == FATAL
        assert "wanted one that this FMU has given" in " ".join(host.log)


def test_the_state_of_an_instance_that_has_failed_is_refused(load: Loader) -> None:
    """Restored, it would refuse every step without a word."""
    failed, host = load("Vehicle7DOF"), begun(load, "Vehicle7DOF")
    assert failed.start(m=-1.0) == FATAL
    assert host.restore(host.from_bytes(failed.to_bytes(failed.state()))) == FATAL
    assert "that of an instance that has failed" in " ".join(host.log)


# ------------------------------------------------------------------ interrupts
# as the callback of a weak reference: an interrupt falls due when the object goes, as if by a signal
FALL_DUE = ctypes.PYFUNCTYPE(None, ctypes.py_object)(("PyErr_SetInterrupt", ctypes.pythonapi))


def code_of(host: Host) -> Any:
    """The class that the host's FMU runs, without the one of the slave script; a process may hold other versions."""
    model = host.fmu.modelIdentifier
    return next(
        found.__mro__[1]
        for name, module in sys.modules.items()
        if name.startswith(f"{model.lower()}_")
        and (found := getattr(module, model, None))
        and found.identity == host.fmu.guid
    )


def interrupted(owner: Any, method: str, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Let Ctrl-C strike once in a method, or function of a module, when it is done; the list then has an entry."""
    plain, struck = getattr(owner, method), list[int]()

    def strike(*arguments: object, **named: object) -> object:
        result = plain(*arguments, **named)
        if not struck:
            struck.append(1)
            raise KeyboardInterrupt
        return result

    monkeypatch.setattr(owner, method, strike)
    return struck


@pytest.mark.parametrize("model", MODELS)
def test_an_interrupt_in_a_step_refuses_it_and_goes_on_to_the_host(
    load: Loader, model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    host, honest = begun(load, model), begun(load, model)
    drive(host, 0, 10)
    drive(honest, 0, 10)
    expected = drive(honest, 10, 20)
    with monkeypatch.context() as patch:
        struck = interrupted(code_of(host), "advance", patch)
        with pytest.raises(KeyboardInterrupt):
            host.step(10 * H, H)
    assert struck
    assert "t = 0.01 s: KeyboardInterrupt(); the state at t = 0.01 s is kept" in host.log[-1]
    assert drive(host, 10, 20) == expected


@pytest.mark.parametrize("method", ["feed_through", "memory"])
def test_an_interrupt_in_another_call_is_put_off_until_it_is_complete(
    load: Loader, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    host, honest = begun(load, "Vehicle7DOF"), begun(load, "Vehicle7DOF")
    for each in (host, honest):
        each.set({"force_fl": 10.0})
    expected = honest.get()
    with monkeypatch.context() as patch:
        struck = interrupted(code_of(host), method, patch)
        with pytest.raises(KeyboardInterrupt):
            host.get()
    assert struck and not host.log  # what is no refusal is a warning
    assert host.get() == expected
    assert drive(host, 0, 10) == drive(honest, 0, 10)


def test_an_interrupted_initialization_is_not_complete_and_can_be_made_anew(
    load: Loader, monkeypatch: pytest.MonkeyPatch
) -> None:
    host, honest = load("Vehicle7DOF"), begun(load, "Vehicle7DOF")
    host.set_string(host.reference["road_sampling"], "end")
    interrupted(code_of(host), "begin", monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        host.start()
    assert "initialization: KeyboardInterrupt()" in host.log[-1]
    assert host.step(0.0, H) == DISCARD
    assert host.status("ExitInitializationMode") == OK
    assert drive(host, 0, 5) == drive(honest, 0, 5)


@pytest.mark.parametrize("model", MODELS)
def test_an_interrupt_that_falls_due_when_a_step_is_made_leaves_it_made(
    load: Loader, model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a signal would: when the last of the step's own objects goes, after the last look for interrupts in it."""
    host, honest = begun(load, model), begun(load, model)
    assert drive(host, 0, 10) == drive(honest, 0, 10)
    plain, due = code_of(host).memory, list[Any]()

    class Kept(list[Any]):
        pass

    def memory(self: object) -> list[Any]:
        kept = Kept(plain(self))
        due.append(weakref.ref(kept, FALL_DUE))
        return kept

    with monkeypatch.context() as patch:
        host.set({name: 1e-3 * np.sin(10 + i) for i, name in enumerate(host.inputs)})
        patch.setattr(code_of(host), "memory", memory)
        with pytest.raises(KeyboardInterrupt):
            host.step(10 * H, H)
    assert due and not host.log
    assert host.get() == drive(honest, 10, 11)[0]
    assert drive(host, 11, 20) == drive(honest, 11, 20)


@pytest.mark.parametrize("act", [lambda car: car.exit_initialization_mode(), lambda car: car.set_real([4711], [1.0])])
def test_an_interrupt_in_a_refusal_makes_no_consent_of_it(
    act: Callable[[Vehicle7DOF], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    car = Vehicle7DOF(instance_name="car", resources="")
    car.set_real([car.reals.index("m") + len(car.u) + len(car.y)], [-1.0])
    with monkeypatch.context() as patch:
        struck = interrupted(fmu_src.variables, "keep", patch)
        with pytest.raises(RuntimeError, match=r"m = -1\.0 kg|none of value reference 4711"):
            act(car)
    assert struck and car.failed
    with pytest.raises(KeyboardInterrupt):
        car._get_log_queue().clear()


@pytest.mark.parametrize("where", ["_register", "_set_up", "messages"])
def test_an_interrupt_at_instantiation_goes_on_to_the_host_and_leaves_a_whole_instance(
    load: Loader, where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = begun(load, "Vehicle7DOF")
    code = code_of(honest)
    variables = sys.modules[next(c for c in code.__mro__ if c.__name__ == "Variables").__module__]
    with monkeypatch.context() as patch:
        struck = (
            interrupted(variables.Messages, "__init__", patch)
            if where == "messages"
            else interrupted(code, where, patch)
        )
        host = load("Vehicle7DOF")
    assert struck
    with pytest.raises(KeyboardInterrupt):
        host.status("SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
    host.set_string(host.reference["road_sampling"], "end")
    assert host.start() == OK
    assert drive(host, 0, 10) == drive(honest, 0, 10)


def test_serialized_states_survive_interrupts(monkeypatch: pytest.MonkeyPatch) -> None:
    car = Vehicle7DOF(instance_name="car", resources="")
    state, times = car._get_fmu_state(), []

    def interrupt(*_: object) -> bytes:
        times.append(1)
        if len(times) == 1:
            raise KeyboardInterrupt
        return b""

    monkeypatch.setattr("fmu_src.slave.json.dumps", lambda *_, **__: interrupt() or "{}")
    with pytest.raises(KeyboardInterrupt):
        assert len(car._fmu_state_to_bytes(state)) == 34
        while True:
            sleep(0.001)


STRUCK = """
import gc, os, signal, sys
sys.path[:0] = {path!r}
from pathlib import Path
from fmpy.fmi1 import FMICallException
from host import FATAL, Host
gc.disable()
clean = 0
folder, way = Path(sys.argv[1]), sys.argv[2]
for life in range(40):
    host = Host(folder)
    assert host.start() == 0
    if way == "at once":  # before the first instruction of a call, where nothing in it can catch it
        kind = next(k for n, m in sys.modules.items() if n.startswith("vehicle7dof_") and (k := m.Vehicle7DOF))
        def strike(self, *_):
            raise KeyboardInterrupt
        kind.do_step = strike
        assert host.step(0.0, 1e-3) == FATAL
        del kind.do_step
        assert host.step(0.0, 1e-3) == 2 and len(host.get()) == 29
    elif way == "resets":  # each makes the instance anew, when the library has given the old one up
        kind = next(k for n, m in sys.modules.items() if n.startswith("vehicle7dof_") and (k := m.Vehicle7DOF))
        def strike(self):
            del kind._register
            raise KeyboardInterrupt
        kind._register = strike
        try:
            assert host.status("Reset") == 0
            host.start()
        except KeyboardInterrupt:
            clean += 1
        assert host.start() == 0 == host.step(0.0, 1e-3)
    else:
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        signal.setitimer(signal.ITIMER_REAL, 0.001 + 0.0001 * life)
        try:
            for k in range(100_000):
                assert host.set({{"h_fl": 0.0}}) == host.step(0.001 * k, 0.001) == 0
                host.get("body.heave")
        except KeyboardInterrupt:
            clean += 1
        except (AssertionError, FMICallException):  # it struck before the first instruction of a call
            assert host.step(0.0, 1e-3) == 2 and "Fatal py exception" in host.log[0], host.log
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    host.free()
    litter = [dict(a=i) for i in range(2000)]
assert clean > {{"at once": -1, "resets": 39, "anywhere": 20}}[way], clean
print("alive", flush=True)
"""


@pytest.mark.parametrize("way", ["at once", "resets", "anywhere"])
def test_interrupts_leave_the_host_alive_wherever_they_strike(unpacked: dict[str, Path], way: str) -> None:
    code = STRUCK.format(path=[str(ROOT), str(ROOT / "tests")])
    command = [sys.executable, "-c", code, str(unpacked["Vehicle7DOF"]), way]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (0, "alive\n"), done.stderr


# ------------------------------------------------------------------ many lives
LIVES = """
import gc, os, resource, sys
sys.path[:0] = {path!r}
from pathlib import Path
from host import Host

def life():
    host = Host(Path(sys.argv[1]))
    assert host.start() == 0
    for k in range(5):
        assert host.step(1e-3 * k, 1e-3) == 0
        host.get()
    host.status("Terminate")
    host.free()

def resident():
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()

for _ in range(200):
    life()
before, paths = resident(), len(sys.path)
for _ in range(600):
    life()
grown = resident() - before
alive = [o for o in gc.get_objects() if any(c.__name__ == "Fmi2Slave" for c in type(o).__mro__)]
kinds = [o for o in gc.get_objects() if isinstance(o, type) and o.__name__ == Path(sys.argv[1]).name]
print(grown / 600, len(alive), len(kinds), len(sys.path) - paths, flush=True)
"""


def kept_of_a_life(folder: Path) -> float:
    """Bytes of a life of an instance that its process keeps, after 200, over 600; no instance, class or path stays."""
    code = LIVES.format(path=[str(ROOT), str(ROOT / "tests")])
    done = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    size, *alive = done.stdout.split()
    assert alive == ["0", "2", "0"]  # the class, and the slave script's
    return float(size)


@pytest.mark.parametrize("model", MODELS)
def test_many_lives_in_one_process_leave_only_behind_what_pythonfmu_leaves(
    unpacked: dict[str, Path], model: str
) -> None:
    """A stock FMU without content: 6.9 kB, with a class and an entry of `sys.path`, of which ours leave none."""
    assert kept_of_a_life(unpacked[model]) < 4_000  # bytes; measured: 2.5 to 2.9 kB


def test_runs_leave_no_file_behind(dist: Path, tmp_path: Path) -> None:
    code = (
        "import tempfile\n"
        f"tempfile.tempdir = {str(tmp_path)!r}\n"
        "from dataclasses import replace\n"
        "from analysis.cosimulation import simulate\n"
        "from analysis.scenario import read_scenario\n"
        "for _ in range(5): simulate(replace(read_scenario('bump'), stop_time=0.01))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.iterdir()) == []
