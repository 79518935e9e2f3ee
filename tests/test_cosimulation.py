"""The FMUs under the master, against an independent integration of the Lagrangian model: accuracy and orders."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import cache
from pathlib import Path
from typing import Any

import lagrangian
import numpy as np
import pytest
from orders import observed_order

from analysis.check import check
from analysis.cosimulation import simulate
from analysis.errors import CosimError, InputError
from analysis.reference import Parameters, closed_loop
from analysis.scenario import Scenario, built_in_scenarios, read_scenario
from fmu_src.quantities import FORCES, STATES
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car

Array = np.ndarray[Any, Any]
NAMES = [q.name for q in STATES]
COARSE = {"h_max": 1.0}  # one internal step per communication step


@cache
def truth(stop: float, count: int) -> Array:
    """States of the default car on the default bump at count + 1 times, from the energies, corners met exactly."""
    p = RoadParameters()
    h, dh, corners = lagrangian.bump(p.A, p.Lambda, p.v0, p.delays)
    times = np.linspace(0, stop, count + 1)
    return lagrangian.integrate(asdict(Car()), (h, dh), corners, np.zeros(14), times)


def bump_error(stop: float, step: float, **changes: Any) -> float:
    """Largest deviation of any state over its maximum; the run's parameters are the default bump's and the changes."""
    bump = read_scenario("bump")
    parameters = {**bump.parameters, **changes.pop("parameters", {})}
    run = simulate(replace(bump, step=step, stop_time=stop, parameters=parameters, **changes)).trajectory
    expected = truth(stop, len(run.time) - 1)
    return float((np.abs(run.columns(NAMES) - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())


def test_the_default_run_is_right_to_a_millionth_of_each_states_maximum() -> None:
    assert bump_error(5.0, 1e-3) < 1e-6  # measured: 7.9e-8


def test_with_smaller_steps_it_is_right_to_a_billionth() -> None:
    assert bump_error(1.0, 1.25e-4) < 1e-9  # measured: 3.0e-10


def test_road_at_the_end_of_the_step_couples_with_order_at_least_3() -> None:
    """Corners of the bump (multiples of 10 ms) are communication points; one internal step per communication step."""
    slope, bend = observed_order(lambda H: bump_error(0.5, H, parameters=COARSE), [2e-3, 1e-3, 5e-4, 2.5e-4])
    assert 3.9 < slope < 4.2  # with the bow: that of the Runge–Kutta method itself
    assert bend < 0.1


def test_road_at_the_start_of_the_step_couples_with_order_2() -> None:
    start = {"road_sampling": "start"}
    slope, bend = observed_order(
        lambda H: bump_error(0.5, H, coupling="jacobi", parameters=start), [2e-3, 1e-3, 5e-4, 2.5e-4]
    )
    assert slope == pytest.approx(2.0, abs=0.1)
    assert bend < 0.1


def test_a_corner_on_a_communication_point_costs_no_accuracy() -> None:
    """Step 1 ms with all corners on the grid, against the same bump with corners in the middle of steps."""
    bump = read_scenario("bump")

    def deviation(delay: float) -> float:
        parameters = {**bump.parameters, "t_start": delay, "tau0": 0.02}
        run = simulate(replace(bump, stop_time=0.6, parameters=parameters))
        return check(run)[0].measured

    on, off = deviation(0.01), deviation(0.0105)
    assert on < 1e-7
    assert off > 20 * on  # a corner inside a step does cost


def test_held_control_forces_couple_with_order_1() -> None:
    lqr = read_scenario("bump-lqr")

    def error(step: float) -> float:
        run = simulate(replace(lqr, step=step, stop_time=1.0)).trajectory
        expected = closed_loop(lqr, run.time)
        return float((np.abs(run.columns(NAMES) - expected).max(axis=0) / np.abs(expected).max(axis=0)).max())

    slope, bend = observed_order(error, [4e-3, 2e-3, 1e-3, 5e-4])
    assert slope == pytest.approx(1.0, abs=0.1)
    assert bend < 0.1


@pytest.mark.parametrize("name", built_in_scenarios())
def test_every_built_in_scenario_is_a_motion_and_keeps_its_energy_books(name: str) -> None:
    scenario = read_scenario(name)
    for finding in check(simulate(replace(scenario, stop_time=2.5))):
        assert finding.holds, finding


@pytest.mark.parametrize(("step", "stop", "rows"), [(1e-3, 0.0105, 12), (3e-3, 0.01, 5), (0.1, 0.05, 2)])
def test_a_stop_time_between_two_steps_is_met_exactly(step: float, stop: float, rows: int) -> None:
    run = simulate(Scenario(name="short", step=step, stop_time=stop)).trajectory
    assert len(run.time) == rows
    assert run.time[-1] == stop
    np.testing.assert_array_equal(run.time[:-1], step * np.arange(rows - 1))


def test_start_values_reach_the_states_and_the_first_accelerations() -> None:
    start = {"body.heave": 0.01, "der(axle_r.roll)": 0.5}
    parameters: Parameters = {"profile": "flat", "enabled": False, "road_sampling": "end"}
    run = simulate(Scenario(name="perturbed", start=start, stop_time=0.1, parameters=parameters))
    first = {name: run.trajectory[name][0] for name in NAMES}
    assert first == {**dict.fromkeys(NAMES, 0.0), **start}
    assert run.trajectory["body.heave_acceleration"][0] == pytest.approx(-2 * (15000 + 14000) * 0.01 / 870)
    assert check(run)[0].holds


def test_forces_at_the_start_act_in_the_first_accelerations() -> None:
    parameters: Parameters = {"profile": "flat", "horizon": "infinite", "activation": "at t_on", "t_on": 0.0}
    run = simulate(
        Scenario(name="pushed", start={"body.heave": 0.01}, stop_time=0.01, parameters=parameters)
    ).trajectory
    forces = run.columns([q.name for q in FORCES])[0]
    assert np.all(forces < 0)
    expected = (forces.sum() - 2 * (15000 + 14000) * 0.01) / 870
    assert run["body.heave_acceleration"][0] == pytest.approx(expected, rel=1e-12)


def test_a_controller_with_other_parameters_designs_itself_at_initialization() -> None:
    parameters: Parameters = {
        "lambda": 3e10,
        "horizon": "infinite",
        "activation": "at t_on",
        "t_on": 0.0,
        "profile": "flat",
    }
    scenario = Scenario(name="other", start={"body.heave": 0.01}, stop_time=0.2, step=1e-4, parameters=parameters)
    run = simulate(scenario).trajectory
    expected = closed_loop(scenario, run.time)
    assert np.abs(run.columns(NAMES) - expected).max() < 2e-3 * np.abs(expected).max()


def test_any_variables_can_be_recorded() -> None:
    bump = replace(read_scenario("bump"), stop_time=0.05)
    full = simulate(bump).trajectory
    few = simulate(replace(bump, record=("tyre_rr.force", "body.heave", "cp2"))).trajectory
    assert few.names == ("tyre_rr.force", "body.heave", "cp2")
    np.testing.assert_array_equal(few["body.heave"], full["body.heave"])
    assert set(few["cp2"]) == {160000.0}
    with pytest.raises(InputError, match=r"no component has a real variable 'speed'.*body\.heave"):
        simulate(replace(bump, record=("speed",)))


def test_repeating_a_run_from_its_record_gives_the_same_bits() -> None:
    first = simulate(replace(read_scenario("bump-lqr"), stop_time=0.6))
    again = simulate(Scenario(**{**first.record["scenario"], "record": ()}))
    np.testing.assert_array_equal(first.trajectory.values, again.trajectory.values)


def test_a_run_away_state_stops_the_run_and_is_named_with_its_time() -> None:
    unstable = replace(read_scenario("bump"), parameters={"h_max": 10.0, "b1": 1e6, "enabled": False}, step=0.02)
    with pytest.raises(CosimError, match=r"vehicle: step of 0.02 s at t = .*finite numbers: \S+ = \S+ \S+.*t = "):
        simulate(unstable)


def test_all_faults_of_parameters_come_back_in_the_fmus_own_words() -> None:
    parameters: Parameters = {"m21": 20.0, "s2": 0.0, "J2": 0.0}
    with pytest.raises(CosimError, match=r"vehicle: .*m21 = 20.0 kg.*roll inertia"):
        simulate(replace(read_scenario("bump"), parameters=parameters))


def test_whatever_a_component_raises_at_the_start_is_a_refusal_with_its_words() -> None:
    undamped: Parameters = {"lambda": 0.0, "b1": 0.0, "b2": 0.0, "horizon": "infinite"}
    for parameters in (undamped, {"s2": 1e200}):
        with pytest.raises(CosimError, match="initialization: "):
            simulate(replace(read_scenario("bump"), parameters={**parameters, "enabled": True}))


@pytest.mark.parametrize("v0", [9.0, 11.0, 13.9])
def test_corners_within_steps_are_judged_by_their_own_tolerance(v0: float) -> None:
    bump = read_scenario("bump")
    deviation, energy, *_ = check(simulate(replace(bump, stop_time=1.0, parameters={**bump.parameters, "v0": v0})))
    assert deviation.holds
    assert energy.holds
    assert deviation.tolerance == pytest.approx(1e-3, rel=1e-12)  # its step is that of the rows


def test_no_tolerance_lets_a_wrong_run_pass_however_long_its_steps() -> None:
    coarse = replace(read_scenario("bump"), coupling="jacobi", step=0.02, parameters={"road_sampling": "start"})
    assert not check(simulate(coarse))[0].holds


@pytest.mark.parametrize(
    ("start", "step", "stop"), [(0.0, 0.1, 0.3), (1e5, 1e-3, 1e5 + 0.0505), (1e6, 1e-3, 1e6 + 0.1)]
)
def test_the_last_time_is_the_stop_time_and_all_times_differ(start: float, step: float, stop: float) -> None:
    parameters: Parameters = {"profile": "flat", "enabled": False}
    run = simulate(Scenario(name="late", start_time=start, step=step, stop_time=stop, parameters=parameters)).trajectory
    assert run.time[-1] == stop
    assert np.all(np.diff(run.time) > 0.4 * step)


def test_unpacked_folders_are_removed_after_success_and_after_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    simulate(Scenario(name="ok", stop_time=0.01))
    with pytest.raises(CosimError):
        simulate(Scenario(name="refused", stop_time=0.01, parameters={"m21": 1.0}))
    with pytest.raises(InputError):
        simulate(Scenario(name="unknown", stop_time=0.01, record=("nothing",)))
    assert list(tmp_path.iterdir()) == []


def test_a_missing_or_broken_system_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no such file; build it with: python3 build\.py build"):
        simulate(Scenario(name="x"), tmp_path / "none.ssp")
    (tmp_path / "broken.ssp").write_bytes(b"not a zip")
    with pytest.raises(InputError, match="cannot be unpacked"):
        simulate(Scenario(name="x"), tmp_path / "broken.ssp")


def test_jacobi_and_gauss_seidel_tend_to_the_same_motion() -> None:
    lqr = replace(read_scenario("bump-lqr"), stop_time=0.6)
    start = {**lqr.parameters, "road_sampling": "start"}

    def gap(step: float) -> float:
        sequential = simulate(replace(lqr, step=step)).trajectory.columns(NAMES)
        parallel = simulate(replace(lqr, step=step, coupling="jacobi", parameters=start)).trajectory.columns(NAMES)
        return float(np.abs(sequential - parallel).max())

    assert gap(5e-4) < 0.6 * gap(1e-3)
