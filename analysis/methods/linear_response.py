"""The solution of the linear part, Eq. (2.3), in closed form: x_lin(t) at any t, without time stepping."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from .polynomials import Array
from .signals import Piece, Signal

RESOLUTION = 12  # decimals of a second; steps that agree so far are equal but for round-off


def linear_response(A: Array, B: Array, x0: ArrayLike, signal: Signal, t: Array) -> Array:
    """x_lin (n, len(t)): x' = A x + B w(t), x = x0 (n,) at the signal's start; times t not before it, in any order.

    On a piece w = Σ a_k exp(σ_k s), so (x, exp(σ_k s)) obeys one linear equation with constant coefficients, and its
    matrix exponential holds (2.3) with the integral done. Nothing is asked of A: it may be defective or in resonance.
    From each time to the next in a piece the exponential takes the solution exactly, so that equal steps share one.
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
    result, state = np.empty((n, len(s))), np.concatenate([x0, np.ones(k)])
    order = np.argsort(s)
    exponentials, which = _exponentials(M, np.diff(s[order], prepend=0.0))
    for place, i in zip(order, which, strict=True):
        state = exponentials[i] @ state
        result[:, place] = state[:n].real
    return result


def held_response(A: Array, B: Array, u: Array, t: Array) -> Array:
    """x (n, len(t)) at the rising times t, from rest at t[0], under inputs u (m, len(t)); exact.

    Each row of inputs is held from its time to the next.
    """
    n = len(A)
    M = np.zeros((n + len(u), n + len(u)))
    M[:n, :n], M[:n, n:] = A, B
    exponentials, which = _exponentials(M, np.diff(t))
    result = np.zeros((n, len(t)))
    for k, i in enumerate(which):
        result[:, k + 1] = exponentials[i][:n] @ np.concatenate([result[:, k], u[:, k]])
    return result


def _exponentials(M: NDArray[Any], steps: Array) -> tuple[NDArray[Any], NDArray[np.intp]]:
    """exp(M·step) for the steps [s] that differ by more than round-off, and which of them each step is.

    Of steps that are equal but for round-off the mean stands for all, so that their sums stay what they are.
    """
    _, which = np.unique(np.round(steps, RESOLUTION), return_inverse=True)
    means = np.bincount(which, steps) / np.bincount(which)
    return expm(means[:, None, None] * M), which


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
