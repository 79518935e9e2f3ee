"""The two-point problem of the maximum principle, (4.3)–(4.5), solved without any Riccati equation."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_bvp
from scipy.linalg import expm
from scipy.sparse import block_array, eye_array, kron
from scipy.sparse.linalg import spsolve

from ..errors import InputError
from ..methods.polynomials import Array
from .regulator import Arc, Regulator


def by_exponentials(regulator: Regulator, x0: Array, t: Array) -> Arc:
    """The optimal arc from x0 (n,), p(t[-1]) = 0, at evenly spaced t: exact, by multiple shooting.

    From each instant to the next (x, p) goes by the exponential of M; all instants are unknowns of one linear system,
    so nothing grows over the horizon, as it would in a single exponential.
    """
    n, steps = len(x0), len(t) - 1
    scale = _scale(regulator)
    flow = expm(regulator.hamiltonian * scale / scale[:, None] * (t[1] - t[0]))
    onward = kron(eye_array(steps, steps + 1), flow) - kron(eye_array(steps, steps + 1, k=1), eye_array(2 * n))
    start, end = eye_array(n, 2 * n * (steps + 1)), eye_array(n, 2 * n * (steps + 1), k=2 * n * (steps + 1) - n)
    right = np.concatenate([x0, np.zeros(2 * n * steps + n)])
    y = spsolve(block_array([[start], [onward], [end]]).tocsc(), right)
    return _arc(regulator, t, y.reshape(-1, 2 * n).T * scale[:, None])


def by_collocation(regulator: Regulator, x0: Array, t: Array, tolerance: float = 1e-10) -> Arc:
    """The same by scipy's `solve_bvp`, whose residual is below `tolerance`.

    Raises InputError where it does not get there.
    """
    n = len(x0)
    scale = _scale(regulator)
    M = regulator.hamiltonian * scale / scale[:, None]
    solution = solve_bvp(
        lambda _, y: M @ y,
        lambda first, last: np.concatenate([first[:n] - x0, last[n:]]),
        t,
        np.zeros((2 * n, len(t))),
        fun_jac=lambda s, _: np.repeat(M[:, :, None], len(s), axis=2),
        tol=tolerance,
        max_nodes=50_000,
    )
    if not solution.success:
        raise InputError(f"the two-point problem is not solved: {solution.message}")
    return _arc(regulator, t, solution.sol(t) * scale[:, None])


def hamiltonian(regulator: Regulator, arc: Arc) -> Array:
    """H (k,) of an arc, the function above (4.3); constant along an optimal one, since A, B, Q, R are."""
    flow = regulator.A @ arc.x + regulator.B @ arc.u
    value: Array = regulator.running_cost(arc.x, arc.u) + np.sum(arc.p * flow, axis=0)
    return value


def _scale(regulator: Regulator) -> Array:
    """Sizes of x and p (2n,) that make the blocks of M of like size."""
    size = np.abs(regulator.Q).max() / (np.abs(regulator.S).max() or 1.0)
    return np.repeat([1.0, np.sqrt(size) or 1.0], len(regulator.A))


def _arc(regulator: Regulator, t: Array, y: Array) -> Arc:
    x, p = np.split(y, 2)
    return Arc(t, x, p, regulator.control(p))
