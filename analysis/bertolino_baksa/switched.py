"""Linear parts that change in time: almost stability where a feedback acts for a while, from tubes alone.

As in `tube.py`, but the linear part is A(t), which contracts or grows at the rate μ(t) of its logarithmic norm, in one
metric while the feedback acts and in another before and after. A start off ψ(0) widens the tube from its beginning:
that bounds δ(ε) by norms alone, which is coarse where δ dominates, and as sharp as any tube where the floor does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, arb_mat, fmpq

from .balls import (
    Array,
    ExactSystem,
    NotProvedError,
    below,
    jacobian,
    length,
    matrix,
    refuse_unrest,
    rounded,
    two_norm,
)
from .cells import errors
from .norms import Metric, Norm, proved_metric, usable_inverse
from .proof import at_rest
from .tube import Excess, Piece, Tube, at_end, closed, defect_of, grown, inputs_around, jumps, refuse_gaps, up

PARTS = 4  # of a piece, over each of which A(t) is enclosed
Equations = Callable[..., Sequence[Any]]


@dataclass(frozen=True, slots=True)
class Phase:
    """From `begin` [s] on, ‖·‖_S of this metric."""

    begin: fmpq
    metric: Metric


@dataclass(frozen=True, slots=True)
class Switched:
    """A system whose linear part is `linear`(x, w, sin, cos), and its phases; A is constant, w = 0 after the pieces.

    excess : ∂F/∂x − A over balls x and w, with A's own change over w left out of the difference.
    """

    system: ExactSystem
    linear: Equations
    excess: Excess
    phases: tuple[Phase, ...]

    @property
    def linear_system(self) -> ExactSystem:
        """x_lin' of it."""
        s = self.system
        return ExactSystem(s.n, s.m, self.linear, s.pieces, s.period)


@dataclass(frozen=True, slots=True)
class Measured:
    """Pieces from rest, ψ(0) = 0, with what is known of each before any start is: defects, and μ(t) over it."""

    switched: Switched
    pieces: tuple[Piece, ...]
    phase: tuple[int, ...]
    defects: Array  # (pieces, 2)
    mu: Array  # (pieces,) [1/s]

    def epsilon(self, norm: Norm, delta: float) -> float:
        """ε: N(x(0) − ψ(0)) ≤ δ implies N(x(t) − ψ(t)) ≤ ε for all t ≥ 0. Raises NotProvedError where there is none."""
        found, most = self.tubes(norm, delta), 0.0
        for tube, phase in zip(found, self.switched.phases, strict=True):
            most = max(most, float(errors(tube, phase.metric, norm).max()))
        last = self.switched.phases[-1].metric
        end = found[-1].pieces[-1]
        _, V, V_e = found[-1].at_end
        x = last.length(at_end(end.linear) + at_end(end.error)) + V
        e = last.length(at_end(end.error)) + V_e
        later = last.of(norm) * at_rest(self.switched.system, last, x * (1.0 + 1e-12), e * (1.0 + 1e-12), 0.0)
        if not later < np.inf:
            raise NotProvedError("at the end of the last piece the motion is still too large to be proved to die out")
        return max(most, later) * (1.0 + 1e-9)

    def tubes(self, norm: Norm, delta: float) -> list[Tube]:
        """A tube for each phase, around all motions that start within δ."""
        phases = self.switched.phases
        V = up(
            delta
            * carried(
                usable_inverse(norm.T, f"matrix of the {norm.name} norm"), matrix(phases[0].metric.S), norm.largest
            )
        )
        off = 0.0, V, V
        rest = np.zeros((self.switched.system.n, 1))
        start = rest, rest
        found = []
        for k, phase in enumerate(phases):
            if k:
                c = carried(phases[k - 1].metric.inverse, matrix(phase.metric.S), largest=False)
                off = up(off[0] * c), up(off[1] * c), up(off[2] * c)
            tube = self._followed(phase.metric, [i for i, p in enumerate(self.phase) if p == k], start, off)
            found.append(tube)
            off, start = tube.at_end, (tube.pieces[-1].linear, tube.pieces[-1].error)
        return found

    def _followed(self, metric: Metric, which: list[int], before: tuple[Array, Array], off: Any) -> Tube:
        V_lin, V, V_e = off
        widths, rates = [], []
        for i in which:
            piece, mu, (d_lin, d) = self.pieces[i], float(self.mu[i]), self.defects[i].tolist()
            V_lin, V, V_e = (up(v + j) for v, j in zip((V_lin, V, V_e), jumps(metric, before, piece), strict=True))
            after, L = closed(self.switched.system, metric, piece, V, d, self.switched.excess, mu)
            after_lin, full = grown(V_lin, mu, d_lin, piece), max(V, after)
            after_e = grown(V_e, mu, arb(L) * full + d_lin + d, piece)
            widths.append((max(V_lin, after_lin), full, max(V_e, after_e)))
            rates.append(up(L + mu))
            V_lin, V, V_e = after_lin, after, after_e
            before = piece.linear, piece.error
        linear, full_, error = np.array(widths).T
        pieces = tuple(self.pieces[i] for i in which)
        return Tube(pieces, self.defects[which], linear, full_, error, (V_lin, V, V_e), np.array(rates))


def carried(right: arb_mat, left: arb_mat, largest: bool) -> float:
    """Bound of ‖left right x‖₂ over ‖x‖₂ ≤ 1, or over max |x_i| ≤ 1."""
    product = left * right
    if largest:
        rows = [sum(map(abs, row), arb(0)) for row in product.tolist()]
        return length(rows)
    centre, rest = rounded(product)
    return float(two_norm(centre)) + rest


def measured(switched: Switched, pieces: Sequence[Piece]) -> Measured:
    """What is known of the pieces. Raises NotProvedError where they leave a gap or cross from phase to phase."""
    refuse_unrest(switched.system)
    system, begins = switched.linear_system, [phase.begin for phase in switched.phases]
    if pieces[0].begin != 0 or pieces[-1].end <= begins[-1]:
        raise NotProvedError("the pieces do not reach from 0 into the last phase")
    corner, rest = switched.system.pieces[-1]
    if pieces[-1].end < corner or not all(w == 0 for w in rest(arb(0, math.inf))):
        raise NotProvedError("after the last piece the input is not proved to be 0")
    which, defects, mus = [], [], []
    refuse_gaps(pieces)
    for k, piece in enumerate(pieces):
        phase = sum(begin <= piece.begin for begin in begins) - 1
        if any(piece.begin < begin < piece.end for begin in begins):
            raise NotProvedError(f"piece {k} lies in two phases")
        metric = switched.phases[phase].metric
        which.append(phase)
        parts = [arb(piece.begin) + arb(piece.duration) * (k + arb(0.5, 0.5)) / PARTS for k in range(PARTS)]
        w = (system.inputs_over(piece.begin, piece.end)(t) for t in parts)
        mus.append(max(logarithmic_norm(metric, jacobian(system, [arb(0)] * system.n, each)) for each in w))
        around = inputs_around(system, piece, piece.terms)
        both = (system, piece.near_x_lin), (switched.system, piece.near_x)
        defects.append([defect_of(each, metric, piece, p, around) for each, p in both])
    if set(which) != set(range(len(begins))):
        raise NotProvedError("a phase has no pieces")
    return Measured(switched, tuple(pieces), tuple(which), np.array(defects), np.array(mus))


def logarithmic_norm(metric: Metric, A: arb_mat) -> float:
    """Bound of the logarithmic norm of A in ‖·‖_S, by Gershgorin's rows of the symmetric part."""
    turned = matrix(metric.S) * A * metric.inverse
    symmetric = (turned + turned.transpose()) / 2
    n = A.nrows()
    rows = (symmetric[i, i] + sum((abs(symmetric[i, j]) for j in range(n) if j != i), arb(0)) for i in range(n))
    return max(-below(-row) for row in rows)


def phases(
    switched: ExactSystem, linear: Equations, excess: Excess, begins: Sequence[fmpq], S: Sequence[Array]
) -> Switched:
    """A switched system with the metrics S of its phases, each proved to contract with the A at its phase's begin …

    Raises NotProvedError where one does not.
    """
    found = []
    for begin, each in zip(begins, S, strict=True):
        w = switched.inputs_at(begin)(arb(begin))

        def frozen(x: Sequence[Any], _: Any, sin: Any, cos: Any, w: Any = w) -> Sequence[Any]:
            return linear(x, w, sin, cos)

        constant = ExactSystem(switched.n, switched.m, frozen, switched.pieces, switched.period)
        found.append(Phase(begin, proved_metric(constant, each)))
    return Switched(switched, linear, excess, tuple(found))
