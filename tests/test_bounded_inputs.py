"""All inputs of |w| ≤ W: the exact threshold of a textbook system, closed-form gains, worst inputs, and the car."""

from __future__ import annotations

import numpy as np
import pytest
from flint import fmpq
from test_almost_stable import Equations, build, cubic, duffing, pendulum, quiet

from analysis.__main__ import main
from analysis.bertolino_baksa.adversary import motions
from analysis.bertolino_baksa.balls import NotProvedError, precision
from analysis.bertolino_baksa.bounded_inputs import Gains, gains, reached, worst_inputs
from analysis.bertolino_baksa.norms import euclid, modal_metric, proved_metric, weighted_sup
from analysis.car import car_form
from analysis.certificates.car_bounded_roads import car_gains, heights
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
            bound = found.motion(np.array([W]), np.zeros(1))[0][0]
            assert exact < bound < exact * 1.03
        with pytest.raises(NotProvedError, match="without end"):
            found.motion(np.array([1.001 * 4.0 / (3.0 * np.sqrt(3.0))]), np.zeros(1))


def test_gains_of_an_oscillator_are_those_of_the_closed_form() -> None:
    """x'' + x' + 4x = w: ∫|e^(−at) sin bt|/b = coth(πa/2b)/(a² + b²)."""
    found, _ = textbook(duffing, 2)
    a, b = 0.5, np.sqrt(3.75)
    exact = 0.25 / np.tanh(np.pi * a / (2.0 * b))
    assert exact < found.of_inputs[0, 0] < 1.003 * exact
    assert found.of_rates[0, 1] == pytest.approx(found.of_inputs[0, 0])


@pytest.mark.parametrize("equations", [duffing, pendulum])
def test_no_input_gets_beyond_and_the_worst_comes_near(equations: Equations) -> None:
    found, form = textbook(equations, 2)
    W, rng = np.array([0.2]), np.random.default_rng(2)
    for norm in (euclid(2), weighted_sup(np.ones(2))):
        with precision(2):
            floor, wider = found.epsilon(W, norm, [0.0, 0.3])
        assert floor < wider
        assert floor / 1.5 < reached(form, worst_inputs(form, norm, W), norm) < floor
        off = rng.normal(size=(2, 100))
        off *= 0.3 / norm(off)
        for _ in range(2):
            values = rng.uniform(-W, W, 40)
            signal = Signal(
                tuple(Piece(0.4 * k, np.zeros(1, complex), np.array([[v + 0j]])) for k, v in enumerate(values))
            )
            assert max(norm(x).max() for _, x in motions(form, signal, off, 16.0, 0.02)) < wider


def test_every_road_under_the_car() -> None:
    """Nearly sharp in each state: the weighted sup of |h| ≤ 0.01 m."""
    found, form, W = car_gains({}), car_form(Car()), heights({}, 0.01)
    norm = norms(Car(), (found.of_inputs @ W)[:, None])[1]
    with precision(2):
        floor = found.epsilon(W, norm, [0.0])[0]
        with pytest.raises(NotProvedError):
            found.motion(heights({}, 0.2), np.zeros(14))
    assert floor / 1.1 < reached(form, worst_inputs(form, norm, W), norm) < floor


def test_roads_that_cannot_be_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for A in (-0.01, 0.0, np.nan, np.inf):
        with pytest.raises(InputError, match="wanted a height"):
            heights({}, A)
    with pytest.raises(InputError, match="tyres without dampers"):
        heights({"bp1": 10.0}, 0.01)
    assert main(["certify", "bump", "--bounded", "0.01", "-o", "x.json"]) == 2
    assert main(["certify", "bump", "--bounded", "0.5"]) == 1
    assert "no certificate" in capsys.readouterr().out
