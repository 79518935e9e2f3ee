"""Conditions 1 and 2 after (2.11) and their forms C0 to C3, on textbook systems and on the car.

That C1 agrees with exact Floquet exponents to the order A⁴ is tested in test_averaging.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from flint import fmpq
from test_almost_stable import OMEGA, PERIOD, build, certified, duffing, quiet

from analysis.bertolino_baksa.balls import NotProvedError
from analysis.bertolino_baksa.conditions import Verdict, conditions, growth_of
from analysis.bertolino_baksa.norms import proved_metric
from analysis.bertolino_baksa.proof import Proof, prove
from analysis.car import car_form, road_signal
from analysis.certificates.car_amplitudes import amplitude_lines, car_amplitudes
from analysis.certificates.car_conditions import car_verdicts
from analysis.methods.amplitudes import LEFT_OUT
from analysis.methods.averaging import average
from analysis.methods.floquet import floquet
from analysis.methods.modes import modes
from analysis.methods.signals import Piece, harmonic
from analysis.methods.standard_form import standard_form
from analysis.reference import Parameters, road_parameters
from analysis.scenario import read_scenario
from fmu_src.vehicle.parameters import Car


def wave(height: float) -> Piece:
    return harmonic([height], OMEGA).pieces[-1]


def verdicts(equations: Any, piece: Piece | None) -> tuple[Verdict, ...]:
    """Of a system that no motion is proved of but rest."""
    form = standard_form(equations, ["x", "v"], 1)

    def at_rest() -> Proof:
        system = build(equations, 2, quiet, fmpq(0))({})
        return prove(system, proved_metric(system, np.eye(2)), [], [0.0, 0.0])

    return conditions(form, piece, at_rest)


def test_duffing_without_force_has_no_average_at_all() -> None:
    """λ = −1/2 ± iβ: each of its 8 monomials dies, slowest v v v* in v' as exp(−t); so S_1 = 0 and v = 0 is neutral."""
    _, proof, form, _ = certified(duffing, 2)
    C0, C1, C2, C3 = conditions(form, None, lambda: proof)
    growth = growth_of(form)
    assert (growth.growing, growth.dying, growth.lasting) == (0, 8, 0)
    assert not C0.holds and "neutral" in C0.reason
    assert C1.holds and C1.number == pytest.approx(-0.5)
    assert C2.holds and C2.number == pytest.approx(1.0)
    assert C3.holds and C3.number < 1e-6


def test_forced_duffing_contracts_and_the_print_cannot_say_so() -> None:
    """E E E in v' grows as exp(t/2), to the print's S_1 = ∞; the proved multiplier is just above the exact one."""
    _, proof, form, _ = certified(duffing, 2, forced=True)
    C0, C1, C2, C3 = conditions(form, wave(0.3), lambda: proof)
    assert not C0.holds and C0.number == pytest.approx(0.5)
    assert C1.holds and C2.holds and C3.holds
    exact = np.exp(floquet(form, wave(0.3)).exponents.real.max() * float(PERIOD))
    assert exact < C3.number < 1.05 * exact


def test_van_der_pols_origin_is_unstable_in_every_form() -> None:
    C0, C1, C2, C3 = verdicts(lambda z, w, s, c: [z[1], -z[0] + z[1] * 0.2 - z[0] * z[0] * z[1] * 0.2 + w[0]], None)
    assert not (C0.holds or C1.holds or C2.holds or C3.holds)
    assert C1.number == pytest.approx(0.1)
    assert "does not contract" in C3.reason


def test_the_print_holds_where_only_the_input_damps() -> None:
    """x'' + w² x' + x = 0, w = cos Ωt: S_1(v) = −v/4, w bounded. C3 asks for damping without input: not proved."""

    def equations(z: Sequence[Any], w: Sequence[Any], s: Any, c: Any) -> list[Any]:
        return [z[1], -z[0] - w[0] * w[0] * z[1]]

    C0, C1, C2, C3 = verdicts(equations, wave(1.0))
    assert C0.holds and C1.holds and C2.holds and not C3.holds
    assert C0.number == pytest.approx(-0.25)
    assert C2.number == pytest.approx(2.0)  # E E* v in v*'; (E*)² v there has 2Ω − 2, more than that


def test_on_the_car_the_print_never_holds() -> None:
    """All monomials of the slowest mode die out, whatever the constants; those of fast modes grow."""
    form = car_form(Car(), order=3)
    growth, alpha = growth_of(form), modes(form.A).alpha
    slowest = growth.sigma.real[np.array(growth.equation) == np.argmax(alpha)]
    assert len(slowest) and (slowest < 0.0).all()
    assert growth.growing > 100
    assert growth.fastest == pytest.approx(3.0 * alpha.max() - alpha.min())


def test_the_verdict_of_record_on_the_bump() -> None:
    C0, C1, C2, C3 = car_verdicts(read_scenario("bump").parameters)
    assert not C0.holds
    assert C1.holds and C2.holds and C3.holds


def test_the_amplitudes_table_is_that_of_the_averaged_equations_and_its_second_order_is_nearer_to_floquet() -> None:
    parameters: Parameters = {"profile": "sine", "A": 0.03, "Lambda": 1.0, "v0": 10.0, "tau0": 0.02}
    form, piece = car_form(Car()), road_signal(road_parameters(parameters)).pieces[-1]
    found, exact = car_amplitudes(parameters, piece), floquet(form, piece).exponents[:7]
    equations = average(form, piece)
    np.testing.assert_allclose(found.A + found.B, equations.linear[:7], rtol=1e-9)
    assert np.abs(found.B[[1, 5, 6]].real).min() > 1e-6 * np.abs(found.A).max() and not found.B[3].any()
    error = [
        np.abs(equations.modes.eigenvalues[:7] + change - exact).max() for change in (found.A + found.B, found.second)
    ]
    assert error[1] < 0.1 * error[0] < 0.01 * np.abs(exact - equations.modes.eigenvalues[:7]).max()
    assert found.own[1] == equations.coefficient(1, (1, 1, 8))
    (rest, out), *others = found.resting
    assert not rest.amplitudes.any() and rest.stable and out < LEFT_OUT and len(others) == 20
    lines = amplitude_lines(parameters, piece)
    row = next(line for line in lines if line.startswith("   7")).split()
    assert [float(row[i]) for i in (1, 2, 3, 5)] == pytest.approx(
        [equations.modes.alpha[6], found.A[6].real, found.B[6].real, found.second[6].real], rel=0.01
    )
    assert row[7].endswith("*") and float(row[7][:-1]) > float(row[8])
    assert "20 more solve the equations where averaging ends" in lines[-1]


def test_the_amplitudes_table_says_where_there_is_none() -> None:
    creeping: Parameters = {"b1": 12000.0, "b2": 12000.0}
    (line,) = amplitude_lines(creeping, None)
    assert "not for this car and road" in line


def test_near_a_resonance_averaging_reaches_further_than_its_small_divisors() -> None:
    """Where the road all but meets mode 7: the term is kept, not divided by the detuning."""

    def unproved() -> Proof:
        raise NotProvedError("left out here")

    parameters: Parameters = {"profile": "sine", "A": 0.01, "Lambda": 1.0, "v0": 12.75404, "tau0": 0.02}
    piece = road_signal(road_parameters(parameters)).pieces[-1]
    C1 = conditions(car_form(Car(), order=3), piece, unproved)[1]
    height = float(C1.reason.split("not lost up to ")[1].split(" times")[0])
    assert C1.holds and 5.0 < height < 20.0
