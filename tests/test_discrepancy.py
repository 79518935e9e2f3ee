"""Exported trajectories against the linear approximation (2.3): the same plant, the order in amplitude, the claims."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from orders import observed_order
from scipy.integrate import solve_ivp

from analysis import discrepancy
from analysis.__main__ import main
from analysis.certificates.run_certificates import certified_findings
from analysis.check import LASTS, _held, check, too_short
from analysis.cosimulation import simulate
from analysis.discrepancy import linear_states, scales
from analysis.errors import InputError
from analysis.methods.linear_response import held_response
from analysis.scenario import Scenario, read_scenario
from analysis.trajectory import Run, write_run
from fmu_src.quantities import FORCES, STATES
from fmu_src.vehicle.linear import linearized
from fmu_src.vehicle.parameters import Car

NAMES = [q.name for q in STATES]
ROADS_AND_TYRES = [("bump", 0.0), ("bump-lqr", 0.0), ("sine", 0.0), ("bump", 300.0), ("bump-lqr", 150.0)]


def run_at(name: str, factor: float, **changes: Any) -> Run:
    """A built-in scenario over one second, its road and its start so many times as high."""
    scenario = read_scenario(name)
    parameters = {**scenario.parameters, "A": 0.01 * factor, "h_max": 2.5e-4}
    start = {"body.roll": 0.003 * factor, "der(wheel_fl.heave)": 0.1 * factor}
    return simulate(replace(scenario, stop_time=1.0, parameters=parameters, start=start, **changes))


@pytest.mark.parametrize("name", ["bump", "bump-lqr"])
def test_the_discrepancy_of_exported_runs_is_of_order_3_in_the_amplitude(name: str) -> None:
    """FMU runs at A, 2A and 4A, with and without control: each state's discrepancy grows as the cube."""
    sizes = [1.0, 2.0, 4.0]
    runs = [run_at(name, size) for size in sizes]
    away = [np.abs(run.trajectory.columns(NAMES) - linear_states(run)).max(axis=0) for run in runs]
    by_size = dict(zip(sizes, away, strict=True))
    own_error = 1e-8 * scales(
        runs[0].trajectory.columns(NAMES)
    )  # of a run with this h_max, rounded up: measured 7.8e-9
    judged = np.flatnonzero(away[0] > 30.0 * own_error)
    assert len(judged) >= 6
    for state in judged:
        slope, bend = observed_order(lambda size, i=state: float(by_size[size][i]), sizes)  # type: ignore[misc]
        assert slope == pytest.approx(3.0, abs=0.05), NAMES[state]
        assert bend < 0.03, NAMES[state]


DAMPED = {f"{name}, tyres damped by {bp:g}": (name, {"bp1": bp, "bp2": bp}) for name, bp in ROADS_AND_TYRES}


def honest(name: str, parameters: dict[str, Any], stop_time: float = 0.8) -> Run:
    scenario = read_scenario(name)
    return simulate(replace(scenario, stop_time=stop_time, parameters={**scenario.parameters, **parameters}))


@pytest.mark.parametrize(("name", "parameters"), DAMPED.values(), ids=DAMPED)
def test_both_claims_hold_on_honest_runs(name: str, parameters: dict[str, float]) -> None:
    """Damped tyres take the road's rate, which jumps at its corners."""
    run = honest(name, parameters)
    size, order, *each = check(run)[2 : 4 + len(STATES)]
    assert size.holds and size.measured > 30.0 * size.tolerance  # it is seen, not lost in the tolerance
    assert order.holds and order.measured == pytest.approx(3.0, abs=1e-3)
    assert "14 of 14 states are told" in order.source and "up to 5, 10, 20 mm" in order.claim
    away = np.abs(run.trajectory.columns(NAMES) - linear_states(run))
    for k, finding in enumerate(each):
        assert NAMES[k] in finding.claim and f"[{STATES[k].unit}]" in finding.claim and finding.holds
        assert finding.measured == pytest.approx(away[:, k].max())
        assert f"at t = {run.trajectory.time[away[:, k].argmax()]:.4g} s" in finding.source


@pytest.mark.parametrize("parameters", [{"profile": "step"}, {"bp1": 1000.0, "bp2": 1000.0}], ids=str)
def test_the_order_is_3_on_roads_that_jump_under_the_car(parameters: dict[str, Any]) -> None:
    """By their height, or for tyres with strong dampers by their rate."""
    order = check(honest("bump", parameters, stop_time=0.5))[3]
    assert order.measured == pytest.approx(3.0, abs=1e-3) and "14 of 14 states are told" in order.source


@pytest.mark.parametrize("parameters", [{}, {"bp1": 300.0, "bp2": 300.0}, {"profile": "step"}], ids=str)
def test_what_counts_as_resolved_is_well_above_the_integrations_own_error(parameters: dict[str, Any]) -> None:
    """That error is linear in the amplitude: at 1e-3 of the road the cube is far below it."""
    run = honest("bump", parameters, stop_time=0.5)
    linear, (forces, switches) = linear_states(run), _held(run)
    small = discrepancy._motion(run, forces, switches, 1e-3 * linear[0], run.trajectory.time, 1e-3)
    states = np.abs(linear).max(axis=0)
    error = np.abs(small - 1e-3 * linear).max(axis=0)
    assert np.all(error < 0.2e-3 * discrepancy.RESOLVED * np.maximum(states, discrepancy.LEAST * states.max()))


def test_a_discrepancy_that_the_run_may_not_resolve_is_said_to_be_one() -> None:
    run = run_at("bump", 1e-3)
    assert "less than the run's own error may be" in check(run)[2].source
    assert "less than" not in check(run_at("bump", 1.0))[2].source


def test_forces_are_those_of_the_run_not_of_a_linear_loop() -> None:
    """Forces that no controller would give: the linear plant under them is still what the discrepancy is taken from."""
    lqr = run_at("bump-lqr", 1.0)
    forces = lqr.trajectory.columns([q.name for q in FORCES])
    assert np.abs(forces).max() > 10.0
    linear = linear_states(lqr)
    without = linear_states(replace(lqr, trajectory=_with_forces(lqr, 0.0)))
    doubled = linear_states(replace(lqr, trajectory=_with_forces(lqr, 2.0)))
    assert np.abs(linear - without).max() > 1e-3 * np.abs(linear).max()
    np.testing.assert_allclose(doubled - linear, linear - without, atol=1e-12 * np.abs(linear).max())


def _with_forces(run: Run, factor: float) -> Any:
    values = run.trajectory.values.copy()
    for q in FORCES:
        values[:, run.trajectory.names.index(q.name)] *= factor
    return replace(run.trajectory, values=values)


def test_held_inputs_are_solved_exactly_on_uneven_steps() -> None:
    A, B = np.array(linearized(Car()).A), np.array(linearized(Car()).Bu)
    rng = np.random.default_rng(3)
    t = 5.0 + np.cumsum(np.tile([0.01, 0.01, 0.004, 0.03], 6))
    u = rng.uniform(-100.0, 100.0, (4, len(t)))
    x, states = np.zeros(14), [np.zeros(14)]
    for k, step in enumerate(np.diff(t)):
        force = B @ u[:, k]
        x = solve_ivp(lambda _, y, f=force: A @ y + f, (0, step), x, "DOP853", rtol=1e-12, atol=1e-15).y[:, -1]
        states.append(x)
    expected = np.stack(states, axis=1)
    np.testing.assert_allclose(held_response(A, B, u, t), expected, atol=1e-10 * np.abs(expected).max())


def test_a_run_of_another_car_is_told_from_its_linear_approximation() -> None:
    """The record says one stiffness, the run was made with another: both claims of size fail."""
    run = run_at("bump", 1.0)
    parameters = {
        component: {name: 15100.0 if name == "c1" else value for name, value in values.items()}
        for component, values in run.record["parameters"].items()
    }
    motion, _, size, order, *_ = check(replace(run, record={**run.record, "parameters": parameters}))
    assert not motion.holds and not size.holds
    assert order.holds  # the order belongs to the car, not to the run


def test_an_order_other_than_3_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Integrations that start where the run does, whatever the factor: their difference from x_lin is no cube."""
    run, motion = run_at("bump", 1.0), discrepancy._motion

    def unscaled_start(run: Run, forces: Any, switches: Any, x0: Any, times: Any, factor: float) -> Any:
        return motion(run, forces, switches, x0 / factor, times, factor)

    monkeypatch.setattr(discrepancy, "_motion", unscaled_start)
    assert not check(run)[3].holds


def test_a_single_state_of_another_order_fails_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """A small quadratic term in a front wheel's heave, such as the printed (3.2) makes."""
    run, motion = run_at("bump", 1.0), discrepancy._motion
    wheel = NAMES.index("wheel_fl.heave")

    def bent(run: Run, forces: Any, switches: Any, x0: Any, times: Any, factor: float) -> Any:
        states = motion(run, forces, switches, x0, times, factor)
        states[:, wheel] += 1e-8 * factor**2
        return states

    monkeypatch.setattr(discrepancy, "_motion", bent)
    order = check(run)[3]
    assert not order.holds and "column wheel_fl.heave;" in order.source


@pytest.mark.parametrize(
    "start", [{"body.heave": 0.02}, {"body.heave": 1e-6}, {}], ids=["pure heave", "tiny pure heave", "rest"]
)
def test_no_order_is_claimed_of_a_motion_that_is_linear(start: dict[str, float]) -> None:
    """A car of four equal corners in heave meets none of the nonlinear terms."""
    parameters: dict[str, float | str | bool] = {"profile": "flat", "enabled": False, "road_sampling": "end"}
    parameters |= {"a": 1.25, "b": 1.25, "c2": 15000.0, "b2": 1200.0}
    checked = check(simulate(Scenario(name="heave", start=start, stop_time=0.5, parameters=parameters)))
    found = [finding for finding in checked if finding.equation == "(2.3)"]
    assert len(found) == 1 + len(STATES) and all(finding.holds for finding in found)
    assert found[0].measured < 1e-7  # over states that rest, and so over next to nothing


def test_tiny_and_large_motions_have_their_order_taken_at_one_size() -> None:
    for factor in (0.1, 20.0):  # up to 0.2 rad
        found = check(run_at("bump", factor))
        assert found[3].measured == pytest.approx(3.0, abs=0.01), factor


def test_a_single_row_is_no_motion_to_check() -> None:
    run = run_at("bump", 1.0)
    row = replace(run.trajectory, time=run.trajectory.time[:1], values=run.trajectory.values[:1])
    with pytest.raises(InputError, match="at least two rows"):
        check(replace(run, trajectory=row))


# ---------------------------------------------------------------------------------------------------- short runs
SHORT = [
    ("bump", {}),
    ("sine", {}),
    ("bump-lqr", {}),
    ("bump", {"t_start": 0.4}),
    ("bump", {"bp1": 300.0, "bp2": 300.0}),
]


def ended(name: str, parameters: dict[str, float], after: float, **changes: Any) -> Run:
    """The run until so long [s] after its road begins."""
    scenario = read_scenario(name)
    stop_time = parameters.get("t_start", 0.0) + after
    return simulate(replace(scenario, stop_time=stop_time, parameters={**scenario.parameters, **parameters}, **changes))


@pytest.mark.parametrize(("name", "parameters", "step"), [*((*of, 1e-3) for of in SHORT), ("bump", {}, 5e-4)], ids=str)
def test_honest_runs_that_last_hold_in_all_findings(name: str, parameters: dict[str, float], step: float) -> None:
    run = ended(name, parameters, LASTS, step=step)
    assert too_short(run) == ""
    assert all(finding.holds for finding in (*check(run), *certified_findings(run)[0]))


@pytest.mark.parametrize(("name", "parameters"), SHORT, ids=str)
def test_shorter_ones_are_said_to_be_short_and_hold_from_when_the_limits_say(
    name: str, parameters: dict[str, float]
) -> None:
    for after in (0.02, 0.052):
        run = ended(name, parameters, after)
        assert f"the run ends {after:g} s after rest" in too_short(run)
        assert all(finding.holds for finding in check(run))
    assert all(finding.holds for finding in certified_findings(run)[0])


def test_the_check_of_a_run_that_is_too_short_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its findings fail: the axle has moved by 2e-11 m, and a step's error is a part of that."""
    (tmp_path / "short").mkdir()
    write_run(run := ended("bump", {}, 0.002), tmp_path / "short")
    assert main(["check", str(tmp_path / "short")]) == 1
    assert "check: the run ends 0.002 s after rest; of honest runs that end before 0.1 s" in capsys.readouterr().err
    columns = [run.trajectory.time, *run.trajectory.columns(NAMES).T]
    np.savetxt(tmp_path / "a.csv", np.transpose(columns), delimiter=",", header=",".join(["time", *NAMES]), comments="")
    main(["check", str(tmp_path / "a.csv"), "--road-class", "exact"])
    assert "check: the run ends 0.002 s after rest" in capsys.readouterr().err


def test_a_run_in_which_nothing_moves_is_not_short() -> None:
    assert too_short(ended("bump", {"t_start": 0.4}, -0.39)) == ""
