"""The linear-quadratic regulator on a finite horizon by its Riccati equation, (4.6)–(4.7)."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from scipy.integrate import simpson, solve_ivp
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import expm

from fmu_src.controller.riccati import finite_horizon, verify
from fmu_src.quantities import ParameterError

from ..errors import InputError
from ..methods.polynomials import Array

RESOLUTION = 0.03  # of the fastest time constant, between two entries of L: its spline is then right to 1e-11
DEGREE = 7
ROUND_OFF = 1e-12  # of the largest eigenvalue of a weight: less than this below zero is zero


@dataclass(frozen=True, slots=True, eq=False)
class Regulator:
    """x' = A x + B u, n states and m controls, with the cost J = ½ ∫ xᵀQx + uᵀRu dt.

    Raises InputError, with the reason, unless A, B, Q, R fit together, Q is symmetric and positive semidefinite, and R
    symmetric and positive definite.
    """

    A: Array  # (n, n)
    B: Array  # (n, m)
    Q: Array  # (n, n)
    R: Array  # (m, m)

    def __post_init__(self) -> None:
        n, m = self.B.shape if self.B.ndim == 2 else (-1, -1)
        for name, shape in (("A", (n, n)), ("B", (n, m)), ("Q", (n, n)), ("R", (m, m))):
            matrix = getattr(self, name)
            if matrix.shape != shape:
                raise InputError(f"{name}: wanted the shape {shape}, as B has it, got {matrix.shape}")
            if not np.all(np.isfinite(matrix)):
                raise InputError(f"{name}: wanted finite numbers, got {matrix[~np.isfinite(matrix)][0]}")
        least, scale = _least_eigenvalue("Q", self.Q)
        if least < -ROUND_OFF * scale:
            raise InputError(
                f"Q is indefinite: wanted no eigenvalue < 0, got {least:.6g}; the cost would reward motion"
            )
        least, scale = _least_eigenvalue("R", self.R)
        if least <= ROUND_OFF * scale:
            raise InputError(
                f"R is not positive definite: wanted all eigenvalues > 0, got {least:.6g}; some control would be free"
            )

    @property
    def S(self) -> Array:
        """B R⁻¹ Bᵀ (n, n)."""
        S: Array = self.B @ np.linalg.solve(self.R, self.B.T)
        return S

    @property
    def hamiltonian(self) -> Array:
        """M (2n, 2n) of (x, p)' = M (x, p): (4.1) and (4.3) with the optimal control (4.4)."""
        M: Array = np.block([[self.A, -self.S], [-self.Q, -self.A.T]])
        return M

    def control(self, p: Array) -> Array:
        """u = −R⁻¹ Bᵀ p (m, …), Eq. (4.4)."""
        return np.asarray(-np.linalg.solve(self.R, self.B.T @ p), dtype=float)

    def running_cost(self, x: Array, u: Array) -> Array:
        """½ (xᵀQx + uᵀRu) (k,) of states (n, k) and controls (m, k)."""
        cost: Array = 0.5 * (np.einsum("ik,ij,jk->k", x, self.Q, x) + np.einsum("ik,ij,jk->k", u, self.R, u))
        return cost


def _least_eigenvalue(name: str, weight: Array) -> tuple[float, float]:
    """Least eigenvalue and largest absolute one of a symmetric matrix. Raises InputError if it is not symmetric."""
    scale = float(np.abs(weight).max())
    if np.abs(weight - weight.T).max() > ROUND_OFF * scale:
        raise InputError(f"{name} is not symmetric: wanted {name} = {name}ᵀ")
    return float(np.linalg.eigvalsh(weight)[0]), scale


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """A motion of a regulator at the times t (k,) [s]: states x (n, k), co-states p (n, k), controls u (m, k)."""

    t: Array
    x: Array
    p: Array
    u: Array


def instants(begin: float, end: float, step: float) -> Array:
    """Times from `begin` to `end` [s], evenly at most `step` apart.

    Raises InputError unless step > 0 and the interval lasts at least one step.
    """
    span = end - begin
    if not span > 0.0:
        raise InputError(
            f"T = {end:g} s: wanted an end of control after its start at {begin:g} s, got {span:g} s of it"
        )
    if not step > 0.0:
        raise InputError(f"step = {step:g} s: wanted > 0")
    if span < step:
        raise InputError(f"T = {end:g} s: wanted at least one step of {step:g} s from {begin:g} s on, got {span:g} s")
    return np.linspace(begin, end, 1 + int(np.ceil(span / step - 1e-9)))


def riccati_solution(regulator: Regulator, span: float) -> BSpline:
    """L (…, n, n) of (4.7) with L(T) = 0, as a function of the times to go (…) in [0, span] [s]."""
    fastest = float(np.abs(np.linalg.eigvals(regulator.hamiltonian)).max())
    to_go = np.linspace(0.0, span, 2 * DEGREE + int(span * fastest / RESOLUTION))
    L = finite_horizon(regulator.A, regulator.B, regulator.Q, regulator.R, to_go)
    return make_interp_spline(to_go, L, k=DEGREE)


def stationary(regulator: Regulator) -> tuple[Array, Array]:
    """(L, K) of remark 4.1, u = K x, by python-control, whose gain is that of u = −K x.

    Raises InputError where the algebraic equation has no stabilizing solution.
    """
    matrices = (regulator.A, regulator.B, regulator.Q, regulator.R)
    try:
        gain, L = control.lqr(*matrices)[:2] if regulator.Q.any() else (0.0 * regulator.B.T, 0.0 * regulator.A)
        verify(L, *matrices)
    except (np.linalg.LinAlgError, ParameterError) as error:
        raise InputError(f"no control u = K x is optimal for ever: {error}") from error
    return L, -gain


def by_riccati(regulator: Regulator, x0: Array, t: Array) -> Arc:
    """The optimal arc from x0 (n,) at t[0] as §4 has it: L backward from t[-1], then x' = (A − S L) x forward."""
    L, S = riccati_solution(regulator, t[-1] - t[0]), regulator.S
    solution = solve_ivp(
        lambda s, x: (regulator.A - S @ L(t[-1] - s)) @ x,
        (t[0], t[-1]),
        x0,
        method="DOP853",
        t_eval=t,
        rtol=1e-12,
        atol=1e-15 * np.abs(x0).max(),
    )
    if not solution.success:
        raise InputError(f"the closed loop cannot be integrated: {solution.message}")
    x = solution.y
    p = np.einsum("kij,jk->ik", L(t[-1] - t), x)
    return Arc(t, x, p, regulator.control(p))


def quadrature(regulator: Regulator, t: Array, x: Array, u: Array) -> float:
    """J = ∫ ½ (xᵀQx + uᵀRu) dt along a sampled motion, by Simpson's rule."""
    return float(simpson(regulator.running_cost(x, u), x=t))


def modal_reach(A: Array, B: Array) -> float:
    """Least |wᴴB| / |w| |B| over the left eigenvectors w of A: how far the control reaches the mode it reaches least.

    0 if a mode is out of reach, and with eigenvalues all different only then (Popov, Belevitch, Hautus): (A, B) is
    not controllable. A measure of the coordinates as they are; here SI units.
    """
    _, w = np.linalg.eig(A.T)
    return float(np.linalg.norm(w.T @ B, axis=1).min() / np.linalg.norm(B, 2))


def energy_to_rest(A: Array, B: Array, x0: Array, span: float) -> float:
    """Least ∫ uᵀu dt that brings x' = A x + B u from x0 to rest in the time `span` [s]: what control must spend.

    (e^{AT} x0)ᵀ W⁻¹ (e^{AT} x0) with the controllability Gramian W; infinite where W is singular to round-off.
    """
    n = len(A)
    flow = expm(np.block([[-A, B @ B.T], [np.zeros((n, n)), A.T]]) * span)
    gramian, end = flow[n:, n:].T @ flow[:n, n:], flow[n:, n:].T @ x0  # C. F. Van Loan, IEEE TAC 23 (1978) 395
    if np.linalg.matrix_rank(gramian) < n:
        return float("inf")
    return float(end @ np.linalg.solve(gramian, end))
