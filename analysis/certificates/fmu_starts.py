"""Motions of the FMUs themselves, from hundreds of starts within δ, in parallel: none may leave ε."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fmu_src.quantities import STATES

from ..bertolino_baksa.adversary import FEW, INSTANTS, furthest_starts, slowest
from ..bertolino_baksa.certificate import Certificate, Claim
from ..bertolino_baksa.norms import Norm
from ..car import car_form, road_signal
from ..cosimulation import simulate
from ..methods.polynomials import Array
from ..methods.standard_form import StandardForm
from ..parallel import mapped
from ..reference import car_of, road_parameters
from ..scenario import Scenario
from .car_certificates import linear_motion

STEP = 5e-4  # s: the integrator's own error is then far below what the smallest δ adds to the floor
STEEPEST = 1.5  # rad, of a start: the FMU takes angles up to a right angle
ANGLES = [k for k, q in enumerate(STATES) if q.unit == "rad"]
NAMES = [q.name for q in STATES]


@dataclass(frozen=True, slots=True)
class Start:
    """A run, a norm, and ε of the start's δ."""

    scenario: Scenario
    norm: Norm
    epsilon: float


def on_the_fmus(certificate: Certificate, scenario: Scenario, count: int) -> tuple[list[str], bool]:
    """How far runs of the scenario without control get from x_lin, over ε, in words; and whether none gets beyond.

    Half of the `count` starts are those that the linear part carries furthest, half are random, over all δ of the
    tables; starts that no FMU takes are left out.
    """
    form = car_form(car_of(scenario.parameters))
    end = road_signal(road_parameters(scenario.parameters)).edges[-1] + slowest(form)
    passive = {**scenario.parameters, "enabled": False, "road_sampling": "end", "h_max": STEP / 2.0}
    run = replace(
        scenario, parameters=passive, start_time=0.0, stop_time=end, step=STEP, coupling="gauss-seidel", record=()
    )
    starts = [
        Start(replace(run, start=dict(zip(NAMES, off.tolist(), strict=True))), claim.norm, epsilon)
        for claim in certificate.claims
        for epsilon, off in _offsets(form, claim, -(-count // len(certificate.claims)))
        if np.abs(off[ANGLES]).max() < STEEPEST
    ]
    shares = np.array(mapped(_share, starts, "starts on the FMUs"))
    lines = []
    for claim in certificate.claims:
        own = shares[[start.norm is claim.norm for start in starts]]
        lines.append(
            f"  {claim.norm.name} norm: {len(own)} starts on the FMUs within delta reach {own.max():.6g} of eps at most"
        )
    return lines, bool(shares.max() < 1.0)


def _offsets(form: StandardForm, claim: Claim, count: int) -> Iterator[tuple[float, Array]]:
    """ε and an offset (14,) with N just below its δ, over the table's rows in turn."""
    rng, inverse = np.random.default_rng(0), np.linalg.inv(claim.norm.T)
    times = np.linspace(0.0, slowest(form), INSTANTS)
    far = furthest_starts(form, claim.norm, 1.0, times, np.zeros((len(inverse), INSTANTS)), FEW)
    for k in range(count):
        epsilon, delta = claim.table[k * (len(claim.table) - 1) // max(count - 1, 1)].tolist()
        off = inverse @ rng.normal(size=len(inverse)) if k % 2 else far[:, k // 2 % FEW]
        yield epsilon, off * delta / claim.norm(off) * (1.0 - 1e-9)


def _share(start: Start) -> float:
    run = simulate(start.scenario).trajectory
    off = run.columns(NAMES).T - linear_motion(start.scenario.parameters, run.time).T
    return float(start.norm(off).max() / start.epsilon)
