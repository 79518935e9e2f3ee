"""x' = A x + f from row to row, f given by polynomials in each cell, and how errors in f and of rounding grow.

In coordinates y = S x, and for errors pair by pair: V_k bounds |(y_k, y_{k + n/2})|. In a metric of modes each pair is
a mode, and its error dies out as fast as the mode does.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from .balls import Array, NotProvedError, matrix, rounded, two_norm
from .norms import Metric, Norm

TERMS = 30  # of Taylor's series over a cell
EPS = 1e-12  # relative, over the sum of the terms' sizes: the roundings of one step or value, with much to spare


def flow(metric: Metric, widths: Array, forcing: Array, start: Array) -> tuple[Array, Array, Array]:
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


def grown(metric: Metric, widths: Array, added: Array, forced: Array, start: Array) -> Array:
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
    """C (n/2, n/2): the pairs of S x under x' = A x + f grow at most as V' = C V + (sizes of the pairs of S f).

    On its diagonal the largest eigenvalue of a pair's own symmetric part, beside it the sizes of the other blocks.
    """
    turned, rest = rounded(matrix(metric.S) * metric.A * metric.inverse)
    half = len(turned) // 2
    blocks = turned.reshape(2, half, 2, half)
    C = np.sqrt((blocks**2).sum(axis=(0, 2)))
    a, b, c, d = (np.diagonal(blocks[p, :, q, :]) for p in (0, 1) for q in (0, 1))
    np.fill_diagonal(C, (a + d) / 2.0 + np.hypot((a - d) / 2.0, (b + c) / 2.0))
    return C + rest + EPS * np.abs(C)


def pairs(m: Array) -> Array:
    """Sizes (…, n/2) of the pairs of entries (…, n)."""
    return np.asarray(np.hypot(*np.split(m, 2, axis=-1)))


def sizes_of(to: Array, V: Array, norm: Norm) -> Array:
    """Bounds (N,) of N(x) of all T x = to · y with y in V (N, n/2)."""
    if norm.largest:
        return np.asarray((V @ pairs(to).T).max(axis=1))
    columns = np.stack(np.split(to, 2, axis=1), axis=2).swapaxes(0, 1)  # (n/2, n, 2)
    gram = two_norm(np.einsum("ikp,jkq->ijpq", columns, columns))
    return np.asarray(np.sqrt(np.einsum("ci,ij,cj->c", V, gram, V)))
