"""The solution of the full equations x' = F(x, w(t)), by DOP853, restarted at every edge of the input."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from ..errors import InputError
from .polynomials import Array
from .signals import Piece, Signal, constant
from .standard_form import StandardForm

SMALL = 1e-3  # m, rad: of motions smaller than this the error is not relative any more


def nonlinear_response(
    form: StandardForm, x0: ArrayLike, signal: Signal | None, t: Array, *, rtol: float = 1e-12
) -> Array:
    """x (n, len(t)) at the times t, increasing, none before the signal's start, from x0 (n,) there (no signal: w = 0).

    Raises InputError where the motion cannot be integrated.
    """
    w = signal or constant([0.0] * form.B.shape[1], float(t[0]))
    x, result = np.asarray(x0, dtype=float), np.empty((len(form.A), len(t)))
    ends = [*w.edges[1:], np.inf]
    for (piece, mask), end in zip(w.spans(t), ends, strict=True):
        stop = min(end, float(t[-1]))
        if stop < piece.begin:
            break

        def rate(time: float, y: Array, piece: Piece = piece) -> list[float]:
            inputs = (piece.amplitudes @ np.exp(piece.exponents * (time - piece.begin))).real
            return [float(v) for v in form.equations(y.tolist(), inputs.tolist(), math.sin, math.cos)]

        at = np.union1d(t[mask], [stop])
        solution = solve_ivp(rate, (piece.begin, stop), x, "DOP853", at, rtol=rtol, atol=rtol * SMALL)
        if not solution.success:
            raise InputError(f"from t = {piece.begin:g} s the motion cannot be integrated: {solution.message}")
        result[:, mask], x = solution.y[:, : np.count_nonzero(mask)], solution.y[:, -1]
    return result
