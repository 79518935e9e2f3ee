"""Almost stable where a feedback acts for a while: Φ(t, 0) of a changing A, a sharp δ(ε), files proved anew."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_mat, fmpq
from scipy.linalg import expm
from test_almost_stable import rehashed
from test_certificates import certified

from analysis.__main__ import main
from analysis.bertolino_baksa import switched_certificate
from analysis.bertolino_baksa.balls import Array, ExactSystem, NotProvedError, matrix, precision
from analysis.bertolino_baksa.cells import carried_on
from analysis.bertolino_baksa.certificate import opened
from analysis.bertolino_baksa.motions_by_time import Motions
from analysis.bertolino_baksa.norms import contracting, euclid, weighted_sup
from analysis.bertolino_baksa.pieces import Piece
from analysis.bertolino_baksa.switched import Phase, Switched, SwitchedProof, prove, switched
from analysis.bertolino_baksa.switched_certificate import (
    SwitchedCertificate,
    certificate_of,
    certify,
    to_json,
    verify,
)
from analysis.bertolino_baksa.taylor import find_pieces
from analysis.bertolino_baksa.transition import matrices
from analysis.certificates import closed_loop_certificate
from analysis.certificates.car_certificates import car_norms, certify_car
from analysis.certificates.closed_loop_certificate import infinite_gain
from analysis.certificates.finite_horizon import build, certify_horizon, certify_table
from analysis.certificates.horizon_words import motions_of, reference_floors, statement
from analysis.errors import InputError
from analysis.reference import Parameters
from analysis.scenario import read_scenario
from fmu_src.controller.design import design
from fmu_src.controller.gain_table import GainTable
from fmu_src.controller.law import control_parameters

BUMP = dict(read_scenario("bump-lqr").parameters)
AT_ONCE: Parameters = {**BUMP, "activation": "at t_on", "t_on": 0.0}


# ------------------------------------------------------------------------------------------------ without a car
def damped(x: Any, w: Any, sin: Any, cos: Any) -> list[Any]:
    """A spring that hardens; w[0] is a damper's constant, whose force enters like sin v, w[1] a force."""
    return [x[1], x[0] * -4.0 - x[1] - w[0] * sin(x[1]) - x[0] * x[0] * x[0] * 0.5 + w[1] * cos(x[0])]


def damped_linear(x: Any, w: Any, sin: Any, cos: Any) -> list[Any]:
    return [x[1], x[0] * -4.0 - x[1] - w[0] * x[1] + w[1]]


def damped_excess(x: Sequence[Any], w: Sequence[Any]) -> arb_mat:
    return arb_mat([[0, 0], [-w[1] * x[0].sin() - x[0] * x[0] * 1.5, w[0] * (1 - x[1].cos())]])


def damped_switched(model: dict[str, Any]) -> Switched:
    """Force 0.4 for 1 s; from 1 to 2 s a damper of `most` (2 − t), then none."""
    most = arb(model["most"])
    inputs = (
        (fmpq(0), lambda t: [arb(0), arb("0.4")]),
        (fmpq(1), lambda t: [(t * -1 + 2) * most, arb(0)]),
        (fmpq(2), lambda t: [arb(0), arb(0)]),
    )
    return switched(ExactSystem(2, 2, damped, inputs, fmpq(0)), damped_linear, damped_excess)


def metric(damping: float) -> Array:
    """S of the oscillator's modes, as for any v'' + damping v' + 4 v = 0 with complex roots."""
    return np.array([[2.0, 0.5 * damping / 2.0], [0.0, np.sqrt(4.0 - damping**2 / 4.0) / 2.0]])


@cache
def oscillator() -> tuple[SwitchedCertificate, SwitchedProof]:
    with precision(2):
        model = {"most": 1.0}
        loop = damped_switched(model)
        pieces = find_pieces(loop.system, [0.0, 0.0], fmpq(16), changing=loop.linear_system)
        phases = [Phase(fmpq(t), metric(d)) for t, d in ((0, 1.0), (1, 2.0), (2, 1.0))]
        return certify(model, loop, phases, pieces, [euclid(2), weighted_sup(np.array([1.0, 2.0]))])


def oscillations(stop: float = 6.0) -> Motions:
    def w(t: float, x: Array) -> list[Array]:
        return [np.full(x.shape[1], v) for v in (max(2.0 - t, 0.0) if t > 1.0 else 0.0, 0.4 if t < 1.0 else 0.0)]

    def rate(of: Any) -> Any:
        return lambda t, x: np.stack(of(list(x), w(t, x), np.sin, np.cos))

    return Motions(rate(damped), rate(damped_linear), [1.0, 2.0], stop, 0.01)


def test_an_oscillator_whose_damper_comes_and_goes_stays_within_epsilon_and_nearly_gets_there() -> None:
    certificate, proof = oscillator()
    verify(certificate, damped_switched)
    motions, rng = oscillations(), np.random.default_rng(3)
    reached = motions.off(np.zeros((2, 1)))
    for claim in certificate.claims:
        own = float(np.max([claim.norm(x) for x in reached]))
        assert own < claim.floor < 1.01 * own
        for epsilon, delta in claim.table[[2, 12, -1]].tolist():
            starts = rng.normal(size=(2, 200))
            off = motions.off(starts * delta / claim.norm(starts))
            assert max(claim.norm(x).max() for x in off) < epsilon
        with precision(2):
            third = claim.largest_delta / 3.0
            epsilon = float(proof.epsilon(claim.norm, np.array([third]))[0])
        worst = motions.worst([claim.norm], [np.array([third])])[0][0]
        assert worst < epsilon < 1.10 * worst


def test_the_flow_of_a_linear_part_that_grows_for_a_while_is_the_exact_one() -> None:
    """x' = −x + w x, w = 12 (t − 1)(2 − t) from 1 to 2 s: Φ(2, 1) = e, and a larger Φ lies inside, where w = 1."""

    def equations(x: Any, w: Any, sin: Any, cos: Any) -> list[Any]:
        return [w[0] * x[0] - x[0]]

    rest: Any = lambda t: [arb(0)]  # noqa: E731
    inputs = ((fmpq(0), rest), (fmpq(1), lambda t: [(t - 1) * (t * -1 + 2) * 12]), (fmpq(2), rest))
    with precision(2):
        loop = switched(ExactSystem(1, 1, equations, inputs, fmpq(0)), equations, lambda x, w: arb_mat([[0]]))
        pieces = find_pieces(loop.system, [0.0], fmpq(9), changing=loop.linear_system)
        phases = [Phase(fmpq(t), np.array([[s]])) for t, s in ((0, 1.0), (1, 3.0), (2, 0.5))]
        proof = prove(loop, phases, pieces)
        t = 1.0 + np.linspace(0.0, 1.0, 100_001)
        most = np.exp(-t + 6.0 * (t - 1.0) ** 2 - 4.0 * (t - 1.0) ** 3).max()
        changing = proof.stretches[1].decay
        assert most <= changing.of(euclid(1)).max() < 1.001 * most
        np.testing.assert_allclose(changing.ends[[0, -1], 0, 0], [np.exp(-1.0), 1.0], rtol=1e-13)
        assert changing.off < 1e-13
        found = proof.epsilon(euclid(1), np.array([0.1, 2.0]))
    np.testing.assert_allclose(found, [0.1 * most, 2.0 * most], rtol=1e-3)


def test_what_is_no_linear_part_is_refused() -> None:
    with pytest.raises(NotProvedError, match=r"row 1 .* not of A\(w\) x"):
        matrices(2, 2, damped)
    with pytest.raises(NotProvedError, match="row 0"):
        matrices(1, 1, lambda x, w, sin, cos: [w[0] * w[0] * x[0] - x[0]])

    def waving(t: Any) -> list[Any]:
        return [t.sin()]

    with precision(2), pytest.raises(NotProvedError, match="not proved to be a polynomial"):
        matrices(1, 1, lambda x, w, sin, cos: [w[0] * x[0] - x[0]]).series(waving, fmpq(0), fmpq(1, 10))


@pytest.mark.parametrize(("ends", "proved"), [(1, True), (3, False), (None, False)])
def test_phases_are_refused_where_the_input_goes_on_after_them(ends: int | None, proved: bool) -> None:
    """x' = −x + w, w = 1 up to `ends` [s], pieces up to 2 s: what is said of all later times needs w = 0 there."""

    def equations(x: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> list[Any]:
        return [w[0] - x[0]]

    begins = [(fmpq(0), lambda t: [arb(1)]), *([] if ends is None else [(fmpq(ends), lambda t: [arb(0)])])]
    with precision(2):
        loop = switched(ExactSystem(1, 1, equations, tuple(begins), fmpq(0)), equations, lambda x, w: arb_mat([[0]]))
        pieces, phases = find_pieces(loop.system, [0.0], fmpq(2)), [Phase(fmpq(0), np.eye(1))]
        if proved:
            assert prove(loop, phases, pieces).epsilon(euclid(1), np.array([0.1]))[0] < 0.1001
        else:
            with pytest.raises(NotProvedError, match="not proved to be 0"):
                prove(loop, phases, pieces)


# ------------------------------------------------------------------------------------------------ files
def corrupted(content: dict[str, Any], rng: random.Random) -> str:
    """Change one thing for the worse; says what."""
    kind = rng.choice(
        ["eps", "delta", "coefficient", "begin", "missing", "norm", "metric", "phases", "switch", "model"]
    )
    claim, piece = rng.choice(content["claims"]), rng.choice(content["pieces"])
    row, phases = rng.choice(claim["delta of eps"]), content["phases"]
    match kind:
        case "eps":
            row["eps"] *= 1.0 - 10.0 ** rng.uniform(-5.5, -1.0)
        case "delta":
            row["delta"] *= 1.0 + 10.0 ** rng.uniform(-2.0, 1.0)
        case "coefficient":
            rng.choice(piece["x_lin"])[rng.randrange(3)] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3.0, 0.0)
        case "begin":
            piece["begin"] = "1/7"
        case "missing":
            content["pieces"].remove(piece)
        case "norm":
            claim["norm"]["T"] = (np.array(claim["norm"]["T"]) * 1.01).tolist()
            claim["delta of eps"] = [{"eps": r["eps"], "delta": r["delta"] * 1.01} for r in claim["delta of eps"]]
        case "metric":
            rng.choice(phases)["metric"][0] = [0.0, 0.0]
        case "phases":
            phases[1], phases[2] = phases[2], phases[1]
        case "switch":
            phases[1]["begin"] = "4/5"
        case "model":
            content["model"]["most"] *= rng.choice([0.99, 1.01])
    claim["l"] = claim["delta of eps"][0]["eps"]
    return kind


def test_corrupted_files_are_rejected_with_and_without_their_hash() -> None:
    data, kinds = to_json(oscillator()[0]), set()
    verify(opened(data, "here", certificate_of), damped_switched)
    for seed in range(32):
        content = json.loads(data)
        kinds.add(corrupted(content, random.Random(seed)))
        with pytest.raises(InputError, match="altered"):
            opened(json.dumps(content).encode(), "here", certificate_of)
        with pytest.raises((InputError, NotProvedError)):
            verify(opened(rehashed(content), "here", certificate_of), damped_switched)
    assert len(kinds) == 10


def test_what_an_earlier_phase_made_leaves_its_chords_no_further_than_is_said() -> None:
    """e^(As) Φ for a Φ that does not commute with A, whose second derivative is 0 in a row at first."""
    A = np.array([[-1.0, 1.0], [0.0, -1.0]])
    start = np.linalg.solve(A @ A, np.array([[0.0, 0.0], [0.0, 1.0]]))
    with precision(2):
        metric = contracting(matrix(A), np.diag([1.0, 2.0]))
        whole = Piece(fmpq(0), fmpq(6), np.zeros((2, 2)), np.zeros((2, 2)))
        flow, _, _ = carried_on(metric, [whole], matrix(start), 0.0)
        sizes = flow.sizes(np.eye(2))
    begin = 0.0
    for cell, width in enumerate(flow.width.tolist()):
        s = np.linspace(0.0, width, 60)
        exact = expm(A * (begin + s)[:, None, None]) @ start
        chord = exact[0] + (exact[-1] - exact[0]) * (s / width)[:, None, None]
        assert (np.abs(exact - chord).max(axis=0) <= flow.curve[cell] + 1e-12).all()
        assert (np.abs(exact).max(axis=0) <= sizes[cell] + 1e-12).all()
        begin += width


# ------------------------------------------------------------------------------------------------ the car
@cache
def made() -> tuple[SwitchedCertificate, SwitchedProof]:
    return certify_horizon(BUMP, car_norms(BUMP))


def test_the_gain_by_time_has_a_delta_like_that_without_control_and_its_true_floor() -> None:
    certificate, proof = made()
    true = reference_floors(certificate.model, [c.norm for c in certificate.claims], 2.0)
    for claim, floor in zip(certificate.claims, true.tolist(), strict=True):
        assert floor < claim.floor < 1.01 * floor
    assert certificate.claims[0].largest_delta > 20.0  # [√J]; 20.1 without control
    said = "\n".join(statement(certificate, proof))
    assert "from 0.32 to 2.3 s, x_lin too, by u = K(t) x" in said and "energy norm: l <= 0.000178" in said


def test_no_start_within_delta_leaves_epsilon_and_the_worst_nearly_do() -> None:
    certificate, proof = made()
    near, far = motions_of(certificate.model, 0.5), motions_of(certificate.model, 2.5, 4e-3)
    rng = np.random.default_rng(8)
    for claim in certificate.claims:
        epsilon, delta = claim.table[[8, 16, -1]].T
        starts = rng.normal(size=(14, 120))
        starts *= np.repeat(delta, 40) / claim.norm(starts)
        reached = np.max([claim.norm(x) for x in far.off(starts)], axis=0)
        assert np.all(reached < np.repeat(epsilon, 40))
        for share in (0.1, 1.0 / 3.0):
            some = share * claim.largest_delta
            with precision(2):
                bound = float(proof.epsilon(claim.norm, np.array([some]))[0])
            worst = near.worst([claim.norm], [np.array([some])])[0][0]
            assert worst < bound < 1.05 * worst


def test_where_the_gain_acts_and_changes_at_once_it_is_as_sharp() -> None:
    parameters = {**AT_ONCE, "T": 0.4}
    energy = car_norms(parameters)[0]
    certificate, proof = certify_horizon(parameters, [energy])
    delta = certificate.claims[0].largest_delta / 3.0
    with precision(2):
        bound = float(proof.epsilon(energy, np.array([delta]))[0])
    worst = motions_of(certificate.model, 0.7).worst([energy], [np.array([delta])])[0][0]
    assert worst < bound < 1.05 * worst


def test_a_constant_table_says_what_the_certificate_of_a_constant_gain_says() -> None:
    """u = K x from t = 0 on; T is so late that the largest size of a motion does not see it."""
    control = control_parameters(AT_ONCE)
    K = design(control.model, infinite=True, span=None).infinite
    assert K is not None
    table = GainTable((0.0, 2.3), (tuple((k, *[0.0] * 7) for k in K),), settled=False)
    gain = infinite_gain(AT_ONCE)
    energy = car_norms(BUMP)[0]
    _, proof = certify_table(AT_ONCE, table, gain, [])
    _, closed = certify_car(BUMP, gain)
    delta = np.array([0.0, 1e-3, 0.1, 1.0, 6.0])
    with precision(2):
        np.testing.assert_allclose(proof.epsilon(energy, delta), closed.epsilon(energy, delta), rtol=2e-3)


def test_the_command_writes_a_file_of_its_own_and_verify_knows_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(closed_loop_certificate, "both", lambda parameters: (certified(0.01), certified(0.01)))
    monkeypatch.setattr(closed_loop_certificate, "certify_horizon", lambda parameters, norms: made())
    monkeypatch.setattr(switched_certificate, "verify", lambda certificate, build: made()[1])
    where = tmp_path / "c.json"
    assert main(["certify", "bump-lqr", "--closed-loop", "-o", str(where)]) == 0
    said = capsys.readouterr().out
    assert "energy norm: l times 1; largest delta times 1.04" in said and "c.horizon.json, " in said
    assert (tmp_path / "c.horizon.json").read_bytes() == to_json(made()[0])
    assert main(["verify", str(tmp_path / "c.horizon.json")]) == 0
    assert "c.horizon.json: every claim is proved" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "refused"),
    [
        (lambda m: m["table"]["coefficients"][-1][0].__setitem__(0, 1.01 * m["table"]["coefficients"][-1][0][0]), None),
        (lambda m: m["parameters"].update(c1=15100.0), None),
        (lambda m: m["parameters"].update(T=2.4), None),
        (lambda m: m["parameters"].update(horizon="infinite"), "finite"),
        (lambda m: m["parameters"].update(force_limit=500.0), "force_limit"),
        (lambda m: m["parameters"].update(design="full-car"), "coefficients"),
        (lambda m: m["table"]["edges"].__setitem__(1, 0.0), "must rise"),
        (lambda m: m["table"]["edges"].__setitem__(0, "nan"), "finite numbers"),
        (lambda m: m["table"].update(settled=True), "wanted the keys"),
        (lambda m: m.update(gain=[]), "wanted the kind"),
    ],
)
def test_another_table_or_car_or_controller_is_not_what_the_file_speaks_of(change: Any, refused: str | None) -> None:
    content = json.loads(to_json(made()[0]))
    change(content["model"])
    changed = opened(rehashed(content), "here", certificate_of)
    with pytest.raises(InputError if refused else NotProvedError, match=refused):
        verify(changed, build)
