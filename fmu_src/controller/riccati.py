"""Riccati equations of §4: finite horizon (4.7) by backward integration, infinite horizon (remark 4.1).

numpy, scipy and control are imported inside the functions: an FMU that runs on a stored design needs none of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..quantities import ParameterError

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray[Any, Any]


def riccati_rate(L: Array, A: Array, B: Array, Q: Array, R: Array) -> Array:
    """−L̇ = L A + Aᵀ L − L B R⁻¹ Bᵀ L + Q, Eq. (4.7): the growth of L (n × n) with the time to go."""
    import numpy as np

    LB = L @ B
    return L @ A + A.T @ L - LB @ np.linalg.solve(R, LB.T) + Q


def finite_horizon(A: Array, B: Array, Q: Array, R: Array, to_go: Array) -> Array:
    """L of (4.7) with L(T) = 0 at the times to go s = T − t [s] (increasing from 0); shape (len(to_go), n, n)."""
    import numpy as np
    from scipy.integrate import solve_ivp

    n = len(A)
    # L scales with Q; an absolute tolerance below its smallest meaningful entry
    scale = np.max(np.abs(Q)) or 1.0
    try:
        with np.errstate(over="raise", invalid="raise"):
            solution = solve_ivp(
                lambda s, y: riccati_rate(y.reshape(n, n), A, B, Q, R).ravel(),
                (to_go[0], to_go[-1]),
                np.zeros(n * n),
                method="DOP853",
                t_eval=to_go,
                rtol=1e-12,
                atol=1e-16 * scale,
            )
    except FloatingPointError as error:
        raise ParameterError([f"the Riccati equation leaves the finite numbers: {error}"]) from error
    if not solution.success:
        raise ParameterError([f"the Riccati equation cannot be integrated: {solution.message}"])
    L = solution.y.T.reshape(-1, n, n)
    return 0.5 * (L + L.transpose(0, 2, 1))


def infinite_horizon(A: Array, B: Array, Q: Array, R: Array) -> tuple[Array, Array]:
    """(L, K) of remark 4.1: the stabilizing solution of the algebraic equation, and the gain of u = K x.

    `control.lqr` returns the gain of u = −K x; the paper's K = −R⁻¹ Bᵀ L has the other sign.
    """
    import control

    gain, L, _ = control.lqr(A, B, Q, R)
    return L, -gain
