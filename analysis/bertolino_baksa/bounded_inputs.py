"""Every input that is merely bounded, |w_i(t)| ≤ W_i, around ψ = 0: the motion at rest is almost stable.

    x(t) = e^(At) x(0) + ∫ e^(A(t − s)) (B w + R(x, w)) ds,  so  Y ≥ κδ + G W + Γ R̄(Y, W)  keeps |x_j(t)| ≤ Y_j

for all t ≥ 0, with G = ∫|e^(At) B| dt and Γ = ∫|e^(At)| dt: as long as x is within Y, it is even within the right side.
Where heights and slopes are bounded together, less than G W is needed (`slopes.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import arb_mat, fmpq

from .balls import Array, ExactSystem, NotProvedError, matrix, rounded
from .cells import CELLS, Decay, decay
from .majorant import Majorant, majorant
from .norms import Metric, Norm, usable_inverse
from .pieces import Piece
from .slopes import largest_outputs
from .tube import input_matrix

TURN = 0.06  # rad that the fastest mode turns over a cell
LONG = 16.0  # times the slowest time constant: what comes later is bounded as a whole
ROOMS = (1.5, 4.0, 10.0)  # of the box, over what the linear part does
ROOM_INPUT = 2.0
ROUNDS = 200  # of the iteration for Y
STRICT = 1e-9  # relative: by which Y exceeds what it must


@dataclass(frozen=True, slots=True)
class Bounds:
    """|w_i(t)| ≤ sizes_i (m,) for all t ≥ 0; `tied`: the first half Lipschitz, 0 at t = 0, the second their rates."""

    sizes: Array
    tied: bool = False


@dataclass(frozen=True, slots=True)
class Gains:
    """What bounds the linear part under inputs of any kind: e^(At) over cells, and Γ (n, n)."""

    system: ExactSystem
    metric: Metric
    decay: Decay
    of_rates: Array

    def driven(self, left: Array, bounds: Bounds) -> Array:
        """Bounds (p,) of |left x_lin| from rest, left (p, n), over all inputs within the bounds."""
        B = input_matrix(self.system)
        if not bounds.tied:
            return np.asarray(self.decay.integral(self.metric, left, B) @ bounds.sizes * (1.0 + STRICT))
        half = self.system.m // 2
        heights, slopes = (arb_mat([row[k : k + half] for row in B.tolist()]) for k in (0, half))
        A, V = bounds.sizes[:half], bounds.sizes[half:]
        tied = largest_outputs(self.decay, self.metric, left, heights, slopes, A, V)
        apart = self.decay.integral(self.metric, left, heights) * A + self.decay.integral(self.metric, left, slopes) * V
        return np.asarray(np.minimum(tied, apart).sum(axis=1) * (1.0 + STRICT))

    def under(self, bounds: Bounds) -> Driven:
        """What these bounds make of the states."""
        return Driven(self, bounds, self.driven(np.eye(self.system.n), bounds))

    def spread(self, norm: Norm) -> Array:
        """κ_j (n,) ≥ sup_t |(e^(At) y)_j|/N(y), by ‖·‖_S after the last cell."""
        later = self.metric.reach * self.decay.at_end(self.metric, norm) * (1.0 + STRICT)
        return np.maximum(self.decay.rows(norm).max(axis=0), later)

    def kappa(self, norm: Norm) -> float:
        """κ ≥ sup_t N(e^(At) y)/N(y), by ‖·‖_S after the last cell."""
        later = self.metric.of(norm) * self.decay.at_end(self.metric, norm) * (1.0 + STRICT)
        return max(float(self.decay.of(norm).max()), later)


@dataclass(frozen=True, slots=True)
class Driven:
    """All inputs within the bounds; `states` (n,) bounds |x_j| of the linear part from rest."""

    gains: Gains
    bounds: Bounds
    states: Array

    def motion(self, start: Array) -> tuple[Array, Array]:
        """Y (n,) ≥ |x_j(t)| for all t ≥ 0 where |(e^(At) x(0))_j| ≤ start_j (n,), and bounds (n,) of |R(x, w)|.

        Raises NotProvedError if the iteration from below finds no Y.
        """
        W, linear = self.bounds.sizes, start + self.states
        linear = (linear + STRICT * linear.max()) * (1.0 + STRICT)
        for room in ROOMS:
            bound = majorant(self.gains.system, np.concatenate([room * linear, ROOM_INPUT * W]) + 1e-12)
            Y = linear
            for _ in range(ROUNDS):
                forced = _forced(bound, Y, W)
                needed = (linear + self.gains.of_rates @ forced) * (1.0 + STRICT)
                if not np.all(np.isfinite(needed)):
                    break
                if np.all(needed <= Y):
                    return Y, forced
                Y = needed * (1.0 + 1e3 * STRICT)
        raise NotProvedError("the bounds of the states grow without end: this input or start is too large")

    def epsilon(self, norm: Norm, delta: Sequence[float]) -> list[float]:
        """ε for each δ: N(x(0)) ≤ δ and inputs within the bounds imply N(x(t)) ≤ ε for all t ≥ 0.

        Raises NotProvedError if there is none for one of them, or for a norm that floats cannot compute.
        """
        usable_inverse(norm.T, f"matrix of the {norm.name} norm")
        gains = self.gains
        spread, kappa = gains.spread(norm), gains.kappa(norm)
        driven = gains.driven(norm.T, self.bounds)
        by_rates = gains.decay.integral(gains.metric, norm.T, matrix(np.eye(gains.system.n)))
        found = []
        for d in delta:
            rows = driven + by_rates @ self.motion(spread * d)[1]
            size = rows.max() if norm.largest else np.sqrt((rows**2).sum())
            found.append(float(size + kappa * d) * (1.0 + STRICT))
        return found


def _forced(bound: Majorant, Y: Array, W: Array) -> Array:
    """Bound (n,) of |R(x, w)| for |x| ≤ Y, |w| ≤ W; inf out of the box."""
    nothing = np.zeros((len(Y) + len(W), 1))
    with np.errstate(over="ignore", invalid="ignore"):
        return bound.change(nothing, nothing[: len(Y)], np.concatenate([Y, W])[:, None])[:, 0]


def gains(system: ExactSystem, metric: Metric) -> Gains:
    """The gains of a system whose linear part contracts."""
    fastest = float(np.abs(np.linalg.eigvals(rounded(metric.A)[0])).max())
    step = fmpq(max(1, round(1e6 * CELLS * TURN / fastest)), 1_000_000)
    count = int(LONG / metric.alpha / float(step)) + 1
    none = np.zeros((system.n, 1))
    found = decay(metric, tuple(Piece(k * step, (k + 1) * step, none, none) for k in range(count)))
    return Gains(system, metric, found, found.integral(metric, np.eye(system.n), matrix(np.eye(system.n))))
