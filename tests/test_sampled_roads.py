"""Every input of a class through given rows: what is left open around polynomials, proofs, files and the car."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import arb, fmpq
from scipy.linalg import expm
from test_almost_stable import Equations, duffing, pendulum, rehashed

from analysis.__main__ import main
from analysis.bertolino_baksa import convolution as convolutions
from analysis.bertolino_baksa.adversary import stepped
from analysis.bertolino_baksa.balls import ExactSystem, NotProvedError, precision
from analysis.bertolino_baksa.cells import decay
from analysis.bertolino_baksa.certificate import opened
from analysis.bertolino_baksa.input_rows import InputRows, RowClass, looseness, windows
from analysis.bertolino_baksa.majorant import majorant
from analysis.bertolino_baksa.norms import Norm, euclid, modal_metric, weighted_sup
from analysis.bertolino_baksa.pieces import Piece
from analysis.bertolino_baksa.proof import Proof
from analysis.bertolino_baksa.rows_adversary import _signs, _steps, beside, reached
from analysis.bertolino_baksa.rows_certificate import RowsCertificate, certificate_of, certify, to_json, verify
from analysis.car import car_form, road_signal
from analysis.certificates.car_certificates import build as car_build
from analysis.certificates.car_sampled_roads import certify_rows, statement
from analysis.errors import InputError
from analysis.methods.standard_form import StandardForm, standard_form
from analysis.reference import road_parameters
from analysis.trajectory import Trajectory, write_csv
from fmu_src.quantities import ROAD_HEIGHTS
from fmu_src.vehicle.parameters import Car

Array = np.ndarray[Any, Any]
HEIGHTS = tuple(q.name for q in ROAD_HEIGHTS)
CLASSES = [RowClass("curv", 4.0), RowClass("lip", 0.7)]


def rough(end: float = 1.2, step: float = 0.02) -> tuple[Array, Array]:
    """Two heights with a corner at a row and steps of different lengths."""
    t = np.round(np.arange(round(end / step) + 1) * step, 9)
    t = np.delete(t, [3, 8, 9])
    u = 0.1 * np.stack([np.sin(3.0 * t), np.maximum(np.sin(2.0 * np.pi * (t - 0.5)), 0.0)], axis=1)
    return t, u


def members(rows: InputRows, rng: np.random.Generator, parts: int) -> tuple[Array, Array, Array]:
    """Times, heights and rates (steps, parts + 1, k) of a member of the class: chords and bows to sides by chance."""
    side = rng.choice([-1.0, -0.3, 0.5, 1.0], rows.slopes.shape)
    widths, s = np.diff(rows.times), np.linspace(0.0, 1.0, parts + 1)
    times = rows.times[:-1, None] + widths[:, None] * s
    heights, rates = np.empty((2, *times.shape, rows.slopes.shape[1]))
    for i, width in enumerate(widths.tolist()):
        for j, share in enumerate(s.tolist()):
            up, rate = beside(rows.between, width, share * width, rows.slopes[i], side[i])
            heights[i, j], rates[i, j] = rows.heights[i] + share * width * rows.slopes[i] + up, rows.slopes[i] + rate
    return times, heights, rates


# ---------------------------------------------------------------------------------------------- rows and windows
@pytest.mark.parametrize("between", CLASSES, ids=str)
def test_no_member_of_the_class_is_further_off_the_windows_than_is_said(between: RowClass) -> None:
    rows = InputRows(*rough(), between)
    found = windows(rows)
    assert found[0].first == 0 and found[-1].last == len(rows.times) - 1
    assert all(a.last == b.first for a, b in pairwise(found))
    assert len(found) < len(rows.times) / 3  # many rows a window
    loose, rng = looseness(rows, found), np.random.default_rng(1)
    nearest = np.inf
    for _ in range(8):
        times, heights, rates = members(rows, rng, 40)
        for w, peak, mean in zip(found, loose.peak, loose.mean, strict=True):
            begin, end = rows.times[[w.first, w.last]]
            sigma = (2.0 * times[w.first : w.last] - begin - end) / (end - begin)
            powers = sigma[..., None] ** np.arange(w.coefficients.shape[1])
            off = np.abs(heights[w.first : w.last] - powers @ w.coefficients.T)
            slope = np.polynomial.polynomial.polyder(w.coefficients, axis=1) * 2.0 / (end - begin)
            rate = np.abs(rates[w.first : w.last] - powers[..., : slope.shape[1]] @ slope.T)
            k = heights.shape[2]
            assert (off.max(axis=(0, 1)) <= peak[:k]).all() and (rate.max(axis=(0, 1)) <= peak[k:]).all()
            trapezium = ((off[:, 1:] + off[:, :-1]) / 2.0).mean(axis=1).max(axis=0)
            assert (trapezium <= mean).all()
            nearest = min(nearest, float((peak[:k] / off.max(axis=(0, 1))).min()))
    assert nearest < 1.5  # it is not much too much


def test_rows_that_no_member_takes_are_refused() -> None:
    t, u = rough()
    with pytest.raises(NotProvedError, match=r"no road of class lip:0\.1 takes these heights: height 0 changes by 0"):
        InputRows(t, u, RowClass("lip", 0.1)).refuse_steep()
    for times, heights in ((t + 1.0, u), (t[::-1], u), (t[:1], u[:1]), (t, u[:, 0]), (t[:-1], u)):
        with pytest.raises(ValueError, match="wanted"):
            InputRows(times, heights, CLASSES[0])


# ---------------------------------------------------------------------------------------------- what the proof rests on
@pytest.mark.parametrize("equations", [duffing, pendulum])
def test_a_change_near_a_point_is_bounded_and_closely(equations: Equations) -> None:
    form = standard_form(equations, ["a", "b"], 1)
    with precision(2):
        system = ExactSystem(2, 1, equations, ((fmpq(0), lambda t: [arb(0)]),), fmpq(0))
        bound = majorant(system, np.ones(3))
    rng, closest = np.random.default_rng(3), 0.0

    def rest(y: Array) -> Array:
        x, w = y[:2], y[2:]
        return form.rate(x, w) - form.A @ x - form.B @ w

    for _ in range(400):
        middle, radius, Y = rng.uniform(-0.5, 0.5, 3), rng.uniform(0.0, 0.02, 3), rng.uniform(0.0, 0.1, 3)
        said = bound.change_near(middle[:, None], radius[:, None], Y[:, None])[:, 0]
        z = middle[:, None] + radius[:, None] * rng.uniform(-1.0, 1.0, (3, 50))
        y = Y[:, None] * rng.choice([-1.0, 1.0], (3, 50))
        got = np.abs(rest(z + y) - rest(z)).max(axis=1)
        assert (got <= said + 1e-14).all()  # x and w of order 1 are subtracted in `rest`
        closest = max(closest, float(got[1] / said[1]))
    assert closest > 0.8


@pytest.mark.parametrize("name", ["duffing", "stiff"])
def test_a_convolution_is_a_bound_and_close(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of forcings by chance on the cells, by windows much wider than these too; and of 1 with the worst signs."""
    _, proof, form = certificate_of_textbook(name, CLASSES[0])
    n, metric = len(form.A), proof.metric
    none = np.zeros((n, 2))
    flow = decay(metric, tuple(Piece(fmpq(k, 100), fmpq(k + 1, 100), none, none) for k in range(59)))
    ends = np.concatenate([[0.0], np.cumsum(flow.width)])
    f = np.random.default_rng(2).uniform(0.0, 1.0, (len(ends) - 1, n))
    for count, width in ((1, 0.5), (1000, 0.002)):
        monkeypatch.setattr(convolutions, "LEAST", count)
        monkeypatch.setattr(convolutions, "WIDTH", width)
        along = convolutions.convolution(flow, np.eye(n))
        for cell in range(len(f) - 3):  # one push, near the end of its window or not, and what it leaves
            found = along.by_cells(along(f * (np.arange(len(f)) == cell)[:, None]))
            later = float(ends[cell + 3] - (ends[cell] + ends[cell + 1]) / 2.0)
            exact = np.abs(expm(form.A * later)) @ f[cell] * flow.width[cell]
            assert (exact <= found[cell + 2] * 1.01).all()
        found = along.by_cells(along(np.ones_like(f)))
        for cell in range(5, len(f), 17):
            s = np.linspace(0.0, float(ends[cell + 1]), 4001)
            exact = np.trapezoid(np.abs(expm(form.A * s[:, None, None])).sum(axis=2), s, axis=0)
            assert (exact <= found[cell] * 1.001).all()
    whole = along(np.ones_like(f))[-1]
    s = np.linspace(0.0, float(ends[-1]), 20001)
    exact = np.trapezoid(np.abs(expm(form.A * s[:, None, None])).sum(axis=2), s, axis=0)
    assert (whole < (1.1 if name == "duffing" else 1.4) * exact).all()


# ---------------------------------------------------------------------------------------------- textbook systems
def rated(x: Any, w: Any, sin: Any, cos: Any) -> list[Any]:
    """The rate of the height drives it, in its linear part and beyond."""
    restoring = sin(x[0]) * -4.0 - x[1] - x[0] * x[0] * x[0] * 0.5
    return [x[1], restoring + w[0] * 4.0 + w[1] * 0.5 + w[1] * x[0] * x[1] * 0.5 + cos(x[0]) * w[0]]


def stiff(x: Any, w: Any, sin: Any, cos: Any) -> list[Any]:
    """Much faster than rows follow each other; what is open in the height also enters beyond the linear part."""
    return [x[0] * -20.0 + w[0] * 20.0 + w[0] * w[0] * 10.0]


def of_height(equations: Equations) -> Equations:
    """One height for the force; its rate is no part of the equations."""
    return lambda x, w, sin, cos: equations(x, [w[0] * 4.0], sin, cos)


SYSTEMS: dict[str, tuple[Equations, list[float]]] = {
    "duffing": (of_height(duffing), [0.0, 0.0]),
    "pendulum": (of_height(pendulum), [0.0, 0.0]),
    "rated": (rated, [0.15, -0.2]),
    "stiff": (stiff, [0.0]),
}


def textbook(name: str) -> Callable[..., ExactSystem]:
    equations, x0 = SYSTEMS[name]
    rest = ((fmpq(0), lambda t: [arb(0), arb(0)]),)
    return lambda model: ExactSystem(len(x0), 2, equations, rest, fmpq(0))


def norms_of(n: int) -> tuple[Norm, Norm]:
    return euclid(n), weighted_sup(np.array([1.0, 2.0])[:n])


@cache
def certificate_of_textbook(name: str, between: RowClass) -> tuple[RowsCertificate, Proof, StandardForm]:
    equations, start = SYSTEMS[name]
    n = len(start)
    form = standard_form(equations, [f"x{i}" for i in range(n)], 2)
    t, u = rough(step=0.1) if name == "stiff" else rough()
    rows = InputRows(t, u[:, 1:], between)
    S = modal_metric(form.A, np.eye(n))
    return *certify({}, textbook(name), S, lambda _: norms_of(n), rows, np.array(start)), form


@pytest.mark.parametrize("between", CLASSES, ids=str)
@pytest.mark.parametrize("name", SYSTEMS)
def test_no_start_and_no_member_gets_beyond(name: str, between: RowClass) -> None:
    """Members by chance and in resonance, 30 starts each at N = δ: N(x − x_lin) stays within ε; x_lin, x and w within
    what is said of them."""
    certificate, proof, form = certificate_of_textbook(name, between)
    assert verify(certificate, textbook(name)).open is not None
    rng, n, rows = np.random.default_rng(8), len(form.A), certificate.rows
    begins, x0 = np.concatenate([[0.0], np.cumsum(proof.decay.width)]), certificate.x0
    known = proof.open
    assert known is not None
    signs = _signs(form, rows)
    nearest = 0.0
    for number in range(2, signs.shape[2] + 2, 2):
        side = signs[:, :, number] if number < signs.shape[2] else rng.choice([-1.0, -0.3, 0.5, 1.0], rows.slopes.shape)
        claim = certificate.claims[number % 2]
        epsilon, delta = claim.table[rng.integers(len(claim.table))]
        off = rng.normal(size=(n, 30))
        off *= delta / claim.norm(off)
        off[:, 0] = 0.0
        x, z, t, most = x0[:, None] + off, x0[:, None], 0.0, np.zeros(30)
        for h, inputs in _steps(rows, side[:, :, None]):
            x = stepped(form.rate, x, h, *inputs)
            z = stepped(lambda y, v: form.A @ y + form.B @ v, z, h, *inputs)
            t, most = t + h, np.maximum(most, claim.norm(x - z))
            piece = next(p for p in certificate.pieces if t <= float(p.end) + 1e-9)
            tau = (t - float(piece.begin)) / float(piece.duration)
            reference = piece.linear @ tau ** np.arange(piece.linear.shape[1])
            cell = min(int(np.searchsorted(begins, t, side="right")) - 1, len(known.linear) - 1)
            spots = slice(max(cell - 1, 0), cell + 1)
            zeta = np.abs(z[:, 0] - reference)
            assert (zeta <= known.linear[spots].max(axis=0) + 1e-9).all()
            nearest = max(nearest, float((zeta / known.linear[spots].max(axis=0)).max()))
            reached_here = np.concatenate([x[:, 0], inputs[1][:, 0]])
            assert (np.abs(reached_here) <= proof.X[spots].max(axis=0) * (1.0 + 1e-6) + 1e-9).all()
        assert most[0] <= claim.floor
        assert most.max() <= epsilon
    assert nearest > 0.3


def test_what_is_said_is_not_much_too_much() -> None:
    for name in ("duffing", "pendulum"):
        certificate, _, form = certificate_of_textbook(name, CLASSES[0])
        far = reached(form, [c.norm for c in certificate.claims], certificate.rows, certificate.x0)
        assert all(1.0 <= c.floor / f < 1.3 for c, f in zip(certificate.claims, far, strict=True))


def test_where_nothing_is_open_it_is_the_floor_of_the_known_road() -> None:
    """Rows of a straight line are all its class curv:0 leaves: l is that of the polynomials themselves."""
    t = np.linspace(0.0, 2.0, 9)
    rows = InputRows(t, 0.05 * t[:, None], RowClass("curv", 0.0))
    form, norms, rest = standard_form(of_height(duffing), ["a", "b"], 2), (euclid(2),), np.zeros(2)
    S = modal_metric(form.A, np.eye(2))
    certificate, proof = certify({}, textbook("duffing"), S, lambda _: norms, rows, rest)
    far = reached(form, norms, rows, rest)[0]
    assert proof.open is not None and proof.open.linear.max() < 1e-9
    assert 1.0 <= certificate.claims[0].floor / far < 1.01


# ---------------------------------------------------------------------------------------------- files
WRONG: dict[str, Callable[[dict[str, Any]], Any]] = {
    "a wider class": lambda c: c.update(bound=3.0 * c["bound"]),
    "another class": lambda c: c.update({"class": "lip"}),
    "a class that no height is of": lambda c: c.update({"class": "lip", "bound": 0.1}),
    "another height": lambda c: c["heights"][5].__setitem__(0, c["heights"][5][0] + 0.02),
    "another time": lambda c: c["times"].__setitem__(45, c["times"][45] + 0.004),
    "a row more": lambda c: (c["times"].append(2.5), c["heights"].append([0.0])),
    "a window's polynomial": lambda c: c["windows"][1]["u"][0].__setitem__(1, c["windows"][1]["u"][0][1] + 0.05),
    "windows that leave a gap": lambda c: c["windows"].pop(1),
    "a smaller eps": lambda c: (
        [row.update(eps=0.9 * row["eps"]) for row in c["claims"][0]["delta of eps"]]
        and c["claims"][0].update(l=c["claims"][0]["delta of eps"][0]["eps"])
    ),
    "a larger delta": lambda c: c["claims"][1]["delta of eps"][-1].update(
        delta=2.0 * c["claims"][1]["delta of eps"][-1]["delta"]
    ),
    "a missing piece": lambda c: c["pieces"].pop(),
    "a piece's polynomial": lambda c: c["pieces"][2]["x_lin"][0].__setitem__(0, c["pieces"][2]["x_lin"][0][0] + 0.01),
    "another start": lambda c: c["x0"].__setitem__(0, 0.01),
    "an unknown class": lambda c: c.update({"class": "smooth"}),
    "a negative bound": lambda c: c.update(bound=-1.0),
    "a bound that is text": lambda c: c.update(bound="40.0"),
    "a row that is no number": lambda c: c["heights"][5].__setitem__(0, True),
    "rows of windows that are no numbers": lambda c: c["windows"][0].update(rows=[False, c["windows"][0]["rows"][1]]),
    "a word more": lambda c: c["windows"][0].update(remark="smooth"),
    "another theorem": lambda c: c.update(theorem="for all t >= 0"),
}


@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_a_changed_file_is_refused_or_not_proved(change: Callable[[dict[str, Any]], Any]) -> None:
    content = json.loads(to_json(certificate_of_textbook("pendulum", CLASSES[0])[0]))
    change(content)
    with pytest.raises((InputError, NotProvedError)):
        verify(opened(rehashed(content), "here", certificate_of), textbook("pendulum"))


def test_a_file_says_all_of_the_certificate() -> None:
    certificate, _, _ = certificate_of_textbook("pendulum", CLASSES[0])
    again = opened(to_json(certificate), "here", certificate_of)
    assert to_json(again) == to_json(certificate)
    verify(again, textbook("pendulum"))


# ---------------------------------------------------------------------------------------------- the car
def bump_rows(between: RowClass, step: float = 1e-3, stop: float = 0.4) -> InputRows:
    t = np.round(np.arange(round(stop / step) + 1) * step, 9)
    return InputRows(t, road_signal(road_parameters({}))(t)[:4].T, between)


@pytest.mark.parametrize(("between", "step", "sharp"), [("curv:45", 1e-3, 1.06), ("lip:0.72", 1e-3, 4.0)])
def test_the_car_on_all_roads_through_the_bumps_rows(between: str, step: float, sharp: float) -> None:
    kind, bound = between.split(":")
    rows = bump_rows(RowClass(kind, float(bound)), step)
    certificate, proof = certify_rows({}, rows)
    verify(certificate, car_build)
    lines = statement(certificate, proof)
    assert (
        "on every road of class" in lines[0] and "for all t until 0.4 s" in lines[0] and "energy norm: l <=" in lines[1]
    )
    far = reached(car_form(Car()), [c.norm for c in certificate.claims], rows, np.zeros(14))
    assert all(1.0 <= c.floor / f < sharp for c, f in zip(certificate.claims, far, strict=True))


def test_the_command_certifies_the_heights_of_a_csv(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows, road, file = bump_rows(RowClass("curv", 45.0), stop=0.1), tmp_path / "road.csv", tmp_path / "c.json"
    write_csv(Trajectory(time=rows.times, names=HEIGHTS, values=rows.heights), road)
    call = ["certify", "bump", "--sampled", str(road), "--road-class", "curv:45"]
    assert main([*call, "-o", str(file)]) == 0
    said = capsys.readouterr().out
    assert "through 101 rows of heights" in said and "ratio 1.0" in said
    assert main(["verify", str(file)]) == 0
    assert "every claim is proved" in capsys.readouterr().out
    assert main([*call[:-1], "lip:0.1"]) == 1
    assert "no road of class lip:0.1 takes these heights" in capsys.readouterr().out
    assert main([*call[:-1], "smooth"]) == 2
    assert main(call[:4]) == main(["certify", "bump", "--road-class", "curv:45"]) == 2
    assert "wanted both --sampled and --road-class" in capsys.readouterr().err
    road.write_text("time,h_fl,h_fr,h_rl\n0.0,0.0,0.0,0.0\n")
    assert main(call) == 2
    assert "h_rr are missing" in capsys.readouterr().err
    write_csv(Trajectory(time=rows.times + 1.0, names=HEIGHTS, values=rows.heights), road)
    assert main(call) == 2
    assert "row 2, column 'time': wanted 0 s" in capsys.readouterr().err
