"""The series against runs of the FMUs: truncation orders down to the run's own error, and what `check` says of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from orders import observed_order

from analysis.cosimulation import simulate
from analysis.run_series import series_findings
from analysis.scenario import read_scenario
from analysis.trajectory import Run

pytestmark = pytest.mark.usefixtures("dist")


def simulated(name: str = "bump", *, step: float = 1e-3, **parameters: Any) -> Run:
    """The first 0.6 s of a built-in scenario with other parameters."""
    scenario = read_scenario(name)
    coupling = "jacobi" if parameters.get("road_sampling") == "start" else scenario.coupling
    changed = {**scenario.parameters, **parameters}
    return simulate(replace(scenario, step=step, stop_time=0.6, coupling=coupling, parameters=changed))


def test_against_runs_the_truncation_error_falls_at_the_same_orders() -> None:
    """Relative to the motion: A², A⁴, A⁶, at communication steps of which the run's own error is smaller still."""
    amplitudes = [0.2, 0.15, 0.1]
    errors = {A: [f.measured for f in series_findings(simulated(A=A, step=5e-4))[0]] for A in amplitudes}
    for order in range(3):

        def error(A: float, order: int = order) -> float:
            return errors[A][order]

        slope, bend = observed_order(error, amplitudes)
        assert slope == pytest.approx(2 * order + 2, abs=0.15)
        assert bend < 0.02


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("bump", {}),
        ("bump", {"bp1": 150.0, "bp2": 170.0, "tau0": 0.0}),
        ("bump", {"road_sampling": "start"}),
        ("fourier-fl", {}),
        ("sine", {"A": 0.05}),
        ("bump-lqr", {"A": 0.1, "activation": "at t_on", "t_on": 0.1}),
    ],
    ids=["bump", "damped tyres, straight", "road at the start", "fourier", "sine", "controlled"],
)
def test_each_order_leaves_what_its_next_term_says(name: str, parameters: dict[str, Any]) -> None:
    findings, reason = series_findings(simulated(name, **parameters))
    assert not reason
    assert all(finding.holds for finding in findings), findings
    assert findings[0].tolerance < 0.5 * findings[0].expected or parameters.get("road_sampling") == "start"


def test_the_practical_radius_is_said_and_what_the_run_is_too_coarse_to_show() -> None:
    """The factor goes with the square of the motion, so the largest motion is the same whichever the run."""

    def radius(A: float) -> tuple[float, float]:
        source = series_findings(simulated(A=A))[0][0].source
        epsilon, rest = source.split("practical radius ε < ")[1].split(": motions up to ")
        return float(epsilon), A * float(rest.split(" times this one")[0])

    (small, first), (large, second) = radius(0.01), radius(0.02)
    assert f", A = {first:.3g} m" in series_findings(simulated(A=0.01))[0][0].source
    assert small / large == pytest.approx(4.0, rel=0.02)
    assert first == pytest.approx(second, rel=0.01) and first == pytest.approx(0.01 * small**0.5, rel=0.01)
    blind = "less than the run's own error may be"
    assert [blind in f.source for f in series_findings(simulated(A=0.01))[0]] == [False, True, True]
    assert [blind in f.source for f in series_findings(simulated(A=0.1))[0]] == [False, False, True]


@pytest.mark.parametrize(
    ("parameters", "named"),
    [
        ({"A": 0.001}, True),
        ({"A": 0.0, "body.heave": 0.02}, False),
        ({"A": 0.001, "body.heave": 0.02, "body.roll": 0.05}, False),
        ({"A": 0.01, "activation": "at t_on", "t_on": 0.1}, False),
    ],
    ids=["bump", "start alone", "start and bump", "forces and bump"],
)
def test_a_height_of_the_road_is_named_only_where_the_road_alone_makes_the_motion(
    parameters: dict[str, Any], named: bool
) -> None:
    """A start or a force does not grow with A: times as high a road is not times as large a motion."""
    run = simulated("bump-lqr" if "activation" in parameters else "bump", **parameters)
    source = series_findings(run)[0][0].source
    assert "times this one" in source and (" times this one, A = " in source) == named


def test_a_motion_of_another_car_is_not_that_of_the_series() -> None:
    run = simulated(A=0.05)
    Jx = run.reals("Jx")[0] * 1.001
    parameters = {
        component: {name: Jx if name == "Jx" else value for name, value in values.items()}
        for component, values in run.record["parameters"].items()
    }
    other = Run(trajectory=run.trajectory, record={**run.record, "parameters": parameters})
    assert not any(finding.holds for finding in series_findings(other)[0])


def test_where_nothing_can_be_said_it_says_why() -> None:
    assert series_findings(simulated(profile="flat"))[1] == "the car stands still"
    run = simulated()
    for factor in (100.0, 1e200):
        trajectory = replace(run.trajectory, values=run.trajectory.values * factor)
        findings, reason = series_findings(Run(trajectory=trajectory, record=run.record))
        assert not findings
        assert reason.startswith("the motion is too large")
