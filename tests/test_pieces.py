"""Polynomials moved to other places of their piece, jacobians in one pass, and how much work a proved piece takes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flint import arb, arb_mat, fmpq
from test_almost_stable import PERIOD, build, certified, duffing, swinging

from analysis.bertolino_baksa.balls import ExactSystem, jacobian, matrix, precision, rounded
from analysis.bertolino_baksa.norms import proved_metric
from analysis.bertolino_baksa.pieces import MORE, Piece, derivative, everywhere, span
from analysis.bertolino_baksa.tube import defect_of, inputs_around, prove_tube
from analysis.certificates.car_certificates import build as build_car
from analysis.certificates.car_certificates import metric_of, model_of
from analysis.reference import car_of

DEGREE = 6
CLOSE = 1e-20


def drawn(seed: int) -> Piece:
    linear, error = np.random.default_rng(seed).normal(size=(2, 3, DEGREE + 1))
    return Piece(fmpq(1), fmpq(3), linear, error * 1e-6)


def at(coefficients: Any, s: Any) -> list[Any]:
    """Values of polynomials with these coefficients (n, …)."""
    return [sum((c * s**k for k, c in enumerate(row)), arb(0)) for row in coefficients]


def test_polynomials_by_powers_from_the_middle_have_the_same_values() -> None:
    piece = drawn(0)
    with precision(2):
        for tau in (fmpq(0), fmpq(1, 3), fmpq(1)):
            x_lin = at(matrix(piece.linear).tolist(), arb(tau))
            x = [a + b for a, b in zip(x_lin, at(matrix(piece.error).tolist(), arb(tau)), strict=True)]
            sigma = arb(2 * tau - 1)
            for moved, values in ((piece.near_x_lin, x_lin), (piece.near_x, x)):
                assert moved.ncols() == DEGREE + 1 + MORE == piece.terms
                assert all(abs(u - v) < CLOSE for u, v in zip(at(moved.tolist(), sigma), values, strict=True))


def test_balls_hold_values_slopes_and_coefficients_everywhere_on_the_piece() -> None:
    with precision(2):
        p = drawn(1).near_x
        over, whole, slope = p * everywhere(p.ncols()), p * span(p.ncols()), p * derivative(p.ncols())
        for s in (fmpq(-1), fmpq(-2, 5), fmpq(0), fmpq(1)):
            rows = p.tolist()
            assert all(whole[i, 0].overlaps(v) for i, v in enumerate(at(rows, arb(s))))
            for k in range(p.ncols()):  # f^(k)(s)/k!
                assert all(over[i, k].overlaps(v) for i, v in enumerate(at(rows, arb(s))))
                below = [[c * j for j, c in enumerate(row)][1:] for row in rows]
                if k == 0:
                    expected = at(below, arb(s))
                    assert all(abs(u - v) < CLOSE for u, v in zip(at(slope.tolist(), arb(s)), expected, strict=True))
                rows = [[c / (k + 1) for c in row] for row in below]
        assert all(over[i, p.ncols() - MORE].contains(0) for i in range(p.nrows()))


def products(x: Any, w: Any, sine: Any, cosine: Any) -> list[Any]:
    return [x[0] * x[1] * w[0], sine(x[0]) / (x[1] + 2.0), x[2] * 1.0]


def test_a_jacobian_in_one_pass_has_no_products_of_increments() -> None:
    calls = []

    def counted(*arguments: Any) -> list[Any]:
        calls.append(arguments)
        return products(*arguments)

    system = ExactSystem(3, 2, counted, ((fmpq(0), lambda t: [arb(0)] * 2),), fmpq(0))
    with precision(2):
        x, w = [arb(0.5), arb(0.25, 1e-3), arb(3)], [arb(2), arb(7)]
        a, b = x[0], x[1]
        by_x = [[2 * b, 2 * a, 0], [a.cos() / (b + 2), -a.sin() / (b + 2) ** 2, 0], [0, 0, 1]]
        for found, wanted in ((jacobian(system, x, w), by_x), (jacobian(system, x, w, inputs=True), [[a * b, 0]])):
            for got, row in zip(found.tolist(), wanted, strict=False):
                for u, v in zip(got, row, strict=True):
                    assert u.overlaps(arb(v))
                    assert u.rad() <= 2 * arb(v).rad() + CLOSE
    assert len(calls) == 2


def test_what_rounding_a_matrix_leaves_is_bounded() -> None:
    with precision(2):
        m = arb_mat([[arb(1) / 3, arb(5, 1e-9)], [arb("1e-310"), arb(2) ** 60 + 1]])
        centre, rest = rounded(m)
        left = (m - matrix(centre)).entries()
        assert sum((v.abs_upper() for v in left), arb(0)) <= arb(rest)
        assert rest <= 1e-9 + 4e-16 * centre.sum()


def test_a_piece_takes_three_evaluations_of_the_equations() -> None:
    """Around the middle, over the whole piece, and one for the jacobian of a tube that closes at once."""
    certificate, proof, _, _ = certified(duffing, 2, forced=True)
    calls = []

    def counted(*arguments: Any) -> Any:
        calls.append(arguments)
        return duffing(*arguments)

    system = replace(build(duffing, 2, swinging, PERIOD)({}), equations=counted)
    with precision(2):
        prove_tube(system, proof.metric, certificate.pieces, (np.zeros(2), np.zeros(2)))
    assert len(calls) <= 3 * len(certificate.pieces) + 5


@pytest.mark.parametrize("seed", range(3))
def test_a_defect_is_bounded_at_every_time_and_nearly_reached(seed: int) -> None:
    """Of the car, on polynomials that are no motion at all: F(p, w) − p' at many times, without series."""
    with precision(2):
        system = build_car(model_of({"profile": "sine"}))
        metric = proved_metric(system, metric_of(car_of({})))
        size = np.random.default_rng(seed).normal(size=(14, 5)) * 0.05
        piece = Piece(fmpq(1, 10), fmpq(1, 8), size, size * 1e-3)
        bound = defect_of(system, metric, piece, piece.near_x, inputs_around(system, piece, piece.terms))
        largest = 0.0
        for k in range(21):
            s = arb(fmpq(k - 10, 10))
            x, slope = at(piece.near_x.tolist(), s), at((piece.near_x * derivative(piece.terms)).tolist(), s)
            w = system.inputs_at(piece.begin)(arb(piece.begin) + arb(piece.duration) * (s + 1) / 2)
            rates = system.equations(x, w, lambda v: v.sin(), lambda v: v.cos())
            off = arb_mat([[f - v * 2 / arb(piece.duration)] for f, v in zip(rates, slope, strict=True)])
            largest = max(largest, metric.length(off))
    assert largest <= bound * (1.0 + 1e-9)
    assert bound <= 3.0 * largest  # state by state, as the norm of sizes
