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
from flint import arb, arb_mat, arb_poly, arb_series, fmpq

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
    precision,
    sine,
)
from .norms import Metric

Excess = Callable[[Balls, Balls], arb_mat]
Outputs = Callable[[Sequence[Any], Sequence[Any], Any, Any], Sequence[Any]]
MIDDLE, WHOLE = arb(0.5), arb(0.5, 0.5)  # of a piece, as τ
MORE = 4  # terms of a defect's series beyond the polynomials' degree; what is left is enclosed
TRIES = 60  # of a wider tube, before a piece is given up


@dataclass(frozen=True, slots=True)
class Piece:
    """Coefficients (n, degree + 1) of τᵏ near x_lin and near e, τ = (t − begin)/(end − begin); times exact [s]."""

    begin: fmpq
    end: fmpq
    linear: Array
    error: Array

    @property
    def duration(self) -> fmpq:
        """end − begin [s]."""
        return self.end - self.begin


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
    defects = [(_linear_defect(system, metric, B, p), defect_of(system, metric, p, both(p))) for p in pieces]
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
        after = grown(V, -metric.alpha, _linear_defect(system, metric, B, piece), piece)
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


def both(piece: Piece) -> list[list[Any]]:
    """Exact coefficients of the polynomial near x: the sums of those near x_lin and near e."""
    rows = zip(piece.linear.tolist(), piece.error.tolist(), strict=True)
    return [[arb(a) + arb(b) for a, b in zip(lin, rest, strict=True)] for lin, rest in rows]


def at_end(polynomials: Array) -> arb_mat:
    """Exact values (n, 1) at τ = 1."""
    return column([sum(row, arb(0)) for row in exact(polynomials)])


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


def exact(polynomials: Array) -> list[list[Any]]:
    """Coefficients as balls."""
    return [[arb(v) for v in row] for row in polynomials.tolist()]


def _centred(p: Sequence[Balls], centre: Any, terms: int) -> list[list[Any]]:
    """So many coefficients of polynomials in τ by powers of σ = 2 (τ − centre)."""
    moved = arb_poly([centre, arb(1) / 2])
    rows = [arb_poly(c)(moved).coeffs() for c in p]
    return [[*row, *[arb(0)] * (terms - len(row))] for row in rows]


def _inputs(system: ExactSystem, piece: Piece, centre: Any, terms: int) -> list[list[Any]]:
    """So many coefficients of w by powers of σ = 2 (τ − centre), the centre a ball in 0 ≤ τ ≤ 1."""
    h = arb(piece.duration)
    w = system.inputs_over(piece.begin, piece.end)(arb_series([arb(piece.begin) + h * centre, h / 2], prec=terms))
    return [coefficients(wi, terms) for wi in w]


def _linear_defect(system: ExactSystem, metric: Metric, B: arb_mat, piece: Piece) -> float:
    """sup ‖A p + B w − p'‖_S [1/s]; beyond the polynomial's degree there is only w, whose last term is a remainder."""
    terms = piece.linear.shape[1] + MORE
    with precision(terms):
        w = _inputs(system, piece, MIDDLE, terms)
        last = [at[-1] for at in _inputs(system, piece, WHOLE, terms)]
        p = _centred(exact(piece.linear), MIDDLE, terms)
    for wi, remainder in zip(w, last, strict=True):
        wi[-1] = remainder
    slope = [[*(row[k] * k for k in range(1, terms)), arb(0)] for row in p]
    defect = metric.A * arb_mat(p) + B * arb_mat(w) - arb_mat(slope) * (2 / arb(piece.duration))
    return _sup_length(metric, defect.entries(), terms)


def defect_of(system: ExactSystem, metric: Metric, piece: Piece, p: Sequence[Balls]) -> float:
    """sup ‖F(p, w) − p'‖_S [1/s] of polynomials p in τ on the piece."""
    h = arb(piece.duration)

    def defect(y: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> list[Any]:
        return [rate - yi.derivative() * 2 / h for rate, yi in zip(system.equations(y, w, sin, cos), y, strict=True)]

    rows = _series(system, piece, defect, p)
    return _sup_length(metric, [c for row in rows for c in row], len(rows[0]))


def _series(system: ExactSystem, piece: Piece, functions: Outputs, p: Sequence[Balls]) -> list[list[Any]]:
    """Coefficients of σᵏ, σ = 2τ − 1, of functions(p, w, sin, cos): the last over the whole piece, others at σ = 0.

    Around the middle, as there a remainder of order k weighs 2⁻ᵏ of what it does from an end on.
    """
    terms = piece.linear.shape[1] + MORE
    found: list[list[list[Any]]] = []
    with precision(terms + 1):
        for centre in (MIDDLE, WHOLE):
            y = [arb_series(c, prec=terms + 1) for c in _centred(p, centre, terms + 1)]
            w = [arb_series(c, prec=terms + 1) for c in _inputs(system, piece, centre, terms + 1)]
            found.append([coefficients(value, terms) for value in functions(y, w, sine, cosine)])
    return [[*at[:-1], over[-1]] for at, over in zip(*found, strict=True)]


def enclosed_series(system: ExactSystem, piece: Piece, functions: Outputs, off: Array) -> tuple[Array, Array]:
    """Outputs along all x with |x_j − p_j| ≤ off_j: coefficients (k, terms) of (2τ − 1)ᵏ, and how far (k,) they may be
    off."""
    p = both(piece)
    for row, radius in zip(p, off.tolist(), strict=True):
        row[0] = row[0] + arb(0, radius)
    rows = _series(system, piece, functions, p)
    centres = [[float(c.mid()) for c in row[:-1]] for row in rows]
    rest = [
        sum(above(c - arb(near)) for c, near in zip(row, nears, strict=False)) + above(row[-1])
        for row, nears in zip(rows, centres, strict=True)
    ]
    return np.array(centres), np.array(rest) * (1.0 + 1e-13)


def _sup_length(metric: Metric, entries: Sequence[Any], terms: int) -> float:
    """Bound of ‖Σ d_k σᵏ‖_S over |σ| ≤ 1 from the entries, row by row."""
    rows = [entries[k : k + terms] for k in range(0, len(entries), terms)]
    return metric.longest(np.array([above(sum(map(abs, row), arb(0))) for row in rows]))


def over(system: ExactSystem, piece: Piece) -> list[Any]:
    """Balls around w over the whole piece."""
    return list(system.inputs_over(piece.begin, piece.end)(arb(piece.begin) + arb(piece.duration) * WHOLE))


def closed(
    system: ExactSystem, metric: Metric, piece: Piece, V: float, defect: float, excess: Excess, rate: float
) -> tuple[float, float]:
    """V at the end, and L ≥ ‖∂F/∂x − A‖_S on a tube wide enough for V to stay in it.

    excess : ∂F/∂x − A over the balls x and w.  rate : A's logarithmic norm.
    """
    ranges = [arb_poly(c)(arb(0, 1)) for c in _centred(both(piece), MIDDLE, 0)]
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
