"""A motion x = (q, q̇) that is known at rows only, as is its input: x − x_lin at all times, for all that fits the rows.

Between two rows x is near a quintic p. What p fails to obey, and what is open in the input, make a forcing f of x − p,
which is known at both rows; so from the nearer one, in positive numbers,

    |x − p| ≤ D,   D = e^(|A|h) open + ∫₀ʰ e^(|A|s) ds |f|,   h half a width; f has what D may change in R.

Thus e' = A e + R(x, w), e = 0 at the first row, has a forcing known from the rows: R(p, ŵ) but for what D and the open
input change there. Errors do not add up from row to row, as they do for motions of which the first row alone is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from .balls import Array, ExactSystem, NotProvedError, matrix, rounded
from .hermite import CHEBYSHEV, NODES, Quintics, quintics
from .linear_flow import EPS, flow, grown, pairs, sizes_of
from .majorant import SLACK, Majorant, majorant
from .norms import Metric, Norm
from .tube import input_matrix

FINE = 16  # parts of a cell, for the norm of e
ROOM = 1.5  # of the box on which the equations are bounded, over the largest motion and input
ROUNDS = 6  # of widening D until it holds
RADIUS = 6.0  # in u, of the disc on which R(p, ŵ) is bounded: at its nodes' polynomial of degree 6 it is then off by
OFF = 4.0 * (RADIUS + np.sqrt(RADIUS**2 - 1.0)) ** -6 / (RADIUS + np.sqrt(RADIUS**2 - 1.0) - 1.0)  # times the bound
SHARE, LEAST = 0.1, 1e-9  # of it, at least: of what the whole motion could be in one state, and in SI units
CONVERTED = 1e-10  # relative: what the values at the nodes lose as coefficients of τᵏ, with much to spare


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
        off = (self.off + self.off_linear) @ pairs(np.abs(back) + rest).T
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
        top = size(values).max(axis=1) + size(bends) + sizes_of(to, self.off[1:], norm)
        return float((top + (rest + EPS * np.abs(to).sum()) * sizes).max())


def between(system: ExactSystem, metric: Metric, samples: Samples, tilted: int) -> Between:
    """All motions that fit the rows. Raises NotProvedError if the rows leave too much open.

    tilted : a coordinate; the input enters as B w, but for the equation of this coordinate, where as cos q · B w.
    """
    widths = np.diff(samples.times)
    B = rounded(input_matrix(system))[0]
    R, forced, jump = _forcing(system, metric, samples, tilted)
    held = np.stack([samples.inputs[:, 0], samples.inputs[:, 1] - samples.inputs[:, 0]], axis=2)
    start = pairs(np.abs(metric.S) @ (samples.open[0] + EPS * np.abs(samples.x[0])))
    error, pieces, crumbs = flow(metric, widths, R @ _TO_TAU, np.zeros(system.n))
    linear, _, more = flow(metric, widths, B @ held, metric.S @ samples.x[0])
    off_linear = grown(metric, widths, more, np.zeros_like(forced), start)
    off = grown(metric, widths, crumbs, forced, jump[0]) + np.concatenate([jump[:1], jump])
    return Between(metric, linear, error, pieces, off_linear, off)


@dataclass(frozen=True, slots=True)
class _Reference:
    """Quintics p near the motion, on all cells; values at the nodes, and bounds over each cell."""

    p: Quintics
    y: Array  # (cells, n + m, 7), (p, ŵ)
    X: Array  # (n + m, cells) ≥ |(p, ŵ)|
    far: Array  # the same on the disc
    R: Array  # (cells, n, 7), R(p, ŵ)
    off: Array  # (cells, n), how far R(p, ŵ) may be off the polynomial with these values
    defect: Array  # (cells, n, 7), p' − A p − B ŵ − R(p, ŵ)


def _reference(bound: Majorant, AB: Array, samples: Samples) -> _Reference:
    p = _near(bound, AB, samples)
    middle, rise = samples.inputs.mean(axis=1), (samples.inputs[:, 1] - samples.inputs[:, 0]) / 2.0
    y = np.concatenate([p.values, middle[:, :, None] + rise[:, :, None] * NODES], axis=1)
    X, far = (np.hstack([p.size(r), np.abs(middle) + r * np.abs(rise)]).T for r in (1.0, RADIUS))
    R = _on_cells(bound.expansion, y)
    off = (OFF * bound(far) + CONVERTED * bound(X) + bound.tail(X, X)).T
    return _Reference(p, y, X, far, R, off, p.slopes - AB @ y - R)


def _forcing(system: ExactSystem, metric: Metric, samples: Samples, tilted: int) -> tuple[Array, Array, Array]:
    """What moves e: R(p, ŵ) + Γ defect (cells, n, 7), how far off it S times that may be, and how far S e beside it.

    The open input η moves e by Γ B η, Γ = cos q − 1, and x − p by B η. With B η from the equation of x − p this is Γ
    times the defect, and the derivative of Γ (x − p), which is small: the mean of η in a cell shows in the rows.
    """
    n, AB, row = system.n, np.hstack([rounded(metric.A)[0], rounded(input_matrix(system))[0]]), system.n // 2 + tilted
    most = np.concatenate([np.abs(samples.x).max(axis=0), np.abs(samples.inputs).max(axis=(0, 1))])
    more = np.concatenate([samples.open.max(axis=0), samples.peak.max(axis=0)])
    could = metric.reach * np.sqrt(((samples.x @ metric.S.T) ** 2).sum(axis=1)).max()  # also of states that rest
    bound = majorant(system, ROOM * most + 2.0 * more + np.append(SHARE * could, np.zeros(system.m)) + LEAST)
    r, A = _reference(bound, AB, samples), np.abs(AB[:, :n])
    rounding = EPS * ((np.abs(AB) @ r.X).T + np.abs(r.p.coefficients) @ np.arange(6) / r.p.half[:, None])
    wrong = np.abs(r.defect @ CHEBYSHEV.T).sum(axis=2) + r.off + rounding
    D, by_x, by_all = _near_the_rows(bound, r, np.abs(AB), wrong, samples)
    angle, turning = r.X[tilted] + D[:, tilted], r.X[row] + D[:, row]
    gamma, moved = angle**2 / 2.0, angle**2 / 2.0 * D[:, row]
    seen, missed = _product(-2.0 * np.sin(r.y[:, tilted] / 2.0) ** 2, np.cosh(r.far[tilted]) - 1.0, r.defect[:, row])
    forcing, off = r.R.copy(), r.off + by_x + moved[:, None] * A[:, row]
    forcing[:, row] += seen
    off[:, row] += missed + gamma * (by_all[:, row] + (D @ A[row]) + (r.off + rounding)[:, row])
    off[:, row] += angle * D[:, tilted] * wrong[:, row] + angle * turning * D[:, row]
    off[:, row] += gamma * EPS * r.p.size()[:, row] / r.p.half  # p's own jumps at the rows, by rounding
    S = np.abs(metric.S) * (1.0 + EPS)
    return forcing, pairs(off @ S.T), pairs(moved[:, None] * S[:, row])


def _product(gamma: Array, far: Array, defect: Array) -> tuple[Array, Array]:
    """Values (cells, 7) of Γ · defect at the nodes, and how far (cells,) the polynomial with these values may be off.

    gamma, defect : values at the nodes, the defect of degree 6; far (cells,) bounds Γ on the disc.
    """
    a, b = np.abs(gamma @ CHEBYSHEV.T), np.abs(defect @ CHEBYSHEV.T)
    aliased = np.add.outer(np.arange(7), np.arange(7)) > 6  # degrees that fold back onto lower ones
    missed = np.einsum("ck,kl,cl->c", a, aliased.astype(float), b)
    return gamma * defect, missed + (OFF * far + CONVERTED * a.sum(axis=1)) * b.sum(axis=1)


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


def _near_the_rows(
    bound: Majorant, r: _Reference, AB: Array, wrong: Array, samples: Samples
) -> tuple[Array, Array, Array]:
    """Bounds (cells, n): D of |x − p|, and of |R(x, w) − R(p, ŵ)| for w = ŵ and for all w. AB = |(A, B)|."""
    n = len(AB)
    both = np.block([[AB[:, :n], np.eye(n)], [np.zeros((n, 2 * n))]]) * (1.0 + EPS)
    distinct, where = np.unique(r.p.half, return_inverse=True)
    over = np.array([expm(both * h)[:n] for h in distinct * (1.0 + EPS)])[where] * (1.0 + EPS)
    known = np.maximum(samples.open[:-1], samples.open[1:]) + EPS * r.p.size()
    pushed = wrong + samples.mean @ AB[:, n:].T

    def change(D: Array, inputs: Array) -> Array:
        Y = np.hstack([D, inputs]).T
        with np.errstate(over="ignore", invalid="ignore"):
            return (bound(r.X + Y) - bound(r.X) + 2.0 * SLACK * bound(r.X + Y) + bound.tail(r.X + Y, Y)).T

    D = np.zeros_like(pushed)
    for _ in range(ROUNDS):
        by_all = change(D, samples.peak)
        enough = np.einsum("cij,cj->ci", over, np.hstack([known, pushed + by_all]))
        if not np.all(np.isfinite(enough)):
            break
        if np.all(enough <= D):
            return D, change(D, 0.0 * samples.peak), by_all
        D = 1.2 * enough
    raise NotProvedError(
        "between its rows the motion is not known well enough: they are too far apart, or of no motion"
    )


_TO_TAU = np.linalg.inv(((1.0 + NODES) / 2.0)[None, :] ** np.arange(7)[:, None])  # values at the nodes → coefficients
