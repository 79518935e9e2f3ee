"""Linear parts that change in time: almost stability where a feedback acts for a while.

As in `tube.py` and `proof.py`, but the linear part is A(t), which contracts or grows at the rate μ(t) of its
logarithmic norm, in one metric from switch to switch, where the tubes' widths cross by ‖S_k S_{k−1}⁻¹‖₂. After a
switch at t_k,

    y = Φ(t, 0) y(0) + Φ(t, t_k) q(t_k) + q',    q'(t_k) = 0,

with both linear parts exact: what R made of y before the switch is a start of its own, in the metric before it. Where
cells are too long for what moves fast anew, it crosses as the tubes do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from flint import arb, arb_mat, fmpq

from .balls import Array, ExactSystem, NotProvedError, matrix, refuse_unrest, rounded, two_norm
from .cells import Decay, carried_on, counts, inputs, ranges
from .growth import perturbed
from .joint import largest
from .majorant import roomy
from .norms import Metric, Norm, contracting, decay_rate, usable_inverse
from .pieces import Piece
from .proof import UNDERFLOW, at_rest, ends_of, finite
from .transition import Matrices, by_series, constant, matrices
from .tube import Excess, Off, Tube, closed, defect_of, grown, inputs_around, jumps, over, refuse_gaps, up

PARTS = 4  # of a piece, over each of which A(t) is enclosed
Equations = Callable[..., Sequence[Any]]


@dataclass(frozen=True, slots=True)
class Switched:
    """A system, and the linear part that its x_lin obeys: A changes with w, which is 0 in the end.

    linear : rates A(w) x + B w of (x, w, sin, cos), A affine in w.
    excess : ∂F/∂x − A over balls x and w, with A's own change over w left out of the difference.
    """

    system: ExactSystem
    linear: Equations
    excess: Excess
    A: Matrices

    @property
    def linear_system(self) -> ExactSystem:
        """x_lin' of it."""
        s = self.system
        return ExactSystem(s.n, s.m, self.linear, s.pieces, s.period)

    def beyond(self, acting: Sequence[bool]) -> ExactSystem:
        """R(x, w) = F − A(w) x − B w in place of F, with the acting ones (m,) of the inputs, while the others are 0."""
        s = self.system

        def rest(x: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> Sequence[Any]:
            given = iter(w)
            every = [next(given) if acts else arb(0) for acts in acting]
            rates = zip(s.equations(x, every, sin, cos), self.linear(x, every, sin, cos), strict=True)
            return [full - linear for full, linear in rates]

        return ExactSystem(s.n, sum(acting), rest, s.pieces, s.period)


@dataclass(frozen=True, slots=True)
class Phase:
    """From `begin` [s] on, up to the next one's, ‖·‖_S of this S (n, n)."""

    begin: fmpq
    S: Array


@dataclass(frozen=True, slots=True)
class Stretch:
    """What is proved within one phase, from t_k on."""

    metric: Metric
    tube: Tube
    decay: Decay  # of Φ(t, 0)
    X: Array  # bounds (N, n + m) of (x, w) over the cells
    acting: list[bool]  # (m,), whether an input is anything but 0
    rates: Array  # μ (N,) over the cells [1/s]
    crossing: float  # c ≥ ‖·‖_S/‖·‖ of the metric before it; 0 for the first
    again: Decay | None  # of Φ(t, t_k), where that is better


@dataclass(frozen=True, slots=True)
class SwitchedProof:
    """What is proved of the motion from rest, of x_lin and of all motions beside; as `proof.Proof`."""

    switched: Switched
    stretches: tuple[Stretch, ...]

    def epsilon(self, norm: Norm, delta: Array) -> Array:
        """ε (K,) for δ (K,) ≥ 0: N(x(0)) ≤ δ implies N(x(t) − ψ(t)) ≤ ε for all t ≥ 0; inf if not proved.

        Raises NotProvedError as `Proof.epsilon`.
        """
        *rests, later = self._rests(norm, delta)
        most = later
        for s, (top, old) in zip(self.stretches, rests, strict=True):
            on_cells = largest(s.tube, s.metric, s.decay, norm, delta, top) + old
            most = np.maximum(most, on_cells.max(axis=0))
        return most * (1.0 + 1e-9) + UNDERFLOW

    def bounded(self, norm: Norm, delta: float) -> bool:
        """Whether ε(δ) is finite, without what that takes no part in."""
        return finite(lambda: self._rests(norm, np.array([delta])))

    def carried(self, norm: Norm) -> float:
        """κ ≥ N(Φ(t, 0) y)/N(y) over all cells."""
        return max(float(s.decay.of(norm).max()) for s in self.stretches)

    def _rests(self, norm: Norm, delta: Array) -> list[Array]:
        """Over each stretch's cells bounds (2, N, K) of ‖q'‖_S and of N(Φ(t, t_k) q(t_k)); then (K,) of N(e + y) after
        the last piece."""
        usable_inverse(norm.T, f"matrix of the {norm.name} norm")
        found, before, q = [], norm, np.zeros(len(delta))  # ‖q(t_k)‖ in the norm `before`
        for s in self.stretches:
            linear, old = s.decay.rows(norm)[:, :, None] * delta, np.zeros((len(s.X), len(delta)))
            if s.again:
                linear += s.again.rows(before)[:, :, None] * q
                old = _size(norm, s.again.rows(before, norm.T))[:, None] * q
            top, v = self._forced(s, linear, np.zeros(len(q)) if s.again else q * s.crossing * (1.0 + 1e-12))
            found.append(np.stack([top, old]))
            q = v + (s.again.at_end(s.metric, before) * q if s.again else 0.0)
            before = s.metric.norm
        last = self.stretches[-1]
        off = (q + last.decay.at_end(last.metric, norm) * delta) * (1.0 + 1e-12)
        c, ends = last.metric.of(norm), ends_of(last.tube, last.metric)
        return [*found, np.array([c * at_rest(self.switched.system, last.metric, *ends, u) for u in off.tolist()])]

    def _forced(self, s: Stretch, linear: Array, v: Array) -> tuple[Array, Array]:
        """‖q'‖_S over the cells (N, K) and at the end (K,), from v (K,) on, beside |y − q'| ≤ linear (N, n, K)."""
        off, n = linear.max(axis=0) + np.outer(s.metric.reach, v), len(s.metric.reach)
        X = s.X[:, [True] * n + s.acting]  # R of the other inputs would cost time alone
        far = off.max(axis=1, where=np.isfinite(off), initial=0.0)
        bound = roomy(self.switched.beyond(s.acting), X.max(axis=0) + np.pad(far, (0, X.shape[1] - n)))
        spread = np.concatenate([linear, np.zeros((len(X), X.shape[1] - n, len(v)))], axis=1)
        return perturbed(s.metric, bound, s.decay.width, X, spread, v, s.rates)


def switched(system: ExactSystem, linear: Equations, excess: Excess) -> Switched:
    """The system with its linear part taken to pieces. Raises NotProvedError where `linear` is no A(w) x + B w."""
    return Switched(system, linear, excess, matrices(system.n, system.m, linear))


def prove(switched: Switched, phases: Sequence[Phase], pieces: Sequence[Piece]) -> SwitchedProof:
    """Prove what can be proved of the motion from rest, ψ(0) = 0, from these pieces.

    Raises NotProvedError if they do not suffice: where they leave a gap or cross from phase to phase, where the linear
    part as it is at a phase's begin does not contract in its metric, where a tube cannot be closed.
    """
    refuse_unrest(switched.system)
    by_phase = _sorted(switched.system, phases, pieces)
    n = switched.system.n
    before, off = (np.zeros((n, 1)),) * 2, (0.0, 0.0, 0.0)
    flow, dropped = matrix(np.eye(n)), 0.0
    found: list[Stretch] = []
    for phase, own in zip(phases, by_phase, strict=True):
        w = switched.system.inputs_at(phase.begin)(arb(phase.begin))
        if phase is phases[-1]:  # what comes after the pieces is proved of this A
            w = [arb(0)] * switched.system.m
        metric = contracting(switched.A.at(w), phase.S)
        crossing = across(found[-1].metric, metric) if found else 0.0
        off = up(off[0] * crossing), up(off[1] * crossing), up(off[2] * crossing)
        mu = np.array([_rate(switched, metric, piece) for piece in own])
        rates = np.repeat(mu, counts(own, metric))
        tube = _tube(switched, metric, own, mu, before, off)
        if constant(switched.system, switched.A, own, w):
            carry = partial(carried_on, metric, own)
        else:
            carry = partial(by_series, switched.system, switched.A, metric, own, rates)
        decay, flow, dropped = carry(flow, up(dropped * crossing))
        again = _better(carry(matrix(np.eye(n)), 0.0)[0], found[-1].metric, metric, crossing) if found else None
        X = np.hstack([ranges(own, tube.full, metric), inputs(switched.system, metric, own)])
        found.append(Stretch(metric, tube, decay, X, _acting(switched.system, own), rates, crossing, again))
        off, before = tube.at_end, (own[-1].linear, own[-1].error)
    return SwitchedProof(switched, tuple(found))


def _sorted(system: ExactSystem, phases: Sequence[Phase], pieces: Sequence[Piece]) -> list[list[Piece]]:
    """The pieces of each phase, none across a switch, from 0 on and up to where w is 0 for ever."""
    refuse_gaps(pieces)
    begins = [phase.begin for phase in phases]
    if begins[0] != 0 or not all(a < b for a, b in pairwise(begins)):
        raise NotProvedError(f"phases begin at {', '.join(f'{float(t):g}' for t in begins)} s: wanted 0 and rising")
    if pieces[0].begin != 0 or pieces[-1].end <= begins[-1]:
        raise NotProvedError("the pieces do not reach from 0 into the last phase")
    corner, rest = system.pieces[-1]
    if pieces[-1].end < corner or system.period != 0 or not all(w == 0 for w in rest(arb(0, math.inf))):
        raise NotProvedError("after the last piece the input is not proved to be 0")
    found: list[list[Piece]] = [[] for _ in phases]
    for k, piece in enumerate(pieces):
        if any(piece.begin < begin < piece.end for begin in begins):
            raise NotProvedError(f"piece {k} lies in two phases")
        found[sum(begin <= piece.begin for begin in begins) - 1].append(piece)
    if not all(found):
        raise NotProvedError("a phase has no pieces")
    return found


def _acting(system: ExactSystem, pieces: Sequence[Piece]) -> list[bool]:
    """Whether each input is not proved to be 0 over all of the pieces."""
    every = [over(system, piece) for piece in pieces]
    return [not all(arb(w[k]) == 0 for w in every) for k in range(system.m)]


def _better(again: Decay, before: Metric, metric: Metric, crossing: float) -> Decay | None:
    """Φ(t, t_k), unless some state then seems to get further than by crossing from metric to metric."""
    return again if np.all(again.rows(before.norm).max(axis=0) <= crossing * metric.reach) else None


def _size(norm: Norm, rows: Array) -> Array:
    """Bounds (N,) of N(y) where |(T y)_i| ≤ rows (N, n)."""
    return np.asarray(rows.max(axis=1) if norm.largest else np.sqrt((rows**2).sum(axis=1)))


def across(before: Metric, after: Metric) -> float:
    """c ≥ ‖x‖/‖x‖ of the second metric over the first."""
    centre, rest = rounded(matrix(after.S) * before.inverse)
    return up(float(two_norm(centre)) + rest)


def _rate(switched: Switched, metric: Metric, piece: Piece) -> float:
    """Bound of the logarithmic norm of A(t) over the piece."""
    w = switched.system.inputs_over(piece.begin, piece.end)
    parts = [arb(piece.begin) + arb(piece.duration) * (k + arb(0.5, 0.5)) / PARTS for k in range(PARTS)]
    return max(logarithmic_norm(metric, switched.A.at(w(t))) for t in parts)


def logarithmic_norm(metric: Metric, A: arb_mat) -> float:
    """Bound of the logarithmic norm of A in ‖·‖_S, by Gershgorin's rows of the symmetric part."""
    return -decay_rate(matrix(metric.S) * A * metric.inverse)


def _tube(
    switched: Switched, metric: Metric, pieces: Sequence[Piece], mu: Array, before: tuple[Array, Array], off: Off
) -> Tube:
    """The tube around one phase's pieces, as of `tube.followed`, A changing."""
    V_lin, V, V_e = off
    widths, rates, defects = [], [], []
    for piece, rate in zip(pieces, mu.tolist(), strict=True):
        w = inputs_around(switched.system, piece, piece.terms)
        d_lin = defect_of(switched.linear_system, metric, piece, piece.near_x_lin, w)
        d = defect_of(switched.system, metric, piece, piece.near_x, w)
        V_lin, V, V_e = (up(v + j) for v, j in zip((V_lin, V, V_e), jumps(metric, before, piece), strict=True))
        after, L = closed(switched.system, metric, piece, V, d, switched.excess, rate)
        after_lin, full = grown(V_lin, rate, d_lin, piece), max(V, after)
        after_e = grown(V_e, rate, arb(L) * full + d_lin + d, piece)
        widths.append((max(V_lin, after_lin), full, max(V_e, after_e)))
        rates.append(up(L + rate))
        defects.append((d_lin, d))
        V_lin, V, V_e = after_lin, after, after_e
        before = piece.linear, piece.error
    linear, fulls, error = np.array(widths).T
    return Tube(tuple(pieces), np.array(defects), linear, fulls, error, (V_lin, V, V_e), np.array(rates))
