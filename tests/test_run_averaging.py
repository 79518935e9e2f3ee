"""Averaging and resonances on a run: integrated without FMUs, so that its own error is known to be small."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_run import made_up_run

from analysis.car import car_form, road_signal
from analysis.methods.nonlinear_response import nonlinear_response
from analysis.reference import Parameters, car_of, road_parameters
from analysis.run_averaging import averaged_findings, stretch_of
from analysis.trajectory import Run, Trajectory
from fmu_src.quantities import FORCES, STATES

SINE: Parameters = {"profile": "sine", "A": 0.01, "Lambda": 1.0, "v0": 10.0, "tau0": 0.02}
BUMP: Parameters = {**SINE, "profile": "bump"}


def run_of(parameters: Parameters, *, end: float = 1.5, driven: Parameters | None = None) -> Run:
    """A passive run from rest, of these parameters; moved in truth by those of `driven`."""
    truth = driven or parameters
    t = np.linspace(0.0, end, 301)
    signal = road_signal(road_parameters(truth))
    x = nonlinear_response(car_form(car_of(truth), order=1), np.zeros(14), signal, t, rtol=1e-11).T
    names = tuple(q.name for q in (*STATES, *FORCES))
    trajectory = Trajectory(time=t, names=names, values=np.hstack([x, np.zeros((len(t), 4))]))
    record = {**made_up_run().record, "parameters": {"all": {"road_sampling": "end", **parameters}}}
    return Run(trajectory=trajectory, record=record)


@pytest.mark.parametrize(("parameters", "count"), [(SINE, 3), (BUMP, 2)], ids=["sine", "bump, free decay"])
def test_a_passive_run_follows_the_averaged_amplitudes(parameters: Parameters, count: int) -> None:
    run = run_of(parameters)
    found, reason = averaged_findings(run)
    assert not reason and len(found) == count
    assert all(f.holds for f in found)
    envelope = found[0]
    assert 0.0 < envelope.measured < envelope.tolerance < 5e-3
    assert envelope.claim.startswith("from 0.27 s" if parameters is SINE else "from 0.32 s")


def test_what_averaging_leaves_out_falls_with_the_square_of_the_road() -> None:
    small, large = (averaged_findings(run_of({**SINE, "A": A}))[0][0] for A in (0.005, 0.01))
    assert large.measured / small.measured == pytest.approx(4.0, rel=0.05)


def test_a_run_of_another_car_does_not_follow_them() -> None:
    found, _ = averaged_findings(run_of(SINE, driven={**SINE, "c2": 14300.0}))
    assert not found[0].holds


def reason_of(run: Run, findings: int = 0) -> str:
    """Why findings are lacking, all but so many."""
    found, reason = averaged_findings(run)
    assert len(found) == findings and all(finding.holds for finding in found)
    return reason


def test_where_averaging_does_not_apply_it_says_why() -> None:
    run = run_of(SINE, end=0.3)
    assert "actuators act" in reason_of(made_up_run(enabled=True))
    early = replace(run, trajectory=replace(run.trajectory, time=run.trajectory.time * 0.8))
    assert "the road changes its form until 0.27 s, and 0 rows come after" in reason_of(early)
    huge = replace(run, trajectory=replace(run.trajectory, values=run.trajectory.values * 300.0))
    assert "too large" in reason_of(huge)
    assert reason_of(run_of({**SINE, "profile": "flat"}, end=0.5)) == "the car stands still"


@pytest.mark.parametrize(
    ("damping", "why"), [(12000.0, "no linear term but"), (0.0, "wanted damped modes")], ids=["overdamped", "undamped"]
)
def test_what_can_be_said_of_a_car_without_the_condition_is_said(damping: float, why: str) -> None:
    assert why in reason_of(run_of({**SINE, "A": 0.002, "b1": damping, "b2": damping}), findings=2)


def test_a_step_is_a_road_without_waves() -> None:
    assert not reason_of(run_of({**SINE, "profile": "step"}, end=0.6), findings=3)


def test_the_amplitudes_of_a_steady_motion_are_none() -> None:
    """After 1.5 s what is free is a few per cent of the forced motion."""
    stretch = stretch_of(run_of(SINE, end=4.0))
    assert np.abs(stretch.amplitudes[:, -1]).max() < 1e-2 * np.abs(stretch.amplitudes[:, 0]).max()
