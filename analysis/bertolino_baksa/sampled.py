"""A motion x = (q, q̇) that is known at rows only, as is its input: x − x_lin at all times, for all that fits the rows.

Between two rows x is near a quintic p. What p fails to obey, and what is open in the input, make a forcing f of x − p,
which is known at both rows; so from the nearer one, in positive numbers,

    |x − p| ≤ D,   D = e^(|A|h) open + ∫₀ʰ e^(|A|s) ds f,   h half a width, and f counts what D changes in R.

Thus e' = A e + R(x, w), e = 0 at the first row, has a forcing known from the rows: R(p, ŵ) but for what D and the open
input change there. Errors do not add up from row to row, as they do for motions of which the first row alone is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from .balls import Array, ExactSystem, NotProvedError, matrix, rounded, two_norm
from .hermite import CHEBYSHEV, NODES, Quintics, quintics
from .majorant import SLACK, Majorant, majorant
from .norms import Metric, Norm
from .tube import input_matrix

TERMS = 30  # of Taylor's series over a cell
FINE = 16  # parts of a cell, for the norm of e
ROOM = 1.5  # of the box on which the equations are bounded, over the largest motion and input
ROUNDS = 6  # of widening D until it holds
RADIUS = 6.0  # in u, of the disc on which R(p, ŵ) is bounded: at its nodes' polynomial of degree 6 it is then off by
OFF = 4.0 * (RADIUS + np.sqrt(RADIUS**2 - 1.0)) ** -6 / (RADIUS + np.sqrt(RADIUS**2 - 1.0) - 1.0)  # times the bound
BOX = 1e-9  # of it, at least
CONVERTED = 1e-10  # relative: what the values at the nodes lose as coefficients of τᵏ, with much to spare
EPS = 1e-12  # relative, over the sum of the terms' sizes: the roundings of one step or value, with much to spare


@dataclass(frozen=True, slots=True)
class Samples:
    """Rows (N,): times [s], x (N, n), how far the motion may be off x (N, n); the input is linear between them, but

    peak, mean : (N − 1, m) how far it may be off that in a cell, at most, and on the average of half a cell; it
                 may be less off nearer to the rows.
    """

    times: Array
    x: Array
    open: Array
    inputs: Array  # (N − 1, 2, m), at both rows of each cell
    peak: Array
    mean: Array


@dataclass(frozen=True, slots=True)
class Between:
    """x_lin and e = x − x_lin of all motions that fit the rows, in the metric's coordinates y = S x.

    How far they may be off is bounded pair by pair, |(y_k, y_{k + n/2})| ≤ V_k: a metric of modes has a mode in each.
    """

    metric: Metric
    linear: Array  # (N, n), at the rows, for the input that is linear between them
    error: Array  # (N, n), at the rows
    pieces: Array  # (N − 1, n, TERMS + 1), coefficients of τᵏ of e over each cell
    off_linear: Array  # (N, n/2) ≥ V of x_lin, by rounding and by the first row, up to each row
    off: Array  # (N, n/2) ≥ V of e

    def rows(self) -> tuple[Array, Array, Array]:
        """x and e at the rows (N, n), and how far (N, n) x may be off, but for what the open input does to x_lin."""
        back, rest = rounded(self.metric.inverse)
        e = self.error @ back.T
        x = self.linear @ back.T + e
        off = (self.off + self.off_linear) @ _pairs(np.abs(back) + rest).T
        return x, e, off + EPS * (np.abs(self.linear) + np.abs(self.error)) @ np.abs(back).T

    def largest_error(self, norm: Norm) -> float:
        """sup N(e) over all times from the first to the last row."""
        to, rest = rounded(matrix(norm.T) * self.metric.inverse)
        k = np.arange(self.pieces.shape[2])
        terms = to @ self.pieces
        values = terms @ np.linspace(0.0, 1.0, FINE + 1) ** k[:, None]
        bends = np.abs(terms) @ (k * (k - 1)) / (8.0 * FINE**2)
        size = (lambda v: np.abs(v).max(axis=1)) if norm.largest else (lambda v: np.sqrt((v**2).sum(axis=1)))
        sizes = np.sqrt((np.abs(self.pieces).sum(axis=2) ** 2).sum(axis=1)) + self.off[1:].sum(axis=1)
        top = size(values).max(axis=1) + size(bends) + _sizes(to, self.off[1:], norm)
        return float((top + (rest + EPS * np.abs(to).sum()) * sizes).max())


def _pairs(m: Array) -> Array:
    """Sizes (…, n/2) of the pairs of entries (…, n)."""
    return np.asarray(np.hypot(*np.split(m, 2, axis=-1)))


def _sizes(to: Array, V: Array, norm: Norm) -> Array:
    """Bounds (N,) of N(x) of all T x = to · y with y in V (N, n/2)."""
    if norm.largest:
        return np.asarray((V @ _pairs(to).T).max(axis=1))
    columns = np.stack(np.split(to, 2, axis=1), axis=2).swapaxes(0, 1)  # (n/2, n, 2)
    gram = two_norm(np.einsum("ikp,jkq->ijpq", columns, columns))
    return np.asarray(np.sqrt(np.einsum("ci,ij,cj->c", V, gram, V)))


def between(system: ExactSystem, metric: Metric, samples: Samples) -> Between:
    """All motions that fit the rows. Raises NotProvedError if the rows leave too much open."""
    widths = np.diff(samples.times)
    B = rounded(input_matrix(system))[0]
    R, forced = _forcing(system, metric, samples)
    held = np.stack([samples.inputs[:, 0], samples.inputs[:, 1] - samples.inputs[:, 0]], axis=2)
    start = _pairs(np.abs(metric.S) @ (samples.open[0] + EPS * np.abs(samples.x[0])))
    error, pieces, crumbs = _flow(metric, widths, R @ _TO_TAU, np.zeros(system.n))
    linear, _, more = _flow(metric, widths, B @ held, metric.S @ samples.x[0])
    off_linear = _grown(metric, widths, more, np.zeros_like(forced), start)
    return Between(metric, linear, error, pieces, off_linear, _grown(metric, widths, crumbs, forced, 0.0 * start))


def _forcing(system: ExactSystem, metric: Metric, samples: Samples) -> tuple[Array, Array]:
    """R(p, ŵ) (N − 1, n, 7) at the nodes of each cell, and how far (N − 1, n/2) S R(x, w) may be off it."""
    AB = np.hstack([rounded(metric.A)[0], rounded(input_matrix(system))[0]])
    most = np.concatenate([np.abs(samples.x).max(axis=0), np.abs(samples.inputs).max(axis=(0, 1))])
    more = np.concatenate([samples.open.max(axis=0), samples.peak.max(axis=0)])
    bound = majorant(system, ROOM * most + 2.0 * more + BOX)
    p = _near(bound, AB, samples)
    middle, rise = samples.inputs.mean(axis=1), (samples.inputs[:, 1] - samples.inputs[:, 0]) / 2.0
    y = np.concatenate([p.values, middle[:, :, None] + rise[:, :, None] * NODES], axis=1)
    X, far = (np.hstack([p.size(r), np.abs(middle) + r * np.abs(rise)]).T for r in (1.0, RADIUS))
    R = _on_cells(bound.expansion, y)
    off = (OFF * bound(far) + CONVERTED * bound(X) + bound.tail(X, X)).T
    sizes = (np.abs(AB) @ X).T + np.abs(p.coefficients) @ np.arange(6) / p.half[:, None]
    wrong = np.abs((AB @ y + R - p.slopes) @ CHEBYSHEV.T).sum(axis=2) + off + EPS * sizes
    pushed = wrong + samples.mean @ np.abs(AB[:, system.n :]).T
    open_ = np.maximum(samples.open[:-1], samples.open[1:]) + EPS * p.size()
    off += _change(bound, X, np.abs(AB[:, : system.n]), 2.0 * p.half, pushed, open_, samples.peak)
    return R, _pairs(off @ np.abs(metric.S).T) * (1.0 + EPS)


def _near(bound: Majorant, AB: Array, samples: Samples) -> Quintics:
    """The quintics through the rows with the accelerations of the equations."""
    ends = np.stack([samples.x[:-1], samples.x[1:]], axis=2)
    y = np.concatenate([ends, samples.inputs.swapaxes(1, 2)], axis=1)
    rates = AB @ y + _on_cells(bound.expansion, y)
    return quintics(samples.times, samples.x, rates.swapaxes(1, 2)[:, :, len(AB) // 2 :])


def _on_cells(function: Callable[[Array], Array], y: Array) -> Array:
    """function of columns (n + m, K), at y (cells, n + m, k)."""
    cells, size, k = y.shape
    columns = function(y.swapaxes(0, 1).reshape(size, -1))
    return np.asarray(columns.reshape(-1, cells, k).swapaxes(0, 1))


def _change(bound: Majorant, X: Array, A: Array, widths: Array, pushed: Array, open_: Array, inputs: Array) -> Array:
    """Bound (cells, n) of |R(x, w) − R(p, ŵ)|. X (n + m, cells) bounds (p, ŵ), A = |A|.

    pushed, open_, inputs : bounds of the forcing of x − p without it, of x − p at both rows, and of w − ŵ.
    """
    n = len(A)
    both = np.block([[A, np.eye(n)], [np.zeros((n, 2 * n))]]) * (1.0 + EPS)
    distinct, where = np.unique(widths, return_inverse=True)
    grown = np.array([expm(both * h)[:n] for h in distinct / 2.0 * (1.0 + EPS)])[where] * (1.0 + EPS)

    def change(D: Array) -> Array:
        Y = np.hstack([D, inputs]).T
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray((bound(X + Y) * (1.0 + SLACK) - bound(X) * (1.0 - SLACK) + bound.tail(X + Y, Y)).T)

    def needed(more: Array) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):
            return np.einsum("cij,cj->ci", grown, np.hstack([open_, pushed + more]))

    D = 1.5 * needed(np.zeros_like(pushed))
    for _ in range(ROUNDS):
        enough = needed(change(D))
        if np.all(enough <= D):
            return change(enough)
        D = 2.0 * enough
    raise NotProvedError(
        "between its rows the motion is not known well enough: they are too far apart, or of no motion"
    )


def _flow(metric: Metric, widths: Array, forcing: Array, start: Array) -> tuple[Array, Array, Array]:
    """y = S x under x' = A x + Σ f_k τᵏ: at the rows (N, n), its Taylor polynomials in τ, and their errors (N − 1,).

    forcing : (N − 1, n, k).
    """
    A, rest = rounded(matrix(metric.S) * metric.A * metric.inverse)
    f = metric.S @ forcing

    def series(y: Array) -> Array:
        terms = [y]
        for k in range(TERMS):
            slope = terms[-1] @ A.T + (f[:, :, k] if k < f.shape[2] else 0.0)
            terms.append(slope * widths[:, None] / (k + 1))
        return np.stack(terms, axis=2)

    distinct, where = np.unique(widths, return_inverse=True)
    over, driven = np.array([expm(A * w) for w in distinct]), series(np.zeros((len(widths), len(A)))).sum(axis=2)
    rows = [start]
    for k, extra in zip(where.tolist(), driven, strict=True):
        rows.append(over[k] @ rows[-1] + extra)
    pieces = series(np.array(rows[:-1]))
    ratio = widths * (float(two_norm(A)) + rest) / (TERMS + 1)
    if not ratio.max() < 0.5:
        raise NotProvedError(f"rows {widths.max():g} s apart are too far apart")
    sizes = np.abs(pieces).sum(axis=(1, 2)) + widths * (np.abs(metric.S) @ np.abs(forcing)).sum(axis=(1, 2))
    last = np.sqrt((pieces[:, :, -1] ** 2).sum(axis=1))
    return np.array(rows), pieces, 2.0 * last * ratio + (EPS + 2.0 * widths * rest) * sizes


def _grown(metric: Metric, widths: Array, added: Array, forced: Array, start: Array) -> Array:
    """V (N, n/2) from each row to the next one's, V' = C V + forced, and `added` (N − 1,) to each V in each cell."""
    C = _comparison(metric)
    size = len(C)
    both = np.block([[C, np.eye(size)], [np.zeros((size, 2 * size))]])
    rising = np.where(np.eye(size) > 0.0, np.maximum(C, 0.0), C)
    distinct, where = np.unique(widths, return_inverse=True)
    over = np.array([expm(both * w)[:size] for w in distinct]) * (1.0 + EPS)
    within = np.array([expm(rising * w) for w in distinct]) * (1.0 + EPS)
    V, found = start, [start]
    for k, width, more, push in zip(where.tolist(), widths.tolist(), added.tolist(), forced, strict=True):
        found.append(within[k] @ (V + width * push + more))
        V = over[k] @ np.concatenate([V, push]) + more
    return np.array(found)


def _comparison(metric: Metric) -> Array:
    """C (n/2, n/2) such that the pairs of S x under x' = A x + f grow at most as V' = C V + (sizes of the pairs of S f).

    On its diagonal the largest eigenvalue of a pair's own symmetric part, beside it the sizes of the other blocks.
    """
    turned, rest = rounded(matrix(metric.S) * metric.A * metric.inverse)
    half = len(turned) // 2
    blocks = turned.reshape(2, half, 2, half)
    C = np.sqrt((blocks**2).sum(axis=(0, 2)))
    a, b, c, d = (np.diagonal(blocks[p, :, q, :]) for p in (0, 1) for q in (0, 1))
    np.fill_diagonal(C, (a + d) / 2.0 + np.hypot((a - d) / 2.0, (b + c) / 2.0))
    return C + rest + EPS * np.abs(C)


_TO_TAU = np.linalg.inv(((1.0 + NODES) / 2.0)[None, :] ** np.arange(7)[:, None])  # values at the nodes → coefficients
