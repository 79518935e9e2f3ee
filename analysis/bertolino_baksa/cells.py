"""Bounds over short cells of time that no sampling can miss: of e^(At), of the tube's polynomials, of the norm of e.

Between two points a function lies within Δ²/8 sup|f''| of its chord, and a norm on a chord is largest at an end. So all
bounds here are values at the cells' ends plus a term of second order in the cell's width Δ.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from flint import arb, arb_mat

from .balls import Array, ExactSystem, above, magnitudes, matrix, rounded, two_norm
from .norms import Metric, Norm
from .pieces import Piece
from .tube import Outputs, Tube, enclosed_series

CELLS, LATE_CELLS = 12, 3  # per piece, for e^(At) and the growth of perturbations: at first, and from
MANY = (3, 6, 12, 24, 48, 96)  # numbers of cells
TURN, LATE_TURN = 0.5, 2.5  # rad that the fastest mode turns over a cell at most, at first, and from LATE on
LATE = 2.0  # times the slowest time constant on, when what oscillates fast has died out
PARTS = 4  # of a cell, in whose middles R itself is known
FINE = 288  # per piece, for the norm of e
EPS = 1e-13  # relative: covers the roundings of a polynomial's or a product's value, over the sum of its terms' sizes


@dataclass(frozen=True, slots=True)
class Decay:
    """Φ over the cells, e^(At) for a constant A: width [s] (N,), ends (N + 1, n, n), and `curve` (N, n, n) ≥
    sup |Φ''| Δ²/8."""

    width: Array
    ends: Array
    curve: Array
    off: float  # bound of the spectral norm of (exact − ends)

    def of(self, norm: Norm) -> Array:
        """κ (N,) ≥ sup N(e^(At) y)/N(y) over each cell."""
        moved, curve, off = self.turned(norm)
        sizes = np.abs(moved).sum(axis=2).max(axis=1) if norm.largest else two_norm(moved)
        bend = curve.sum(axis=2).max(axis=1) if norm.largest else np.sqrt((curve**2).sum(axis=(1, 2)))
        return (np.maximum(sizes[:-1], sizes[1:]) + bend) * (1 + EPS) + off

    def turned(self, norm: Norm) -> tuple[Array, Array, float]:
        """T e^(At) T⁻¹ at the cells' ends (N + 1, n, n), how far (N, n, n) it may leave chords, and its rounding."""
        inverse, rest = rounded(matrix(norm.T).inv())
        curve = np.abs(norm.T) @ self.curve @ np.abs(inverse)
        return norm.T @ self.ends @ inverse, curve * (1 + EPS), self._rounding(norm.T, inverse, rest)

    def rows(self, norm: Norm, left: Array | None = None) -> Array:
        """κ_j (N, p) ≥ sup |(left e^(At) y)_j|/N(y) over each cell; left (p, n) is exact, 1 if not given."""
        inverse, rest = rounded(matrix(norm.T).inv())
        left = np.eye(len(norm.T)) if left is None else left
        dual = (lambda m: np.abs(m).sum(axis=2)) if norm.largest else (lambda m: np.sqrt((m**2).sum(axis=2)))
        sizes, bend = dual(left @ self.ends @ inverse), dual(np.abs(left) @ self.curve @ np.abs(inverse))
        off = self._rounding(left, inverse, rest)
        return (np.maximum(sizes[:-1], sizes[1:]) + bend) * (1 + EPS) + off

    def sizes(self, left: Array) -> Array:
        """(N, p, n) ≥ sup |left e^(At)| over each cell, entry by entry; left (p, n) exact."""
        values, bend = np.abs(left @ self.ends), np.abs(left) @ self.curve
        off = self._rounding(left, np.eye(left.shape[1]), 0.0)
        return np.asarray((np.maximum(values[:-1], values[1:]) + bend) * (1 + EPS) + off)

    def at_end(self, metric: Metric, norm: Norm) -> float:
        """c ≥ ‖e^(AT) y‖_S/N(y) at the end T."""
        inverse, rest = rounded(matrix(norm.T).inv())
        last = np.sqrt(((metric.S @ self.ends[-1] @ inverse) ** 2).sum())
        root = np.sqrt(len(norm.T)) if norm.largest else 1.0
        return float(last * root * (1 + EPS) + self._rounding(metric.S, inverse, rest))

    def integral(self, metric: Metric, left: Array, right: arb_mat, near: Array | None = None) -> Array:
        """Γ (p, q) ≥ ∫_0^∞ |left e^(At) right − u| dt, entry by entry; left (p, n) exact, right (n, q).

        near : values (N + 1, p, q) of u at the cells' ends, linear between them and 0 from the last on; none: u = 0.

        What comes after the last cell is bounded by ‖·‖_S.
        """
        centre, rest = rounded(right)
        whole = self.by_cells(left, right, near).sum(axis=0)
        start = np.sqrt(((metric.S @ self.ends[-1] @ centre) ** 2).sum(axis=0)) * (1 + EPS)
        start += self._rounding(metric.S, centre, rest)
        reach = np.sqrt((magnitudes(matrix(left) * metric.inverse) ** 2).sum(axis=1))
        return np.asarray((whole + np.outer(reach, start) / metric.alpha) * (1 + 10 * EPS))

    def by_cells(self, left: Array, right: arb_mat, near: Array | None = None) -> Array:
        """The same (N, p, q) over each cell alone, by the trapezium of its ends, as |chord| is convex."""
        centre, rest = rounded(right)
        values = left @ self.ends @ centre
        sizes, bend = np.abs(values if near is None else values - near), np.abs(left) @ self.curve @ np.abs(centre)
        heights = (sizes[:-1] + sizes[1:]) / 2 + bend + self._rounding(left, centre, rest)
        return np.asarray(heights * self.width[:, None, None])

    def _rounding(self, left: Array, inverse: Array, rest: float) -> float:
        """What rounding and enclosures add, at most, to any norm of left · e^(At) · inverse, with much to spare."""
        sizes = [float(np.linalg.norm(m)) for m in (left, np.abs(self.ends).max(axis=0), inverse)]
        n = len(left)
        return n * (sizes[0] * sizes[1] * (1e-14 * sizes[2] + rest) + sizes[0] * self.off * (sizes[2] + rest))


def decay(metric: Metric, pieces: tuple[Piece, ...]) -> Decay:
    """e^(At) over the cells of the pieces, from the first piece's begin."""
    return carried_on(metric, pieces, matrix(np.eye(len(metric.S))), 0.0)[0]


def carried_on(metric: Metric, pieces: Sequence[Piece], start: arb_mat, dropped: float) -> tuple[Decay, arb_mat, float]:
    """e^(At) Φ over the cells of the pieces, for a Φ within `dropped` [‖S ·‖, Frobenius] of `start`, exact; the last of
    it, exact, and how far that is off.

    From piece to piece without the radii of the balls, which would grow: what they hold, e^(At) only shrinks in ‖·‖_S.
    """
    A, now, off = metric.A, start, 0.0
    ends = [rounded(start)[0]]
    S_size = float(np.linalg.norm(metric.S)) * (1 + EPS)
    steps: dict[tuple[int, int], arb_mat] = {}  # e^(AΔ) by Δ's numerator and denominator
    for p, count in zip(pieces, counts(pieces, metric), strict=True):
        width = p.duration / count
        key = int(width.p), int(width.q)
        if key not in steps:
            steps[key] = (A * arb(width)).exp()
        for _ in range(count):
            now = steps[key] * now
            centre, rest = rounded(now)
            ends.append(centre)
            off = max(off, rest)
        dropped += S_size * above(sum((v.rad() for v in now.entries()), arb(0)))
        now = now.mid()
    off = max(off, rounded(start)[1]) + float(np.linalg.norm(metric.reach)) * dropped * (1 + 1e-9)
    values, width = np.array(ends), widths(pieces, metric)
    distinct, where = np.unique(width, return_inverse=True)
    A_size = arb_mat(A.nrows(), A.ncols(), [abs(v) for v in A.entries()])
    spread = np.array([magnitudes((A_size * arb(w)).exp()) for w in distinct.tolist()])[where]  # ≥ |e^(As)|, 0 ≤ s ≤ Δ
    second = np.abs(rounded(A * A)[0] @ values[:-1])
    second += 1e-9 * second.max()  # its rounding, with much to spare
    curve = (spread @ second) * (width**2 / 8)[:, None, None] * (1 + 1e-9)  # A² e^(As) Φ = e^(As) A² Φ
    return Decay(width, values, curve, off), now, dropped * (1 + 1e-9)


def counts(pieces: Sequence[Piece], metric: Metric) -> list[int]:
    """Number of equal cells of each piece; more of a long one, as of a motion that rests."""
    found = []
    for piece in pieces:
        late = float(piece.begin) * metric.alpha >= LATE
        wanted = float(piece.duration) * metric.fastest / (LATE_TURN if late else TURN)
        at_least = LATE_CELLS if late else CELLS
        found.append(next((count for count in MANY if count >= max(at_least, wanted)), MANY[-1]))
    return found


def widths(pieces: Sequence[Piece], metric: Metric) -> Array:
    """Widths (N,) of the cells [s]."""
    cells = zip(pieces, counts(pieces, metric), strict=True)
    return np.concatenate([np.full(count, above(arb(p.duration) / count)) for p, count in cells])


def ranges(pieces: Sequence[Piece], off: Array, metric: Metric) -> Array:
    """X (N, n) ≥ sup |x_j| over each of the cells of `decay`, for motions within `off` (pieces,) of the pieces' x."""
    found = []
    for piece, count, V in zip(pieces, counts(pieces, metric), off, strict=True):
        values, bend = sampled(piece.linear + piece.error, count)
        found.append(np.maximum(np.abs(values[:, :-1]), np.abs(values[:, 1:])).T + bend + V * metric.reach)
    return np.concatenate(found) * (1 + EPS)


def inputs(system: ExactSystem, metric: Metric, pieces: Sequence[Piece]) -> Array:
    """W (N, m) ≥ sup |w| over each of the cells of `decay`."""
    found = []
    for p, count in zip(pieces, counts(pieces, metric), strict=True):
        steps = [arb(p.begin) + arb(p.duration) * (arb(k) + arb(0.5, 0.5)) / count for k in range(count)]
        over = system.inputs_over(p.begin, p.end)
        found += [[above(w) for w in over(t)] for t in steps]
    return np.array(found)


def middles(
    system: ExactSystem, metric: Metric, polynomials: Sequence[Array], pieces: Sequence[Piece], off: Array
) -> tuple[Array, Array]:
    """(x, w) (n + m, N PART) in the middles of PARTS of each of the cells of `decay`, and how far they may be off these
    over the parts; x within `off` (pieces,) [‖·‖_S] of the pieces' polynomials (n, …) in τ."""
    middle, radius = [], []
    for piece, p, count, V in zip(pieces, polynomials, counts(pieces, metric), off, strict=True):
        parts = count * PARTS
        values, bend = sampled(p, parts)
        over = system.inputs_over(piece.begin, piece.end)
        times = (arb(piece.begin) + arb(piece.duration) * (arb(k) + arb(0.5, 0.5)) / parts for k in range(parts))
        resting = all(w == 0 for w in over(arb(piece.begin) + arb(piece.duration) * arb(0.5, 0.5)))
        w = [[arb(0)] * system.m] * parts if resting else [over(t) for t in times]
        near = np.array([[float(v.mid()) for v in each] for each in w])
        apart = [[above(v - arb(c)) for v, c in zip(*both, strict=True)] for both in zip(w, near.tolist(), strict=True)]
        middle.append(np.vstack([(values[:, :-1] + values[:, 1:]) / 2.0, near.T]))
        spread = np.abs(values[:, 1:] - values[:, :-1]) / 2.0 + (bend + V * metric.reach)[:, None]
        radius.append(np.vstack([spread, np.array(apart).T]))
    return np.concatenate(middle, axis=1), np.concatenate(radius, axis=1) * (1 + EPS)


def largest_of_parts(values: Array) -> Array:
    """Largest (N, k) over each cell of values (k, N PARTS) over the parts of `middles`."""
    return np.asarray(values.reshape(len(values), -1, PARTS).max(axis=2).T)


def errors(tube: Tube, metric: Metric, norm: Norm) -> Array:
    """sup N(e) over each of the cells of `decay`, from finer ones in it."""
    if norm.largest:
        return np.asarray(errors_by_rows(tube, metric, norm).max(axis=1))
    found, c = [], metric.of(norm)
    for values, bend, V in finely(tube, metric, norm):
        found.append(np.sqrt((values**2).sum(axis=1).max(axis=1)) + np.sqrt((bend**2).sum()) + c * V)
    return np.concatenate(found) * (1 + EPS)


def errors_by_rows(tube: Tube, metric: Metric, norm: Norm) -> Array:
    """sup |(T e)_i| (N, n) over each of the cells of `decay`, from finer ones in it."""
    c = metric.rows(norm.T)
    found = [np.abs(values).max(axis=2) + bend + c * V for values, bend, V in finely(tube, metric, norm)]
    return np.concatenate(found) * (1 + EPS)


def finely(tube: Tube, metric: Metric, norm: Norm) -> Iterator[tuple[Array, Array, float]]:
    """Of each piece: T p at finer cells' ends, p near e, by the cells of `decay` (cells, n, parts + 1); how far (n,) it
    may leave the chords between; and V."""
    for piece, count, V in zip(tube.pieces, counts(tube.pieces, metric), tube.error.tolist(), strict=True):
        sizes = np.abs(norm.T) @ np.abs(piece.error)
        values, bend = sampled(norm.T @ piece.error, FINE, sizes)
        at = np.arange(count)[:, None] * (FINE // count) + np.arange(FINE // count + 1)
        yield values[:, at].swapaxes(0, 1), bend, V


def sampled(coefficients: Array, cells: int, sizes: Array | None = None, begin: float = 0.0) -> tuple[Array, Array]:
    """Values (n, cells + 1) of polynomials at the cells' ends, and by how much (n,) they may leave the chords between.

    The cells divide what lies between `begin` (0 or −1) and 1.
    sizes : of the coefficients before they were combined, for the rounding of the combination.
    """
    k = np.arange(coefficients.shape[1])
    sizes = np.abs(coefficients) if sizes is None else sizes
    second = (sizes * k * (k - 1)).sum(axis=1)
    return coefficients @ _powers(len(k), cells, begin), second * (1.0 - begin) ** 2 / (
        8.0 * cells**2
    ) + EPS * sizes.sum(axis=1)


@cache
def _powers(count: int, cells: int, begin: float) -> Array:
    """Powers (count, cells + 1) of the ends of cells that divide what lies between `begin` and 1; not to be written."""
    return np.asarray(np.linspace(begin, 1.0, cells + 1)[None, :] ** np.arange(count)[:, None])


def errors_of_states(tube: Tube, metric: Metric) -> Array:
    """sup |e_j| (n,) over all pieces."""
    found = []
    for piece, V in zip(tube.pieces, tube.error, strict=True):
        values, bend = sampled(piece.error, FINE)
        found.append(np.abs(values).max(axis=1) + bend + V * metric.reach)
    return np.max(found, axis=0) * (1 + EPS)


def outputs(
    system: ExactSystem, tube: Tube, metric: Metric, functions: Outputs, wider: Array | None = None
) -> tuple[Array, Array]:
    """Smallest and largest value (k,) of the outputs functions(x, w, sin, cos) along x, over all pieces.

    wider : (N, n + m), how far x and w may be off besides, over the cells of `decay`.
    """
    low, high, cell = [], [], 0
    for piece, count, V in zip(tube.pieces, counts(tube.pieces, metric), tube.full, strict=True):
        off = np.pad(metric.reach * V, (0, system.m))
        if wider is not None:
            off += wider[cell : cell + count].max(axis=0)
            cell += count
        centres, rest = enclosed_series(system, piece, functions, off * (1 + EPS))
        values, bend = sampled(centres, FINE, begin=-1.0)
        low.append((values - bend[:, None]).min(axis=1) - rest)
        high.append((values + bend[:, None]).max(axis=1) + rest)
    return np.min(low, axis=0), np.max(high, axis=0)
