"""The audit: every row decided by its numbers, some of them by a second way, and the page of the docs that it wrote."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from analysis import __main__ as command_line
from analysis.audit import (
    amplitude_equation,
    assumptions,
    averaging,
    car,
    document,
    modal,
    permanent,
    printed_car,
    regulator,
    resonance,
    response,
    rows,
    section2,
    section3,
    section4,
    small_parameter,
)
from analysis.audit.differences import CONVENTION, derived_equations, differences
from analysis.audit.document import Audit
from analysis.audit.rows import FAILS, INSPECTION, MISPRINT, READING, REFUTED, RIGHT, Evidence, Row
from analysis.audit.system import Array, derived, planted, printed
from analysis.derivation import derive
from analysis.quasilinear import quasilinear
from fmu_src.vehicle.parameters import Car

DOCS = Path(__file__).resolve().parents[1] / "docs"
SEVEN = ["(3.2)", "(3.3)", "(3.4)", "(3.5)", "(3.6)", "(3.7)"]  # each once in convention B
EXPECTED = {
    MISPRINT: [
        *["definition 2.1", "(2.10)", "(2.12) and below it", "(2.13)", "(2.14)"],
        *["e = R i", *SEVEN, "(3.1)–(3.7)", "list after (3.7)", "(3.4), (3.7)"],
        *["R̄_i", "C̄_i, R̄_i", "(3.13)", "after (3.14)"],
        *["before (3.20), (3.20)", "(3.20) R̄_i", "(3.20) A_i", "(3.20) B_i", "amplitude equation after (3.20)"],
        *["condition after (3.20)", "§3.4, h12, h22", "(4.1) A", "(4.1) B"],
    ],
    FAILS: [
        *["(2.10) with assumption 1", "between (2.13) and (2.14)", "after (2.14)"],
        *["no-resonance condition before (3.20)", "remark 3.2"],
    ],
    READING: ["§3.4, ε = 0.01", "§4, c1, c2, b1, b2", "§4, φ"],
    RIGHT: [
        *["(2.6), (2.7)", "(3.1)–(3.7)", "(3.1)–(3.7)", "(3.8)", "(3.14)", "(3.15), (3.16)", "(3.17)", "(3.18)"],
        *["(4.1) C", "(4.3)–(4.7)", "remark 4.1"],
    ],
    REFUTED: ["P_i(t, ξ), B_νij, B_νijk", "§3.4, figures 3, 4"],
    INSPECTION: [
        *["(2.5)", "footnote 1", "§3.3, its title and first sentence", "before (3.18)"],
        "before the condition after (3.20)",
    ],
}


@pytest.fixture(scope="module")  # the tests that ask for it stand together, so that one worker runs them
def result() -> Audit:
    return document.audit()


def test_every_row_is_decided_by_every_number_of_its_own(result: Audit) -> None:
    for kind, equations in EXPECTED.items():
        assert [row.equation for row in result.rows if row.verdict == kind] == equations
    assert len(result.rows) == sum(map(len, EXPECTED.values()))
    for row in (*result.rows, *result.in_a):
        assert bool(row.evidence) == (row.kind != INSPECTION), row.equation
        for e in row.evidence:
            off, derived_off = abs(e.printed - e.expected), abs(e.derived - e.expected)
            assert derived_off <= e.tolerance <= e.apart, (row.equation, e.measure, e.derived)
            failing = row.kind in (MISPRINT, FAILS, READING)
            assert off >= e.apart if failing else off <= e.tolerance, (row.equation, e.measure, e.printed)


def test_convention_b_needs_fewer_changes(result: Audit) -> None:
    assert result.counts == {"A": 10, "B": 6}
    assert min(result.counts, key=lambda name: result.counts[name]) == CONVENTION
    assert [row.equation for row in result.in_a] == [d.equation for d in differences("A")]
    assert result.holds


# ------------------------------------------------------------------ page, files, exit status
NUMBER = re.compile(r"(?<![\w_])−?\d+(?:\.\d+)?(?:e[+−]?\d+)?")


def same_page(old: str, new: str) -> bool:
    """Equal words, and numbers equal to 1 % (they are written to three digits)."""

    def numbers(line: str) -> list[float]:
        return [float(n.replace("−", "-")) for n in NUMBER.findall(line)]

    pairs = list(zip(old.splitlines(), new.splitlines(), strict=False))
    return len(old.splitlines()) == len(new.splitlines()) and all(
        NUMBER.sub("#", a) == NUMBER.sub("#", b) and np.allclose(numbers(a), numbers(b), rtol=1e-2, atol=0.0)
        for a, b in pairs
    )


def test_the_page_in_the_docs_is_what_the_command_writes(result: Audit) -> None:
    page = (DOCS / "audit.md").read_text(encoding="utf-8")
    assert document.COMMAND in page
    assert same_page(page, document.markdown(result))
    assert not same_page(page.replace("0.226", "0.3").replace("0.225", "0.3"), document.markdown(result))
    assert all(f"`{subject.file}`" in page for subject in document.subjects())


def test_the_command_writes_its_files_and_fails_if_a_number_does_not_decide(
    result: Audit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(made: Audit, *arguments: str) -> int:
        given: Callable[..., Audit] = lambda progress=False: made  # noqa: E731
        monkeypatch.setattr(document, "audit", given)
        return command_line.main(["audit", *arguments])

    assert run(result, "-o", str(tmp_path / "new" / "folder")) == 0
    out = capsys.readouterr().out
    files = {path.name for path in (tmp_path / "new" / "folder").iterdir()}
    assert files == {"audit.md", "audit.json", "audit-response.svg", "audit-decay.svg"}
    assert "10 in convention A" in out and "6 in convention B" in out and rows.UNDECIDED not in out
    stored = json.loads((tmp_path / "new" / "folder" / "audit.json").read_text(encoding="utf-8"))
    assert [row["verdict"] for row in stored["rows"]] == [row.verdict for row in result.rows]

    (tmp_path / "file").write_text("")
    assert run(result, "-o", str(tmp_path / "file")) == 2
    assert "wanted a folder, got a file" in capsys.readouterr().err

    first = next(row for row in result.rows if row.evidence)
    spoilt = replace(first, evidence=[replace(first.evidence[0], derived=math.nan)])
    assert run(replace(result, rows=(spoilt,))) == 1
    assert f"Not decided: {first.equation}." in capsys.readouterr().out


# ------------------------------------------------------------------ the verdict itself
def evidence(**changed: Any) -> Evidence:
    numbers = {"printed": 2.0, "derived": 0.0, "expected": 0.0, "tolerance": 0.1, "apart": 1.0}
    return Evidence(measure="", unit="1", **{**numbers, **changed})


@pytest.mark.parametrize(
    ("changed", "kinds"),
    [
        ({}, {MISPRINT, FAILS, READING}),
        ({"printed": 0.05}, {RIGHT, REFUTED}),
        ({"printed": 0.5}, set()),  # neither refuted nor confirmed
        ({"derived": 0.5}, set()),
        ({"derived": math.nan}, set()),
        ({"printed": math.nan}, set()),
        ({"printed": 0.05, "apart": 0.01}, set()),  # no gap: anything would do
        ({"expected": 3.0}, set()),
    ],
)
def test_a_number_decides_only_what_it_can(changed: dict[str, float], kinds: set[str]) -> None:
    kinds_of_numbers = (MISPRINT, FAILS, READING, RIGHT, REFUTED)
    assert {kind for kind in kinds_of_numbers if evidence(**changed).decides(kind)} == kinds


def test_a_row_without_evidence_is_not_decided_but_by_inspection() -> None:
    empty = Row(equation="", printed="", derived="", evidence=[])
    assert empty.verdict == rows.UNDECIDED
    assert replace(empty, evidence=[evidence(), evidence(derived=1.0)]).verdict == rows.UNDECIDED
    assert replace(empty, kind=INSPECTION).verdict == INSPECTION
    assert replace(empty, kind=INSPECTION, evidence=[evidence()]).verdict == rows.UNDECIDED


# ------------------------------------------------------------------ numbers by a second way
def test_power_from_nowhere_is_the_misprints_own_power() -> None:
    """dE/dt changes by −q̇_i (printed − derived), nothing else: signs and sizes of the law's residual."""
    from analysis.audit.system import power_residual

    d, (q, v, h, dh) = derive(), car.sample()
    for change in differences(CONVENTION):
        if "m_z" in str(change.printed):
            continue  # m_z is taken as m2 in numbers
        system = planted(change, CONVENTION)
        known = {p: getattr(system.car, p.name) for p in d.parameters}
        term = sp.lambdify([*d.q, *d.v, *d.h], (change.printed - change.derived).subs(known))
        power = -v[change.row] * term(*q, *v, *h)
        residual, turnover = power_residual(system, q, v, h, dh)
        assert_allclose(residual, power, atol=1e-10 * turnover.max())
        expected = np.abs(power).sum() / turnover.sum()
        assert [car.power_from_nowhere(system, seed) for seed in (1, 2, 3)] == pytest.approx([expected] * 3, rel=0.1)
        if expected > 0.0 and (even := car.evenness(system)) > 1e-12:
            assert [car.evenness(system, seed) for seed in (1, 2, 3)] == pytest.approx([even] * 3, rel=0.1)


def test_what_the_misprints_do_to_the_response_is_linear() -> None:
    """The nonlinear runs differ as their linear parts do, which are known in closed form."""
    shown = slice(None, 8000, 160)  # 40 ms apart, for 2 s
    times, both = response.TIMES[shown], response.responses()
    wrong, right = (make("A").linear_over_the_bump(times, response.HEIGHT)[:, :7] for make in (printed, derived))
    off = (both["printed"] - both["derived"])[shown]
    assert_allclose(off / np.abs(right).max(axis=0), (wrong - right) / np.abs(right).max(axis=0), atol=1e-3)
    deviations = response.deviations()
    by_name = {d.quantity.name: d.difference for d in deviations}
    assert by_name["body.roll"] == max(by_name.values())
    assert by_name["body.roll"] > 0.4 and max(sorted(by_name.values())[:-1]) < 0.06


def test_maxima_are_those_of_a_finer_grid() -> None:
    """Peaks, differences, the least l and the cubic accelerations, against rows of 40 µs."""
    fine = np.linspace(0.0, 1.0, 25001)
    right, wrong = (make("A").over_the_bump(fine, response.HEIGHT)[:, :7] for make in (derived, printed))
    deviations, peaks = response.deviations(), np.abs(right).max(axis=0)
    assert_allclose([d.derived for d in deviations], peaks, rtol=1e-4)
    assert_allclose([d.printed for d in deviations], np.abs(wrong).max(axis=0), rtol=1e-4)
    assert_allclose([d.difference for d in deviations], np.abs(wrong - right).max(axis=0) / peaks, rtol=3e-4)
    assert_allclose(section2.least_l(car.CROSSING), section2.least_l(fine), rtol=5e-4)
    found, finer = (section3.cubic_accelerations(times) for times in (car.CROSSING, fine))
    assert_allclose(found[:4], finer[:4], rtol=1e-3)


def test_both_cars_decay_as_their_eigenvalues_say() -> None:
    for make in (printed, derived):
        system = make(CONVENTION)
        times = np.linspace(0.35, 8.0, 400)
        x = system.over_the_bump(np.append(0.0, times), 0.01)[1:]
        slowest = np.linalg.eigvals(system.linear.A).real.max()
        assert np.all(np.linalg.norm(x, axis=1) <= 20.0 * np.abs(x[0]).max() * np.exp(slowest * (times - times[0])))


def test_the_definition_of_the_oscillators_mean_is_that_by_quadrature_over_long_times() -> None:
    """The mean over one period of 512 samples, against adaptive quadrature over the same, at a point off the axes."""
    from scipy.integrate import quad

    v = np.array([0.7, -1.1])
    for force in (section2.S, section2.S_printed):
        pulled = section2.pulled_back(force)
        direct = [
            quad(lambda t, k=k, pulled=pulled: pulled(np.asarray(t), v)[k], 0.0, 2 * np.pi)[0] / (2 * np.pi)
            for k in range(2)
        ]
        assert_allclose(section2.mean(force, v), direct, rtol=1e-10)


def test_what_2_14_leaves_out_is_of_the_order_that_it_has() -> None:
    """As printed it is 0.52/ε times the change of v' from ε S_1; with −ε and the missing term, it is that change."""
    for epsilon in (1e-2, 1e-3, 1e-4):
        exact, printed_size, corrected = permanent.perturbations(permanent.START, epsilon)
        assert printed_size / exact == pytest.approx(0.52 / epsilon, rel=0.03)
        assert corrected / exact == pytest.approx(1.0, abs=3.0 * epsilon)


def test_the_averages_of_a_damped_system_exist_or_not_as_the_row_says() -> None:
    """On a lasting road also a slow mode's mean diverges, and changes sign; where the road dies out it goes to 0."""
    means = [section2._mean(lambda t: section2.pulled_cube(t, 0.0), T) for T in (10.0, 20.0, 30.0)]
    assert_allclose(means, [49.9, 1.042e4, -1.0896e10], rtol=1e-3)
    x = solve_ivp(lambda t, x: -x + np.sin(2.0 * t), (0.0, 5.0), [0.0], rtol=1e-10, atol=1e-12).y[0, -1]
    assert section2._forced(5.0) == pytest.approx(x, abs=1e-8)


def test_b_as_printed_leaves_the_half_car_controllable_by_one_force() -> None:
    """Kalman's rank is that by Hautus: no left eigenvector of A is orthogonal to B; A printed too."""
    for state in (section4.A_PRINTED, section4.derived()[0]):
        _, vectors = np.linalg.eig(section4.numbers(state).T)
        B = section4.numbers(section4.B_PRINTED)
        assert np.abs(vectors.T @ B).max(axis=1).min() > 1e-4 * np.abs(B).max()
        assert section4.reach(state, section4.B_PRINTED, 4)[0] == 4
    one = sp.Matrix([[0], [0], [1 / section4.m], [0]])  # pitch is not reached where a c1 = b c2 and a b1 = b b2
    uncoupled = section4.derived()[0].subs({section4.c2: section4.c1, section4.b2: section4.b1, section4.b: section4.a})
    assert section4.reach(uncoupled, one, 4)[0] == 2


def test_the_determinant_of_the_printed_half_car_decides_its_rest() -> None:
    """c1 c2 (a² − b²)/(J m): at a = b it is 0 for any c1, c2; the derived one is never 0."""
    J, m, a, b, c1, c2 = section4.J, section4.m, section4.a, section4.b, section4.c1, section4.c2
    assert sp.simplify(section4.A_PRINTED.det() - c1 * c2 * (a**2 - b**2) / (J * m)) == 0
    assert sp.simplify(section4.derived()[0].det() - c1 * c2 * (a + b) ** 2 / (J * m)) == 0


def test_the_note_on_the_printed_b_has_the_ranks() -> None:
    """4 for B as printed and corrected, with A corrected and as printed; no row speaks of it, as the paper does not."""
    note = section4._control_matrix().note
    assert note.startswith("The paper does not speak of controllability.")
    assert "for B as printed and for B corrected: with A corrected 4 and 4 (" in note
    assert "; with A as printed 4 and 4 (" in note


def test_another_riccati_equation_would_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """With its quadratic term twice, or half of Q."""
    right = regulator.riccati_rate
    assert regulator.row().holds
    for wrong in (
        lambda L, car: right(L, car) + L @ np.array(car.B) @ np.array(car.B).T @ L,
        lambda L, car: right(L, car) + 0.5 * np.array(car.Q),
    ):
        monkeypatch.setattr(regulator, "riccati_rate", wrong)
        row = regulator.row()
        assert not row.holds and row.evidence[0].printed > 1e-2


def numbered(text: str) -> set[str]:
    """Numbers of equations in a text, those within a range too."""
    found = set()
    for section, first, last in re.findall(r"\((\d)\.(\d+)\)(?:–\(\d\.(\d+)\))?", text):
        found |= {f"{section}.{n}" for n in range(int(first), int(last or first) + 1)}
    return found


def test_every_numbered_equation_has_a_row_or_is_named_as_without_one(result: Audit) -> None:
    left_out = numbered(document.HEAD[document.HEAD.index("Without rows:") : document.HEAD.index("which\nassume")])
    in_rows = set().union(*(numbered(row.equation) for row in result.rows))
    everything = {f"{section}.{n}" for section, last in ((2, 14), (3, 20), (4, 7)) for n in range(1, last + 1)}
    assert left_out | in_rows == everything and not left_out & in_rows


def test_the_bracket_of_2_13_is_of_order_2_at_rest_and_what_is_added_of_order_1() -> None:
    """At v = 0, where S_1 is 0: |(∂w/∂v) v'|, which the inequality bounds, and |v' − ε S_1|/ε, which it should."""
    origin = np.zeros(2)
    w_v = permanent._derivative(
        lambda v: permanent.w(permanent.S, lambda _, at: permanent.mean(permanent.S, at), v, permanent.TIME), origin
    )
    sizes = [0.04, 0.004, 0.0004]
    rates = [permanent.right_sides(permanent.TIME, origin, epsilon)[0] for epsilon in sizes]
    bracket = [float(np.linalg.norm(w_v @ rate)) for rate in rates]
    added = [permanent.perturbations(origin, epsilon)[0] / epsilon for epsilon in sizes]
    slopes = [np.polyfit(np.log(sizes), np.log(values), 1)[0] for values in (bracket, added)]
    assert slopes == [pytest.approx(2.0, abs=0.02), pytest.approx(1.0, abs=0.02)]
    assert "with ε X⁻¹ (∂S/∂ζ) w, which the bracket lacks, it is of order ε at v = 0" in permanent._small().derived


def test_products_of_road_and_coordinates_are_counted() -> None:
    """In the quasi-linear tensors of the derived car there are as many: d_7377 and d_7477."""
    equations = sp.Matrix(derived_equations(CONVENTION))
    counted = [section3.road_products(equations, wheel, 2) for wheel in range(4)]
    d = quasilinear(Car())["d_ijkl"].entries
    assert counted == [sum(index[1] == wheel for index in d) for wheel in range(4)] == [0, 0, 1, 1]


def test_the_products_of_road_and_roll_have_the_sign_of_the_convention_that_is_named() -> None:
    """Third derivatives of ψ̈2 at rest by h21 and ψ2 twice: −2318/(m s²) in A, the opposite in B."""
    p, values = printed_car, {symbol: getattr(Car(), symbol.name) for symbol in derive().parameters}
    for convention, sign in (("A", -1), ("B", 1)):
        left = derived_equations(convention)[6]
        pull = -left.diff(p.h21) / left.diff(p.ddψ2)
        value = float((pull.diff(p.ψ2, 2) / 2).subs({p.ψ2: 0, **values}))
        assert value == pytest.approx(sign * 2318.0, rel=1e-3)
    assert "d_7377 = −2318, d_7477 = 2318 1/(m s²) (convention A)" in section3._parametric().derived


def test_unequal_wheel_masses_couple_in_the_sense_in_which_the_road_drives() -> None:
    """The left wheel's height falls with ψ2 in convention B, as its tyre's force in the corrected (3.7) says."""
    p = printed_car
    slope = -derived_equations(CONVENTION)[6].diff(p.h21) / p.cp2
    assert sp.simplify(slope + p.s2 * sp.cos(p.ψ2)) == 0
    T = assumptions._axle_kinetic_energy()
    assert sp.simplify(T.diff(p.dz2, p.dψ2).diff(p.m21) - slope) == 0
    row = assumptions._axle_masses()
    by_hand = "− s2 (m21 − m22) cos ψ2 ψ̈2 + s2 (m21 − m22) sin ψ2 ψ̇2² in (3.4), − s2 (m21 − m22) cos ψ2 z̈2 in (3.7)"
    assert row.derived.startswith(by_hand) and row.evidence[0].derived < 0.0 and row.holds


def test_a_second_rest_would_be_found() -> None:
    """The derived car, its roll with rests at ψ = 0 and ψ = 0.8 sin 2ψ; a rest at 1.6 rad is not counted."""
    car_at = response.flat_and_still("derived")

    def buckled(q: Array) -> Array:
        return car_at(q - 0.8 * np.sin(2.0 * q[1]) * np.eye(7)[1])

    found = response.rests(buckled)
    assert len(found) == response.STARTS and 10 < response.others(found) < response.STARTS
    roll = found[np.abs(found[:, 1]) > 1e-6, 1]
    assert_allclose(np.abs(roll), brentq(lambda psi: psi - 0.8 * np.sin(2.0 * psi), 0.5, 1.5), atol=1e-8)
    assert len(response.rests(lambda q: 1.6 * np.eye(7)[1] - q)) == 0  # outside


def test_the_textbook_systems_are_real_and_obey_the_corrected_average() -> None:
    for seed in range(5):
        x = averaging.textbook((4, 7, 15), 11, seed)
        values = x.xi()
        assert_allclose(values[:3], values[3:].conj(), atol=1e-12 * np.abs(values).max())
        if not resonance.cubic_condition((4, 7, 15), 11):
            formula = x.s * (averaging.A_corrected(x.alpha_bar, x.P, x.psi) + averaging.pair_sum(x, halved=True))
            assert_allclose(x.R_mean(), formula, rtol=1e-9)


def test_static_loads_that_do_not_cancel_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A print whose front struts pull on the pitch with sin φ for cos φ is not in balance with its weights."""
    from analysis.audit import assumptions, printed_car

    assert assumptions.weights_left(*assumptions.slopes_in_print()) == 0
    wrong = sp.Matrix(printed_car.EQUATIONS)
    wrong[2] += printed_car.c1 * printed_car.z11 * sp.sin(printed_car.φ)
    monkeypatch.setattr(printed_car, "EQUATIONS", wrong)
    assert assumptions.weights_left(*assumptions.slopes_in_print()) == 1


def test_the_condition_is_judged_by_rates_of_growth_that_know_nothing_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another A than the corrected one is not confirmed; nor is ∫ by another right side of (3.20)."""
    assert amplitude_equation._condition().holds and averaging._limit().holds
    corrected = averaging.A_corrected
    for wrong in (lambda *x: 7.0 * corrected(*x) + 1j, lambda *x: 1.01 * corrected(*x)):
        monkeypatch.setattr(averaging, "A_corrected", wrong)
        monkeypatch.setattr(amplitude_equation, "A_corrected", wrong)
        assert not amplitude_equation._condition().holds and not averaging._limit().holds


def test_a_misprint_in_3_14_to_3_18_would_be_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of the three products of (3.16) left out; α turned to another mode."""
    x = averaging.textbook(*averaging.QUIET)

    def two_products(x: averaging.Textbook, xi: Any) -> Any:
        return small_parameter.by_print(x, xi) - [0.0 * xi[0], small_parameter.cube(x, xi[1], xi[0], xi[0])]

    assert small_parameter.order_left(x, two_products) == pytest.approx(2.0, abs=0.1)
    wrong = np.roll(modal.by_the_letter()[0], 1, axis=0), modal.by_the_letter()[1]
    monkeypatch.setattr(modal, "by_the_letter", lambda: wrong)
    assert not modal._nonlinear().holds


def test_the_cubic_criterion_is_right_on_systems_drawn_at_random(rng: np.random.Generator) -> None:
    cases: list[tuple[tuple[int, ...], int]] = []
    while len(cases) < 30:
        *beta, W = rng.choice(np.arange(1, 24), size=4, replace=False).tolist()
        cases.append((tuple(beta), W))
    verdicts = [resonance.cubic_condition(*case) for case in cases]
    assert verdicts == [resonance.is_resonant(*case) for case in cases]
    assert {*verdicts} == {True, False}
