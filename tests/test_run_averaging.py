"""Averaging and resonances on a run: integrated without FMUs, so that its own error is known to be small."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from made_up_run import made_up_run

from analysis import run_averaging
from analysis.car import car_form, road_signal
from analysis.findings import Finding
from analysis.methods.amplitudes import stability
from analysis.methods.averaging import AmplitudeEquations, average
from analysis.methods.floquet import floquet
from analysis.methods.nonlinear_response import nonlinear_response
from analysis.methods.resonance import resonances
from analysis.reference import Parameters, car_of, road_parameters
from analysis.run_averaging import averaged_findings, moved_by, stretch_of
from analysis.trajectory import Run, Trajectory
from fmu_src.quantities import FORCES, STATES
from fmu_src.vehicle.parameters import Car

SINE: Parameters = {"profile": "sine", "A": 0.01, "Lambda": 1.0, "v0": 10.0, "tau0": 0.02}
BUMP: Parameters = {**SINE, "profile": "bump"}
ENVELOPE, CONDITION, REMARK = "(3.18)–(3.20)", "condition after (3.20)", "remark 3.2"


def run_of(parameters: Parameters, *, end: float = 1.5, driven: Parameters | None = None) -> Run:
    """A passive run from rest, of these parameters; moved in truth by those of `driven`."""
    truth = driven or parameters
    t = np.linspace(0.0, end, 1 + round(1000 * end))
    signal = road_signal(road_parameters(truth))
    x = nonlinear_response(car_form(car_of(truth), order=1), np.zeros(14), signal, t, rtol=1e-11).T
    names = tuple(q.name for q in (*STATES, *FORCES))
    trajectory = Trajectory(time=t, names=names, values=np.hstack([x, np.zeros((len(t), 4))]))
    record = {**made_up_run().record, "parameters": {"all": {"road_sampling": "end", **parameters}}}
    return Run(trajectory=trajectory, record=record)


@cache
def standard(profile: str, A: float = 0.01, v0: float = 10.0) -> Run:
    return run_of({**SINE, "profile": profile, "A": A, "v0": v0})


def findings_of(run: Run) -> dict[str, Finding]:
    """By the equation that they judge."""
    return {finding.equation: finding for finding in averaged_findings(run)[0]}


@pytest.mark.parametrize(("profile", "count"), [("sine", 3), ("bump", 2)], ids=["sine", "bump, free decay"])
def test_a_passive_run_follows_the_averaged_amplitudes(profile: str, count: int) -> None:
    found, reason = averaged_findings(standard(profile))
    assert not reason and len(found) == count
    assert all(f.holds for f in found)
    envelope = findings_of(standard(profile))[ENVELOPE]
    assert 0.0 < envelope.measured < envelope.tolerance < 1e-5
    assert envelope.claim.startswith("from 0.27 s" if profile == "sine" else "from 0.32 s")


@pytest.mark.parametrize(("profile", "A", "better"), [("sine", 0.01, 20.0), ("bump", 0.01, 5.0), ("bump", 0.3, 3.0)])
def test_plain_decay_and_averaged_terms_of_the_other_sign_do_not_hold(
    profile: str, A: float, better: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = standard(profile, A)
    envelope = findings_of(run)[ENVELOPE]
    assert envelope.holds and "cannot tell" not in envelope.source
    without = float(envelope.source.split("decay ")[1])
    assert without > better * envelope.tolerance and without > 20.0 * envelope.measured

    def altered(factor: float) -> Finding:
        def other(*given: Any, **options: Any) -> AmplitudeEquations:
            right = average(*given, **options)
            turned = tuple(replace(part, coefficients=factor * part.coefficients) for part in right.resonant)
            return replace(right, resonant=turned)

        monkeypatch.setattr(run_averaging, "average", other)
        return findings_of(run)[ENVELOPE]

    assert not altered(0.0).holds
    assert not altered(-1.0).holds


def test_what_the_run_cannot_tell_is_said() -> None:
    """On a road of 1 mm the averaged terms are less than what the run's own error may be."""
    assert "which this run cannot tell from them" in findings_of(standard("bump", 0.001))[ENVELOPE].source


def test_what_the_averaged_equations_leave_falls_with_the_fourth_power_of_the_road() -> None:
    small, large = (findings_of(standard("bump", A))[ENVELOPE].measured for A in (0.1, 0.2))
    assert large / small == pytest.approx(16.0, rel=0.15)


def test_a_run_of_another_car_does_not_follow_them() -> None:
    assert not findings_of(run_of(SINE, driven={**SINE, "c2": 14300.0}))[ENVELOPE].holds


def test_the_condition_is_what_floquet_says_of_the_full_car() -> None:
    finding = findings_of(standard("sine", 0.05))[CONDITION]
    parameters = standard("sine", 0.05).parameters
    form, piece = car_form(car_of(parameters)), road_signal(road_parameters(parameters)).pieces[-1]
    alpha = average(form, piece).modes.alpha
    taken = (floquet(form, piece).exponents.real - alpha) / np.abs(alpha)
    assert finding.measured == pytest.approx(taken.max(), rel=0.02)  # measured: 0.5 %
    assert f"mode {np.argmax(taken) % 7 + 1}," in finding.source
    assert "where averaging ends" in finding.source


@pytest.mark.parametrize(("growth", "holds"), [(-5.0, True), (-0.1, True), (0.0, False), (0.1, False)])
def test_the_condition_holds_for_growth_below_zero_and_for_no_other(
    growth: float, holds: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a road damps the car more than twice as strongly as its own dampers."""
    stretch = stretch_of(moved_by(standard("sine")))
    alpha = np.abs(stretch.equations.modes.alpha)
    found = replace(stability(stretch.equations), growth=growth * alpha)
    monkeypatch.setattr(run_averaging, "stability", lambda equations: found)
    assert findings_of(standard("sine"))[CONDITION].holds == holds


def test_the_resonances_of_a_run_are_those_of_its_size() -> None:
    small, large = (findings_of(standard("bump", A))[REMARK] for A in (0.01, 0.1))
    assert large.measured == pytest.approx(100.0 * small.measured, rel=0.1)
    assert 1e-6 < small.measured < 1e-3
    rows = resonances(car_form(Car(), order=3), size=0.01).occurring
    damped = min(rows, key=lambda row: row.relative_distance)
    near, largest = (max(rows, key=lambda row: getattr(row, name)) for name in ("near_gain", "gain"))
    assert str(near) == "β1 = β3" and str(largest) == "β2 = β6" and largest.relative > 0.8
    said = (
        f"strongest near resonance {near}; off resonance too a term adds to a large motion: most {largest}, 64.3 rad/s"
    )
    assert said in small.source and f"; nearest in frequency {rows[0]}, " in small.source
    assert f"; nearest with damping {damped}, " in small.source


def test_a_motion_that_is_merely_large_is_in_no_resonance() -> None:
    """Off by 64 of 73 rad/s, β2 = β6 adds more than 0.1 to the motion on a bump of 0.8 m; what is near adds less."""
    remark = findings_of(run_of({**BUMP, "A": 0.8}, end=0.8))[REMARK]
    assert remark.holds and 0.04 < remark.measured < 0.09
    assert float(remark.source.split("most β2 = β6, 64.3 rad/s off, ")[1].split(";")[0]) > 0.1


def test_where_the_road_meets_a_mode_it_is_named_and_averaging_still_applies() -> None:
    found, reason = averaged_findings(standard("sine", 0.01, 12.75404))
    assert not reason and len(found) == 3 and all(finding.holds for finding in found)
    remark = found[0]
    assert "strongest near resonance β7 = Ω; nearest in frequency β7 = Ω, " in remark.source
    assert remark.measured < 2e-3
    nearest = float(remark.source.split("nearest in frequency β7 = Ω, ")[1].split()[0])
    assert nearest < 1e-3


def reason_of(run: Run, findings: int = 1) -> str:
    """Why findings are lacking, all but so many."""
    found, reason = averaged_findings(run)
    assert len(found) == findings and all(finding.holds for finding in found)
    return reason


def test_where_averaging_does_not_apply_it_says_why_and_gives_the_resonances_all_the_same() -> None:
    run = run_of(SINE, end=0.3)
    assert "actuators act" in reason_of(made_up_run(enabled=True))
    early = replace(run, trajectory=replace(run.trajectory, time=run.trajectory.time * 0.8))
    assert "the road changes its form until 0.27 s, and 0 rows come after" in reason_of(early)
    huge = replace(run, trajectory=replace(run.trajectory, values=run.trajectory.values * 300.0))
    found, reason = averaged_findings(huge)
    assert "too large" in reason and [finding.equation for finding in found] == [REMARK]
    assert not found[0].holds
    assert reason_of(run_of({**SINE, "profile": "flat"}, end=0.5), findings=0) == "the car stands still"


def test_what_can_be_said_of_a_car_without_the_condition_is_said() -> None:
    undamped: Parameters = {**SINE, "A": 0.002, "b1": 0.0, "b2": 0.0}
    assert "wanted damped modes" in reason_of(run_of(undamped), findings=2)
    creeping: Parameters = {**SINE, "A": 0.002, "b1": 12000.0, "b2": 12000.0}
    assert not reason_of(run_of(creeping), findings=3)


def test_a_step_is_a_road_without_waves() -> None:
    assert not reason_of(run_of({**SINE, "profile": "step"}, end=0.6), findings=3)


def test_the_amplitudes_of_a_steady_motion_are_none() -> None:
    """After 1.5 s what is free is a few per cent of the forced motion."""
    stretch = stretch_of(moved_by(run_of(SINE, end=4.0)))
    assert np.abs(stretch.amplitudes[:, -1]).max() < 1e-2 * np.abs(stretch.amplitudes[:, 0]).max()
