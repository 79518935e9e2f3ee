"""Proofs about an exported run: which rows are of no motion of its car on its road, and the motion between the rows."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fmu_src.quantities import ACCELERATIONS, FORCES, ROAD_HEIGHTS, STATES

from ..bertolino_baksa.balls import NotProvedError, precision
from ..bertolino_baksa.input_rows import RowClass
from ..bertolino_baksa.norms import proved_metric
from ..bertolino_baksa.sampled import Samples
from ..car import car_form, road_signal
from ..check import own_error, too_short
from ..discrepancy import scales
from ..errors import InputError
from ..findings import Finding, write_findings
from ..methods.polynomials import Array
from ..reference import car_of, road_of, road_parameters
from ..scenario import Scenario, read_scenario
from ..trajectory import FINDINGS, Run
from .authenticity import Export, KnownRoad, defect, profile, sampled
from .car_certificates import metric_of
from .directed import at_most
from .exact_car import energy_norm, exact_system
from .exported import BY_DEFAULT, SAMPLING, read_export
from .falsification import Motions, Rows, judged, motions
from .printed_times import input_within, moved, steepest
from .unknown_roads import AllRoads, on_all_roads, samples
from .unknown_roads import road_class as read_class

DEFAULT = "bump"  # scenario of an export without one: the default car on the paper's bump
LONGEST = 10.0  # s from the first row that are judged


def certified_findings(
    run: Run,
    rounding: Mapping[str, Array] | None = None,
    file: str = "trajectory.csv",
    roads: RowClass | None = None,
) -> tuple[list[Finding], str]:
    """Findings on a passive run on a profile of ours, or on any road of a class; if there are none, why.

    rounding : of each column's printed digits (N,); by default that of doubles. That of times counts as what motions do
               meanwhile, and exported accelerations are not judged then.
    """
    columns = run.trajectory
    if reason := acting(run):
        return [], reason
    if len(columns.time) < 2:
        return [], "a single row is no motion"
    t = columns.time[columns.time <= columns.time[0] + LONGEST]

    def digits(names: Sequence[str]) -> Array:
        if rounding is None:
            return np.spacing(np.abs(columns.columns([*names])))[: len(t)]
        return np.stack([rounding[name] for name in names], axis=1)[: len(t)]

    def of(names: Sequence[str]) -> tuple[Array, Array]:
        return columns.columns([*names])[: len(t)], digits(names)

    x, open_ = of([q.name for q in STATES])
    late = np.zeros(len(t)) if rounding is None else rounding["time"][: len(t)]
    form = car_form(car_of(run.parameters), order=1)
    names = [q.name for q in ACCELERATIONS]
    more, more_open = of(names) if set(names) <= set(columns.names) and not late.any() else (None, None)
    if roads is None:
        open_ = open_ + moved(
            form, x, open_, late, *input_within(road_signal(road_parameters(run.parameters)), t, late)
        )
        return _on_its_road(run, Export(t, x, open_, more, more_open, own_error(run)), file)
    heights, road_open = of([q.name for q in ROAD_HEIGHTS])
    rates = steepest(t, late, heights, road_open, roads.bound, roads.kind == "curv")
    # A corner may lie beside its row by as much as the time is late: the height is then off the chord once more.
    road_open = road_open + (2.0 if roads.kind == "curv" else 1.0) * late[:, None] * rates
    w, loose = np.hstack([heights, np.zeros_like(rates)]), np.hstack([road_open, rates])
    export = Export(t, x, open_ + moved(form, x, open_, late, w, loose), more, more_open, own_error(run))
    return _on_roads(run, export, file, roads, heights, road_open)


def _on_its_road(run: Run, export: Export, file: str) -> tuple[list[Finding], str]:
    parameters, t, findings = run.parameters, export.times, []
    try:
        known = profile(road_signal(road_parameters(parameters)), road_of(parameters).corners(t[-1]), t)
        findings = [_authentic(run, export, file, known)]
        found = _motions(run, t, export.x[0], export.digits[0])
    except NotProvedError as error:
        return findings, str(error)
    expected, e, off = found.at(t)
    rows = judged(export.x, expected, off + export.digits + export.own * scales(expected), e)
    bound = found.largest_error(energy_norm(car_of(parameters)))
    return [*findings, _of_rows(export, rows, file), _between_rows(run, export, rows, bound, None)], ""


def _on_roads(
    run: Run, export: Export, file: str, roads: RowClass, heights: Array, rounding: Array
) -> tuple[list[Finding], str]:
    allowed = export.own * scales(export.x) + export.digits
    fits = samples(export.times, export.x, allowed, heights, rounding, roads)
    findings = [_authentic(run, export, file, sampled(fits))]
    try:
        everywhere = _everywhere(run, fits)
    except NotProvedError as error:
        return findings, str(error)
    rows = everywhere.rows(export.x, allowed)
    bound = everywhere.found.largest_error(energy_norm(car_of(run.parameters)))
    between = _between_rows(run, export, rows, bound, roads)
    return [*findings, _of_rows(export, rows, file), between], ""


def _as_exported(name: str) -> Scenario:
    """The scenario with the road sampled at the start of steps, as by default in any master; a run.json knows."""
    scenario = read_scenario(name)
    if name.endswith(".json"):
        return scenario
    return replace(scenario, parameters={**scenario.parameters, SAMPLING: BY_DEFAULT})


def acting(run: Run) -> str:
    """Why proofs of the passive car say nothing of a run's motion; "" if they do."""
    names = [q.name for q in FORCES]
    recorded = [name for name in names if name in run.trajectory.names]
    if recorded and np.any(run.trajectory.columns(recorded)):
        return "the actuators act, and the proof is of the car without them"
    if len(recorded) < len(names) and run.parameters.get("enabled", True):
        missing = ", ".join(name for name in names if name not in recorded)
        return f"the controller is on, but {missing} are not recorded; a car without control has enabled = false"
    return ""


def judge_export(path: Path, road_class: str | None, scenario: str | None) -> int:
    """Print what can be said of a CSV that another tool wrote; 0 if all holds, 1 if not or if nothing can be said.

    The findings are written beside it: those of FILE.csv to FILE.findings.json, in the format of a run's findings.json.
    Raises InputError for an unknown class of roads, and for what is no export.
    """
    if road_class is None:
        raise InputError(f"{path}: wanted --road-class; a file alone says nothing of the road between its rows")
    roads = None if road_class == "exact" else read_class(road_class)
    run, rounding = read_export(path, _as_exported(scenario or DEFAULT))
    findings, reason = certified_findings(run, rounding, str(path), roads)
    if short := too_short(run):
        print(f"check: {short}", file=sys.stderr)
    if reason:
        print(f"{'not all' if findings else 'nothing'} is proved: {reason}")
    for finding in findings:
        print(finding.line)
    write_findings(findings, path.with_suffix(f".{FINDINGS}"))
    return 0 if not reason and all(finding.holds for finding in findings) else 1


def _motions(run: Run, t: Array, x0: Array, rounding: Array) -> Motions:
    car = car_of(run.parameters)
    with precision(2):
        system = exact_system(car, road_parameters(run.parameters))
    return motions(system, metric_of(car), x0, rounding, float(t[0]), float(t[-1]))


def _everywhere(run: Run, known: Samples) -> AllRoads:
    car = car_of(run.parameters)
    with precision(2):
        system = exact_system(car, road_parameters(run.parameters))
        return on_all_roads(system, proved_metric(system, metric_of(car)), known)


def _authentic(run: Run, export: Export, file: str, road: KnownRoad) -> Finding:
    found = defect(car_of(run.parameters), road, export)
    coordinate, cells = STATES[found.coordinate].name, "1 cell" if found.out == 1 else f"{found.out} cells"
    return Finding(
        claim="the export obeys the equations between its rows: their defect along quintics through the rows, over "
        f"what quintics miss, printed digits, road and integrator ({export.own:.0e} of a state's maximum) leave open",
        equation="(3.1)–(3.7)",
        measured=found.ratio,
        expected=0.0,
        tolerance=1.0,
        unit="1",
        source=f"{file}, rows {found.cell + 2} and {found.cell + 3}, {coordinate}, largest: {found.size:.2g} "
        f"{STATES[found.coordinate + 7].unit}/s; {cells} out",
    )


def _of_rows(export: Export, rows: Rows, file: str) -> Finding:
    first = "" if rows.first is None else f"; the first row out: {rows.first + 2}"
    return Finding(
        claim=f"no row is proved to be of another motion: distance from the proved tube of the motion from the first "
        f"row, over what integrator ({export.own:.0e} of a state's maximum), printed digits and proof allow, to "
        f"{export.times[-1]:g} s",
        equation="(3.1)–(3.7)",
        measured=rows.ratio,
        expected=0.0,
        tolerance=1.0,
        unit="1",
        source=f"{file}, row {rows.row + 2}, column {STATES[rows.state].name}, largest{first}",
    )


def _between_rows(run: Run, export: Export, rows: Rows, bound: float, roads: RowClass | None) -> Finding:
    """The bound is of the exact motion; the run's own error comes on top of it at its rows.

    On a class of roads x − x_lin is compared along the chords of the heights, and that of each road bounded.
    """
    road = f"every road of class {roads} on which a motion has these rows" if roads else "this road"
    norm = energy_norm(car_of(run.parameters))
    seen, last = float(norm(rows.e.T).max()), export.times[-1]
    own = float(np.linalg.norm(np.abs(norm.T) @ rows.allowed.max(axis=0)))
    rest = "the run's integrator and printed digits" + (", and what the class leaves open of x_lin" if roads else "")
    return Finding(
        claim=f"until t = {last:g} s the run is as near x_lin as is proved of its motion, between the rows too: "
        "largest N(x - x_lin) at a row, N the energy norm, to which the run's own error may add",
        equation="(2.3), definition 2.1",
        measured=float(norm((rows.off + rows.e).T).max()),
        expected=0.0,
        tolerance=bound + own,
        unit="√J",
        source=f"proved on {road} of the exact motion until t = {last:g} s: {at_most(bound, 6)}, of which it reaches "
        f"{seen:.6g} at the rows; the rest of the tolerance, {own:.2g}, is {rest}",
    )
