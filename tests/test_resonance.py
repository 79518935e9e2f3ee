"""Resonances: what the table holds, what it leaves out, and where a designer finds the nearest."""

from __future__ import annotations

import csv
import time
from collections.abc import Sequence
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from analysis.__main__ import main
from analysis.car import car_form, road_signal
from analysis.errors import InputError
from analysis.methods.linear_response import periodic_response
from analysis.methods.modes import Modes, modes
from analysis.methods.resonance import Resonance, Resonances, largest_forced, remark_as_printed, resonances
from analysis.methods.series import exact_series
from analysis.methods.signals import constant, harmonic
from analysis.methods.standard_form import StandardForm, standard_form
from analysis.reference import Parameters
from analysis.scans import resonance_scan, resonance_words
from analysis.scans.car_scans import VARIATIONS, variation
from analysis.scans.meetings import meetings
from analysis.scans.resonance_scan import scan
from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car


def pair(ratio: float, power: int = 3, damping: float = 0.0) -> StandardForm:
    """Oscillators of 1 and ratio [rad/s], coupled by x^power in the second and driven in the first."""

    def equations(z: Sequence[Any], w: Sequence[Any], s: Any, c: Any) -> Sequence[Any]:
        x, y, dx, dy = z
        force = x * x * (x if power == 3 else 1.0)
        return [dx, dy, -x - damping * dx + w[0], -(ratio**2) * y - damping * dy + force]

    return standard_form(equations, ["x", "y", "x'", "y'"], 1, order=power, powers={power: 1})


def row(table: Resonances, name: str) -> Resonance:
    return next(r for r in table.rows if str(r) == name)


def test_the_exact_resonance_comes_first_and_off_it_the_detuning_is_the_frequencies() -> None:
    exact = resonances(pair(3.0))
    assert str(exact.rows[0]) == "3β1 = β2" and exact.rows[0].detuning == pytest.approx(0.0, abs=1e-12)
    assert exact.rows[0].in_print
    near = row(resonances(pair(2.9)), "3β1 = β2")
    assert near.detuning == pytest.approx(0.1) and near.relative == pytest.approx(0.1 / 2.9)
    assert str(resonances(pair(2.0, power=2)).rows[0]) == "2β1 = β2"


def test_only_terms_that_phi_has_occur() -> None:
    table = resonances(pair(3.3))
    assert [str(r) for r in table.occurring] == ["3β1 = β2", "β1 = β2"]  # of (x)³ in the second equation alone
    assert row(table, "β1 = 3β2").coefficient == 0.0


def test_damping_counts_in_the_distance() -> None:
    """3 λ1 − λ2: with equal decay α the real part is 2 α."""
    near = row(resonances(pair(3.0, damping=0.2)), "3β1 = β2")
    lam = modes(pair(3.0, damping=0.2).A).eigenvalues
    assert near.distance == pytest.approx(abs(3.0 * lam[0] - lam[1])) and near.distance > 0.19


@pytest.mark.parametrize("ratio", [2.98, 2.996, 3.0, 3.004, 3.02])
def test_the_gain_of_a_free_motion_is_what_the_exact_series_reaches(ratio: float) -> None:
    """Through the resonance 3β1 = β2: largest |ξ_2| of the first correction from x alone, over the amplitude of x."""
    form, damping = pair(ratio, damping=0.02), 0.02
    m = modes(form.A)
    x0 = (m.K[:, 0] + m.K[:, 2]).real * 0.5
    xi = exact_series(form, m, constant([0.0]), x0, 1).modal(np.linspace(0.0, 4.0 / damping, 2001))
    size = float(np.abs(xi[0, 0, 0]))
    found = row(resonances(form, size=size), "3β1 = β2")
    # s_1 s_1 s_1* in s_2', 2 rad/s away, adds to ξ_2 as well: 3 times |σ − λ_2|/2 of what the resonance does
    assert found.gain == pytest.approx(float(np.abs(xi[1, 1]).max()) / size, rel=0.08)
    assert found.gain < found.coefficient / found.distance


@pytest.mark.parametrize(
    ("ratio", "damping", "near"),
    [(3.2, 0.01, True), (3.4, 0.01, False), (2.4, 0.01, False), (2.4, 0.5, False), (2.4, 0.7, True)],
)
def test_what_is_far_off_is_forced_and_in_no_resonance(ratio: float, damping: float, near: bool) -> None:
    """Off by 0.2 of 3.2, 0.4 of 3.4, 0.6 of 3; x x x in y' decays by 3/2 of the damping, mode 2 by half of it."""
    found = row(resonances(pair(ratio, damping=damping), size=10.0), "3β1 = β2")
    assert found.gain > 1.0  # a large motion
    assert found.near_gain == (found.gain if near else 0.0)
    words = "\n".join(resonance_words.strength_lines(resonances(pair(ratio, damping=damping), size=10.0)))
    assert ("strongest of these: 3β1 = β2 adds" in words) == near
    assert ("none" in words) != near and ("merely forced: " in words or near)


@pytest.mark.parametrize("Omega", [0.996, 0.999, 1.0 + 1e-9, 1.004])
def test_the_gain_under_lasting_waves_is_what_the_exact_series_reaches(Omega: float) -> None:
    """Through β2 = 3Ω, from the steady linear motion, so that waves alone act: the first correction of ξ_2 from 0."""
    form, drive = pair(3.0, damping=0.02), harmonic([0.02], Omega)
    m, t = modes(form.A), np.linspace(0.0, 400.0, 8001)
    x0 = periodic_response(form.A, form.B, drive.pieces[0], np.zeros(1))[:, 0]
    largest = float(np.abs(exact_series(form, m, drive, x0, 1).modal(t)[1, 1]).max())
    table = resonances(form, drive.pieces[0])
    assert row(table, "β2 = 3Ω").gain == pytest.approx(largest / table.size, rel=0.05)


def test_the_largest_response_to_a_decaying_force_is_found_wherever_it_is() -> None:
    """Against a fine search in time; equal exponents give 1/(e |α|)."""
    rng = np.random.default_rng(1)
    a, b, q = -(10.0 ** rng.uniform(-1, 1, (3, 60)))
    a[:10], q[10:20], b[20:30] = 0.0, 0.0, a[20:30]
    found = largest_forced((a + 1j * (q + 5.0)).astype(complex), (b + 5j).astype(complex))
    t = np.linspace(0.0, 100.0, 400001)
    for i in range(60):
        values = np.abs(np.exp((a[i] + 1j * q[i]) * t) - np.exp(b[i] * t)) / abs(a[i] - b[i] + 1j * q[i])
        assert found[i] == pytest.approx(values.max(), rel=1e-3)
    lam = np.array([-2.0 + 7j])
    assert largest_forced(lam, lam)[0] == pytest.approx(1.0 / (2.0 * np.e), rel=1e-3)
    close: Any = lam * (1.0 + 1e-12)
    assert largest_forced(close, lam)[0] == pytest.approx(1.0 / (2.0 * np.e), rel=1e-3)
    assert np.isinf(largest_forced(np.array([7j]), np.array([7j]))[0])


def test_where_the_road_meets_a_mode_of_the_car_nothing_becomes_infinite() -> None:
    """β7 = Ω at A = 10 mm: what the series' first correction is of the linear motion, not the 13 of 1/|Ω − β7|."""
    found = resonance_scan.table_of({"profile": "sine", "A": 0.01, "Lambda": 1.0, "v0": 12.75404})
    strongest = max(found.occurring, key=lambda r: r.near_gain)
    assert str(strongest) == "β7 = Ω" and strongest.detuning < 1e-3
    assert 1e-4 < strongest.near_gain == strongest.gain < 2e-3  # measured: 6.9e-4; terms of the series 1.2e-3


def test_the_strongest_of_a_scan_is_no_matter_of_its_points() -> None:
    fine = scan({"profile": "sine", "v0": 12.75}, "speed", points=25)
    gains = [r.near_gain for r in fine.strongest()]
    assert max(gains) == pytest.approx(max(gains[::4]), rel=0.1)
    assert gains == [max(r.near_gain for r in table.values()) for table in fine.tables]


def test_every_term_is_counted_once_and_identities_are_those_of_the_papers_sum() -> None:
    """Against a plain enumeration of s_a s_b s_c in s_k'."""
    table, h = resonances(car_form(Car(), order=3), degrees=(3,)), 7
    assert table.terms == 7 * len(list(combinations_with_replacement(range(14), 3)))
    assert table.trivial == {0: h * h} and table.silent == 0
    beta = modes(car_form(Car()).A).beta
    detunings = []
    for terms in combinations_with_replacement(range(14), 3):
        for k in range(h):
            counts = np.zeros(h, int)
            for i in terms:
                counts[i % h] += 1 if i < h else -1
            counts[k] -= 1
            if counts.min() < 0 < counts.max():
                detunings.append(abs(counts @ beta[:h]) / np.gcd.reduce(counts))
    np.testing.assert_allclose(
        np.unique(np.round([r.detuning for r in table.rows], 9)), np.unique(np.round(detunings, 9)), atol=1e-8
    )


def test_waves_bring_external_resonances_and_their_own_identities() -> None:
    table = resonances(pair(3.3), harmonic([1.0], 1.1).pieces[0])
    names = [str(r) for r in table.rows]
    assert "β1 = Ω" in names and "β2 = 3Ω" in names and "β1 + 2Ω = β2" in names
    assert row(table, "β1 = Ω").detuning == pytest.approx(0.1)
    assert row(table, "β2 = 3Ω").detuning == pytest.approx(0.0, abs=1e-12)
    assert table.trivial == {0: 4, 2: 2}
    assert row(table, "β2 = 3Ω").coefficient > 0.0  # the forced x³
    assert row(table, "β1 = Ω").gain == 0.0  # direct excitation is linear


def test_the_remark_as_printed_misses_what_counts() -> None:
    """An odd system has no three-mode terms, and β_j + β_k = β_l + β_m is not in the remark."""
    form = car_form(Car(), order=3)
    table, lam = resonances(form), modes(form.A).eigenvalues
    three, four = remark_as_printed(lam)
    assert len(three.distance) == 28 * 7 and len(four.distance) == 84 * 7
    i = int(np.argmin(four.detuning))
    *summed, last = (four.indices[i] - 1).tolist()
    assert four.distance[i] == pytest.approx(abs(lam[summed].sum() - lam[last]))
    assert not any(r.coefficient for r in table.rows if sum(map(abs, r.modes)) == 3)
    nearest = table.occurring[0]
    assert not nearest.in_print and nearest.detuning < 0.3 * four.detuning.min()


def test_modes_that_do_not_oscillate_take_no_part() -> None:
    table = resonances(car_form(Car(b1=8000.0), order=3))
    overdamped = np.count_nonzero(modes(car_form(Car(b1=8000.0)).A).beta[:7] == 0.0)
    assert table.silent == overdamped > 0
    assert all(not any(r.modes[7 - overdamped :]) for r in table.rows)
    three, four = remark_as_printed(modes(car_form(Car(b1=8000.0)).A).eigenvalues)
    assert min(three.detuning.min(), four.detuning.min()) > 0.0


def test_the_table_takes_milliseconds() -> None:
    form = car_form(Car(), order=3)
    piece = road_signal(RoadParameters(profile="sine")).pieces[-1]
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        resonances(form, piece)
        times.append(time.perf_counter() - begin)
    assert min(times) < 0.2  # measured: 0.04 s


@pytest.mark.parametrize("name", VARIATIONS)
def test_a_variation_changes_what_it_says(name: str) -> None:
    p: dict[str, float | str | bool] = {"a": 1.1, "v0": 12.0}
    changed = variation(name).changed(p, 1.3)
    assert variation(name).value(changed) == pytest.approx(1.3)
    wheelbase = 1.1 + PARAMETERS["b"].start
    if name == "b/a":
        assert float(changed["a"]) + float(changed["b"]) == pytest.approx(wheelbase)
    with pytest.raises(InputError, match="wanted one of speed, c2/c1, Jy, b/a"):
        variation("colour")


def test_a_road_of_waves_without_height_has_none() -> None:
    table = resonance_scan.table_of({"profile": "sine", "A": 0.0})
    assert table.rows and all(r.road == 0 for r in table.rows)
    with pytest.raises(InputError, match="speed changes nothing"):
        scan({"profile": "sine", "A": 0.0}, "speed", points=2)


def test_a_car_whose_modes_creep_has_an_empty_table() -> None:
    creeping: Parameters = {"b1": 2e6, "b2": 2e6, "bp1": 2e6, "bp2": 2e6}
    table = resonance_scan.table_of(creeping)
    assert table.silent == 7 and not table.rows
    assert "Modes that do not oscillate: 7" in "\n".join(resonance_words.lines(table, creeping))
    with pytest.raises(InputError, match="wanted two modes that oscillate"):
        scan(creeping, "Jy", points=2)


def test_a_scan_finds_the_speed_at_which_the_road_meets_a_mode() -> None:
    result = scan({"profile": "sine", "v0": 11.0}, "speed", points=9)
    assert result.values[4] == pytest.approx(11.0)
    np.testing.assert_allclose(result.road, 2.0 * np.pi * result.values)
    curve = result.curve(((0, 0, 0, 1, 0, 0, 0), -1), "detuning")
    np.testing.assert_allclose(curve, np.abs(result.frequencies[:, 3] - result.road))


@pytest.mark.parametrize("points", [4, 9])
def test_a_scan_says_where_frequencies_meet_whatever_its_points_and_ranks_what_it_detunes(points: int) -> None:
    result = scan({"profile": "sine", "v0": 11.0}, "speed", points=points)
    beta = modes(car_form(Car(), order=1).A).beta
    met = {str(crossing.row): crossing.value for crossing in resonance_scan.crossings(result)}
    assert met["β7 = Ω"] == pytest.approx(beta[6] / (2.0 * np.pi), rel=1e-9)
    assert met["β4 = Ω"] == pytest.approx(beta[3] / (2.0 * np.pi), rel=1e-9)
    assert str(resonance_scan.crossings(result)[0].row) == "β7 = Ω"
    assert all(road for _, road in result.changing)
    assert all(row.road for attribute in ("relative", "relative_distance") for row in result.nearest(attribute))
    said = "\n".join(resonance_words.scan_lines(result))
    assert "β7 = Ω at 12.75, gain" in said and "β5 = β6" not in said
    assert "nearest is nearest in frequency" not in said and said.count("nearest is nearest with damping") == 1


@pytest.mark.parametrize("points", [4, 9])
@pytest.mark.parametrize(
    ("name", "pairs"), [("Jy", {(1, 2): 1269.0, (4, 5): 1643.9}), ("c2/c1", {(0, 1): 0.6295, (1, 2): 0.7604})]
)
def test_a_scan_finds_where_two_modes_meet_whatever_its_points(
    name: str, pairs: dict[tuple[int, int], float], points: int
) -> None:
    """Their numbers by rising β say nothing of it: there β_k − β_j has a kink, and its sign is kept."""
    result = scan({"profile": "bump"}, name, points=points)
    assert {meeting.before: meeting.value for meeting in result.meetings} == pytest.approx(pairs, rel=2e-4)
    for meeting in result.meetings:
        (j, k), varied = meeting.before, variation(name)
        gaps = [
            np.diff(resonance_scan.modes_of(varied.changed({}, value)).beta[[j, k]])[0]
            for value in (0.999 * meeting.value, meeting.value, 1.001 * meeting.value)
        ]
        assert gaps[1] < 1e-4 * min(gaps[0], gaps[2])
    j, k = min(pairs)
    strongest = resonance_scan.crossings(result)[0]
    assert str(strongest.row) == f"β{j + 1} = β{k + 1}" and strongest.value == pytest.approx(pairs[j, k], rel=2e-4)
    assert f"the strongest: {strongest}" in "\n".join(resonance_words.scan_lines(result))


@pytest.mark.parametrize(("coupling", "meet"), [(0.0, [1.0]), (0.003, [])], ids=["meet", "veer"])
def test_modes_that_only_turn_into_each_other_do_not_meet(coupling: float, meet: list[float]) -> None:
    """x and y of the frequencies 1 and v, coupled by a spring: over a step of 0.2 they look as if they had."""

    def modes_at(v: float) -> Modes:
        C = np.array([[1.0, coupling], [coupling, v**2]])
        return modes(np.block([[np.zeros((2, 2)), np.eye(2)], [-C, -0.01 * np.eye(2)]]))

    wide = np.array([0.85, 1.05])
    likeness = np.abs(modes_at(0.85).K_inverse[:2] @ modes_at(1.05).K[:, :2])
    assert likeness.argmax(axis=1).tolist() == [1, 0]
    assert [meeting.value for meeting in meetings(modes_at, wide)] == pytest.approx(meet, abs=1e-9)


def test_the_command_prints_and_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resonance_scan, "POINTS", 5)
    assert main(["resonances", "bump", "-o", str(tmp_path)]) == 0
    assert "no lasting waves" in capsys.readouterr().out
    rows = list(csv.DictReader((tmp_path / "resonances.csv").read_text().splitlines()))
    assert "equality" in rows[0] and len(rows) > 500
    first = rows[0]
    assert float(first["relative detuning"]) == float(first["detuning [rad/s]"]) / float(first["scale [rad/s]"])
    assert float(first["relative distance"]) == float(first["distance [1/s]"]) / float(first["scale [rad/s]"])
    (tmp_path / "resonances.csv").unlink()
    assert main(["resonances", "sine", "--scan", "c2/c1", "-o", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "strongest of these: β6 = β7 adds" in said
    assert "off resonance, merely forced: β7 = Ω, 17.3 rad/s off, adds 0.00015 of it" in said
    assert "the passive car, actuators at rest" in said and "frequencies meet exactly, the strongest: " in said
    assert "λ_7 = λ_7 + σ_1 + σ_2: grows like t exp(λ_7 t)" in said
    assert (tmp_path / "resonances.csv").is_file()
    assert ElementTree.parse(tmp_path / "resonances-c2-c1.svg").getroot().tag.endswith("svg")
    assert len((tmp_path / "resonances-c2-c1.csv").read_text().splitlines()) == 6
    assert main(["resonances", "sine", "--scan", "colour"]) == 2
