"""A proof over time: bounds on its short cells, for all motions that start within δ. What figures of a tube show."""

from __future__ import annotations

import numpy as np

from .balls import Array, precision
from .cells import errors
from .growth import perturbed
from .joint import largest
from .norms import Norm
from .proof import Proof


def ends(proof: Proof) -> Array:
    """Ends (N + 1,) [s] of the cells, from 0 on."""
    return np.concatenate([[0.0], np.cumsum(proof.decay.width)])


def funnel(proof: Proof, norm: Norm, delta: float) -> tuple[Array, Array]:
    """Bounds (N,) of N(x − x_lin) and (N, n) of |x_j − x_lin,j| over each cell, for N(x(0) − x_lin(0)) ≤ delta."""
    n, metric, rows = proof.system.n, proof.metric, proof.decay.rows(norm) * delta
    spread = np.zeros((*proof.X.shape, 1))
    spread[:, :n, 0] = rows
    with precision(2):
        bound = proof.majorant(rows.max(axis=0))
        top, _ = perturbed(metric, bound, proof.decay.width, proof.X, spread, np.zeros(1))
        size = largest(proof.tube, metric, proof.decay, norm, np.array([delta]), top)[:, 0]
        single = [Norm("a state", row[None, :], largest=True) for row in np.eye(n)]
        e = np.stack([errors(proof.tube, metric, state) for state in single], axis=1)
    return size * (1.0 + 1e-9), (e + rows + top * metric.reach) * (1.0 + 1e-9)
