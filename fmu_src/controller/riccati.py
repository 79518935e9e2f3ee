"""Riccati equations of §4: finite horizon (4.7) by backward integration, infinite horizon (remark 4.1).

numpy and scipy are imported inside the functions: an FMU that runs on a stored design needs none of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..quantities import ParameterError

if TYPE_CHECKING:
    import numpy as np

    Array = np.ndarray[Any, Any]

RESIDUAL = 1e-9  # of the algebraic equation, over its largest terms
ON_AXIS = 1e-7  # of poles, over the largest: closer to the imaginary axis they may lie on it, where the algebraic
# equation's solution is right to the root of round-off alone
PADE = [  # of exp, degree 13: coefficients of the numerator
    64764752532480000.0, 32382376266240000.0, 7771770303897600.0, 1187353796428800.0, 129060195264000.0,
    10559470521600.0, 670442572800.0, 33522128640.0, 1323241920.0, 40840800.0, 960960.0, 16380.0, 182.0, 1.0,
]  # fmt: skip
PADE_NORM = 5.37  # up to this 1-norm the approximant is exp to round-off (Higham 2005)


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
    """(L, K) of remark 4.1: the stabilizing solution of the algebraic equation, and the gain K = −R⁻¹ Bᵀ L of u = K x.

    Raises ParameterError where there is no stabilizing solution, or none in double precision.
    """
    import numpy as np

    L = _stabilizing(A, B, Q, R)
    verify(L, A, B, Q, R)
    return L, -np.linalg.solve(R, B.T @ L)


def _stabilizing(A: Array, B: Array, Q: Array, R: Array) -> Array:
    import numpy as np
    from scipy.linalg import solve_continuous_are

    try:
        return solve_continuous_are(A, B, Q, R) if Q.any() else np.zeros_like(A)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise ParameterError([f"the Riccati equation has no stabilizing solution: {error}"]) from error


def verify(L: Array, A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Poles (n) of the closed loop with the algebraic equation's solution L.

    Raises ParameterError unless L solves it to round-off and all poles are left of what may lie on the axis.
    """
    import numpy as np

    S = B @ np.linalg.solve(R, B.T)
    poles = np.linalg.eigvals(A - S @ L)
    stable = poles.real.max() < -ON_AXIS * np.abs(poles).max()
    size = np.abs(L @ A).max() + np.abs(L @ S @ L).max() + np.abs(Q).max()
    if not (np.abs(riccati_rate(L, A, B, Q, R)).max() <= RESIDUAL * size and stable):
        raise ParameterError(["the Riccati equation has no stabilizing solution in double precision"])
    return poles


def without_cross(A: Array, B: Array, Q: Array, R: Array, N: Array) -> tuple[Array, Array, Array]:
    """(A', Q', K0): the cost xᵀQx + 2xᵀNu + uᵀRu is xᵀQ'x + vᵀRv of x' = A'x + B v, with u = v + K0 x."""
    import numpy as np

    K0 = -np.linalg.solve(R, N.T)
    left = Q + N @ K0
    return A + B @ K0, 0.5 * (left + left.T), K0


def exponentials(X: Array) -> Array:
    """exp of each of the matrices X (k × n × n), scaled and squared alike: Padé's approximant of degree 13.

    scipy's goes through matrices one by one, in BLAS calls whose threads on matrices this small only wait for each
    other: ten times the time of this in a host that does not limit them.
    """
    import numpy as np

    doublings = int(np.ceil(np.log2(max(np.abs(X).sum(axis=-2).max() / PADE_NORM, 1.0))))
    X, one, b = X / 2.0**doublings, np.eye(X.shape[-1]), PADE
    X2 = X @ X
    X4 = X2 @ X2
    X6 = X4 @ X2
    odd = X6 @ (b[13] * X6 + b[11] * X4 + b[9] * X2) + b[7] * X6 + b[5] * X4 + b[3] * X2 + b[1] * one
    even = X6 @ (b[12] * X6 + b[10] * X4 + b[8] * X2) + b[6] * X6 + b[4] * X4 + b[2] * X2 + b[0] * one
    odd = X @ odd
    E = np.linalg.solve(even - odd, even + odd)
    for _ in range(doublings):
        E = E @ E
    return E


def flow(A: Array, B: Array, Q: Array, R: Array) -> tuple[Callable[[Array, Array], Array], Array]:
    """Solution of (4.7) in closed form, and the poles (n) of the closed loop with infinite horizon.

    The function takes L (p, n, n) at some time to go and gives L (p, k, n, n) later by the times s (k) [s]. With the
    stabilizing solution L∞ of the algebraic equation, its closed loop Ac and S = B R⁻¹ Bᵀ, Δ = L − L∞ obeys
    Δ' = Δ Ac + Acᵀ Δ − Δ S Δ, hence

        Δ(s) = Eᵀ Δ(0) [1 + W Δ(0)]⁻¹ E,  E = exp(Ac s),  W = ∫ E S Eᵀ ds = W∞ − E W∞ Eᵀ.

    Raises ParameterError where there is no stabilizing solution in double precision.
    """
    import numpy as np
    from scipy.linalg import solve_continuous_lyapunov

    S, one, last = B @ np.linalg.solve(R, B.T), np.eye(len(A)), _stabilizing(A, B, Q, R)
    poles, closed = verify(last, A, B, Q, R), A - S @ last
    reach = solve_continuous_lyapunov(closed, -S)

    def later(L: Array, s: Array) -> Array:
        E = exponentials(closed * s[:, None, None])
        W = reach - E @ reach @ E.transpose(0, 2, 1)
        start = (L - last)[:, None]
        whole = np.linalg.solve(one + W @ start, np.broadcast_to(E, (len(L), *E.shape)))
        after = last + E.transpose(0, 2, 1) @ start @ whole
        return 0.5 * (after + after.swapaxes(2, 3))

    return later, poles
