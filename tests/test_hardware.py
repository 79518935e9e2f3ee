"""What a real car puts between law and struts: the law of each part, alone and in the loop of the FMUs."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from fmpy import extract
from host import DISCARD, OK, Host
from numpy.testing import assert_allclose
from orders import observed_order

from analysis.cosimulation import simulate
from analysis.reference import closed_loop
from analysis.ride import ride
from analysis.scenario import read_scenario
from fmu_src.controller.design import design
from fmu_src.controller.hardware import Forces, Hardware, Loop, Memory
from fmu_src.controller.kalman import Filter, discretized, filter_for, sensor_matrices, steady_state
from fmu_src.controller.law import control_law, control_parameters
from fmu_src.quantities import FORCES, STATES, ParameterError
from fmu_src.vehicle.equations import equations_of_motion, strut_rates
from fmu_src.vehicle.linear import linearized
from fmu_src.vehicle.parameters import Car

Array = np.ndarray[Any, Any]
STATE_NAMES, FORCE_NAMES = [q.name for q in STATES], [q.name for q in FORCES]
EVERYTHING: dict[str, Any] = {
    "design": "full-car", "force_limit": 60.0, "actuator_lag": 0.01, "sample_time": 0.01, "feedback": "estimate",
    "actuators": "semi-active",
}  # fmt: skip
REST = [0.0] * 14


def heave_law(t: float, x: Any) -> Forces:
    """Forces of the heave alone, of four sizes."""
    return 100.0 * x[0], -200.0 * x[0], 300.0 * x[0], -400.0 * x[0]


def heave(z: float) -> list[float]:
    return [z, *[0.0] * 13]


# ------------------------------------------------------------------ each alone
def test_without_hardware_the_struts_do_what_the_law_asks_for() -> None:
    assert Hardware().ideal
    for some in (Hardware(force_limit=1.0), Hardware(actuator_lag=0.01), Hardware(sample_time=0.01)):
        assert not some.ideal
    assert not Hardware(actuators="semi-active").ideal
    loop, x = Loop(Hardware(), heave_law), heave(0.5)
    assert loop.forces(x, loop.sampled(0.0, x, Memory())) == heave_law(0.0, x)


def test_no_force_is_beyond_the_limit_and_those_within_are_left_alone() -> None:
    loop, x = Loop(Hardware(force_limit=120.0), heave_law), heave(0.5)
    assert loop.sampled(0.0, x, Memory()).reached == (50.0, -100.0, 120.0, -120.0)


def test_the_lag_has_its_closed_form_over_steps_of_any_length(rng: np.random.Generator) -> None:
    """f(t) = u (1 − exp(−t/τ)), whatever the steps that the time is cut into."""
    loop, x = Loop(Hardware(actuator_lag=0.02), heave_law), heave(0.5)
    m = loop.sampled(0.0, x, Memory())
    assert loop.forces(x, m) == (0.0, 0.0, 0.0, 0.0)
    t = 0.0
    for step in [*rng.uniform(1e-6, 0.03, 20).tolist(), 1e3]:
        m = loop.sampled(t + step, x, loop.elapsed(step, m))
        t += step
        assert_allclose(loop.forces(x, m), np.array(heave_law(t, x)) * -np.expm1(-t / 0.02), rtol=1e-12)


def test_forces_are_held_between_samples_which_are_the_first_times_at_or_after_the_multiples() -> None:
    """Samples every 10 ms, communication points every 3 ms: those at 0, 12, 21, 30, 42 … ms are samples."""
    loop, m, taken = Loop(Hardware(sample_time=0.01), heave_law), Memory(), []
    for k in range(20):
        x = heave(k + 1.0)
        m = loop.sampled(0.003 * k, x, m)
        if m.command == heave_law(0.0, x):
            taken.append(3 * k)
    assert taken == [0, 12, 21, 30, 42, 51]
    again = loop.sampled(0.003 * 19, heave(99.0), m)  # the same sample is not taken twice
    assert again == m


@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_no_force_is_held_beyond_the_end_of_control(lag: float) -> None:
    """Samples every 0.2 s, control to 0.45 s: the force of the sample at 0.4 s ends there, or dies away from there."""
    loop, x, m = Loop(Hardware(sample_time=0.2, actuator_lag=lag), heave_law, 0.45), heave(1.0), Memory()
    found = {}
    for k in range(12):
        m = loop.sampled(0.05 * k, x, loop.elapsed(0.05, m))
        found[k] = m.command
    assert found[8] == heave_law(0.4, x)
    assert found[9] == found[10] == found[11] == (0.0, 0.0, 0.0, 0.0)
    assert any(m.reached) is bool(lag)


def test_semi_active_forces_take_energy_out_and_stay_below_the_shut_valve(rng: np.random.Generator) -> None:
    rates = strut_rates(Car())
    loop = Loop(Hardware(actuators="semi-active", valve_damping=800.0), heave_law)
    seen = set()
    for _ in range(200):
        x = (0.1 * rng.normal(size=14)).tolist()
        asked = (300.0 * rng.normal(size=4)).tolist()
        u1, u2, u3, u4 = asked
        for u, f, rate in zip(asked, loop.passed(x, (u1, u2, u3, u4)), rates(x[:7], x[7:]), strict=True):
            assert f * rate <= 0.0
            assert abs(f) <= 800.0 * abs(rate) * (1 + 1e-15)
            if u * rate > 0.0:
                assert f == 0.0
            elif abs(u) <= 800.0 * abs(rate):
                assert f == u
            seen.add((u * rate > 0.0, abs(u) <= 800.0 * abs(rate)))
    assert len(seen) == 4


def test_strut_rates_are_those_of_the_travels(rng: np.random.Generator) -> None:
    car = Car()
    motion, rates = equations_of_motion(car), strut_rates(car)
    q, v, h = 0.1 * rng.normal(size=7), rng.normal(size=7), 1e-6
    level = [0.0] * 4
    ahead, behind = (np.array(motion(q + s * h * v, v, level, level, level)[1]) for s in (1.0, -1.0))
    assert_allclose(rates(q.tolist(), v.tolist()), (ahead - behind) / (2 * h), rtol=1e-8)


# ------------------------------------------------------------------ sensors and filter
def test_the_sensors_are_to_first_order_those_that_the_filter_knows(rng: np.random.Generator) -> None:
    quiet = Filter(Car(), np.zeros((14, 8)), [0.0] * 8, 1)
    C, D = map(np.array, sensor_matrices(Car()))
    x, u = rng.normal(size=14), rng.normal(size=4)

    def off(size: float) -> float:
        y = quiet.measured((size * x).tolist(), (size * u).tolist(), 0)
        return float(np.abs(y - size * (C @ x + D @ u)).max())

    assert not any(quiet.measured(REST, [0.0] * 4, 0))
    slope, bend = observed_order(off, [1e-2, 3e-3, 1e-3, 3e-4])
    assert slope > 1.95  # the remainder is of second order or higher
    assert bend < 0.5


def test_the_noise_is_that_of_its_seed_and_sample_with_the_deviations_asked_for() -> None:
    def noise(seed: int, samples: range) -> Array:
        sensors = filter_for(Car(), 0.01, 0.05, 5e-4, 3e-3, seed)
        return np.array([sensors.measured(REST, [0.0] * 4, k) for k in samples])

    first = noise(1, range(3000))
    np.testing.assert_array_equal(noise(1, range(100, 200)), first[100:200])
    assert not np.any(noise(2, range(100)) == first[:100])
    expected = np.repeat([0.05, 5e-4], 4)
    assert_allclose(first.std(axis=0), expected, rtol=0.06)  # 4.6 deviations of a deviation of 3000
    assert np.abs(first.mean(axis=0) / expected).max() < 4.6 / np.sqrt(3000)
    together = np.corrcoef(np.hstack([first[1:], first[:-1]]).T) - np.eye(16)
    assert np.abs(together).max() < 5.0 / np.sqrt(3000)


def test_the_filters_covariance_is_steady_and_is_that_of_its_errors(rng: np.random.Generator) -> None:
    """P against a simulation of 6,000 samples of the linear car on a random road, and against its own recursion."""
    car, step, sigmas, sigma_road = Car(), 0.01, [0.05] * 4 + [5e-4] * 4, 3e-3
    P, M = steady_state(car, step, sigmas, sigma_road)
    linear, C = linearized(car), np.array(sensor_matrices(car)[0])
    whole = discretized(car, linear.Bh, step)
    F, G = whole[:, :14], whole[:, 14:]
    left = P - M @ C @ P
    recursion = F @ left @ F.T + sigma_road**2 * G @ G.T
    scales = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    assert np.abs((recursion - P) / scales).max() < 1e-8
    assert np.linalg.eigvalsh(P / scales).min() > -1e-9
    assert np.abs(np.linalg.eigvals(F - F @ M @ C)).max() < 1.0
    sensors = filter_for(car, step, 0.05, 5e-4, sigma_road, 1)
    x, errors = np.zeros(14), []
    estimate: tuple[float, ...] = (0.0,) * 14
    for _ in range(6000):
        y = C @ x + rng.normal(size=8) * sigmas
        estimate = sensors.updated(estimate, [0.0] * 4, step, y.tolist())
        errors.append(x - estimate)
        x = F @ x + G @ (sigma_road * rng.normal(size=4))
    assert_allclose(np.std(errors[200:], axis=0), np.sqrt(np.diag(left)), rtol=0.15)


def test_estimates_between_unequal_samples_are_carried_on_exactly() -> None:
    """Two short ways are one long way, under the same forces."""
    sensors, u = filter_for(Car(), 0.01, 0.05, 5e-4, 3e-3, 1), [10.0, -20.0, 30.0, -40.0]
    start = tuple(0.01 * (k - 6.5) for k in range(14))
    C, D = map(np.array, sensor_matrices(Car()))

    def carried(x: tuple[float, ...], step: float) -> tuple[float, ...]:
        F = discretized(Car(), linearized(Car()).Bu, step) @ np.array([*x, *u])
        return sensors.updated(x, u, step, (C @ F + D @ u).tolist())  # with measurements that bring no news

    assert_allclose(carried(carried(start, 0.004), 0.009), carried(start, 0.013), rtol=1e-9, atol=1e-12)


def test_an_estimate_that_knows_all_stays_true_when_samples_fall_between_communication_points() -> None:
    """From rest under constant forces, on a level road, with sensors that hardly err: samples every 10 ms, looked at
    every 3 ms and so 12, 9, 9, 12 … ms apart."""
    pushed: Forces = (20.0, 10.0, -5.0, 15.0)
    quiet = Hardware(sample_time=0.01, feedback="estimate", sigma_acceleration=1e-5, sigma_travel=1e-8)
    loop, m, x = Loop(quiet, lambda t, x: pushed), Memory(), np.zeros(14)
    flow = discretized(Car(), linearized(Car()).Bu, 0.003)
    for k in range(60):
        m = loop.sampled(0.003 * k, x.tolist(), m)
        if m.time == 0.003 * k:
            assert_allclose(m.estimate, x, atol=1e-4)  # nonlinear sensors, too
        x = flow @ np.array([*x, *pushed])
    assert np.abs(x).max() > 1e-3


# ------------------------------------------------------------------ in the loop of the FMUs
def loop_error(step: float, **parameters: Any) -> float:
    """Largest deviation of any state over its maximum from a direct integration of the closed loop."""
    lqr = read_scenario("bump-lqr")
    scenario = replace(lqr, step=step, stop_time=1.0, parameters={**lqr.parameters, **parameters})
    run = simulate(scenario).trajectory
    expected = closed_loop(scenario, run.time)
    return float((np.abs(run.columns(STATE_NAMES) - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())


@pytest.mark.parametrize(
    "parameters",
    [
        {"design": "full-car", "T": 0.8},
        {"design": "full-car", "horizon": "infinite"},
        {"actuator_lag": 0.02},
        {"design": "full-car", "sample_time": 0.01, "actuator_lag": 0.02},
    ],
)
def test_in_the_loop_the_fmu_is_the_direct_integration_to_order_1(parameters: dict[str, Any]) -> None:
    slope, bend = observed_order(lambda H: loop_error(H, **parameters), [2e-3, 1e-3, 5e-4])
    assert slope == pytest.approx(1.0, abs=0.1)
    assert bend < 0.05


@pytest.mark.parametrize(
    "parameters", [{}, {"feedback": "estimate", "force_limit": 80.0}, {"sample_time": 0.2, "T": 0.45}]
)
def test_sampled_forces_are_held_by_the_master_too_and_nothing_is_lost(parameters: dict[str, Any]) -> None:
    assert loop_error(1e-3, **{"design": "full-car", "sample_time": 0.01, **parameters}) < 2e-7  # measured: 7.9e-8


def test_in_the_loop_the_estimate_tracks_the_states_and_samples_may_fall_between_communication_points() -> None:
    """The controller's hardware once more along the exported run: it gives the run's forces, and its estimate."""
    lqr = read_scenario("bump-lqr")
    parameters = {**lqr.parameters, "design": "full-car", "sample_time": 0.01, "feedback": "estimate"}
    scenario = replace(lqr, step=3e-3, stop_time=1.2, parameters=parameters)
    run = simulate(scenario).trajectory
    x, u = run.columns(STATE_NAMES), run.columns(FORCE_NAMES)
    control = control_parameters(scenario.parameters)
    loop, m = (
        Loop(control.hardware, control_law(control, design(control.model, infinite=False, span=2.0)), control.end),
        Memory(),
    )
    estimates = []
    for t, state, forces in zip(run.time.tolist(), x.tolist(), u, strict=True):
        m = loop.sampled(t, state, m)
        assert_allclose(loop.forces(state, m), forces, rtol=1e-5, atol=1e-6)
        estimates.append(m.estimate if m.time == t else [np.nan] * 14)
    late = ~np.isnan(np.array(estimates)[:, 0]) & (run.time > 0.3)
    off = np.sqrt(np.mean((np.array(estimates)[late] - x[late]) ** 2, axis=0) / np.mean(x[late] ** 2, axis=0))
    assert off[7:10].max() < 0.5, off  # rates of heave, roll, pitch; measured: 0.28, 0.43, 0.21
    assert off[1:3].max() < 0.7, off  # roll, pitch; how high the body is over a level road no sensor sees
    assert (
        loop_error(3e-3, **{key: parameters[key] for key in ("design", "sample_time", "feedback")}) < 2e-4
    )  # corners within steps


def settled_under_the_default_sensors(design_of: str, seeds: Sequence[int]) -> Array:
    """Times [s] at which heave, roll, pitch have settled, a row for each seed; infinite if not within 3 s."""
    lqr = read_scenario("bump-lqr")
    sensors: dict[str, Any] = {"design": design_of, "sample_time": 0.01, "feedback": "estimate"}
    noises = [{**lqr.parameters, **sensors, "seed": float(seed)} for seed in seeds]
    found = [ride(simulate(replace(lqr, stop_time=3.0, parameters=noise))).settled for noise in noises]
    return np.nan_to_num(found, nan=np.inf)


def test_with_the_default_sensors_control_is_better_than_none() -> None:
    """Without it: 1.56, 0.81, 0.90 s. Roll is as small as its noise: it may leave its 5 % late, as with seed 9."""
    half, full = (
        settled_under_the_default_sensors("half-car", (1, 5, 9)),
        settled_under_the_default_sensors("full-car", range(1, 10)),
    )
    for found in (half, full):
        assert np.all(found[:, [0, 2]] <= [1.45, 0.80]), found  # measured, seeds 1 to 24: 1.41, 0.63 at most
    assert np.median(full[:, 1]) < 0.70, full  # measured: 0.53


def test_all_together_in_the_loop_tend_to_the_direct_integration() -> None:
    errors = [loop_error(H, **EVERYTHING) for H in (2e-3, 5e-4)]
    assert errors[0] < 1e-2
    assert errors[1] < 0.4 * errors[0]


def test_in_the_loop_forces_keep_their_limit_and_valves_take_energy_out() -> None:
    lqr = read_scenario("bump-lqr")
    whole = simulate(replace(lqr, stop_time=1.0, parameters={**lqr.parameters, **EVERYTHING}))
    run, ridden = whole.trajectory, ride(whole)
    assert ridden.energy_spent < 1e-3 * ridden.energy_taken  # of struts that turn within a step; measured: 6.1e-4
    u, x = run.columns(FORCE_NAMES), run.columns(STATE_NAMES)
    rates = np.array([strut_rates(Car())(row[:7], row[7:]) for row in x.tolist()])
    assert np.abs(u).max() <= 60.0
    assert np.all(u * rates <= 0.0)
    assert np.abs(u).max() > 10.0


# ------------------------------------------------------------------ state, refusals
@pytest.fixture(scope="module")
def loader(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Host]:
    folder = Path(extract(dist / "LqrController.fmu", tmp_path_factory.mktemp("controller")))

    def load(parameters: dict[str, Any] = EVERYTHING) -> Host:
        host = Host(folder)
        give(host, parameters)
        return host

    return load


def give(host: Host, parameters: dict[str, Any]) -> None:
    """Hardware, at work from the start."""
    for name, value in {**parameters, "activation": "at t_on", "t_on": 0.0}.items():
        given = host.set_string(host.reference[name], value) if isinstance(value, str) else host.set({name: value})
        assert given == OK


def drive(host: Host, first: int, last: int, reads: int = 0, halts: int = 0) -> list[list[float]]:
    """Steps of 3 ms, so that samples fall between; before each, outputs are read and steps of no length are made."""
    rows = []
    for k in range(first, last):
        assert host.set({name: 1e-3 * np.sin(k + i) for i, name in enumerate(host.inputs)}) == OK
        for _ in range(reads):
            host.get()
        for _ in range(halts):
            assert host.step(k * 3e-3, 0.0) == OK
        assert host.step(k * 3e-3, 3e-3) == OK, host.log
        rows.append(host.get())
    return rows


HARDWARE: list[dict[str, Any]] = [
    {},
    {"force_limit": 60.0},
    {"actuator_lag": 0.01},
    {"sample_time": 0.005},
    {"sample_time": 0.005, "actuator_lag": 0.01, "design": "full-car"},
    {"sample_time": 0.005, "feedback": "estimate"},
    {"actuators": "semi-active"},
    EVERYTHING,
]


@pytest.mark.parametrize("parameters", HARDWARE)
def test_neither_reading_nor_halting_changes_the_motion(
    loader: Callable[..., Host], parameters: dict[str, Any]
) -> None:
    """A host may read outputs whenever it likes: what is looked at, and when, is for its steps to say."""
    runs = []
    for reads, halts in ((0, 0), (2, 0), (0, 2), (1, 1)):
        host = loader(parameters)
        assert host.start() == OK
        runs.append(drive(host, 0, 40, reads, halts))
        host.free()
    assert np.abs(runs[0]).max() > 1.0
    assert runs == [runs[0]] * 4


@pytest.mark.parametrize("parameters", [p for p in HARDWARE if "force_limit" not in p])
@pytest.mark.parametrize("read", [False, True])
def test_inputs_that_ask_for_infinite_forces_can_be_repaired(
    loader: Callable[..., Host], parameters: dict[str, Any], read: bool
) -> None:
    host, honest = loader(parameters), loader(parameters)
    assert host.start() == honest.start() == OK
    assert drive(host, 0, 15) == drive(honest, 0, 15)
    for step in (6e-3, 0.0):  # a sample falls into the first
        assert host.set(dict.fromkeys(host.inputs, 1e308)) == OK
        if read:
            assert np.isfinite(host.get()).all()
        assert host.step(15 * 3e-3, step) == DISCARD or (step == 0.0 and host.get() == honest.get())
        assert np.isfinite(host.get()).all()
    assert drive(host, 15, 30) == drive(honest, 15, 30)
    for each in (host, honest):
        each.free()


def test_the_whole_memory_travels_with_the_state_and_goes_with_reset(loader: Callable[..., Host]) -> None:
    host, fresh = loader(), loader()
    assert host.start() == fresh.start() == OK
    drive(host, 0, 25)
    state = host.state()
    data = host.to_bytes(state)
    expected = drive(host, 25, 50)
    assert np.abs(expected).max() > 1.0
    assert host.restore(state) == OK
    assert drive(host, 25, 50) == expected
    assert fresh.restore(fresh.from_bytes(data)) == OK
    assert drive(fresh, 25, 50) == expected
    host.fmu.freeFMUState(state)
    again = loader()
    assert again.start() == OK
    beginning = drive(again, 0, 25)
    assert fresh.status("Reset") == OK
    give(fresh, EVERYTHING)
    assert fresh.start() == OK
    assert drive(fresh, 0, 25) == beginning
    for each in (host, fresh, again):
        each.free()


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"feedback": "estimate"}, r"sample_time = 0\.0 s: wanted a sample time > 0"),
        ({"seed": 1.5}, r"seed = 1\.5: wanted a whole number"),
        ({"force_limit": -1.0}, r"force_limit = -1\.0 N: wanted"),
        ({"actuator_lag": float("nan")}, r"actuator_lag = nan s: wanted"),
        ({"sigma_travel": 0.0, "feedback": "estimate", "sample_time": 0.01}, r"sigma_travel = 0\.0 m: wanted"),
        ({"actuators": "passive"}, r"actuators = 'passive': wanted one of active, semi-active"),
        ({"feedback": "estimate", "sample_time": 0.01, "m21": 1.0}, r"m21 = 1\.0 kg, m22 = 22\.0 kg: wanted equal"),
    ],
)
def test_hardware_that_cannot_be_is_refused_by_name(parameters: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        control_parameters(parameters)


def test_a_filter_that_needs_missing_packages_says_what_to_install_and_stored_designs_need_none() -> None:
    code = (
        "import sys; sys.modules['numpy'] = None\n"
        "from pathlib import Path\n"
        "from fmu_src.controller.lqr_controller import LqrController\n"
        "for feedback in ('states', 'estimate'):\n"
        "    c = LqrController(instance_name='c', resources=sys.argv[1])\n"
        "    c.chosen[:] = ['finite', 'at t_on', 'full-car', 'semi-active', feedback]\n"
        "    c.p[c.reals.index('sample_time')] = 0.01\n"
        "    c.p[c.reals.index('actuator_lag')] = 0.01\n"
        "    c.setup_experiment(0.3)\n"
        "    try:\n        c.exit_initialization_mode()\n        c.u[:] = [0.01] * 14\n"
        "        print(c.do_step(0.3, 0.1), c.do_step(0.4, 0.1), any(c.y))\n"
        "    except RuntimeError as refusal: print(refusal)\n"
    )
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(ROOT / "dist" / "LqrController.fmu") as archive:
        archive.extract("resources/lqr_design_full_car.json", folder)
        command = [sys.executable, "-c", code, f"{folder}/resources"]
        said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    assert said[0] == "True True True"
    assert "feedback = 'estimate' needs a filter" in said[1]
    assert "not installed: numpy. Install numpy and scipy" in said[1]
