"""How far a motion that starts off the reference can get: y = e^(At) y(0) + q, the linear part exact, q by comparison.

    q' = A q + R(x + y, w) − R(x, w),  q(0) = 0:     v' = −α v + ‖ΔR̄(|x|, κ_j δ + n_j v)‖_S  keeps  ‖q‖_S ≤ v

for all y(0) with N(y(0)) ≤ δ. Many δ at once. Where A changes in time, e^(At) is the flow of y' = A(t) y, and −α is the
logarithmic norm μ(t) of A(t), which may be > 0.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from .balls import Array
from .majorant import Majorant
from .norms import Metric

ROUNDS = 6  # of widening v over a cell until it holds
ROOM = 1e-9  # relative: for roundings where v is hardly forced


def perturbed(
    metric: Metric, bound: Majorant, widths: Array, X: Array, spread: Array, v0: Array, rates: Array | None = None
) -> tuple[Array, Array]:
    """v over each cell (N, K) and at the end (K,); inf where no bound is found.

    widths : of the cells (N,) [s].  X : bounds (N, n + m) of (x, w) over them.
    spread : bounds (N, n + m, K) over the cells of what is known without R: of |y − q|, and of changes of w.
    v0     : ‖q‖_S at the begin (K,).
    rates  : μ over the cells (N,) [1/s]; −α if not given.
    """
    n, S = len(metric.S), np.abs(metric.S)
    v, largest = np.array(v0, dtype=float), np.full((len(X), len(v0)), np.inf)
    at_X = bound(X.T)
    reach = np.concatenate([metric.reach, np.zeros(X.shape[1] - n)])[:, None]

    def forcing(cell: int, size: Array) -> Array:
        change = bound.change(X[cell][:, None], at_X[:, cell : cell + 1], spread[cell] + reach * size)
        return np.sqrt(((S @ change) ** 2).sum(axis=0)) * (1.0 + 1e-12)

    pushed = np.zeros(len(v0))
    mu = np.full(len(widths), -metric.alpha) if rates is None else rates
    for cell, (width, factor) in enumerate(zip(widths.tolist(), np.exp(mu * widths).tolist(), strict=True)):
        most = max(factor, 1.0)  # of what A alone makes of v, within the cell
        top, pushed = _held(partial(forcing, cell), v * most, width * most, pushed)
        largest[cell] = top
        v = (v * factor + width * most * pushed) * (1.0 + 1e-12)
        v[~np.isfinite(top)] = np.inf
        if not np.isfinite(v).any():
            break
    return largest, v


def _held(forcing: Callable[[Array], Array], v: Array, width: float, guess: Array) -> tuple[Array, Array]:
    """A size that v cannot leave within the width, and the forcing there; inf where none is found.

    guess : of the forcing; that of the cell before mostly does.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        top = v * (1.0 + ROOM) + 1.2 * width * guess
        for k in range(ROUNDS):
            pushed = forcing(top)
            fits = ((v + width * pushed) * (1.0 + 1e-12) <= top) | ~np.isfinite(top)
            if fits.all():
                return top, pushed
            top = np.where(fits, top, v * (1.0 + ROOM) + (1.5 + k) * width * pushed)
    return np.where(fits, top, np.inf), pushed
