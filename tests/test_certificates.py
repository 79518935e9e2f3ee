"""Certificates of the car: nearly sharp, sound against starts of all kinds and the FMU, worthless if altered."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import arb, fmpq

from analysis.bertolino_baksa.adversary import excursions, reached, reference_floor, worst
from analysis.bertolino_baksa.balls import NotProvedError, precision
from analysis.bertolino_baksa.certificate import Certificate, from_json, to_json, verify
from analysis.bertolino_baksa.norms import proved_metric
from analysis.bertolino_baksa.pieces import Piece
from analysis.bertolino_baksa.proof import Proof, prove
from analysis.bertolino_baksa.tube import prove_linear
from analysis.car import car_form, road_signal
from analysis.certificates.car_certificates import build, certify_car, model_of, prove_reference
from analysis.cosimulation import simulate
from analysis.methods.linear_response import linear_response
from analysis.methods.signals import Signal
from analysis.methods.standard_form import StandardForm
from analysis.reference import car_of, road_parameters
from analysis.scenario import read_scenario
from fmu_src.quantities import STATES

REST = np.zeros(14)


@cache
def certified(A: float) -> tuple[Certificate, Proof]:
    return certify_car({"A": A})


def system(parameters: dict[str, Any]) -> tuple[StandardForm, Signal]:
    return car_form(car_of(parameters)), road_signal(road_parameters(parameters))


# ---------------------------------------------------------------------------------------------------- sharpness
@pytest.mark.parametrize("A", [0.01, 0.02, 0.05, 0.1])
def test_the_floor_on_the_bump_is_within_one_per_cent_of_the_truth(A: float) -> None:
    certificate, _ = certified(A)
    true = reference_floor(*system({"A": A}), [c.norm for c in certificate.claims], REST, 3.0)
    assert [c.norm.name for c in certificate.claims] == ["energy", "weighted sup", "Euclid"]
    for claim, floor in zip(certificate.claims, true, strict=True):
        assert floor < claim.floor <= 1.01 * floor


ENDLESS = {
    "10 Hz": {"profile": "sine", "Lambda": 1.0},
    "1.25 Hz": {"profile": "sine", "Lambda": 8.0},
    "Fourier": dict(read_scenario("fourier-fl").parameters),
}


@pytest.mark.parametrize("parameters", ENDLESS.values(), ids=ENDLESS)
def test_the_floor_on_an_endless_road_is_within_two_per_cent_of_the_truth(parameters: dict[str, Any]) -> None:
    certificate, proof = certify_car(parameters)
    assert proof.repetition is not None
    true = reference_floor(*system(parameters), [c.norm for c in certificate.claims], REST, 9.0)
    for claim, floor in zip(certificate.claims, true, strict=True):
        assert floor < claim.floor <= 1.02 * floor


@pytest.mark.parametrize("A", [0.01, 0.05])
def test_up_to_a_third_of_the_largest_delta_an_adversary_gets_nearly_as_far_as_proved(A: float) -> None:
    """Over the whole range of δ, most of them where the start begins to tell beside e: there the sum is the hardest."""
    certificate, proof = certified(A)
    form, signal = system({"A": A})
    for claim in certificate.claims:
        with precision(2):
            turn = claim.floor / float(proof.decay.of(claim.norm).max())
            delta = np.concatenate([np.geomspace(0.2, 6.0, 5), np.geomspace(20.0, claim.largest_delta / turn / 3.0, 3)])
            proved = proof.epsilon(claim.norm, turn * delta)
        found = reached(form, signal, [claim.norm], REST, [turn * delta], 0.5)[0]
        assert np.all(found < proved)
        assert np.all(proved <= 1.05 * found)


@pytest.mark.parametrize("which", range(3))
def test_a_search_on_the_full_equations_hardly_gets_further(which: int) -> None:
    certificate, proof = certified(0.05)
    claim, (form, signal) = certificate.claims[which], system({"A": 0.05})
    delta = claim.largest_delta / 3.0
    with precision(2):
        proved = float(proof.epsilon(claim.norm, np.array([delta]))[0])
    first = reached(form, signal, [claim.norm], REST, [np.array([delta])], 0.5)[0][0]
    far, start = worst(form, signal, claim.norm, REST, delta, 0.5, rounds=1)
    assert claim.norm(start) <= delta * (1.0 + 1e-12)
    assert first <= far * (1.0 + 1e-5) < proved <= 1.05 * far


@pytest.mark.parametrize(
    "made", [lambda: certify_car({"profile": "flat"}), lambda: certified(0.05)], ids=["flat", "bump"]
)
def test_the_largest_delta_is_the_largest_that_the_proof_gives(made: Callable[[], tuple[Certificate, Proof]]) -> None:
    certificate, proof = made()
    with precision(2):
        for claim in certificate.claims:
            more = claim.largest_delta * np.array([1.06, 1.5, 4.0, 64.0])
            assert proof.bounded(claim.norm, claim.largest_delta)
            assert not any(proof.bounded(claim.norm, delta) for delta in more.tolist())


def test_the_rest_on_a_flat_road_is_as_stable_as_a_motion_over_a_bump() -> None:
    """Its pieces last as long as pieces may, and so many modes' turns; their cells must not."""
    certificate, proof = certify_car({"profile": "flat"})
    claim, form = certificate.claims[0], car_form(car_of({}))
    assert claim.largest_delta > 0.98 * certified(0.01)[0].claims[0].largest_delta
    delta = np.array([claim.largest_delta / 3.0])
    found = reached(form, road_signal(road_parameters({"profile": "flat"})), [claim.norm], REST, [delta], 0.5)[0][0]
    with precision(2):
        assert found < float(proof.epsilon(claim.norm, delta)[0]) < 1.1 * found


# ---------------------------------------------------------------------------------------------------- soundness
def starts(claim: Any, delta: float, count: int, seed: int) -> Any:
    """Offsets (14, count) on the sphere N = delta, on its corners, and inside."""
    rng = np.random.default_rng(seed)
    inverse = np.linalg.inv(claim.norm.T)
    directions = np.where(rng.random(count) < 0.5, rng.normal(size=(14, count)), rng.choice([-1.0, 1.0], (14, count)))
    off = inverse @ directions
    return off * delta / claim.norm(off) * np.where(rng.random(count) < 0.8, 1.0, rng.random(count))


@pytest.mark.parametrize("which", range(3))
def test_ten_thousand_starts_inside_delta_stay_inside_epsilon(which: int) -> None:
    certificate, _ = certified(0.05)
    claim, (form, signal) = certificate.claims[which], system({"A": 0.05})
    rows = len(claim.table)
    crowds = [(rows // 3, 300, 2.5e-4), (2 * rows // 3, 1518, 1e-3), (rows - 1, 1518, 1e-3), (0, 30, 1.25e-4)]
    for row, count, step in crowds:  # near the floor the integrator itself must be the better
        epsilon, delta = claim.table[row].tolist()
        off = starts(claim, delta, count, seed=which + 10 * row)
        assert excursions(form, signal, [claim.norm], REST, off, 0.5, step).max() < epsilon


@pytest.mark.parametrize("part", range(4))
def test_two_hundred_starts_on_the_fmu_stay_inside_epsilon(part: int) -> None:
    certificate, _ = certified(0.01)
    scenario = replace(read_scenario("bump"), stop_time=0.4, step=5e-3)
    form, signal = system({})
    claim = certificate.claims[part % 3]
    epsilon, delta = claim.table[-1 if part == 3 else len(claim.table) // 2].tolist()
    for off in starts(claim, delta, 50, seed=part).T:
        start = {q.name: float(v) for q, v in zip(STATES, off, strict=True)}
        if max(abs(start[name]) for name in ("body.roll", "body.pitch", "axle_r.roll")) > 1.5:
            continue  # the FMU takes angles up to a right angle
        run = simulate(replace(scenario, start=start)).trajectory
        x_lin = linear_response(form.A, form.B, REST, signal, run.time)
        assert claim.norm(run.columns([q.name for q in STATES]).T - x_lin).max() < epsilon


# ---------------------------------------------------------------------------------------------------- verification
def test_a_certificate_is_read_back_and_proved_and_another_car_is_not_it(tmp_path: Path) -> None:
    certificate, _ = certified(0.01)
    path = tmp_path / "bump.json"
    path.write_bytes(to_json(certificate))
    again = from_json(path.read_bytes(), str(path))
    verify(again, build)
    for other in ({"c1": 15000.1}, {"A": 0.010001}, {"tau0": 0.0201}, {"b2": 1100.01}):
        with pytest.raises(NotProvedError):
            verify(replace(again, model={**again.model, "parameters": other}), build)


def test_verifying_loads_nothing_to_optimize_integrate_or_draw_with(tmp_path: Path) -> None:
    path = tmp_path / "bump.json"
    path.write_bytes(to_json(certified(0.01)[0]))
    code = (
        f"import sys; from analysis.__main__ import main; proved = main(['verify', {str(path)!r}]) == 0; "
        "unused = ('matplotlib', 'pandas', 'pint', 'scipy.integrate', 'scipy.interpolate', 'scipy.optimize', 'sympy'); "
        "sys.exit(not proved or any(name in sys.modules for name in unused))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


@pytest.mark.parametrize("seed", range(12))
def test_a_corrupted_certificate_of_the_car_is_rejected(seed: int) -> None:
    certificate, _ = certified(0.01)
    rng = np.random.default_rng(seed)
    if seed % 3 == 0:  # a smaller ε, in one row
        claims = list(certificate.claims)
        table = claims[seed // 3 % 3].table.copy()
        table[rng.integers(len(table)), 0] *= 1.0 - 1e-5
        claims[seed // 3 % 3] = replace(claims[seed // 3 % 3], table=table)
        bad = replace(certificate, claims=tuple(claims))
    else:  # a coefficient
        pieces = list(certificate.pieces)
        k = int(rng.integers(len(pieces)))
        linear, error = pieces[k].linear.copy(), pieces[k].error.copy()
        (linear if seed % 3 == 1 else error)[rng.integers(14), rng.integers(3)] += 1e-3
        pieces[k] = replace(pieces[k], linear=linear, error=error)
        bad = replace(certificate, pieces=tuple(pieces))
    with pytest.raises(NotProvedError):
        verify(bad, build)


def test_a_piece_across_a_corner_of_the_road_is_rejected() -> None:
    """At rest until 1 s, in one piece, though the bump comes at 0.5 s: w of its begin is not w of all of it."""
    model, rest = model_of({"A": 0.05, "t_start": 0.5}), np.zeros((14, 2))
    certificate, _ = certified(0.01)
    with precision(2):
        road = build(model)
        metric, whole = proved_metric(road, certificate.S), Piece(fmpq(0), fmpq(1), rest, rest)
        for judge in (partial(prove, x0=REST.tolist()), prove_linear):
            with pytest.raises(NotProvedError, match="across a corner"):
                judge(road, metric, (whole,))
        halves = tuple(replace(whole, begin=fmpq(k, 2), end=fmpq(k + 1, 2)) for k in range(2))
        with pytest.raises(NotProvedError, match="across a corner"):
            prove_linear(road, metric, halves)
        assert prove_linear(road, metric, halves[:1])[0] < 1e-20


@pytest.mark.parametrize(
    "road",
    [
        {"A": 0.5, "t_start": 1e6},
        {"A": 0.5, "tau0": 2e6, "excite_fl": False, "excite_rl": False, "excite_rr": False},
        {"v0": 2.5e-6, "excite_fl": False, "excite_fr": False},
        {"profile": "sine", "t_start": 1e6},
        {"A": 0.2, "v0": 2e-7, "Lambda": 1.0},
    ],
)
def test_a_road_that_comes_late_or_lasts_long_is_no_flat_one(road: dict[str, Any]) -> None:
    with precision(2):
        pieces = build(model_of(road)).pieces
    assert float(pieces[-1][0]) >= 1e6
    assert any(w != 0 for begin, inputs in pieces for w in inputs(arb(begin)))
    with pytest.raises(NotProvedError, match="pieces reach 1250 s at most"):
        certify_car(road)


def test_too_large_a_bump_has_no_certificate_and_says_where_it_fails() -> None:
    with pytest.raises(NotProvedError, match="cannot be closed from t = "):
        prove_reference({"A": 5.0})


def test_a_car_that_does_not_settle_has_no_certificate() -> None:
    with pytest.raises(NotProvedError, match="does not settle"):
        certify_car({"b1": 0.0, "b2": 0.0})


def test_the_file_says_its_theorem() -> None:
    content = json.loads(to_json(certified(0.01)[0]))
    assert "for all t >= 0" in content["theorem"]
    assert content["claims"][0]["l"] == content["claims"][0]["delta of eps"][0]["eps"]
