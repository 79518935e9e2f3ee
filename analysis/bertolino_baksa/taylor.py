"""Polynomials near x_lin and near e = x − x_lin by Taylor's series: found here, proved in `tube.py`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from flint import arb, arb_mat, arb_series, fmpq

from .balls import ExactSystem, NotProvedError, coefficients, column, cosine, decimal, jacobian, precision, sine
from .pieces import Piece

DEGREE = 30
LAST_TERM = 1e-13  # of a polynomial, over the size of the motion: it sets the length of a piece
LONGEST, SHORTEST = 0.25, 1e-5  # s
MOST = 5000  # pieces; more are no certificate that anyone would read or verify


def find_pieces(
    system: ExactSystem,
    x0: Sequence[float],
    stop: fmpq,
    *,
    linear_only: bool = False,
    changing: ExactSystem | None = None,
) -> list[Piece]:
    """Pieces from x(0) = x0 [exact doubles] to `stop`, none across a corner of the input or the last period's begin.

    linear_only : e is left at 0.
    changing    : what x_lin obeys, if its A changes in time.

    Raises NotProvedError where the motion runs away, or for more than MOST pieces.
    """
    if stop > MOST * decimal(LONGEST):
        raise _too_long(stop, MOST * LONGEST)
    zero = [arb(0)]
    A = jacobian(system, zero * system.n, zero * system.m)
    B = jacobian(system, zero * system.n, zero * system.m, inputs=True)
    corners = [*(begin for begin, _ in system.pieces), stop - system.period]
    pieces: list[Piece] = []
    x_lin, x, t, size = column([arb(v) for v in x0]), [arb(v) for v in x0], fmpq(0), 1e-9
    while t < stop:
        with precision(DEGREE + 1):
            w = system.inputs_at(t)(arb_series([arb(t), 1]))
        linear = _taylor(changing, w, x_lin.entries()) if changing else _linear_taylor(A, B, x_lin, w)
        full = linear if linear_only else _taylor(system, w, x)
        size = max(size, *(abs(float(c[0])) for c in full))
        h = _length(full, size)
        if not h > SHORTEST:
            raise NotProvedError(f"the motion runs away near t = {float(t):g} s: its Taylor series lasts {h:.1g} s")
        if len(pieces) == MOST:
            raise _too_long(stop, float(t))
        left = min([c for c in corners if c > t] + [stop]) - t
        pieces.append(_scaled(linear, full, t, t + _fitting(h, left)))
        ends = pieces[-1].linear.sum(axis=1), pieces[-1].error.sum(axis=1)
        x_lin = column([arb(v) for v in ends[0].tolist()])
        x = [arb(a) + arb(b) for a, b in zip(*(end.tolist() for end in ends), strict=True)]
        t = pieces[-1].end
    return pieces


def _too_long(stop: fmpq, reach: float) -> NotProvedError:
    return NotProvedError(
        f"the motion must be followed to t = {float(stop):g} s, but {MOST} pieces reach {reach:g} s at most"
    )


def _linear_taylor(A: arb_mat, B: arb_mat, x0: arb_mat, w: Sequence[Any]) -> list[list[Any]]:
    inputs = arb_mat([coefficients(wi, DEGREE + 1) for wi in w])
    terms, driven = [x0], B * inputs
    for k in range(DEGREE):
        slope = A * terms[-1] + column([driven[i, k] for i in range(A.nrows())])
        terms.append((slope / (k + 1)).mid())
    return [[term[i, 0] for term in terms] for i in range(A.nrows())]


def _taylor(system: ExactSystem, w: Sequence[Any], x0: Sequence[Any]) -> list[list[Any]]:
    """Coefficients of y' = F(y, w), y(0) = x0, one more with each pass."""
    terms = [[v.mid()] for v in x0]
    for k in range(DEGREE):
        with precision(k + 1):
            slopes = system.equations([arb_series(c) for c in terms], w, sine, cosine)
            for c, slope in zip(terms, slopes, strict=True):
                c.append((coefficients(slope, k + 1)[k] / (k + 1)).mid())
    return terms


def _length(terms: list[list[Any]], size: float) -> float:
    """Time [s] over which the last two terms stay small."""
    last = max(abs(float(c[k])) ** (1.0 / k) for c in terms for k in (DEGREE - 1, DEGREE))
    return min(LONGEST, (LAST_TERM * size) ** (1.0 / DEGREE) / max(last, 1e-9))


def _fitting(h: float, left: fmpq) -> fmpq:
    """A duration ≤ h, a short fraction, that leaves no crumb before the next corner."""
    parts = int(float(left) / h) + 1
    return left if parts == 1 else min(left / 2, fmpq(max(int(h * 10_000), 1), 10_000))


def _scaled(linear: list[list[Any]], full: list[list[Any]], begin: fmpq, end: fmpq) -> Piece:
    """Coefficients in τ; e gets what x_lin's, rounded to doubles, leave."""
    powers = [arb(end - begin) ** k for k in range(DEGREE + 1)]
    lin = [[float((c * p).mid()) for c, p in zip(row, powers, strict=True)] for row in linear]
    rest = [
        [float((c * p - arb(near)).mid()) for c, p, near in zip(row, powers, nears, strict=True)]
        for row, nears in zip(full, lin, strict=True)
    ]
    return Piece(begin, end, np.array(lin), np.array(rest))
