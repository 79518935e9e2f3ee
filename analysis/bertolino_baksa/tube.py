"""The validated reference: polynomials near x_lin and near e = x − x_lin, and a proved tube around them.

Both x_lin and the motion x of the full equations run within V of their polynomials in metric S, and e = x − x_lin
within V_e of the difference of these:

    V'  ≤ (−α + L) V + ‖defect‖_S            L: bound of ‖∂F/∂x − A‖_S on the tube
    V_e' ≤ −α V_e + L V + ‖both defects‖_S

for x and e, and the first without L for x_lin. Polynomials need not fit together: a jump between pieces adds to V. How
they were found does not matter to the proof (`taylor.py` finds them).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from flint import arb, arb_mat, arb_series

from .balls import (
    Array,
    Balls,
    ExactSystem,
    NotProvedError,
    above,
    coefficients,
    column,
    cosine,
    jacobian,
    magnitudes,
    matrix,
    precision,
    sine,
)
from .norms import Metric
from .pieces import Piece, derivative, everywhere, span

Excess = Callable[[Balls, Balls], arb_mat]
Outputs = Callable[[Sequence[Any], Sequence[Any], Any, Any], Sequence[Any]]
MIDDLE, WHOLE = arb(0.5), arb(0.5, 0.5)  # of a piece, as τ
OF_OUTPUTS = 20  # terms of outputs: the remainder is about 1e-10 of them
TRIES = 60  # of a wider tube, before a piece is given up


Around = tuple[arb_mat, arb_mat]
Off = tuple[float, float, float]
"""Bounds [‖·‖_S] for x_lin, x and e."""


@dataclass(frozen=True, slots=True)
class Tube:
    """What is proved: on each piece x_lin, x, e are within `linear`, `full`, `error` [‖·‖_S] of their polynomials."""

    pieces: tuple[Piece, ...]
    defects: Array  # (pieces, 2) of x_lin's and of x's polynomials [1/s]
    linear: Array  # (pieces,)
    full: Array  # (pieces,)
    error: Array  # (pieces,)
    at_end: Off  # of the last piece
    growth: Array  # (pieces,) −α + L [1/s]


def prove_tube(
    system: ExactSystem,
    metric: Metric,
    pieces: Sequence[Piece],
    start: tuple[Array, Array],
    off: tuple[float, float] = (0.0, 0.0),
) -> Tube:
    """The tube around the pieces for motions x_lin and x that begin within `off` [‖·‖_S] of start[0] and of the sum.

    Raises NotProvedError where the pieces leave a gap or lie across a corner of w, or the tube cannot be closed.
    """
    B = input_matrix(system)
    defects = []
    for piece in pieces:
        w = inputs_around(system, piece, piece.terms)
        defects.append((_linear_defect(metric, B, piece, w), defect_of(system, metric, piece, piece.near_x, w)))
    return followed(system, metric, pieces, np.array(defects), start, (*off, off[0] + off[1]))


def followed(
    system: ExactSystem, metric: Metric, pieces: Sequence[Piece], defects: Array, start: tuple[Array, Array], off: Off
) -> Tube:
    """The tube around pieces with these defects (pieces, 2), as of `prove_tube`; it raises the same."""

    def excess(x: Balls, w: Balls) -> arb_mat:
        return jacobian(system, x, w) - metric.A

    V_lin, V, V_e = off
    before = start[0][:, None], start[1][:, None]
    widths, rates = [], []
    refuse_gaps(pieces)
    for piece, (d_lin, d) in zip(pieces, defects.tolist(), strict=True):
        V_lin, V, V_e = (up(v + jump) for v, jump in zip((V_lin, V, V_e), jumps(metric, before, piece), strict=True))
        after, L = closed(system, metric, piece, V, d, excess, -metric.alpha)
        after_lin, full = grown(V_lin, -metric.alpha, d_lin, piece), max(V, after)
        after_e = grown(V_e, -metric.alpha, arb(L) * full + d_lin + d, piece)
        widths.append((max(V_lin, after_lin), full, max(V_e, after_e)))
        rates.append(up(L - metric.alpha))
        V_lin, V, V_e = after_lin, after, after_e
        before = piece.linear, piece.error
    linear, fulls, errors = np.array(widths).T
    return Tube(tuple(pieces), defects, linear, fulls, errors, (V_lin, V, V_e), np.array(rates))


def prove_linear(system: ExactSystem, metric: Metric, pieces: Sequence[Piece]) -> Array:
    """V (pieces,) of x_lin alone, from x_lin(0) = the first piece's begin on. Raises NotProvedError for a gap."""
    B, V, before = input_matrix(system), 0.0, (pieces[0].linear[:, :1], pieces[0].error[:, :1])
    found = []
    refuse_gaps(pieces)
    for piece in pieces:
        V = up(V + jumps(metric, before, piece)[0])
        after = grown(
            V, -metric.alpha, _linear_defect(metric, B, piece, inputs_around(system, piece, piece.terms)), piece
        )
        found.append(max(V, after))
        V, before = after, (piece.linear, piece.error)
    return np.array(found)


def refuse_gaps(pieces: Sequence[Piece]) -> None:
    """Raise NotProvedError unless each piece begins where the one before it ends."""
    for k, (piece, following) in enumerate(pairwise(pieces)):
        if piece.end != following.begin:
            raise NotProvedError(f"pieces {k} and {k + 1} do not follow each other")


def input_matrix(system: ExactSystem) -> arb_mat:
    """B (n, m)."""
    return jacobian(system, [arb(0)] * system.n, [arb(0)] * system.m, inputs=True)


def at_end(polynomials: Array) -> arb_mat:
    """Values (n, 1) at τ = 1, balls."""
    return matrix(polynomials) * matrix(np.ones((polynomials.shape[1], 1)))


def jumps(metric: Metric, before: tuple[Array, Array], piece: Piece) -> Off:
    """‖·‖_S of the jumps of the polynomials of x_lin, x and e at the piece's begin."""
    linear, error = (
        column([arb(v) for v in new[:, 0].tolist()]) - at_end(old)
        for new, old in zip((piece.linear, piece.error), before, strict=True)
    )
    return metric.length(linear), metric.length(linear + error), metric.length(error)


def grown(V: float, rate: float, defect: Any, piece: Piece) -> float:
    """V at the piece's end under V' = rate V + defect."""
    h = arb(piece.duration)
    factor = (arb(rate) * h).exp()
    integral = h if rate == 0.0 else (factor - 1) / arb(rate)
    return above(factor * V + integral * defect)


def up(x: float) -> float:
    """A float that is not below a number rounded to x."""
    return math.nextafter(x, math.inf)


def inputs_around(system: ExactSystem, piece: Piece, terms: int) -> Around:
    """Coefficients (m, terms) of σᵏ of w, around the middle of the piece, and around all of its points at once."""
    h = arb(piece.duration)
    w = system.inputs_over(piece.begin, piece.end)
    found = []
    with precision(terms):
        for centre in (MIDDLE, WHOLE):
            around = w(arb_series([arb(piece.begin) + h * centre, h / 2], prec=terms))
            found.append(arb_mat([coefficients(wi, terms) for wi in around]))
    return found[0], found[1]


def _linear_defect(metric: Metric, B: arb_mat, piece: Piece, w: Around) -> float:
    """sup ‖A p + B w − p'‖_S [1/s]; beyond the polynomial's degree there is only w, whose last term is a remainder."""
    p, (at, over) = piece.near_x_lin, w
    bounded = arb_mat([[*row[:-1], whole[-1]] for row, whole in zip(at.tolist(), over.tolist(), strict=True)])
    return _sup_length(metric, metric.A * p + B * bounded - _slope(piece, p))


def defect_of(system: ExactSystem, metric: Metric, piece: Piece, p: arb_mat, w: Around) -> float:
    """sup ‖F(p, w) − p'‖_S [1/s] of polynomials p and inputs w, as of `Piece.near_x` and `inputs_around`."""
    return _sup_length(metric, _series(system.equations, p, w) - _slope(piece, p))


def _slope(piece: Piece, p: arb_mat) -> arb_mat:
    """p' by powers of σ [1/s]."""
    return p * derivative(piece.terms) * (2 / arb(piece.duration))


def _series(functions: Outputs, p: arb_mat, w: Around) -> arb_mat:
    """Coefficients (k, terms) of σᵏ of functions(p, w, sin, cos): the last over the whole piece, others at σ = 0.

    As many as w has. Around the middle, as there a remainder of order k weighs 2⁻ᵏ of what it does from an end on.
    """
    terms, found = w[0].ncols(), []
    with precision(terms):
        for both in zip((p, p * everywhere(p.ncols())), w, strict=True):
            y, u = ([arb_series(row, prec=terms) for row in m.tolist()] for m in both)
            found.append([coefficients(value, terms) for value in functions(y, u, sine, cosine)])
    return arb_mat([[*at[:-1], over[-1]] for at, over in zip(*found, strict=True)])


def enclosed_series(system: ExactSystem, piece: Piece, functions: Outputs, off: Array) -> tuple[Array, Array]:
    """Outputs along all x and w that are off the piece's by off_j (n + m,) at most: coefficients (k, terms) of
    (2τ − 1)ᵏ, and how far (k,) they may be off."""
    n = system.n
    w = [_widened(m, off[n:]) for m in inputs_around(system, piece, OF_OUTPUTS)]
    rows = _series(functions, _widened(piece.near_x, off[:n]), (w[0], w[1])).tolist()
    centres = [[float(c.mid()) for c in row[:-1]] for row in rows]
    rest = [
        sum(above(c - arb(near)) for c, near in zip(row, nears, strict=False)) + above(row[-1])
        for row, nears in zip(rows, centres, strict=True)
    ]
    return np.array(centres), np.array(rest) * (1.0 + 1e-13)


def _widened(m: arb_mat, off: Array) -> arb_mat:
    """Coefficients with balls of these radii around the first of each row."""
    rows = m.tolist()
    return arb_mat([[row[0] + arb(0, radius), *row[1:]] for row, radius in zip(rows, off.tolist(), strict=True)])


def _sup_length(metric: Metric, d: arb_mat) -> float:
    """Bound of ‖Σ d_k σᵏ‖_S over |σ| ≤ 1, row by row."""
    return metric.longest(magnitudes(d * span(d.ncols())).ravel())


def over(system: ExactSystem, piece: Piece) -> list[Any]:
    """Balls around w over the whole piece."""
    return list(system.inputs_over(piece.begin, piece.end)(arb(piece.begin) + arb(piece.duration) * WHOLE))


def closed(
    system: ExactSystem, metric: Metric, piece: Piece, V: float, defect: float, excess: Excess, rate: float
) -> tuple[float, float]:
    """V at the end, and L ≥ ‖∂F/∂x − A‖_S on a tube wide enough for V to stay in it.

    excess : ∂F/∂x − A over the balls x and w.  rate : A's logarithmic norm.
    """
    ranges = (piece.near_x * span(piece.terms)).entries()
    w = over(system, piece)
    most = 2.0 * (V + defect * above(arb(piece.duration)))
    for _ in range(TRIES):
        box = [r + arb(0, up(n * most)) for r, n in zip(ranges, metric.reach.tolist(), strict=True)]
        try:
            L = metric.size(excess(box, w))
            after = grown(V, up(L + rate), defect, piece)
        except NotProvedError:  # wider than numbers go
            break
        if max(V, after) <= most:
            return after, L
        most = 2.0 * max(after, most)
    raise NotProvedError(f"the tube cannot be closed from t = {float(piece.begin):g} s on")
