"""Definition 2.1 proved for textbook systems, whose truth is known, and what must not be proved is not."""

from __future__ import annotations

import dataclasses
import json
import random
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_series, ctx, fmpq

from analysis.bertolino_baksa.adversary import excursions, reference_floor
from analysis.bertolino_baksa.balls import ExactSystem, NotProvedError, above, decimal, length, precision, two_norm
from analysis.bertolino_baksa.bounded_inputs import Bounds, gains
from analysis.bertolino_baksa.certificate import Certificate, certify, from_json, to_json, verify
from analysis.bertolino_baksa.majorant import SECANT, majorant
from analysis.bertolino_baksa.norms import Norm, euclid, modal_metric, proved_metric, weighted_sup
from analysis.bertolino_baksa.proof import Proof
from analysis.bertolino_baksa.quick import quick_floors
from analysis.errors import InputError
from analysis.methods.signals import Signal, constant, harmonic
from analysis.methods.standard_form import StandardForm, standard_form

Equations = Callable[..., Sequence[Any]]
PERIOD = fmpq(5, 2)
OMEGA = 2.0 * np.pi / 2.5


def cubic(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
    """x' = −x + x³/4 + w; without w every |x(0)| < 2 dies out and no other does."""
    return [x[0] * -1.0 + x[0] * x[0] * x[0] * 0.25 + w[0]]


def duffing(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
    return [x[1], x[0] * -4.0 + x[1] * -1.0 + x[0] * x[0] * x[0] * -0.5 + w[0]]


def pendulum(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
    return [x[1], sine(x[0]) * -4.0 - x[1] + cosine(x[0]) * w[0]]


def quiet(t: Any) -> list[Any]:
    return [arb(0)]


def swinging(t: Any) -> list[Any]:
    return [(t * (2 * arb.pi() / PERIOD)).cos() * arb("0.3")]


def build(
    equations: Equations, states: int, input: Callable[[Any], list[Any]], period: fmpq
) -> Callable[..., ExactSystem]:
    return lambda model: ExactSystem(states, 1, equations, ((fmpq(0), input),), period)


def certified(
    equations: Equations, states: int, *, forced: bool = False, x0: Sequence[float] | None = None
) -> tuple[Certificate, Proof, StandardForm, Signal]:
    form = standard_form(equations, [f"x{i}" for i in range(states)], 1)
    made = build(equations, states, swinging if forced else quiet, PERIOD if forced else fmpq(0))
    S, start = modal_metric(form.A, np.eye(states)), np.array(x0 or [0.0] * states)
    norms = (euclid(states), weighted_sup(np.ones(states)))
    certificate, proof = certify({}, made, S, lambda x_lin: norms, [fmpq(30)], start)
    signal = harmonic([0.3], OMEGA) if forced else constant([0.0])
    return certificate, proof, form, signal


# ---------------------------------------------------------------------------------------------------- balls
def test_the_traps_of_ball_arithmetic_are_closed() -> None:
    assert decimal(0.1) == fmpq(1, 10)
    assert above(arb("0.1")) > 0.1 >= float(arb("0.1").lower())
    assert length([arb(0, 1e-30)]) <= 1.1e-30  # the square of a ball around 0 reaches below 0
    for bad in (arb("nan"), arb("inf"), arb(0, float("inf"))):
        with pytest.raises(NotProvedError):
            above(bad)
    before = ctx.cap
    with precision(37):
        assert len((1 / (1 - arb_series([0, 1]))).coeffs()) == 37
    assert ctx.cap == before
    m = np.random.default_rng(3).normal(size=(5, 4, 4))
    exact = np.linalg.svd(m)[1][:, 0]
    assert (two_norm(m) >= exact).all()
    np.testing.assert_allclose(two_norm(m), exact, rtol=1e-10)


def test_a_bound_of_a_norm_does_not_trust_its_eigenvectors(monkeypatch: pytest.MonkeyPatch) -> None:
    m, eigh = np.random.default_rng(3).normal(size=(4, 4)), np.linalg.eigh
    exact = np.linalg.norm(m, 2)
    for wrong, worst in ((1e-5, 1.0 + 1e-4), (0.1, None), (np.nan, None)):
        monkeypatch.setattr(np.linalg, "eigh", lambda a, wrong=wrong: (eigh(a)[0], eigh(a)[1] * (1.0 - wrong)))
        if worst:
            assert exact <= two_norm(m) <= worst * exact
        else:
            with pytest.raises(NotProvedError, match="orthogonal"):
                two_norm(m)


@pytest.mark.parametrize("equations", [duffing, pendulum])
def test_the_majorant_is_one_and_it_is_close(equations: Equations) -> None:
    """R(x + y) − R(x) never changes by more than it says, at random points; but the worst comes near."""
    form = standard_form(equations, ["a", "b"], 1)
    with precision(2):
        bound = majorant(build(equations, 2, quiet, fmpq(0))({}), np.array([1.0, 1.0, 1.0]))
    rng = np.random.default_rng(5)
    closest = 0.0
    for _ in range(300):
        X, Y = rng.uniform(0.0, 0.5, 3), np.append(rng.uniform(0.0, 0.5, 2), 0.0)
        x, y = (rng.choice([-1.0, 1.0], (3, 64)) * size[:, None] for size in (X, Y))
        R = [form.rate(v[:2], v[2:]) - form.A @ v[:2] - form.B @ v[2:] for v in (x + y, x)]
        change = np.abs(R[0] - R[1]).max(axis=1)
        most = bound.change(X[:, None], bound(X[:, None]), Y[:, None])[:, 0]
        assert (change <= most + 1e-14).all()  # its own rounding
        closest = max(closest, change[1] / most[1])
    assert closest > 0.99


# ---------------------------------------------------------------------------------------------------- known basins
def test_the_exact_basin_is_not_left_and_most_of_it_is_proved() -> None:
    certificate, _, form, signal = certified(cubic, 1)
    claim = certificate.claims[0]
    assert 1.6 < claim.largest_delta < 2.0
    with pytest.raises(InputError, match="at least l"):
        claim.delta(0.5 * claim.floor)
    inside = np.linspace(-1.0, 1.0, 21)[None, :] * claim.largest_delta
    reached = excursions(form, signal, [claim.norm], np.zeros(1), inside, 20.0, 0.02)[0]
    assert reached.max() < claim.table[-1, 0]


@pytest.mark.parametrize("equations", [duffing, pendulum])
def test_a_forced_oscillator_is_almost_stable_for_ever(equations: Equations) -> None:
    """l > 0 strictly, as x_lin is no solution, and nearly sharp; every start inside δ stays inside ε."""
    certificate, proof, form, signal = certified(equations, 2, forced=True)
    assert proof.repetition is not None
    rng = np.random.default_rng(11)
    for claim in certificate.claims:
        true = reference_floor(form, signal, [claim.norm], np.zeros(2), 40.0)[0]
        assert 1e-4 < true < claim.floor < 1.02 * true
        for epsilon, delta in claim.table[[0, 8, 16, -1]].tolist():
            off = rng.normal(size=(2, 200))
            off *= delta / claim.norm(off)
            assert excursions(form, signal, [claim.norm], np.zeros(2), off, 25.0, 0.02).max() < epsilon
            assert claim.delta(epsilon) == delta


def test_a_start_off_rest_is_the_start_of_psi_too() -> None:
    certificate, _, form, signal = certified(duffing, 2, x0=[0.4, -0.2])
    true = reference_floor(form, signal, [c.norm for c in certificate.claims], np.array([0.4, -0.2]), 30.0)
    for claim, floor in zip(certificate.claims, true, strict=True):
        assert floor < claim.floor < 1.01 * floor


# ---------------------------------------------------------------------------------------------------- no certificate
def test_van_der_pols_origin_has_no_certificate_and_says_why() -> None:
    def van_der_pol(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
        return [x[1], x[0] * -1.0 + x[1] * 0.1 - x[0] * x[0] * x[1] * 0.1 + w[0]]

    with pytest.raises(NotProvedError, match=r"does not contract: growth rate up to 0\.05 1/s"):
        certified(van_der_pol, 2)


def test_units_in_which_squares_of_floats_vanish_are_refused() -> None:
    """With S · 1e80 and T · 1e-84 every |T S⁻¹|² would be 0, and so every bound of a norm."""
    certificate, proof, _, _ = certified(duffing, 2)
    norm, made = certificate.claims[0].norm, build(duffing, 2, quiet, fmpq(0))
    for scale in (1e-84, 1e84, 0.0):
        with pytest.raises(NotProvedError, match=r"singular|largest entry"), precision(2):
            proof.epsilon(dataclasses.replace(norm, T=norm.T * scale), np.array([scale]))
        with pytest.raises(NotProvedError, match=r"singular|largest entry"):
            verify(dataclasses.replace(certificate, S=certificate.S * scale), made)
    verify(dataclasses.replace(certificate, S=certificate.S * 1e20), made)
    with precision(2):  # starts whose squares vanish are not proved to stay at rest
        assert (proof.epsilon(norm, np.array([0.0, 1e-200])) > 1e-100).all()


def test_a_motion_that_runs_away_has_no_certificate() -> None:
    with pytest.raises(NotProvedError):
        certified(cubic, 1, x0=[2.01])


def test_a_system_that_does_not_rest_without_input_is_refused() -> None:
    """x' = −x + (cos x − 1)/128 + w rests; without the 1 it does not, and l would be too small by as much."""

    def pushed(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
        return [x[0] * -1.0 + cosine(x[0]) * (arb(1) / 128) + w[0]]

    def resting(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
        return [pushed(x, w, sine, cosine)[0] - arb(1) / 128]

    none, one = [fmpq(5)], np.eye(1)
    certify({}, build(resting, 1, quiet, fmpq(0)), one, lambda x: (euclid(1),), none, np.zeros(1))
    made = build(pushed, 1, quiet, fmpq(0))
    with pytest.raises(NotProvedError, match="row 0 of F"):
        certify({}, made, one, lambda x: (euclid(1),), none, np.zeros(1))
    with precision(2):
        metric = proved_metric(made({}), one)
        with pytest.raises(NotProvedError, match="row 0 of F"):
            quick_floors(made({}), metric, [euclid(1)], [0.0], fmpq(5))
        with pytest.raises(NotProvedError, match="row 0 of F"):
            gains(made({}), metric).under(Bounds(np.zeros(1))).motion(np.zeros(1))


def test_the_majorant_ends_before_a_pole() -> None:
    """x₁⁷/(1 − x₁²)² has a pole at 1; its majorant, where |2x² − x⁴| may reach 1: at x² = √2 − 1."""

    def pole(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
        square = x[0] * x[0]
        left = 1.0 - square
        return [x[0] * -1.0, square * square * square * x[0] * (arb(1) / 20) / (left * left) - x[1] + w[0]]

    made, end = build(pole, 2, quiet, fmpq(0)), np.sqrt(np.sqrt(2.0) - 1.0)
    with precision(2):
        good = majorant(made({}), np.array([0.99 * end / (1.0 + SECANT), 1.0, 1.0]))
        assert np.isfinite(good.slope).all()
        for size in (0.99 * end, 1.2, 3.0):  # a secant beyond 0.99 end reaches over it
            with pytest.raises(NotProvedError, match="divisor"):
                majorant(made({}), np.array([size, 1.0, 1.0]))
    certificate, _ = certify({}, made, np.eye(2), lambda x: (Norm("sup", np.eye(2), True),), [fmpq(7)], np.zeros(2))
    assert certificate.claims[0].largest_delta < end


def test_an_input_that_is_not_over_is_not_taken_for_none() -> None:
    form = standard_form(duffing, ["x", "v"], 1)
    endless = build(duffing, 2, swinging, fmpq(0))
    with pytest.raises(NotProvedError, match="not proved to be flat"):
        certify({}, endless, modal_metric(form.A, np.eye(2)), lambda x: (euclid(2),), [fmpq(30)], np.zeros(2))


def test_a_claimed_period_that_is_none_is_refused() -> None:
    form = standard_form(duffing, ["x", "v"], 1)
    wrong = build(duffing, 2, swinging, fmpq(1))
    with pytest.raises(NotProvedError):
        certify({}, wrong, modal_metric(form.A, np.eye(2)), lambda x: (euclid(2),), [fmpq(30)], np.zeros(2))


# ---------------------------------------------------------------------------------------------------- certificates
def corrupted(content: dict[str, Any], rng: random.Random) -> str:
    """Change one thing for the worse; says what."""
    kind = rng.choice(["eps", "delta", "coefficient", "begin", "missing", "norm", "metric", "x0"])
    claim, piece = rng.choice(content["claims"]), rng.choice(content["pieces"])
    row = rng.choice(claim["delta of eps"])
    match kind:
        case "eps":  # a digit, downwards
            row["eps"] *= 1.0 - 10.0 ** rng.uniform(-5.5, -1.0)
        case "delta":
            row["delta"] *= 1.0 + 10.0 ** rng.uniform(-2.0, 1.0)
        case "coefficient":
            column = rng.choice(piece["x_lin"])
            column[rng.randrange(3)] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3.0, 0.0)
        case "begin":
            piece["begin"] = "1/7"
        case "missing":
            content["pieces"].remove(piece)
        case "norm":  # smaller units: the same numbers now claim more
            claim["norm"]["T"] = (np.array(claim["norm"]["T"]) * 1.01).tolist()
            claim["delta of eps"] = [{"eps": r["eps"], "delta": r["delta"] * 1.01} for r in claim["delta of eps"]]
        case "metric":
            content["metric"][0] = [0.0] * len(content["metric"])
        case "x0":
            content["x0"][0] += 0.01
    claim["l"] = claim["delta of eps"][0]["eps"]
    return kind


def test_corrupted_certificates_are_rejected_with_and_without_their_hash() -> None:
    certificate, _, _, _ = certified(duffing, 2, forced=True)
    made = build(duffing, 2, swinging, PERIOD)
    data = to_json(certificate)
    verify(from_json(data, "here"), made)
    kinds = set()
    for seed in range(60):
        content = json.loads(data)
        kinds.add(kind := corrupted(content, random.Random(seed)))
        with pytest.raises(InputError, match="altered"):
            from_json(json.dumps(content).encode(), "here")
        with pytest.raises((InputError, NotProvedError)):
            verify(from_json(rehashed(content), "here"), made)
        assert kind
    assert len(kinds) == 8


def rehashed(content: dict[str, Any]) -> bytes:
    from analysis.bertolino_baksa.certificate import _hash

    rest = {key: value for key, value in content.items() if key != "sha256"}
    return json.dumps({"sha256": _hash(rest), **rest}).encode()


@pytest.mark.parametrize("value", ["nan", "inf", '"x"', "null", "[]", "1e400"])
def test_what_is_no_number_is_refused(value: str) -> None:
    certificate, _, _, _ = certified(cubic, 1)
    content = json.loads(to_json(certificate))
    content["pieces"][0]["e"][0][0] = "HERE"
    text = json.dumps(content).replace('"HERE"', value.replace("nan", "NaN").replace("inf", "Infinity"))
    with pytest.raises(InputError):
        from_json(text.encode(), "here")


def test_another_system_is_not_what_the_certificate_speaks_of() -> None:
    certificate, _, _, _ = certified(duffing, 2, forced=True)

    def other(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
        return [x[1], x[0] * -4.004 + x[1] * -1.0 + x[0] * x[0] * x[0] * -0.5 + w[0]]

    with pytest.raises(NotProvedError):
        verify(certificate, build(other, 2, swinging, PERIOD))


def test_a_norm_is_a_norm() -> None:
    x = np.array([[3.0], [-4.0]])
    assert euclid(2)(x)[0] == pytest.approx(5.0)
    assert weighted_sup(np.array([1.0, 8.0]))(x)[0] == pytest.approx(3.0)
    assert dataclasses.replace(euclid(2), largest=True)(x)[0] == 4.0
    assert Norm("half", 0.5 * np.eye(2))(x)[0] == pytest.approx(2.5)
