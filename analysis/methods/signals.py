"""Inputs w(t) that are, piece by piece, finite sums of exponentials: every profile of the road FMU is one, exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Piece:
    """w(t) = Σ_k amplitudes[:, k] exp(exponents[k] (t − begin)) from `begin` [s] on, until the next piece begins.

    exponents (K,) [1/s] and amplitudes (m, K) come in conjugate pairs, so that the sum is real.
    """

    begin: float
    exponents: NDArray[np.complex128]
    amplitudes: NDArray[np.complex128]

    def __call__(self, t: ArrayLike) -> Array:
        """w (m, …) at the times t (…)."""
        s = np.asarray(t) - self.begin
        return np.tensordot(self.amplitudes, np.exp(np.multiply.outer(self.exponents, s)), axes=1).real


@dataclass(frozen=True, slots=True)
class Signal:
    """Pieces in the order of time; before the first one there is no signal."""

    pieces: tuple[Piece, ...]

    @property
    def begin(self) -> float:
        """Start of the first piece [s]."""
        return self.pieces[0].begin

    @property
    def edges(self) -> list[float]:
        """Starts of all pieces [s]."""
        return [piece.begin for piece in self.pieces]

    def spans(self, t: Array) -> list[tuple[Piece, NDArray[np.bool_]]]:
        """Each piece with the mask of the times t (n,) that lie in it. Raises InputError for times before the first."""
        if np.any(early := ~(t >= self.begin)):
            raise InputError(f"t = {t[early][0]:g} s: wanted times not before the signal's start, {self.begin:g} s")
        index = np.searchsorted(self.edges, t, side="right") - 1
        return [(piece, index == i) for i, piece in enumerate(self.pieces)]

    def __call__(self, t: ArrayLike) -> Array:
        """w (m, n) at the times t (n,); at an edge, the value of the piece that begins there."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        values = np.empty((len(self.pieces[0].amplitudes), len(times)))
        for piece, mask in self.spans(times):
            values[:, mask] = piece(times[mask])
        return values


def constant(values: Sequence[float], begin: float = 0.0) -> Signal:
    """w(t) = values."""
    return Signal((Piece(begin, np.zeros(1, complex), np.array(values, complex)[:, None]),))


def harmonic(amplitudes: Sequence[Any], frequency: float, begin: float = 0.0) -> Signal:
    """w(t) = Re(amplitudes · exp(iωt)), frequency ω [rad/s]; complex amplitudes (m,) carry the phases."""
    half = np.array(amplitudes, complex) / 2.0 * np.exp(1j * frequency * begin)
    return Signal((Piece(begin, np.array([1j * frequency, -1j * frequency]), np.stack([half, half.conj()], axis=1)),))
