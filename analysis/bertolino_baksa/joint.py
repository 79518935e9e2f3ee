"""How large e + e^(At) y + q can be over a cell, for N(y) ≤ δ: each is largest at another time, in another direction.

With z = T y and M = T e^(At) T⁻¹, row by row |(T e)_i| + Σ_j |M_ij| δ where the norm is a maximum, and for ‖·‖₂ by
Lagrange's dual, which has no gap here: for every μ above all singular values s of M = U diag(s) Vᵀ, and g = Uᵀ T e,

    ‖T e + M z‖² ≤ μ² (δ² + Σ g_i²/(μ² − s_i²)),  ‖z‖₂ ≤ δ.

For fixed z a cell's chord is largest at an end; T e and M leave their chords by terms of second order.
"""

from __future__ import annotations

import numpy as np

from .balls import Array
from .cells import EPS, Decay, errors, errors_by_rows, finely
from .norms import Metric, Norm
from .tube import Tube

NEWTON = 8  # steps towards the best μ; from below they only approach it
APART = 1e-12  # relative, of μ from the largest s at least


def largest(tube: Tube, metric: Metric, decay: Decay, norm: Norm, delta: Array, q: Array) -> Array:
    """Bounds (N, K) of N(e + e^(At) y + q) over each cell, for N(y) ≤ delta (K,) and ‖q‖_S ≤ q (N, K)."""
    if norm.largest:
        return _by_rows(tube, metric, decay, norm, delta, q)
    apart = errors(tube, metric, norm)[:, None] + decay.of(norm)[:, None] * delta
    return np.asarray((np.minimum(apart, _by_ends(tube, metric, decay, norm, delta)) + metric.of(norm) * q) * (1 + EPS))


def _by_rows(tube: Tube, metric: Metric, decay: Decay, norm: Norm, delta: Array, q: Array) -> Array:
    e, kappa, c = errors_by_rows(tube, metric, norm), decay.rows(norm, norm.T), metric.rows(norm.T)
    sizes = e[:, :, None] + kappa[:, :, None] * delta + c[:, None] * q[:, None, :]
    return np.asarray(sizes.max(axis=1) * (1 + EPS))


def _by_ends(tube: Tube, metric: Metric, decay: Decay, norm: Norm, delta: Array) -> Array:
    """Bounds (N, K) of ‖T e + M z‖ over each cell from those at its ends."""
    moved, curve, off = decay.turned(norm)
    (begins, stops), leaves = _chords(tube, metric, norm)
    at = furthest(np.concatenate([begins, stops[-1:]]), moved, delta)
    gaps = np.append(np.sqrt(((begins[1:] - stops[:-1]) ** 2).sum(axis=1)), 0.0)  # of T e, from piece to piece
    at = np.maximum(at[:-1], at[1:] + gaps[:, None])
    bend = np.sqrt((curve**2).sum(axis=(1, 2))) + off
    return np.asarray((at + leaves[:, None] + bend[:, None] * delta) * (1 + EPS))


def _chords(tube: Tube, metric: Metric, norm: Norm) -> tuple[Array, Array]:
    """T e's polynomials at the begin and the end of each cell (2, N, n), and how far (N,) T e may leave the chord."""
    ends, leaves, c = [], [], metric.of(norm)
    for values, bend, V in finely(tube, metric, norm):  # (n, parts + 1) of each cell
        s = np.linspace(0.0, 1.0, values.shape[2])
        chord = values[:, :, :1] + (values[:, :, -1:] - values[:, :, :1]) * s
        ends.append(np.stack([values[:, :, 0], values[:, :, -1]]))
        sizes = np.sqrt((values**2).sum(axis=1)).max(axis=1)
        away = np.sqrt(((values - chord) ** 2).sum(axis=1)).max(axis=1)
        leaves.append(away + np.sqrt((bend**2).sum()) + c * V + EPS * sizes)
    return np.concatenate(ends, axis=1), np.concatenate(leaves)


def furthest(e: Array, M: Array, delta: Array) -> Array:
    """Bounds (N, K) of ‖e + M z‖₂ for ‖z‖₂ ≤ delta (K,); e (N, n) and M (N, n, n) exact.

    They hold whatever U, s, V and μ are: what these lack of M, e and orthogonality is added. 1 + EPS covers roundings.
    """
    U, s, Vt = np.linalg.svd(M)
    g = np.einsum("cji,cj->ci", U, e)
    top, size, one = s[:, 0], np.sqrt((e**2).sum(axis=1)), np.eye(M.shape[1])
    lacks_M = _frobenius(M - (U * s[:, None, :]) @ Vt)
    lacks_e = np.sqrt(((e - np.einsum("cij,cj->ci", U, g)) ** 2).sum(axis=1))
    stretch_U, stretch_V = (_frobenius(np.swapaxes(Q, 1, 2) @ Q - one) + EPS for Q in (U, np.swapaxes(Vt, 1, 2)))
    least = APART * size / top + np.finfo(float).tiny  # so that a δ of 0 has a μ as well
    far = np.maximum(delta * (1.0 + stretch_V[:, None]), least[:, None])  # (N, K)
    value = _dual(g[:, None, :], s[:, None, :], far) * (1.0 + stretch_U)[:, None]
    return np.asarray(value + (lacks_M + EPS * top)[:, None] * far + (lacks_e + EPS * size)[:, None])


def _frobenius(m: Array) -> Array:
    return np.asarray(np.sqrt((m**2).sum(axis=(1, 2))))


def _dual(g: Array, s: Array, delta: Array) -> Array:
    """√ of the dual's value (N, K) at a μ near the best; g and s (N, 1, n), s falling, delta (N, K) > 0."""
    gs, least = (g * s) ** 2, s[:, :, 0] * (1.0 + APART)
    square = np.maximum((s**2 + np.abs(g * s) / delta[:, :, None]).max(axis=2), least**2)  # not above the best
    for _ in range(NEWTON):  # on 1/√(Σ g²s²/(μ² − s²)²) = 1/δ, nearly linear in μ²
        gap = square[:, :, None] - s**2
        second, third = (gs / gap**2).sum(axis=2), (gs / gap**3).sum(axis=2)
        step = np.divide(second * (np.sqrt(second) / delta - 1.0), third, out=np.zeros_like(third), where=third > 0.0)
        square = np.maximum(square + step, least**2)
    mu = np.maximum(np.sqrt(square), least)[:, :, None]
    return np.asarray(np.sqrt(mu[:, :, 0] ** 2 * (delta**2 + (g**2 / ((mu - s) * (mu + s))).sum(axis=2))) * (1 + EPS))
