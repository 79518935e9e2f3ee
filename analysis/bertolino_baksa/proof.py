"""The proof of definition 2.1 for ψ = x_lin: everything that holds for all t ≥ 0, from given pieces.

With x the motion from ψ(0) itself and y the difference of another one to it, N(x + y − x_lin) ≤ N(e) + N(y). The tube
bounds e; y is e^(At) y(0), exactly, and a rest that `growth` bounds. What comes after the last piece is a tail; of an
input that is not known exactly, `open_inputs` bounds what that changes, until the end of the pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from flint import arb

from .balls import Array, ExactSystem, NotProvedError, above, jacobian, refuse_unrest
from .cells import Decay, decay, errors, inputs, ranges
from .growth import perturbed
from .joint import largest
from .majorant import Majorant, roomy
from .norms import Metric, Norm, usable_inverse
from .open_inputs import Loose, Open, opened
from .tube import Off, Piece, Tube, at_end, followed, jumps, prove_tube

SETTLED = 1e-3
UNDERFLOW = 1e-80  # squares that floats round to 0 make less than 1e-154, times sizes within `norms.RANGE`


@dataclass(frozen=True, slots=True)
class Repetition:
    """The road repeats itself: x runs in the tube of the last `window` pieces for ever, period after period."""

    window: Tube
    X: Array  # bounds (N, n + m) of (x, w) over its cells

    @property
    def multiplier(self) -> tuple[float, float]:
        """m ≥ ‖x(t + T) − y(t + T)‖_S / ‖x(t) − y(t)‖_S of motions in the tube, at t of its begin, and T [s]."""
        pieces = self.window.pieces
        logarithm = sum((arb(g) * arb(p.duration) for g, p in zip(self.window.growth, pieces, strict=True)), arb(0))
        return above(logarithm.exp()), float(pieces[-1].end - pieces[0].begin)


@dataclass(frozen=True, slots=True)
class Proof:
    """What is proved of the reference motion x and of x_lin; `repetition` is None where the road ends flat.

    open : None where w is known. Else x and x_lin are those of any such w, and nothing is said of what comes later.
    """

    system: ExactSystem
    metric: Metric
    tube: Tube
    decay: Decay
    X: Array  # bounds (N, n + m) of (x, w) over the cells
    repetition: Repetition | None
    open: Open | None = None

    def epsilon(self, norm: Norm, delta: Array) -> Array:
        """ε (K,) for δ (K,) ≥ 0: N(x(0) − ψ(0)) ≤ δ implies N(x(t) − ψ(t)) ≤ ε for all t ≥ 0; inf if not proved.

        ε(0) bounds the floor l. Raises NotProvedError for a norm that floats cannot compute, and where the equations
        have no bound for the largest δ.
        """
        top, later = self._rest(norm, delta)
        on_pieces = largest(self.tube, self.metric, self.decay, norm, delta, top)
        if self.open is not None:
            on_pieces = on_pieces + self.open.errors(norm)[:, None]
        return np.maximum(on_pieces.max(axis=0), later) * (1.0 + 1e-9) + UNDERFLOW

    def bounded(self, norm: Norm, delta: float) -> bool:
        """Whether ε(δ) is finite, without what that takes no part in."""
        return finite(lambda: self._rest(norm, np.array([delta])))

    def carried(self, norm: Norm) -> float:
        """κ ≥ N(e^(At) y)/N(y) over all cells."""
        return float(self.decay.of(norm).max())

    def _rest(self, norm: Norm, delta: Array) -> tuple[Array, Array]:
        """Bounds (N, K) of ‖y − e^(At) y(0)‖_S over the cells, and (K,) of N(e + y) after the last piece."""
        usable_inverse(norm.T, f"matrix of the {norm.name} norm")
        rows = self.decay.rows(norm)
        bound = self.majorant(rows.max(axis=0) * delta.max())
        spread = np.zeros((*self.X.shape, len(delta)))
        spread[:, : self.system.n] = rows[:, :, None] * delta
        top, end = perturbed(self.metric, bound, self.decay.width, self.X, spread, np.zeros(len(delta)))
        return top, self._later(norm, bound, self.decay.at_end(self.metric, norm) * delta + end)

    def settled(self, norm: Norm, floor: float) -> bool:
        """Whether longer pieces would lower this floor by less than SETTLED of it: the tail has no part in it."""
        return floor <= (1.0 + SETTLED) * float(errors(self.tube, self.metric, norm).max()) + UNDERFLOW

    def majorant(self, spread: Array) -> Majorant:
        """R̄ on a box with room for motions that are off the reference by `spread` (n,)."""
        return roomy(self.system, self.X.max(axis=0) + np.pad(spread, (0, self.system.m)))

    def _later(self, norm: Norm, bound: Majorant, off: Array) -> Array:
        """sup N(e + y) after the last piece, where ‖y‖_S begins with `off` (K,)."""
        if self.open is not None:
            return np.zeros(len(off))
        c = self.metric.of(norm)
        if self.repetition is None:
            return np.array([c * at_rest(self.system, self.metric, *self.ends, u) for u in off.tolist()])
        window, X = self.repetition.window, self.repetition.X
        widths, off = self.decay.width[-len(X) :], off + 1e-9 * self.ends[0]  # room for roundings where nothing is off
        top, end = perturbed(self.metric, bound, widths, X, np.zeros((*X.shape, len(off))), off)
        most = errors(window, self.metric, norm).max() + c * top.max(axis=0)
        return np.where(end <= off, most, np.inf)

    @property
    def ends(self) -> tuple[float, float]:
        """Bounds of ‖x‖_S and ‖e‖_S at the end of the last piece."""
        return ends_of(self.tube, self.metric)


def finite(found: Callable[[], Sequence[Array]]) -> bool:
    """Whether all that is found is finite; not if there is no proof of it."""
    try:
        return all(bool(np.isfinite(each).all()) for each in found())
    except NotProvedError:
        return False


def ends_of(tube: Tube, metric: Metric) -> tuple[float, float]:
    """Bounds of ‖x‖_S and ‖e‖_S at the end of the tube's last piece."""
    last = tube.pieces[-1]
    x = metric.length(at_end(last.linear) + at_end(last.error))
    e = metric.length(at_end(last.error))
    _, V, V_e = tube.at_end
    return (x + V) * (1.0 + 1e-15), (e + V_e) * (1.0 + 1e-15)


def prove(system: ExactSystem, metric: Metric, pieces: Sequence[Piece], x0: Sequence[float]) -> Proof:
    """Prove what can be proved from these pieces. Raises NotProvedError if they do not suffice."""
    corner, last = system.pieces[-1]
    if pieces[-1].end < corner:
        raise NotProvedError("the pieces end before the road's last corner")
    if system.period == 0 and not all(w == 0 for w in last(arb(0, math.inf))):
        raise NotProvedError("the road has no period, and after its last corner it is not proved to be flat")
    tube, X = _reference(system, metric, pieces, x0)
    again = _repetition(system, metric, tube) if system.period != 0 else None
    proof = Proof(system, metric, tube, decay(metric, tube.pieces), X, again)
    if again is None and not rest_growth(system, metric, proof.ends[0]) < metric.alpha:
        raise NotProvedError("at the end of the last piece the motion is still too large to be proved to die out")
    return proof


def prove_open(
    system: ExactSystem, metric: Metric, pieces: Sequence[Piece], x0: Sequence[float], loose: Loose
) -> Proof:
    """The same until the end of the pieces, for all w that are but so far off the system's. Raises NotProvedError."""
    tube, X = _reference(system, metric, pieces, x0)
    flow = decay(metric, tube.pieces)
    found = opened(system, metric, tube, flow, X, loose)
    return Proof(system, metric, tube, flow, X + found.wider, None, found)


def _reference(system: ExactSystem, metric: Metric, pieces: Sequence[Piece], x0: Sequence[float]) -> tuple[Tube, Array]:
    """The tube, and bounds (N, n + m) of (x, w) over the cells."""
    refuse_unrest(system)
    if pieces[0].begin != 0:
        raise NotProvedError(f"the first piece begins at t = {float(pieces[0].begin):g} s; wanted 0")
    tube = prove_tube(system, metric, pieces, (np.array(x0, dtype=float), np.zeros(system.n)))
    return tube, np.hstack([ranges(tube.pieces, tube.full, metric), inputs(system, metric, tube.pieces)])


def _repetition(system: ExactSystem, metric: Metric, tube: Tube) -> Repetition:
    """The last period's pieces, with a V that comes back no larger than it began."""
    first = _window(system, tube.pieces)
    pieces, defects = tube.pieces[first:], tube.defects[first:]
    begin = pieces[0].linear[:, 0], pieces[0].error[:, 0]
    jump = jumps(metric, (pieces[-1].linear, pieces[-1].error), pieces[0])

    def around(off: Off) -> Tube:
        return followed(system, metric, pieces, defects, begin, off)

    once = around(jump)
    shrink = above(arb(sum(float(g) * float(p.duration) for g, p in zip(once.growth, pieces, strict=True))).exp())
    if not shrink < 1.0:
        raise NotProvedError(f"over a period differences grow by {shrink:g}; wanted < 1")
    lin, full, _ = (1.1 * (j + v) / (1.0 - shrink) + t for j, v, t in zip(jump, once.at_end, tube.at_end, strict=True))
    gained = around((lin, full, 0.0)).at_end[2]  # by e, which shrinks as the linear part does
    once_linear = math.exp(-metric.alpha * float(pieces[-1].end - pieces[0].begin))
    off = lin, full, 1.1 * (jump[2] + gained) / (1.0 - once_linear) + tube.at_end[2]
    window = around(off)
    returned = [max(v, t) + j for v, t, j in zip(window.at_end, tube.at_end, jump, strict=True)]
    if not all(v * (1.0 + 1e-15) <= o for v, o in zip(returned, off, strict=True)):
        raise NotProvedError("the tube of one period does not come back into itself")
    return Repetition(window, np.hstack([ranges(window.pieces, window.full, metric), inputs(system, metric, pieces)]))


def _window(system: ExactSystem, pieces: Sequence[Piece]) -> int:
    """Index of the first of the pieces that make the last whole number of periods; all after the last corner."""
    for k in range(len(pieces) - 1, -1, -1):
        periods = (pieces[-1].end - pieces[k].begin) / system.period
        if periods.denominator == 1 and pieces[k].begin >= system.pieces[-1][0]:
            return k
    raise NotProvedError("no whole number of periods at the end of the pieces")


def at_rest(system: ExactSystem, metric: Metric, x: float, e: float, off: float) -> float:
    """sup ‖e + y‖_S on the flat road, from ‖x‖, ‖e‖ and ‖y‖ = off on; inf if there is no bound.

    There x' = A x + R(x), and ‖R(x)‖ ≤ L ‖x‖ with L < α: x → 0, as x_lin does.
    """
    size = (x + off) * (1.0 + 1e-12)
    L = rest_growth(system, metric, size)
    if not metric.alpha > L:
        return np.inf
    return (e + off + L * size / (metric.alpha - L)) * (1.0 + 1e-12)


def rest_growth(system: ExactSystem, metric: Metric, size: float) -> float:
    """L ≥ ‖∂F/∂x − A‖_S where ‖x‖_S ≤ size and w = 0; inf if there is no bound."""
    if not size < np.inf:
        return np.inf
    box = [arb(0, n * size) for n in metric.reach.tolist()]
    try:
        return metric.size(jacobian(system, box, [arb(0)] * system.m) - metric.A)
    except NotProvedError:
        return np.inf
