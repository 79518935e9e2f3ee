"""§4: the regulator of (4.3)–(4.7) as printed, against the cost itself, which knows no co-state and no matrix L."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp

from fmu_src.controller.halfcar import HalfCar

from ..methods.polynomials import Array
from .rows import RIGHT, Evidence, Row

SPAN = 2.0  # s, from t_B2 to T
START = np.array([0.01, 0.01, 0.1, -0.1])  # z, φ, ż, φ̇ at t_B2
DEGREE = 60  # of the forces' polynomials in time
JUDGED = 10  # of them, the lowest: changes of the control in whose directions the cost is differentiated
_GAUSS = legendre.leggauss(200)
NODES, WEIGHTS = 0.5 * SPAN * (1.0 + _GAUSS[0]), 0.5 * SPAN * _GAUSS[1]
EXACT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}


def riccati_rate(L: Array, car: HalfCar) -> Array:
    """L̇ by (4.7) as printed: L̇ + L A − L B R⁻¹ Bᵀ L + Q + Aᵀ L = 0."""
    A, B, Q, R = (np.array(matrix) for matrix in (car.A, car.B, car.Q, car.R))
    rate: Array = -(L @ A - L @ B @ np.linalg.solve(R, B.T @ L) + Q + A.T @ L)
    return rate


def printed_arc(car: HalfCar) -> tuple[Array, Array]:
    """States (4, k) and forces (2, k) at NODES by (4.4), (4.6) and (4.7): L back from L(T) = 0, then x from START."""
    A, B, R = (np.array(matrix) for matrix in (car.A, car.B, car.R))
    scale = float(np.array(car.Q).max())  # of L, so that one tolerance suits all its entries
    back = solve_ivp(
        lambda _, y: (riccati_rate(scale * y.reshape(4, 4), car) / scale).ravel(),
        (SPAN, 0.0),
        np.zeros(16),
        dense_output=True,
        **EXACT,
    )

    def control(t: float, x: Array) -> Array:
        p = scale * back.sol(t).reshape(4, 4) @ x  # (4.6)
        return np.asarray(-np.linalg.solve(R, B.T @ p), dtype=float)  # (4.4)

    run = solve_ivp(lambda t, x: A @ x + B @ control(t, x), (0.0, SPAN), START, t_eval=NODES, **EXACT)
    return run.y, np.stack([control(t, x) for t, x in zip(NODES, run.y.T, strict=True)], axis=1)


def responses(car: HalfCar) -> tuple[Array, Array, Array]:
    """At NODES the free motion (4, k); forces (n, 2, k), Legendre's polynomials in each; their motions (n, 4, k)."""
    A, B = np.array(car.A), np.array(car.B)
    inputs = np.array([np.outer(e, c) for c in np.eye(DEGREE + 1) for e in np.eye(2)])

    def forces(t: float | Array) -> Array:
        return inputs @ legendre.legvander(np.atleast_1d(2.0 * t / SPAN - 1.0), DEGREE).T

    def rate(t: float, y: Array) -> Array:
        states = y.reshape(-1, 4)
        driven = np.vstack([np.zeros((1, 4)), forces(t)[:, :, 0] @ B.T])
        return np.asarray((states @ A.T + driven).ravel(), dtype=float)

    start = np.zeros((1 + len(inputs), 4))
    start[0] = START
    motions = solve_ivp(rate, (0.0, SPAN), start.ravel(), t_eval=NODES, **EXACT).y.reshape(1 + len(inputs), 4, -1)
    return motions[0], forces(NODES), motions[1:]


def products(x: Array, u: Array, motions: Array, forces: Array, car: HalfCar) -> tuple[Array, Array]:
    """∫ xᵀQ δx and ∫ uᵀR δu (n) for changes (δx, δu) of an arc at NODES: `motions` (n, 4, k), `forces` (n, 2, k)."""
    by_motion = np.einsum("k,ik,ij,njk->n", WEIGHTS, x, np.array(car.Q), motions, optimize=True)
    by_force = np.einsum("k,ik,ij,njk->n", WEIGHTS, u, np.array(car.R), forces, optimize=True)
    return by_motion, by_force


def row() -> Row:
    """δ∫ ½ (xᵀQx + uᵀRu) = ∫ xᵀQ δx + uᵀR δu is 0 at the control that costs least."""
    car = HalfCar()
    free, forces, motions = responses(car)

    def slope(x: Array, u: Array) -> float:
        by_motion, by_force = products(x, u, motions, forces, car)
        return float(np.abs(by_motion + by_force)[: 2 * JUDGED].max() / np.abs(by_force).max())

    second = np.array([sum(products(x, u, motions, forces, car)) for x, u in zip(motions, forces, strict=True)])
    least = np.linalg.solve(second, -products(free, np.zeros_like(forces[0]), motions, forces, car)[0])
    best = free + np.tensordot(least, motions, 1), np.tensordot(least, forces, 1)
    return Row(
        equation="(4.3)–(4.7)",
        printed="ṗ = −Qx − Aᵀp, u = −R⁻¹Bᵀp, p(T) = 0, p = Lx, L̇ + LA − LBR⁻¹BᵀL + Q + AᵀL = 0",
        derived="the same",
        kind=RIGHT,
        evidence=[
            Evidence(
                measure="first-order change of the cost by small changes of the forces, largest of "
                f"{2 * JUDGED} (polynomials in time), over that of its part ½ uᵀRu: forces by (4.4), (4.6), (4.7), and "
                f"those that cost least among polynomials of degree {DEGREE}",
                printed=slope(*printed_arc(car)),
                derived=slope(*best),
                unit="1",
                tolerance=1e-9,
                apart=1e-2,
            )
        ],
    )
