"""Every input that is merely bounded, |w_i(t)| ≤ W_i, around ψ = 0: the motion at rest is almost stable.

    x(t) = e^(At) x(0) + ∫ e^(A(t − s)) (B w + R(x, w)) ds,  so  Y ≥ κδ + G W + Γ R̄(Y, W)  keeps |x_j(t)| ≤ Y_j

for all t ≥ 0, with G = ∫|e^(At) B| dt and Γ = ∫|e^(At)| dt: as long as x is within Y, it is even within the right side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq
from scipy.linalg import expm

from ..methods.signals import Piece as Constant
from ..methods.signals import Signal
from ..methods.standard_form import StandardForm
from .adversary import motions
from .balls import Array, ExactSystem, NotProvedError, matrix, rounded
from .cells import CELLS, Decay, decay
from .majorant import Majorant, majorant
from .norms import Metric, Norm, usable_inverse
from .tube import Piece, input_matrix

TURN = 0.06  # rad that the fastest mode turns over a cell
LONG = 16.0  # times the slowest time constant: what comes later is bounded as a whole
ROOMS = (1.5, 4.0, 10.0)  # of the box, over what the linear part does
ROOM_INPUT = 2.0
ROUNDS = 200  # of the iteration for Y
STRICT = 1e-9  # relative: by which Y exceeds what it must
MEMORY = 4.0  # slowest time constants that the worst input is made for
SAMPLES = 2000  # over them
TURNS = 12  # of the search for the worst input in a norm


@dataclass(frozen=True, slots=True)
class Gains:
    """What the linear part makes of bounded inputs: G (n, m) and Γ (n, n), and e^(At) over cells for others."""

    system: ExactSystem
    metric: Metric
    decay: Decay
    of_inputs: Array
    of_rates: Array

    def motion(self, W: Array, start: Array) -> tuple[Array, Array]:
        """Y (n,) ≥ |x_j(t)| for all t ≥ 0 where |(e^(At) x(0))_j| ≤ start_j (n,), and bounds (n,) of |R(x, w)|.

        Raises NotProvedError if the iteration from below finds no Y.
        """
        linear = start + self.of_inputs @ W
        linear = (linear + STRICT * linear.max()) * (1.0 + STRICT)
        for room in ROOMS:
            bound = majorant(self.system, np.concatenate([room * linear, ROOM_INPUT * W]) + 1e-12)
            Y = linear
            for _ in range(ROUNDS):
                forced = _forced(bound, Y, W)
                needed = (linear + self.of_rates @ forced) * (1.0 + STRICT)
                if not np.all(np.isfinite(needed)):
                    break
                if np.all(needed <= Y):
                    return Y, forced
                Y = needed * (1.0 + 1e3 * STRICT)
        raise NotProvedError("the bounds of the states grow without end: this input or start is too large")

    def spread(self, norm: Norm) -> Array:
        """κ_j (n,) ≥ sup_t |(e^(At) y)_j|/N(y)."""
        return np.asarray(self.decay.rows(norm).max(axis=0))

    def epsilon(self, W: Array, norm: Norm, delta: Sequence[float]) -> list[float]:
        """ε for each δ: N(x(0)) ≤ δ and |w| ≤ W imply N(x(t)) ≤ ε for all t ≥ 0.

        Raises NotProvedError if there is none for one of them, or for a norm that floats cannot compute.
        """
        usable_inverse(norm.T, f"matrix of the {norm.name} norm")
        one, spread, kappa = np.eye(self.system.n), self.spread(norm), float(self.decay.of(norm).max())
        driven = self.decay.integral(self.metric, norm.T, input_matrix(self.system)) @ W
        by_rates = self.decay.integral(self.metric, norm.T, matrix(one))
        found = []
        for d in delta:
            rows = driven + by_rates @ self.motion(W, spread * d)[1]
            size = rows.max() if norm.largest else np.sqrt((rows**2).sum())
            found.append(float(size + kappa * d) * (1.0 + STRICT))
        return found


def _forced(bound: Majorant, Y: Array, W: Array) -> Array:
    """Bound (n,) of |R(x, w)| for |x| ≤ Y, |w| ≤ W; inf out of the box."""
    nothing = np.zeros(len(Y) + len(W))
    with np.errstate(over="ignore", invalid="ignore"):
        return bound.change(nothing, np.zeros(len(Y)), np.concatenate([Y, W])[:, None])[:, 0]


def gains(system: ExactSystem, metric: Metric) -> Gains:
    """The gains of a system whose linear part contracts."""
    fastest = float(np.abs(np.linalg.eigvals(rounded(metric.A)[0])).max())
    step = fmpq(max(1, round(1e6 * CELLS * TURN / fastest)), 1_000_000)
    count = int(LONG / metric.alpha / float(step)) + 1
    none = np.zeros((system.n, 1))
    found = decay(metric, tuple(Piece(k * step, (k + 1) * step, none, none) for k in range(count)))
    one = np.eye(system.n)
    of_inputs, of_rates = (found.integral(metric, one, right) for right in (input_matrix(system), matrix(one)))
    return Gains(system, metric, found, of_inputs, of_rates)


def worst_inputs(form: StandardForm, norm: Norm, W: Array) -> Signal:
    """An input of |w_i| = W_i that switches as the linear part needs it to make N large at its end.

    w = W sign(c e^(A(T − t)) B), and c the direction in which N grows, over and over.
    """
    stop = MEMORY / -float(np.linalg.eigvals(form.A).real.max())
    step = stop / SAMPLES
    over, kernel = expm(form.A * step), np.empty((SAMPLES, *form.B.shape))
    kernel[-1] = expm(form.A * step / 2.0) @ form.B * step
    for k in range(SAMPLES - 1, 0, -1):
        kernel[k - 1] = over @ kernel[k]
    best, signs = 0.0, np.ones((SAMPLES, len(W)))
    for row in norm.T:
        c = row
        for _ in range(1 if norm.largest else TURNS):
            tried = np.where(np.tensordot(c, kernel, (0, 1)) < 0.0, -1.0, 1.0)
            end = np.einsum("knm,km->n", kernel, tried * W)
            if norm(end) > best:
                best, signs = float(norm(end)), tried
            c = norm.T.T @ (norm.T @ end)
    switches = [0, *(np.flatnonzero(np.any(signs[1:] != signs[:-1], axis=1)) + 1).tolist()]
    pieces = [Constant(k * step, np.zeros(1, complex), (W * signs[k])[:, None].astype(complex)) for k in switches]
    return Signal(tuple(pieces))


def reached(form: StandardForm, signal: Signal, norm: Norm) -> float:
    """sup N(x) of the motion from rest under an input that `worst_inputs` made."""
    stop = MEMORY / -float(np.linalg.eigvals(form.A).real.max())
    start = np.zeros((len(form.A), 1))
    return max(float(norm(x).max()) for _, x in motions(form, signal, start, stop, stop / SAMPLES))
