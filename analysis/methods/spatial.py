"""Spatial instability (§3.3): energy that the nonlinear terms move from some modes to others.

Damping couples the modes of (3.12), whose energies do not add up. Here a mode is one of the undamped linear system
M q'' + C q = 0: with η = Vᵀ M q, its energy is ½ (η'² + ω² η²); all modes together have ½ q'ᵀ M q' + ½ qᵀ C q, exactly.
A linear system moves energy between its modes as well (by damping, and because a force meets several of them); what
the paper calls spatial instability needs Φ, so it is the change against the linear motion under the same input: a mode
that gains much, be it at the cost of others or of the input, and most of all one that the input does not drive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from ..errors import InputError
from .polynomials import Array

UNDRIVEN = 1e-3  # of the energy of the linear motion: a mode with less is hardly driven


@dataclass(frozen=True, slots=True, kw_only=True)
class UndampedModes:
    """M q'' + C q = 0: frequencies ω (n,) [rad/s] rising, shapes V (n, n) with Vᵀ M V = 1."""

    M: Array
    frequencies: Array
    shapes: Array

    def energies(self, x: Array) -> Array:
        """Energy of each mode (n, …) [J] in states x = (q, q') (2 n, …)."""
        to_modes = self.shapes.T @ self.M
        n = len(self.M)
        eta, rate = np.tensordot(to_modes, x[:n], axes=1), np.tensordot(to_modes, x[n:], axes=1)
        squares = (self.frequencies**2).reshape(n, *[1] * (x.ndim - 1))
        return 0.5 * (rate**2 + squares * eta**2)

    def kinetic_energies(self, x: Array) -> Array:
        """½ q'_i (M q')_i (n, …) [J]: the kinetic energy of each coordinate; they add up to all of it."""
        rates = x[len(self.M) :]
        return 0.5 * rates * np.tensordot(self.M, rates, axes=1)


def undamped_modes(M: Array, C: Array) -> UndampedModes:
    """Modes of M (n, n) and C (n, n), both symmetric. Raises InputError unless M > 0 and C ≥ 0."""
    if not np.allclose(C, C.T, rtol=1e-9, atol=1e-9 * np.abs(C).max()) or not np.allclose(M, M.T):
        raise InputError("modes without damping: wanted symmetric matrices of mass and stiffness")
    try:
        squares, shapes = eigh(0.5 * (C + C.T), M)
    except np.linalg.LinAlgError as error:
        raise InputError(f"modes without damping: wanted a positive definite mass matrix: {error}") from error
    if squares[0] < -1e-9 * squares[-1]:
        raise InputError(f"modes without damping: wanted stiffness >= 0, got the eigenvalue {squares[0]:g} 1/s²")
    return UndampedModes(M=M, frequencies=np.sqrt(np.maximum(squares, 0.0)), shapes=shapes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """Mean energies (n,) [J] of the modes over a stretch of time, in the linear and in the full motion."""

    linear: Array
    nonlinear: Array

    @property
    def change(self) -> Array:
        """What Φ adds to each mode, over the whole linear energy (n,)."""
        return (self.nonlinear - self.linear) / self.linear.sum()

    @property
    def moved(self) -> float:
        """Share of the energy that Φ moves from modes that lose to modes that gain: the smaller of both sums.

        0 if all modes gain or all lose, as where Φ lets a mode take more from the road; it cannot exceed 1.
        """
        change = self.change
        return float(min(change[change > 0.0].sum(), abs(change[change < 0.0].sum())))

    @property
    def largest_gain(self) -> float:
        """What Φ adds to the mode that gains most, wherever it comes from, over the whole linear energy; 0 if none."""
        return float(max(0.0, self.change.max()))

    @property
    def undriven_gain(self) -> float:
        """What Φ adds to the mode that gains most of those with less than UNDRIVEN of the whole energy in the linear
        motion, over that whole; 0 if none of them gains, or there is none."""
        undriven = self.linear < UNDRIVEN * self.linear.sum()
        return float(self.change[undriven].max(initial=0.0))


def transfer(modes: UndampedModes, t: Array, linear: Array, nonlinear: Array) -> Transfer:
    """Time means over t (T,) of the modes' energies in both motions (2 n, T)."""
    span = t[-1] - t[0]
    means = [np.trapezoid(modes.energies(x), t, axis=1) / span for x in (linear, nonlinear)]
    return Transfer(linear=means[0], nonlinear=means[1])
