"""The validated reference: polynomials near x_lin and near e = x − x_lin, and a proved tube around them.

Both x_lin and the motion x of the full equations, with the same x(0), run within V of their polynomials in metric S:

    V' ≤ (−α + L) V + ‖defect‖_S        L: bound of ‖∂F/∂x − A‖_S on the tube

for x, and the same without L for x_lin. Polynomials need not fit together: a jump between pieces adds to V. How they
were found does not matter to the proof (`taylor.py` finds them).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, arb_mat, arb_poly, arb_series, fmpq

from .balls import Array, ExactSystem, NotProvedError, above, coefficients, column, cosine, jacobian, precision, sine
from .norms import Metric

Outputs = Callable[[Sequence[Any], Sequence[Any], Any, Any], Sequence[Any]]
MORE = 8  # terms of a defect's series beyond the polynomials' degree; what is left is enclosed
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


@dataclass(frozen=True, slots=True)
class Tube:
    """What is proved: on each piece x_lin and x are within `linear` and `full` [‖·‖_S] of their polynomials."""

    pieces: tuple[Piece, ...]
    linear: Array  # (pieces,)
    full: Array  # (pieces,)
    at_end: tuple[float, float]  # both at the end of the last piece
    growth: Array  # (pieces,) −α + L [1/s]

    @property
    def error(self) -> Array:
        """Bound of ‖e − its polynomial‖_S on each piece."""
        return (self.linear + self.full) * (1.0 + 1e-15)


def prove_tube(
    system: ExactSystem,
    metric: Metric,
    pieces: Sequence[Piece],
    start: tuple[Array, Array],
    off: tuple[float, float] = (0.0, 0.0),
) -> Tube:
    """The tube around the pieces for motions x_lin and x that begin within `off` [‖·‖_S] of start[0] and of the sum.

    Raises NotProvedError where the pieces leave a gap or the tube cannot be closed.
    """
    B = input_matrix(system)
    V_lin, V = off
    before = start[0][:, None], start[1][:, None]
    linear, full, rates = [], [], []
    for k, piece in enumerate(pieces):
        if k and piece.begin != pieces[k - 1].end:
            raise NotProvedError(f"pieces {k - 1} and {k} do not follow each other")
        jump_lin, jump = jumps(metric, before, piece)
        V_lin, V = V_lin + jump_lin, V + jump
        after, growth = _closed(system, metric, piece, V, _defect(system, metric, piece))
        after_lin = _grown(V_lin, -metric.alpha, _linear_defect(system, metric, B, piece), piece)
        linear.append(max(V_lin, after_lin))
        full.append(max(V, after))
        rates.append(growth)
        V_lin, V = after_lin, after
        before = piece.linear, piece.error
    return Tube(tuple(pieces), np.array(linear), np.array(full), (V_lin, V), np.array(rates))


def prove_linear(system: ExactSystem, metric: Metric, pieces: Sequence[Piece]) -> Array:
    """V (pieces,) of x_lin alone, from x_lin(0) = the first piece's begin on."""
    B, V, before = input_matrix(system), 0.0, (pieces[0].linear[:, :1], pieces[0].error[:, :1])
    found = []
    for piece in pieces:
        V += jumps(metric, before, piece)[0]
        after = _grown(V, -metric.alpha, _linear_defect(system, metric, B, piece), piece)
        found.append(max(V, after))
        V, before = after, (piece.linear, piece.error)
    return np.array(found)


def input_matrix(system: ExactSystem) -> arb_mat:
    """B (n, m)."""
    return jacobian(system, [arb(0)] * system.n, [arb(0)] * system.m, inputs=True)


def both(piece: Piece) -> list[list[Any]]:
    """Exact coefficients of the polynomial near x: the sums of those near x_lin and near e."""
    rows = zip(piece.linear.tolist(), piece.error.tolist(), strict=True)
    return [[arb(a) + arb(b) for a, b in zip(lin, rest, strict=True)] for lin, rest in rows]


def jumps(metric: Metric, before: tuple[Array, Array], piece: Piece) -> tuple[float, float]:
    """‖·‖_S of the jumps of the polynomials of x_lin and of x at the piece's begin."""
    old = [[sum((arb(v) for v in row), arb(0)) for row in c.tolist()] for c in before]
    new = [[arb(v) for v in c[:, 0].tolist()] for c in (piece.linear, piece.error)]
    linear = column(new[0]) - column(old[0])
    return metric.length(linear), metric.length(linear + column(new[1]) - column(old[1]))


def _grown(V: float, rate: float, defect: float, piece: Piece) -> float:
    """V at the piece's end under V' = rate V + defect."""
    h = arb(piece.duration)
    factor = (arb(rate) * h).exp()
    integral = h if rate == 0.0 else (factor - 1) / arb(rate)
    return above(factor * V + integral * defect)


def _inputs(system: ExactSystem, piece: Piece, centre: Any, terms: int) -> list[list[Any]]:
    """Coefficients of w(τ) at the centre, a ball in 0 ≤ τ ≤ 1."""
    h = arb(piece.duration)
    w = system.inputs_at(piece.begin)(arb_series([arb(piece.begin) + h * centre, h], prec=terms))
    return [coefficients(wi, terms) for wi in w]


def _linear_defect(system: ExactSystem, metric: Metric, B: arb_mat, piece: Piece) -> float:
    """sup ‖A p + B w − p'‖_S [1/s]; beyond the polynomial's degree there is only w, whose last term is a remainder."""
    terms = piece.linear.shape[1] + MORE
    with precision(terms):
        w = _inputs(system, piece, arb(0), terms)
        last = [at[-1] for at in _inputs(system, piece, arb(0.5, 0.5), terms)]
    for wi, remainder in zip(w, last, strict=True):
        wi[-1] = remainder
    zeros = [arb(0)] * MORE
    p = [[arb(v) for v in row] + zeros for row in piece.linear.tolist()]
    slope = [[row[k + 1] * (k + 1) for k in range(terms - 1)] + [arb(0)] for row in p]
    defect = metric.A * arb_mat(p) + B * arb_mat(w) - arb_mat(slope) / arb(piece.duration)
    return _sup_length(metric, [defect[i, k] for i in range(system.n) for k in range(terms)], terms)


def _defect(system: ExactSystem, metric: Metric, piece: Piece) -> float:
    """sup ‖F(p, w) − p'‖_S [1/s]."""
    h = arb(piece.duration)

    def defect(y: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> list[Any]:
        return [rate - yi.derivative() / h for rate, yi in zip(system.equations(y, w, sin, cos), y, strict=True)]

    rows = _series(system, piece, defect, both(piece))
    return _sup_length(metric, [c for row in rows for c in row], len(rows[0]))


def _series(system: ExactSystem, piece: Piece, functions: Outputs, p: list[list[Any]]) -> list[list[Any]]:
    """Coefficients of functions(p(τ), w(τ), sin, cos): all but the last at τ = 0, the last over the whole piece."""
    terms = piece.linear.shape[1] + MORE
    found: list[list[list[Any]]] = []
    with precision(terms + 1):
        for centre in (arb(0), arb(0.5, 0.5)):
            shift = arb_poly([centre, 1])
            y = [arb_series(arb_poly(c)(shift).coeffs() or [0], prec=terms + 1) for c in p]
            w = [arb_series(c, prec=terms + 1) for c in _inputs(system, piece, centre, terms + 1)]
            found.append([coefficients(value, terms) for value in functions(y, w, sine, cosine)])
    return [[*at[:-1], over[-1]] for at, over in zip(*found, strict=True)]


def enclosed_series(system: ExactSystem, piece: Piece, functions: Outputs, off: Array) -> tuple[Array, Array]:
    """Outputs along all x with |x_j − p_j| ≤ off_j: coefficients (k, terms) of τᵏ, and how far (k,) they may be off."""
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
    """Bound of ‖Σ d_k τᵏ‖_S over 0 ≤ τ ≤ 1 from the entries, row by row."""
    sums = np.array([above(c) for c in entries]).reshape(-1, terms).sum(axis=1)
    return metric.longest(sums * (1.0 + 1e-13))


def _closed(system: ExactSystem, metric: Metric, piece: Piece, V: float, defect: float) -> tuple[float, float]:
    """V at the end, and the growth rate −α + L that holds on a tube wide enough for V to stay in it."""
    whole = arb(0.5, 0.5)
    ranges = [arb_poly(c)(whole) for c in both(piece)]
    w = system.inputs_at(piece.begin)(arb(piece.begin) + arb(piece.duration) * whole)
    most = 2.0 * (V + defect * above(arb(piece.duration)))
    for _ in range(TRIES):
        box = [r + arb(0, n * most) for r, n in zip(ranges, metric.reach.tolist(), strict=True)]
        try:
            growth = metric.size(jacobian(system, box, w) - metric.A) - metric.alpha
            after = _grown(V, growth, defect, piece)
        except NotProvedError:  # wider than numbers go
            break
        if max(V, after) <= most:
            return after, growth
        most = 2.0 * max(after, most)
    raise NotProvedError(f"the tube cannot be closed from t = {float(piece.begin):g} s on")
