"""The solution of the linear part, Eq. (2.3), in closed form: x_lin(t) at any t, without time stepping."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from .polynomials import Array
from .signals import Piece, Signal


def linear_response(A: Array, B: Array, x0: ArrayLike, signal: Signal, t: Array) -> Array:
    """x_lin (n, len(t)): x' = A x + B w(t), x = x0 (n,) at the signal's start; times t not before it, in any order.

    On a piece w = Σ a_k exp(σ_k s), so (x, exp(σ_k s)) obeys one linear equation with constant coefficients, and its
    matrix exponential holds (2.3) with the integral done. Nothing is asked of A: it may be defective or in resonance.
    """
    result = np.empty((len(A), len(t)))
    x = np.asarray(x0, dtype=float)
    ends = [*signal.edges[1:], np.inf]
    for (piece, mask), end in zip(signal.spans(t), ends, strict=True):
        wanted = t[mask] if np.isinf(end) else np.append(t[mask], end)
        if len(wanted):
            values = _on_piece(A, B, x, piece, wanted - piece.begin)
            result[:, mask], x = values[:, : np.count_nonzero(mask)], values[:, -1]
    return result


def _on_piece(A: Array, B: Array, x0: Array, piece: Piece, s: Array) -> Array:
    """x (n, len(s)) at the times s since the piece's begin."""
    n, k = len(A), len(piece.exponents)
    M = np.zeros((n + k, n + k), complex)
    M[:n, :n], M[:n, n:] = A, B @ piece.amplitudes
    M[n:, n:] = np.diag(piece.exponents)
    return (expm(s[:, None, None] * M)[:, :n] @ np.concatenate([x0, np.ones(k)])).real.T


def periodic_response(A: Array, B: Array, piece: Piece, t: Array) -> Array:
    """What x' = A x + B w(t) settles to, w of this piece for ever: Σ (σ_k − A)⁻¹ B a_k exp(σ_k s), shape (n, len(t)).

    Raises numpy.linalg.LinAlgError where an exponent is an eigenvalue of A.
    """
    forced = [
        np.linalg.solve(sigma * np.eye(len(A)) - A, B @ a)
        for sigma, a in zip(piece.exponents, piece.amplitudes.T, strict=True)
    ]
    waves = np.exp(np.multiply.outer(piece.exponents, t - piece.begin))
    return (np.array(forced).reshape(-1, len(A)).T @ waves).real
