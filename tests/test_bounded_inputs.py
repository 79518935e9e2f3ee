"""All inputs of |w| ≤ W: the exact threshold of a textbook system, closed-form gains, worst inputs, and the car."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flint import arb, fmpq
from scipy.linalg import expm
from test_almost_stable import Equations, build, cubic, duffing, pendulum, quiet

from analysis.__main__ import main
from analysis.bertolino_baksa import bounded_inputs
from analysis.bertolino_baksa.adversary import motions
from analysis.bertolino_baksa.balls import ExactSystem, NotProvedError, precision
from analysis.bertolino_baksa.bounded_certificate import (
    BoundedCertificate,
    certificate_of,
    certify,
    to_json,
    verify,
)
from analysis.bertolino_baksa.bounded_inputs import Bounds, Gains, gains
from analysis.bertolino_baksa.certificate import opened
from analysis.bertolino_baksa.norms import Norm, euclid, modal_metric, proved_metric, weighted_sup
from analysis.bertolino_baksa.worst_inputs import reached, worst_inputs
from analysis.car import car_form
from analysis.certificates.car_bounded_roads import car_gains, heights, highest
from analysis.certificates.exact_car import norms
from analysis.errors import InputError
from analysis.methods.signals import Piece, Signal
from analysis.methods.standard_form import StandardForm, standard_form
from fmu_src.vehicle.parameters import Car


def textbook(equations: Equations, states: int) -> tuple[Gains, StandardForm]:
    form = standard_form(equations, [f"x{i}" for i in range(states)], 1)
    with precision(2):
        system = build(equations, states, quiet, fmpq(0))({})
        return gains(system, proved_metric(system, modal_metric(form.A, np.eye(states)))), form


def test_the_exact_threshold_is_found() -> None:
    """x' = −x + x³/4 + w: bounded for |w| ≤ W < 4/(3√3), by the root Y of Y − Y³/4 = W; for no larger W."""
    found, _ = textbook(cubic, 1)
    with precision(2):
        for share in (0.2, 0.9, 0.98):
            W = share * 4.0 / (3.0 * np.sqrt(3.0))
            exact = np.roots([-0.25, 0.0, 1.0, -W])
            exact = min(exact[exact > 0.0].real)
            bound = found.under(Bounds(np.array([W]))).motion(np.zeros(1))[0][0]
            assert exact < bound < exact * 1.03
        with pytest.raises(NotProvedError, match="without end"):
            found.under(Bounds(np.array([1.001 * 4.0 / (3.0 * np.sqrt(3.0))]))).motion(np.zeros(1))


def test_gains_of_an_oscillator_are_those_of_the_closed_form() -> None:
    """x'' + x' + 4x = w: ∫|e^(−at) sin bt|/b = coth(πa/2b)/(a² + b²)."""
    found, _ = textbook(duffing, 2)
    a, b = 0.5, np.sqrt(3.75)
    exact = 0.25 / np.tanh(np.pi * a / (2.0 * b))
    with precision(2):
        of_input = found.driven(np.eye(2), Bounds(np.ones(1)))[0]
    assert exact < of_input < 1.003 * exact
    assert found.of_rates[0, 1] == pytest.approx(of_input)


@pytest.mark.parametrize("equations", [duffing, pendulum])
def test_no_input_gets_beyond_and_the_worst_comes_near(equations: Equations) -> None:
    found, form = textbook(equations, 2)
    W, rng = 0.2, np.random.default_rng(2)
    bounds = Bounds(np.array([W]))
    for norm in (euclid(2), weighted_sup(np.ones(2))):
        with precision(2):
            floor, wider = found.under(bounds).epsilon(norm, [0.0, 0.3])
        assert floor < wider
        assert floor / 1.5 < reached(form, norm, bounds, worst_inputs(form, norm, bounds)) < floor
        off = rng.normal(size=(2, 100))
        off *= 0.3 / norm(off)
        for _ in range(2):
            values = rng.uniform(-W, W, 40)
            signal = Signal(
                tuple(Piece(0.4 * k, np.zeros(1, complex), np.array([[v + 0j]])) for k, v in enumerate(values))
            )
            assert max(norm(x).max() for _, x in motions(form, signal, off, 16.0, 0.02)) < wider


def test_what_a_start_does_after_the_last_cell_is_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells up to 0.4 s of x'' + x' + 4x = 0, whose velocity is largest later: both bounds are of all times."""
    monkeypatch.setattr(bounded_inputs, "LONG", 0.05)
    found, form = textbook(duffing, 2)
    flow = np.array([expm(form.A * t) for t in np.linspace(0.0, 10.0, 1000)])
    with precision(2):
        assert found.decay.width.sum() < 0.4
        assert (found.spread(euclid(2)) >= np.linalg.norm(flow, axis=2).max(axis=0)).all()
        assert found.kappa(euclid(2)) >= np.linalg.norm(flow, 2, axis=(1, 2)).max()


def tied(model: dict[str, float]) -> ExactSystem:
    """x'' + x' + 4x + x³/2 = w + c ẇ, of inputs w, ẇ."""

    def equations(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
        force = w[0] + w[1] * arb(model.get("c", 0.0))
        return [x[1], x[0] * -4.0 + x[1] * -1.0 + x[0] * x[0] * x[0] * -0.5 + force]

    return ExactSystem(2, 2, equations, ((fmpq(0), lambda t: [arb(0), arb(0)]),), fmpq(0))


def tied_gains(c: float = 0.0) -> tuple[Gains, StandardForm]:
    form = standard_form(tied({"c": c}).equations, ["x", "v"], 2)
    with precision(2):
        system = tied({"c": c})
        return gains(system, proved_metric(system, modal_metric(form.A, np.eye(2)))), form


@pytest.mark.parametrize("c", [0.0, 0.25])
def test_what_slopes_add_is_met_by_linear_programming(c: float) -> None:
    """Duality leaves no gap: the bound on the linear part is what an input reaches, but for the sampling."""
    found, form = tied_gains(c)
    A, before = 1e-4, np.zeros(2)  # so small that the cube does not count
    for V in (A, 4.0 * A, 16.0 * A):
        bounds = Bounds(np.array([A, V]), tied=True)
        for row, norm in enumerate(np.eye(2)):
            only = Norm("one", norm[:, None] * norm, largest=True)
            with precision(2):
                bound = found.driven(np.eye(2), bounds)[row]
                apart = found.driven(np.eye(2), Bounds(bounds.sizes))[row]
            most = reached(form, only, bounds, worst_inputs(form, only, bounds))
            assert most < bound <= apart
            assert before[row] < bound < 1.05 * most
            before[row] = bound
    with precision(2):
        static = found.driven(np.eye(2), Bounds(np.array([A, 1e-3 * A]), tied=True))[0]
    assert 0.25 * A < static < 0.252 * A


def test_a_certificate_of_all_inputs_is_read_back_and_proved_and_more_is_not() -> None:
    found, _ = tied_gains()
    with precision(2):
        made = certify({}, found.under(Bounds(np.array([0.3, 0.3]), tied=True)), [euclid(2), weighted_sup(np.ones(2))])
    read = opened(to_json(made), "here", certificate_of)
    assert isinstance(read, BoundedCertificate)
    verify(read, tied)
    claim = read.claims[0]
    sharper = replace(claim, table=claim.table * np.array([1.0 - 1e-5, 1.0]))
    wider = replace(claim, table=claim.table * np.array([1.0, 1.1]))
    for wrong in (
        replace(read, claims=(sharper,)),
        replace(read, claims=(wider,)),
        replace(read, bounds=Bounds(np.array([0.301, 0.3]), tied=True)),
        replace(read, bounds=Bounds(np.array([0.3, 0.31]), tied=True)),
        replace(read, bounds=Bounds(np.array([0.3, 0.3]))),
        replace(read, bounds=Bounds(np.array([0.3]))),
        replace(read, model={"c": 0.01}),
    ):
        with pytest.raises(NotProvedError):
            verify(wrong, tied)
    with pytest.raises(InputError, match="altered"):
        opened(to_json(made).replace(b'"tied": true', b'"tied": false'), "here", certificate_of)


def test_every_road_under_the_car() -> None:
    """Nearly sharp in each state: the weighted sup of |h| ≤ 0.01 m."""
    found, form, bounds = car_gains({}), car_form(Car()), heights({}, 0.01)
    with precision(2):
        driven = found.under(bounds)
        norm = norms(Car(), driven.states[:, None])[1]
        floor = driven.epsilon(norm, [0.0])[0]
        with pytest.raises(NotProvedError):
            found.under(heights({}, 0.2)).motion(np.zeros(14))
        for V, share in ((0.1, 0.75), (10.0, 1.0)):  # a slope of 1/100 at 10 m/s spares the axles; a steep one no one
            states = found.under(heights({}, 0.01, V)).states
            assert (states <= driven.states * (1.0 + 1e-6)).all()
            assert states[5] < share * driven.states[5] * (1.0 + 1e-6)
    assert floor / 1.1 < reached(form, norm, bounds, worst_inputs(form, norm, bounds)) < floor


def test_up_to_the_largest_height_that_is_printed_there_is_a_certificate() -> None:
    """Of starts off ψ = 0 as well: the motion from rest alone is bounded a little further."""
    with precision(2):
        found = car_gains({})
        top = highest(found, {}, 0.02, None)
        driven = found.under(heights({}, top))
        made = certify({}, driven, norms(Car(), driven.states[:, None]))
        assert min(claim.largest_delta for claim in made.claims) > 0.0
        with pytest.raises(NotProvedError):
            beyond = found.under(heights({}, 1.02 * top))
            certify({}, beyond, norms(Car(), beyond.states[:, None]))


def test_roads_that_cannot_be_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for A in (-0.01, 0.0, np.nan, np.inf):
        with pytest.raises(InputError, match="wanted a height"):
            heights({}, A)
        with pytest.raises(InputError, match="wanted a rate of height"):
            heights({}, 0.01, A)
    with pytest.raises(InputError, match="tyres without dampers"):
        heights({"bp1": 10.0}, 0.01)
    assert heights({"bp1": 10.0}, 0.01, 0.1).tied
    assert main(["certify", "bump", "--slope", "0.1"]) == 2
    assert main(["certify", "bump", "--quick", "-o", "x.json"]) == 2
    assert main(["certify", "bump", "--bounded", "0.5"]) == 1
    assert "no certificate" in capsys.readouterr().out
