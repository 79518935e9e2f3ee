"""Conditions 1 and 2 after (2.11) and their forms C0 to C3, on textbook systems and on the car.

That C1 agrees with exact Floquet exponents to the order A⁴ is tested in test_averaging.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flint import fmpq
from test_almost_stable import OMEGA, PERIOD, build, certified, duffing, quiet

from analysis.bertolino_baksa.balls import NotProvedError
from analysis.bertolino_baksa.conditions import Verdict, by_averaging, by_normal_form, conditions, growth_of
from analysis.bertolino_baksa.norms import proved_metric
from analysis.bertolino_baksa.proof import Proof, prove
from analysis.car import car_form, road_signal
from analysis.certificates import car_amplitudes as car_amplitudes_module
from analysis.certificates.car_amplitudes import amplitude_lines, car_amplitudes
from analysis.certificates.car_conditions import car_verdicts
from analysis.methods.amplitudes import LEFT_OUT, Stability, decided
from analysis.methods.averaging import AmplitudeEquations, average
from analysis.methods.floquet import floquet
from analysis.methods.modes import modes
from analysis.methods.signals import Piece, harmonic
from analysis.methods.standard_form import standard_form
from analysis.reference import Parameters, car_of, road_parameters
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


def unproved_verdicts(parameters: Parameters) -> tuple[Verdict, ...]:
    """Without the proof of C3, which takes long."""

    def unproved() -> Proof:
        raise NotProvedError("left out here")

    piece = road_signal(road_parameters(parameters)).pieces[-1]
    return conditions(car_form(car_of(parameters), order=3), piece if piece.amplitudes.any() else None, unproved)


MEETING: Parameters = {"profile": "sine", "Lambda": 1.0, "v0": 12.75404, "tau0": 0.02}  # Ω = β7


@pytest.mark.parametrize(
    ("parameters", "why"),
    [
        ({**MEETING, "A": 0.4}, "small ones, got s_3 in s_2'"),
        ({**MEETING, "v0": 10.0, "A": 0.4, "b1": 12000.0, "b2": 12000.0}, "modes of equal frequency"),
        ({"profile": "bump", "b1": 0.0, "b2": 0.0}, "wanted damped modes, got one whose decay is round-off"),
        ({**MEETING, "v0": 10.0, "A": 0.01, "b1": 0.0, "b2": 0.0}, "wanted damped modes"),
    ],
    ids=["the road meets a mode", "creeping", "undamped", "undamped on a road"],
)
def test_where_averaging_does_not_decide_the_others_still_speak(parameters: Parameters, why: str) -> None:
    C0, C1, C2, C3 = unproved_verdicts(parameters)
    assert "monomials of X^-1 S" in C0.reason and C3.reason == "not proved: left out here"
    assert not C1.holds and np.isnan(C1.number) and C1.reason.startswith("not decided: ") and why in C1.reason
    assert not C2.holds and 0.0 < C2.number < 1.0 and C2.reason.endswith("; decay of what stays not decided, as in C1")
    piece = road_signal(road_parameters(parameters)).pieces[-1]
    (line,) = amplitude_lines(parameters, piece if piece.amplitudes.any() else None)
    assert line.startswith("(3.20) mode by mode: not for this car and road: ") and why in line


def test_a_decay_that_is_round_off_beside_a_mode_that_grows_leaves_it_unstable() -> None:
    """x'' + 4 x = 0 beside van der Pol's oscillator."""
    form = standard_form(
        lambda z, w, s, c: [z[2], z[3], -z[0] + z[2] * 0.2 - z[0] * z[0] * z[2] * 0.2 + w[0], z[1] * -4.0],
        ["x", "y", "x'", "y'"],
        1,
    )
    found = decided(average(form))
    assert by_averaging(found).number == pytest.approx(0.1) and not by_averaging(found).holds


def test_a_margin_less_the_sizes_of_what_nearly_resonates_says_so() -> None:
    parameters: Parameters = {**MEETING, "v0": 12.754, "A": 0.03}
    piece = road_signal(road_parameters(parameters)).pieces[-1]
    found = car_amplitudes(parameters, piece)
    plain = found.modes.alpha[:7] + (found.A + found.B).real
    np.testing.assert_allclose(found.condition.growth[:7] - found.condition.sizes[:7], plain, rtol=1e-9)
    assert plain[6] == pytest.approx(-16.828, abs=1e-3) and found.condition.growth[6] == pytest.approx(-16.72, abs=1e-3)
    lines = amplitude_lines(parameters, piece)
    rows = [next(line for line in lines if line.startswith(f"   {k} ")).split() for k in range(1, 8)]
    assert [row[4].endswith("~") for row in rows] == [False, True, True, False, True, True, True]
    assert float(rows[6][4][:-1]) == pytest.approx(16.72, abs=1e-4) and "   ~ less the sizes of what nearly" in lines[9]
    C1 = by_averaging(found.condition)  # mode 1 decides, which nothing resonates with
    assert "resonates" not in C1.reason and C1.number == pytest.approx(plain[0])
    slow = replace(found.condition, growth=found.condition.growth * np.where(np.arange(14) % 7 == 6, 1e-2, 1.0))
    assert "B_k), its margin less the sizes of what nearly resonates, not lost" in by_averaging(slow).reason
    C2 = by_normal_form(growth_of(car_form(Car(), order=3), piece), slow)
    assert C2.reason.endswith("decay of what stays 0.1672 1/s, less the sizes of what nearly resonates")


def test_the_forced_motion_is_told_apart_from_amplitudes_that_are_the_formulas() -> None:
    """At A = 0.4 m averaging leaves out too much of both."""

    def resting(A: float) -> list[str]:
        parameters: Parameters = {**MEETING, "v0": 10.0, "A": A}
        return amplitude_lines(parameters, road_signal(road_parameters(parameters)).pieces[-1])[-2:]

    rest, others = resting(0.4)
    assert rest.startswith("s = 0, the forced motion: beyond the reach of averaging, which leaves out 0.28 of it")
    assert others.startswith("19 more solve the equations where averaging ends, the smallest with |s_7| = 0.91")
    rest, others = resting(0.03)
    assert rest.startswith("constant amplitudes s = 0: stable, slowest change -2.08") and others.startswith("20 more")


def test_an_amplitude_that_does_not_exist_is_beyond_no_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    def none_critical(equations: AmplitudeEquations) -> Stability:
        return replace(decided(equations), critical_amplitude=np.full(14, np.inf))

    monkeypatch.setattr(car_amplitudes_module, "decided", none_critical)
    text = "\n".join(amplitude_lines({"profile": "bump"}, None))
    assert text.count(" inf ") == 7 and "*" not in text


def test_near_a_resonance_averaging_reaches_further_than_its_small_divisors() -> None:
    """Where the road all but meets mode 7: the term is kept, not divided by the detuning."""

    C1 = unproved_verdicts({**MEETING, "A": 0.01})[1]
    height = float(C1.reason.split("not lost up to ")[1].split(" times")[0])
    assert C1.holds and 5.0 < height < 20.0
