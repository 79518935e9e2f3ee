"""Lyapunov functions of M q̈ = S (q, q̇) that go with M and S as energies do, and the search for one on many systems.

    V = qᵀ X' q + 2 q̇ᵀ M C q + q̇ᵀ M Y q̇,   X' = X − sym(Svᵀ C + Y Sq),   S = (Sq, Sv)

with M and Y diagonal. Along a motion M cancels against M⁻¹, so that V and V̇ are both affine in (M, S): a V that falls
at the corners of a box of parameters in which (M, S) are affine falls all over it. X' leaves of V̇'s mixed part what
is skew. A V of the same coefficients for all parameters could not follow a natural frequency that moves by more than
the damping is wide; this one proves the car's box of seven parameters in one piece.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..methods.polynomials import Array

FIRST, MORE = 8, 8  # systems that the search begins with, and that are added at a time
SHRINK = 0.2  # of the barrier's weight from one centre to the next
NEAR = 0.5  # Newton decrement at which a centre has been met
LEAST = 1e-8  # weight of the barrier at which the search is given up, over the largest entry of V̇ at its start
STEPS = 300


@dataclass(frozen=True, slots=True, eq=False)
class Energy:
    """Y (n,), C (n, n), X (n, n) symmetric, of the function V above."""

    Y: Array
    C: Array
    X: Array

    def forms(self, M: Array, S: Array) -> tuple[Array, Array]:
        """P, W (2n, 2n) with V = xᵀ P x and V̇ = xᵀ W x, x = (q, q̇), for M (n,), S (n, 2n) of doubles or of balls."""
        n = len(M)
        Sq, Sv = S[:, :n], S[:, n:]
        mixed = Sv.T @ self.C + self.Y[:, None] * Sq
        stiff = self.X - (mixed + mixed.T) / 2
        MC = M[:, None] * self.C
        square, speeds = Sq.T @ self.C, MC + self.Y[:, None] * Sv
        P = np.block([[stiff, MC.T], [MC, np.diag(M * self.Y)]])
        W = np.block([[square + square.T, (stiff + mixed).T], [stiff + mixed, speeds + speeds.T]])
        return P, W


def search(M: Array, S: Array, first: Sequence[int]) -> Energy | None:
    """An energy with V̇ < 0 on all k systems M (k, n), S (k, n, 2n), in doubles; None if none is found.

    first : the systems in the order in which they are likely to decide.
    The least eigenvalue of −V̇ over some systems is made large while the mean of V is kept, by a barrier method, and
    those that fail on what is found are added, until none does.
    """
    units = _Units.of(M.mean(axis=0), S.mean(axis=0))
    chosen, y = list(first[:FIRST]), np.zeros(units.free)
    while True:
        found = _largest_margin(*units.constraints(M[chosen], S[chosen]), y)
        if found is None:
            return None
        y = found
        energy = units.energy(y)
        least = np.array([units.least(energy, *system) for system in zip(M, S, strict=True)])
        if least.min() > 0.0:
            return energy
        chosen += [int(k) for k in np.argsort(least) if least[k] <= 0.0 and k not in chosen][:MORE]


@dataclass(frozen=True, slots=True, eq=False)
class _Units:
    """Energies as combinations of unit ones, in coordinates in which a mean system has masses and stiffnesses 1, with
    the mean of V's eigenvalues there 1: start + span y."""

    scale: Array  # (2n,)
    each: tuple[Energy, ...]
    start: Array  # (N,)
    span: Array  # (N, N − 1)

    @classmethod
    def of(cls, M: Array, S: Array) -> _Units:
        n, root = len(M), np.sqrt(M)
        stiffness = np.abs(np.diag(S))
        frequency = np.sqrt(np.where(stiffness > 0.0, stiffness, M) / M)
        q, v, zero = 1.0 / (root * frequency), 1.0 / root, np.zeros((n, n))
        each = [Energy(row, zero, zero) for row in np.eye(n)]
        for i, j in np.ndindex(n, n):
            one = zero.copy()
            one[i, j] = 1.0
            each.append(Energy(np.zeros(n), one * np.outer(v, 1.0 / q), zero))
            if i <= j:
                each.append(Energy(np.zeros(n), zero, np.maximum(one, one.T) / np.outer(q, q)))
        scale = np.concatenate([q, v])
        means = np.array([np.mean(np.diag(e.forms(M, S)[0]) * scale**2) for e in each])
        start = np.concatenate([np.ones(n), np.zeros(len(each) - n)])
        return cls(scale, tuple(each), start / (means @ start), np.linalg.svd(means[None])[2][1:].T)

    @property
    def free(self) -> int:
        return self.span.shape[1]

    def energy(self, y: Array) -> Energy:
        x = self.start + self.span @ y
        parts = (np.tensordot(x, [getattr(e, name) for e in self.each], axes=1) for name in ("Y", "C", "X"))
        return Energy(*parts)

    def constraints(self, M: Array, S: Array) -> tuple[Array, Array]:
        """F0 (k, 2n, 2n), F (k, N − 1, 2n, 2n) of −W = F0 + Σ y F, scaled, on these systems."""
        around = -np.outer(self.scale, self.scale)
        basis = np.array([[e.forms(*system)[1] * around for e in self.each] for system in zip(M, S, strict=True)])
        return np.einsum("kaij,a->kij", basis, self.start), np.einsum("kaij,ab->kbij", basis, self.span, optimize=True)

    def least(self, energy: Energy, M: Array, S: Array) -> float:
        """Least eigenvalue of −W, scaled."""
        return float(np.linalg.eigvalsh(-energy.forms(M, S)[1] * np.outer(self.scale, self.scale))[0])


def _largest_margin(F0: Array, F: Array, y: Array) -> Array | None:
    """y with t > 0 near the largest t for which all F0 + Σ y F − t 1 are positive definite; None if there is none.

    Newton's method on −t/μ − Σ log det, from this y on, for one μ after the other. At a centre t is less than μ times
    the number of rows below its largest value.
    """
    k, size = F0.shape[:2]
    F = np.concatenate([F, -np.broadcast_to(np.eye(size), (k, 1, size, size))], axis=1)
    t = float(np.linalg.eigvalsh(F0 + np.einsum("kaij,a->kij", F[:, :-1], y)).min())
    most = float(np.abs(F0).max())
    z = np.append(y, t - 0.1 * most)
    weight = 0.1 * most
    for _ in range(STEPS):
        step, decrement = _newton(F0, F, z, weight)
        z = z + step
        if decrement < NEAR:
            if z[-1] > 10.0 * weight:
                return z[:-1]
            if z[-1] + weight * k * size < 0.0 or weight < LEAST * most:
                return None
            weight *= SHRINK
    return None


def _newton(F0: Array, F: Array, z: Array, weight: float) -> tuple[Array, float]:
    """A step that stays within, and the Newton decrement."""
    k, number, size = F.shape[:3]
    inverse = np.linalg.inv(np.linalg.cholesky(F0 + np.einsum("kaij,a->kij", F, z)))
    left = (inverse @ F.transpose(0, 2, 1, 3).reshape(k, size, -1)).reshape(k, size, number, size)
    inner = np.einsum("kiaj,klj->akil", left, inverse, optimize=True)  # L⁻¹ F L⁻ᵀ
    gradient = -np.einsum("akii->a", inner)
    gradient[-1] -= 1.0 / weight
    flat = inner.reshape(number, -1)
    hessian = flat @ flat.T
    hessian[np.diag_indices(number)] *= 1.0 + 1e-10
    step = -np.linalg.solve(hessian, gradient)
    decrement = float(np.sqrt(max(-gradient @ step, 0.0)))
    least = float(np.linalg.eigvalsh(np.tensordot(step, inner, axes=1)).min())
    return step * (1.0 if decrement < 0.25 else min(1.0, -0.7 / least if least < 0.0 else 1.0)), decrement
