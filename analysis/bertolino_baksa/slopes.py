"""Inputs of bounded height and bounded slope: the largest output of a kernel, by duality.

Over all h with h(0) = 0, |h| ≤ A and |ḣ| ≤ V, and for K with K' = k, K(∞) = 0 and any u with u(∞) = 0,

    ∫ k(s) h(T − s) + k_v(s) ḣ(T − s) ds ≤ A (|K(0) − u(0)| + ∫|u'| ds) + V ∫|K + k_v − u| ds

by parts. u = K gives A ∫|k|, u = 0 the slope alone; the best u is K + k_v with its total variation made small. Above
each level it is a set of times, the best of which a two-state recursion finds; how u was found does not matter to the
bound.
"""

from __future__ import annotations

import numpy as np
from flint import arb_mat
from numpy.typing import NDArray

from .balls import Array, rounded
from .cells import EPS, Decay
from .norms import Metric

Booleans = NDArray[np.bool_]
LEVELS = 64  # on either side of 0, in geometric order
SMALLEST = 1e-3  # of them, over the largest


def largest_outputs(
    decay: Decay, metric: Metric, left: Array, of_heights: arb_mat, of_slopes: arb_mat, A: Array, V: Array
) -> Array:
    """Bounds (p, q) of each input's part in `left` x (p, n), its height bounded by A (q,) and its slope by V (q,)."""
    K = metric.A.inv() * of_heights
    both, (start, rest) = rounded(K + of_slopes)[0], rounded(K)
    begin = left @ start
    off = len(left.T) * np.abs(left).sum() * (rest + EPS * np.abs(start).sum())
    values = left @ decay.ends @ both

    def bound(u: Array) -> Array:
        variation = np.abs(begin - u[0]) + off + np.abs(np.diff(u, axis=0)).sum(axis=0)
        return (A * variation + V * decay.integral(metric, left, K + of_slopes, u)) * (1.0 + 1e-9)

    u = _smoothed(values, begin, decay.width, A, V)
    least = SMALLEST * np.abs(values).max(axis=0)
    return np.minimum(bound(u), bound(np.where(np.abs(u) <= least, 0.0, u)))  # between the least levels, u or 0


def _smoothed(values: Array, begin: Array, width: Array, A: Array, V: Array) -> Array:
    """u (N + 1, p, q) for values (N + 1, p, q) of K + k_v at the cells' ends and K(0) (p, q)."""
    top = np.abs(values).max(axis=0) + np.finfo(float).tiny
    steps = np.geomspace(SMALLEST, 1.0, LEVELS)
    levels = np.concatenate([-steps[::-1], steps])[:, None, None] * top
    weight = np.convolve(width, [0.5, 0.5])[:, None, None, None] * V
    above = _sets(values[:, None] > levels, begin > levels, levels < 0.0, weight, np.broadcast_to(A, levels.shape))
    count = above.sum(axis=1)
    edges = np.concatenate([-top[None], levels, top[None]])
    low, high = (np.take_along_axis(edges, index, axis=0) for index in (count, count + 1))
    u = np.clip(values, low, high)
    u[-1] = 0.0
    return np.asarray(u)


def _sets(target: Booleans, first: Booleans, last: Booleans, weight: Array, jump: Array) -> Booleans:
    """s (N + 1, …) with the least Σ weight |s − target| + jump (|s_0 − first| + Σ|s_(j+1) − s_j|) and s_N = last."""
    zero, one = jump * first, jump * ~first  # the least cost of all so far that ends in False, in True
    stays = np.empty((len(target), 2, *first.shape), dtype=bool)  # whether the best way there comes from the same
    for j, (here, w) in enumerate(zip(target, weight, strict=True)):
        if j:
            stays[j, 0], stays[j, 1] = zero <= one + jump, one <= zero + jump
            zero, one = np.minimum(zero, one + jump), np.minimum(one, zero + jump)
        zero, one = zero + w * here, one + w * ~here
    found = np.empty(target.shape, dtype=bool)
    found[-1] = last
    for j in range(len(target) - 1, 0, -1):
        found[j - 1] = found[j] == np.where(found[j], stays[j, 1], stays[j, 0])
    return found
