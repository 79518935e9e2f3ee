"""A floor in about a second, by comparison, with no reference but x_lin, for all t ≥ 0 on a road that ends flat.

    V' = −α V + ‖R̄(|x_lin| + n V)‖_S  keeps  ‖e‖_S ≤ V, all states measured in one metric: much too much.

    |T e(t)| ≤ ∫ |T e^(A(t − s))| f(s) ds,  f = |R(x_lin)| + R̄(|x_lin| + |e|) − R̄(|x_lin|),  row by row, is much less:
    |e| ≤ n V at first, and then what this has given.

What it still says too much, as nothing cancels over time, whoever prints it measures.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import fmpq

from .balls import Array, ExactSystem, NotProvedError
from .cells import Decay, decay, inputs, largest_of_parts, middles, ranges, widths
from .convolution import convolution
from .growth import perturbed
from .majorant import Majorant, majorant
from .norms import Metric, Norm
from .pieces import Piece
from .proof import rest_growth
from .taylor import find_pieces
from .tube import at_end, prove_linear

ROOM, SHARE = 2.0, 0.1  # of the box, over x_lin's sizes, and over what a motion of its size could be in each state
PASSES = 2  # of the integral, each with the bounds of e that the last one gave
SLACK = 1.0 + 1e-9


def quick_floors(
    system: ExactSystem, metric: Metric, norms: Sequence[Norm], x0: Sequence[float], stop: fmpq
) -> list[float]:
    """l in each norm. Raises NotProvedError if the road never ends, or the motion is too large for this comparison."""
    if system.period != 0:
        raise NotProvedError("the quick comparison needs a road that ends flat")
    n, pieces = system.n, tuple(find_pieces(system, x0, stop, linear_only=True))
    off = prove_linear(system, metric, pieces)
    X = np.hstack([ranges(pieces, off, metric), inputs(system, metric, pieces)])
    spread = np.pad(metric.reach * metric.longest(X.max(axis=0)[:n]), (0, system.m))
    bound = majorant(system, ROOM * X.max(axis=0) + SHARE * spread + 1e-9)
    V, V_end = perturbed(metric, bound, widths(pieces, metric), np.zeros_like(X), X[:, :, None], np.zeros(1))
    if not np.isfinite(V).all():
        raise NotProvedError("the quick comparison cannot follow so large a motion")
    lefts = [np.eye(n), metric.S, *(norm.T for norm in norms)]
    along = _along(system, metric, pieces, off, bound)
    rows = _states(bound, X, along, V * metric.reach, decay(metric, pieces), lefts)
    e_end = min(float(V_end[0]), float(np.sqrt((rows[1][-1] ** 2).sum())) * SLACK)
    size = (metric.length(at_end(pieces[-1].linear)) + float(off[-1]) + e_end) * SLACK
    L = rest_growth(system, metric, size)
    if not metric.alpha > L:
        raise NotProvedError("the quick comparison cannot follow so large a motion")
    later = e_end + L * size / (metric.alpha - L)
    return [max(_largest(norm, y), metric.of(norm) * later) * SLACK for norm, y in zip(norms, rows[2:], strict=True)]


def _largest(norm: Norm, rows: Array) -> float:
    return float(rows.max() if norm.largest else np.sqrt((rows**2).sum(axis=1)).max())


def _along(system: ExactSystem, metric: Metric, pieces: Sequence[Piece], off: Array, bound: Majorant) -> Array:
    """Bounds (N, n) of |R(x_lin, w)| over the cells: R itself in the middles of their parts, R̄ for what is off."""
    middle, radius = middles(system, metric, [p.linear for p in pieces], pieces, off)
    sizes = np.abs(middle) * SLACK
    total = bound(sizes)
    here = np.abs(bound.expansion(middle)) + total * (SLACK - 1.0) + bound.tail(sizes, sizes)
    moved = bound(sizes + radius) * SLACK - total + bound.tail(sizes + radius, radius)
    return np.asarray(largest_of_parts(here + moved) * SLACK)


def _states(bound: Majorant, X: Array, along: Array, e: Array, flow: Decay, lefts: Sequence[Array]) -> list[Array]:
    """Bounds (windows, n) of |left e| for each left, the first of which must be the unit matrix.

    X, along : bounds (N, n + m) of (x_lin, w) and (N, n) of R there, over the cells.  e : bounds (N, n) of |e|.
    """
    gathered, at_X, n = convolution(flow, np.concatenate(lefts)), bound(X.T), e.shape[1]
    for only in (n,) * (PASSES - 1) + (None,):  # the states alone, but in the last pass
        moved = np.pad(e, ((0, 0), (0, X.shape[1] - n)))
        found = gathered(along + bound.change(X.T, at_X, moved.T).T, only)
        e = np.minimum(e, gathered.by_cells(found[:, :n]))
    return np.split(found, len(lefts), axis=1)
