"""The periodic motion of the full equations under a periodic input, and its Floquet exponents."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import linear_sum_assignment

from ..errors import InputError
from .linear_response import periodic_response
from .modes import Complex, modes
from .polynomials import Array
from .signals import Piece
from .standard_form import StandardForm

STEP = 1e-30  # of the complex-step derivative
MOST = 24  # multiples of the fundamental frequency among which the waves are looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class PeriodicMotion:
    """The start x0 (n,) of a motion of a period [s] at t = 0, and the exponents μ (n,) [1/s], in the order of λ."""

    x0: Array
    period: float
    exponents: Complex
    residual: float  # |x(T) − x0|, largest


def period_of(piece: Piece) -> float:
    """The period [s] of a sum of waves. Raises InputError if there is none, or too long a one."""
    omega = np.abs(piece.exponents.imag[piece.exponents != 0.0])
    if not omega.size or np.any(piece.exponents.real != 0.0):
        raise InputError(f"period: wanted an input of waves that last, got the exponents {piece.exponents} 1/s")
    for parts in range(1, MOST + 1):
        multiples = omega / (omega.min() / parts)
        if np.allclose(multiples, np.round(multiples), rtol=1e-9, atol=1e-9):
            return float(2.0 * math.pi * parts / omega.min())
    raise InputError(f"period: the frequencies {omega} rad/s have no common part above their smallest over {MOST}")


def floquet(form: StandardForm, piece: Piece, *, period: float | None = None, rtol: float = 1e-12) -> PeriodicMotion:
    """The motion of x' = F(x, w) with w's period near the linear one, by Newton's method, and its exponents.

    Flow and variational equations are integrated by DOP853; F' comes from complex steps, exact to round-off.
    Raises InputError if there is none near.
    """
    T, m = period or period_of(piece), modes(form.A)
    x = periodic_response(form.A, form.B, piece, np.zeros(1))[:, 0]
    for _ in range(8):
        end, M = _over_a_period(form, piece, x, T, rtol)
        residual = float(np.abs(end - x).max())
        if residual <= 1e2 * rtol * max(float(np.abs(x).max()), 1e-300):
            break
        x = x - np.linalg.solve(M - np.eye(len(x)), end - x)
    else:
        raise InputError(f"Floquet: no periodic motion found near the linear one; left over: {residual:.3g}")
    return PeriodicMotion(x0=x, period=T, exponents=_exponents(M, m.eigenvalues, T), residual=residual)


def _over_a_period(form: StandardForm, piece: Piece, x0: Array, T: float, rtol: float) -> tuple[Array, Array]:
    """x(T) and the derivative of x(T) by x0."""
    n = len(x0)

    def rate(t: float, y: Array) -> Array:
        value, slope = rate_and_slope(form, y[:n], piece(t))
        return np.concatenate([value, (slope @ y[n:].reshape(n, n)).ravel()])

    start = np.concatenate([x0, np.eye(n).ravel()])
    size = max(float(np.abs(x0).max()), 1e-300)
    atol = rtol * np.concatenate([np.full(n, 1e-2 * size), np.full(n * n, 1e-2)])
    solution = solve_ivp(rate, (0.0, T), start, "DOP853", [T], rtol=rtol, atol=atol)
    if not solution.success:
        raise InputError(f"Floquet: the motion cannot be integrated: {solution.message}")
    return solution.y[:n, 0], solution.y[n:, 0].reshape(n, n)


def rate_and_slope(form: StandardForm, x: Array, w: Array) -> tuple[Array, Array]:
    """F(x, w) (n,) and ∂F/∂x (n, n)."""
    inputs = w.tolist()
    columns = []
    for i in range(len(x)):
        moved: list[complex] = x.tolist()
        moved[i] += 1j * STEP
        columns.append([complex(v) for v in form.equations(moved, inputs, cmath.sin, cmath.cos)])
    values = np.array(columns)
    return values[0].real, values.T.imag / STEP


def _exponents(M: Array, eigenvalues: Complex, T: float) -> Complex:
    """Logarithms of M's eigenvalues over T, paired with the λ whose multipliers are nearest, on their branch."""
    multipliers = np.linalg.eigvals(M).astype(complex)
    expected = np.exp(eigenvalues * T)
    apart = np.abs(np.log(multipliers[None, :] / expected[:, None]))
    rows, columns = linear_sum_assignment(apart)
    result = eigenvalues.copy()
    result[rows] += np.log(multipliers[columns] / expected[rows]) / T
    return result
