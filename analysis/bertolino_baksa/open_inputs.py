"""Heights and rates that are known but to within something, w = ŵ + (η, η'): what that makes of x_lin and of e.

    x_lin[w] − x_lin[ŵ] = ζ,  ζ' = A ζ + B_h η + B_r η':        ζ(t) = B_r η(t) + ∫₀ᵗ e^(As) (B_h + A B_r) η(t − s) ds
    e[w] − e[ŵ] = q,  q' = A q + R(x̂ + ζ + q, w) − R(x̂, ŵ):    |q(t)| ≤ ∫₀ᵗ |e^(A(t − s))| |ΔR| ds

ζ by parts, as η is small where η' is not, and without the jumps of η; so e feels the linear part's freedom ζ, which is
much larger, through R alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import arb_mat

from .balls import Array, ExactSystem, NotProvedError, magnitudes, rounded
from .cells import Decay, counts, largest_of_parts, middles
from .convolution import convolution
from .growth import perturbed
from .majorant import Majorant, roomy
from .norms import Metric, Norm
from .tube import Tube, input_matrix

PASSES = 3  # of the integral, each with the bounds of q that the last one gave
SLACK = 1.0 + 1e-9


@dataclass(frozen=True, slots=True)
class Loose:
    """How far w may be off, windows one after the other.

    peak  : (windows, m), of heights and rates, at most.
    mean  : (windows, m/2), of heights on the average of each step, none of which is longer than `step` [s].
    jumps : (m/2,), the sizes of all jumps of η, that at the begin among them, in all.
    """

    peak: Array
    mean: Array
    jumps: Array
    step: float


@dataclass(frozen=True, slots=True)
class Open:
    """What open inputs change: `wider` (N, n + m) bounds |ζ + q| and |η| over the cells, `linear` (N, n) |ζ| alone, and
    `forced` (N, n) what makes q."""

    flow: Decay
    wider: Array
    linear: Array
    forced: Array

    def errors(self, norm: Norm) -> Array:
        """Bounds (N,) of N(q) over the cells."""
        rows = self.rows(norm.T)
        return np.asarray(rows.max(axis=1) if norm.largest else np.sqrt((rows**2).sum(axis=1)) * SLACK)

    def rows(self, left: Array) -> Array:
        """Bounds (N, p) of |left q| over the cells, left (p, n) exact."""
        along = convolution(self.flow, left)
        return along.by_cells(along(self.forced))


def opened(system: ExactSystem, metric: Metric, tube: Tube, flow: Decay, X: Array, loose: Loose) -> Open:
    """What open inputs change along the tube, X (N, n + m) ≥ |(x̂, ŵ)|; loose by pieces.

    Raises NotProvedError where that may run away.
    """
    eta = np.repeat(loose.peak, counts(tube.pieces, metric), axis=0)
    linear = _linear(system, metric, tube, flow, loose)
    known = np.hstack([linear, eta])
    bound = roomy(system, (X + known).max(axis=0))
    v, _ = perturbed(metric, bound, flow.width, X, known[:, :, None], np.zeros(1))
    if not np.isfinite(v).all():
        raise NotProvedError("what is open in the input may make the motion run away")
    q, gathered = v * metric.reach, convolution(flow, np.eye(system.n))
    for _ in range(PASSES):
        wider = known + np.pad(q, ((0, 0), (0, system.m)))
        forced = _changed(system, metric, tube, bound, wider)
        q = np.minimum(q, gathered.by_cells(gathered(forced)))
    return Open(flow, known + np.pad(q, ((0, 0), (0, system.m))), linear, forced)


def _linear(system: ExactSystem, metric: Metric, tube: Tube, flow: Decay, loose: Loose) -> Array:
    """Bounds (N, n) of |ζ| over the cells, by the most that heights were off so far.

    With K = |e^(As) (B_h + A B_r)|, over a step ∫ K |η| ≤ sup K · step · mean. The sum of K's suprema times the steps
    is ∫ K but for a step times its variation and, where t lies within a step, its largest value.
    """
    half, one, rows = system.m // 2, np.eye(system.n), input_matrix(system).tolist()
    B_h, B_r = (arb_mat([row[k : k + half] for row in rows]) for k in (0, half))
    driving = B_h + metric.A * B_r
    peak, mean = (
        np.maximum.accumulate(np.repeat(off, counts(tube.pieces, metric), axis=0), axis=0)
        for off in (loose.peak[:, :half], loose.mean)
    )
    over, varied = (np.cumsum(flow.by_cells(one, right), axis=0) for right in (driving, metric.A * driving))
    stepped = over + loose.step * (2.0 * varied + magnitudes(driving))
    by_peak, by_mean = (np.einsum("cnk,ck->cn", K, off) for K, off in ((over, peak), (stepped, mean)))
    own = np.abs(rounded(B_r)[0]) * SLACK
    jumps = (flow.sizes(one).max(axis=0) @ own) @ loose.jumps
    return np.asarray((np.minimum(by_peak, by_mean) + peak @ own.T + jumps) * SLACK)


def _changed(system: ExactSystem, metric: Metric, tube: Tube, bound: Majorant, wider: Array) -> Array:
    """Bounds (N, n) of |R(x̂ + y, ŵ + η) − R(x̂, ŵ)| over the cells, for |(y, η)| ≤ wider (N, n + m)."""
    found, cell = [], 0
    for piece, count, V in zip(tube.pieces, counts(tube.pieces, metric), tube.full, strict=True):
        middle, radius = middles(system, metric, [piece.linear + piece.error], [piece], np.array([V]))
        Y = np.repeat(wider[cell : cell + count], middle.shape[1] // count, axis=0).T
        found.append(largest_of_parts(bound.change_near(middle, radius, Y)))
        cell += count
    changed = np.concatenate(found)
    if not np.isfinite(changed).all():
        raise NotProvedError("what is open in the input may make the motion run away")
    return changed
