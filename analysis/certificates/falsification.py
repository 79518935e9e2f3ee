"""Which rows of an export no motion of this car on this road can pass through, and what holds between the rows.

The road is a profile of ours, known exactly. The motion from the first row and its x_lin run in proved tubes, so that a
row outside the tube, widened by what the integrator and the printed digits may have changed, is of another motion.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from flint import fmpq

from ..bertolino_baksa.balls import Array, ExactSystem, Inputs, NotProvedError, decimal, precision
from ..bertolino_baksa.cells import EPS, errors
from ..bertolino_baksa.norms import Metric, Norm, proved_metric
from ..bertolino_baksa.taylor import find_pieces
from ..bertolino_baksa.tube import Tube, prove_tube


@dataclass(frozen=True, slots=True)
class Motions:
    """The tube of all motions x and x_lin whose start is within the rounding of a first row, at times from it on."""

    system: ExactSystem  # its time counted from the first row
    tube: Tube
    metric: Metric
    begin: fmpq  # [s], time of the first row

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """x and x − x_lin (N, n) at the decimals that the times (N,) [s] print, and how far (N, n) x may be off."""
        ends = [piece.end for piece in self.tube.pieces[:-1]]
        x, e, off = [], [], []
        for t in times.tolist():
            since = decimal(t) - self.begin
            k = bisect_right(ends, since)
            piece = self.tube.pieces[k]
            tau = (since - piece.begin) / piece.duration
            powers = (float(tau.p) / float(tau.q)) ** np.arange(piece.linear.shape[1])
            e.append(piece.error @ powers)
            x.append(piece.linear @ powers + e[-1])
            rounded = EPS * (np.abs(piece.linear) + np.abs(piece.error)).sum(axis=1)
            off.append(self.metric.reach * self.tube.full[k] + rounded)
        return np.array(x), np.array(e), np.array(off)

    def largest_error(self, norm: Norm) -> float:
        """sup N(x − x_lin) over all times of the tube, not only those of rows."""
        return float(errors(self.tube, self.metric, norm).max())


def motions(system: ExactSystem, S: Array, x0: Array, rounding: Array, begin: float, end: float) -> Motions:
    """All motions from within |x − x0| ≤ rounding (n,) at `begin` [s] until `end` [s], in the metric S.

    Raises NotProvedError if the linear part does not contract, or the motion is too large for a tube.
    """
    with precision(2):
        start, last = decimal(begin), decimal(end)
        later = since(system, start)
        metric = proved_metric(later, S)
        off = metric.longest(rounding)
        pieces = find_pieces(later, x0.tolist(), last - start)
        tube = prove_tube(later, metric, pieces, (x0, np.zeros(later.n)), (off, off))
    return Motions(later, tube, metric, start)


def since(system: ExactSystem, begin: fmpq) -> ExactSystem:
    """The same system with its time counted from `begin` [s]. Raises NotProvedError for a time before its first."""

    def shifted(inputs: Inputs) -> Callable[[Any], list[Any]]:
        return lambda t: inputs(t + begin)

    if begin < system.pieces[0][0]:
        raise NotProvedError(f"the export begins at {float(begin):g} s, before the road is known")
    return replace(system, pieces=tuple((at - begin, shifted(inputs)) for at, inputs in system.pieces))


@dataclass(frozen=True, slots=True)
class Rows:
    """How far an export's rows are from the tube: the largest ratio of distance to what is allowed, and where."""

    ratio: float
    row: int  # from 0
    state: int
    first: int | None  # row, from 0, that is the first out of what is allowed
    off: Array  # (N, n), the rows minus the motion
    allowed: Array  # (N, n)
    e: Array  # (N, n), x − x_lin of the motion at the rows' times


def judged(x: Array, expected: Array, limit: Array, e: Array) -> Rows:
    """Rows x (N, n) that may be off the expected ones by the limit (N, n)."""
    ratio = np.abs(x - expected) / limit
    row, state = (int(i) for i in np.unravel_index(np.argmax(ratio), ratio.shape))
    out: list[int] = np.flatnonzero(~(ratio <= 1.0).all(axis=1)).tolist()
    return Rows(float(ratio[row, state]), row, state, out[0] if out else None, x - expected, limit, e)
