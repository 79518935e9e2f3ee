"""§4: the half car of (4.1) as printed, against its own energies, and evidence on the control."""

from __future__ import annotations

from functools import cache

import control
import numpy as np
import sympy as sp
from scipy.linalg import expm, solve_continuous_are, solve_continuous_lyapunov

from fmu_src.controller.halfcar import HalfCar

from ..figures import readable
from ..methods.polynomials import Array
from . import regulator
from .differences import plain
from .rows import RIGHT, Evidence, Row

m, J, a, b, c1, c2, b1, b2 = SYMBOLS = sp.symbols("m J a b c1 c2 b1 b2", positive=True)
z, phi, dz, dphi = STATE = sp.symbols("z phi dz dphi", real=True)
u1, u2 = CONTROLS = sp.symbols("u1 u2", real=True)
za, zb, dza, dzb = ROAD = sp.symbols("za zb dza dzb", real=True)

A_PRINTED = sp.Matrix([
    [0, 0, 1, 0],
    [0, 0, 0, 1],
    [-(c1 + c2) / m, -(a * c1 - b * c2) / m, -(b1 + b2) / m, -(a * b1 - b * b2) / m],
    [-(a * c1 + b * c2) / J, -(a**2 * c1 - b**2 * c2) / J, -(a * b1 - b * b2) / J, -(a**2 * b1 + b**2 * b2) / J],
])  # fmt: skip
B_PRINTED = sp.Matrix([[0, 0], [0, 0], [-1 / m, -1 / m], [-1 / J, -1 / J]])
C_PRINTED = sp.Matrix([
    0,
    0,
    (c1 * za + c2 * zb + b1 * dza + b2 * dzb) / m,
    (a * c1 * za - b * c2 * zb + a * b1 * dza - b * b2 * dzb) / J,
])  # fmt: skip


@cache
def derived() -> tuple[sp.Matrix, sp.Matrix, sp.Matrix]:
    """A, B, C of (4.1) by Lagrange's equations; φ positive front up, u positive down on the body."""
    front, rear = z + a * phi, z - b * phi
    dfront, drear = dz + a * dphi, dz - b * dphi
    V = (c1 * (front - za) ** 2 + c2 * (rear - zb) ** 2) / 2
    R = (b1 * (dfront - dza) ** 2 + b2 * (drear - dzb) ** 2) / 2
    power = -u1 * dfront - u2 * drear
    forces = [-V.diff(q) - R.diff(v) + power.diff(v) for q, v in ((z, dz), (phi, dphi))]
    rates = sp.Matrix([dz, dphi, forces[0] / m, forces[1] / J])
    C = rates.xreplace(dict.fromkeys([*STATE, *CONTROLS], sp.S.Zero))
    return rates.jacobian(STATE), rates.jacobian(CONTROLS), C


def rows() -> list[Row]:
    """§4 in the order of the paper."""
    return [_state_matrix(), _control_matrix(), _excitation(), regulator.row(), _gain()]


def changes(printed: sp.Matrix, right: sp.Matrix) -> list[tuple[int, int]]:
    """Places where the difference is not zero."""
    off = (printed - right).applyfunc(sp.expand)
    return [(i, j) for i in range(off.rows) for j in range(off.cols) if off[i, j] != 0]


def _values() -> tuple[float, ...]:
    """Of SYMBOLS, default half car, with stiffness and damping per axle."""
    car = HalfCar()
    return car.m, car.Jy, car.a, car.b, 2 * car.c1, 2 * car.c2, 2 * car.b1, 2 * car.b2


def numbers(matrix: sp.Matrix) -> Array:
    """The matrix of the default half car."""
    return np.array(matrix.subs(dict(zip(SYMBOLS, _values(), strict=True))).tolist(), dtype=float)


def _words(printed: sp.Matrix, right: sp.Matrix) -> tuple[str, str]:
    """The entries that differ, before and after."""
    places = changes(printed, right)
    texts = [", ".join(_entry(matrix[i, j]) for i, j in places) for matrix in (printed, right)]
    return f"row {places[0][0] + 1}: {texts[0]}", texts[1]


def _entry(entry: sp.Expr) -> str:
    over, under = sp.fraction(sp.together(entry))
    return f"({plain(sp.expand(over))})/{under}" if isinstance(sp.expand(over), sp.Add) else f"{plain(over)}/{under}"


def _state_matrix() -> Row:
    A, _, _ = derived()
    before, after = _words(A_PRINTED, A)
    wrong, right = numbers(A_PRINTED), numbers(A)
    inertia = np.diag([HalfCar().m, HalfCar().Jy])

    def asymmetry(matrix: Array) -> float:
        K = -inertia @ matrix[2:, :2]
        return float(np.abs(K - K.T).max() / np.abs(K).max())

    return Row(
        equation="(4.1) A",
        printed=before,
        derived=after,
        evidence=[
            Evidence(
                measure="stiffness matrix, largest |K − Kᵀ| over largest |K|",
                printed=asymmetry(wrong),
                derived=asymmetry(right),
                unit="1",
                tolerance=1e-12,
                apart=0.1,
            ),
            Evidence(
                measure="eigenvalues of A with a real part > 0, default half car",
                printed=float(np.sum(np.linalg.eigvals(wrong).real > 0.0)),
                derived=float(np.sum(np.linalg.eigvals(right).real > 0.0)),
                unit="1",
                tolerance=0.0,
                apart=1.0,
            ),
            Evidence(
                measure=f"rank of A where a = b, c1 ≠ c2: 3 leaves a lasting offset; det A = {_determinant(A_PRINTED)} "
                f"as printed, {_determinant(A)} as derived",
                printed=float(A_PRINTED.subs(b, a).rank()),
                derived=float(A.subs(b, a).rank()),
                unit="1",
                expected=4.0,
                tolerance=0.0,
                apart=1.0,
            ),
        ],
        note=f"Largest eigenvalue as printed {np.linalg.eigvals(wrong).real.max():.3g} 1/s: where a < b, det A < 0: "
        "rest is a saddle, and the paper's curve without control would diverge.",
    )


def _determinant(matrix: sp.Matrix) -> str:
    return f"{plain(sp.factor(matrix.det() * J * m))}/(J m)"


def reach(state: sp.Matrix, control: sp.Matrix, powers: int) -> tuple[int, float]:
    """Of [B AB …] with so many blocks, default half car: rank, by exact fractions, and least singular value [1].

    The singular value is over the largest, rows by mass and inertia, which makes them of like size.
    """
    A, B = (matrix.subs(dict(zip(SYMBOLS, map(sp.Rational, _values()), strict=True))) for matrix in (state, control))
    blocks = sp.Matrix.hstack(*(A**k * B for k in range(powers)))
    inertia = np.array([1.0, 1.0, HalfCar().m, HalfCar().Jy])[:, None]
    singular = np.linalg.svd(inertia * np.array(blocks.tolist(), dtype=float), compute_uv=False)
    return int(blocks.rank()), float(singular[-1] / singular[0])


def _control_matrix() -> Row:
    A, B, _ = derived()
    before, after = _words(B_PRINTED, B)
    return Row(
        equation="(4.1) B",
        printed=before,
        derived=after,
        evidence=[
            Evidence(
                measure="rank of B",
                printed=float(B_PRINTED.rank()),
                derived=float(B.rank()),
                unit="1",
                expected=2.0,
                tolerance=0.0,
                apart=1.0,
            ),
            Evidence(
                measure="rank of [B AB], A corrected: 4 if each of z and φ has a control of its own",
                printed=float(reach(A, B_PRINTED, 2)[0]),
                derived=float(reach(A, B, 2)[0]),
                unit="1",
                expected=4.0,
                tolerance=0.0,
                apart=1.0,
            ),
        ],
        note=_reached(),
    )


def _reached() -> str:
    """Not lost with the second control: one force still reaches heave and pitch, as their frequencies differ."""
    said = []
    for state, which in ((derived()[0], "corrected"), (A_PRINTED, "as printed")):
        (rank, least), (rank_corrected, least_corrected) = reach(state, B_PRINTED, 4), reach(state, derived()[1], 4)
        said.append(
            f"with A {which} {rank} and {rank_corrected} (least singular value over the largest: "
            f"{readable(least, 2)} and {readable(least_corrected, 2)})"
        )
    return (
        "The paper does not speak of controllability. Rank of [B AB A²B A³B] by exact fractions, for B as printed and "
        f"for B corrected: {'; '.join(said)}. What B as printed loses is strength, not rank."
    )


def _excitation() -> Row:
    """Against Lagrange's C, and that against Newton's: the road's force at each axle, and its moment."""
    _, _, C = derived()
    front, rear = c1 * za + b1 * dza, c2 * zb + b2 * dzb
    newton = sp.Matrix([0, 0, (front + rear) / m, (a * front - b * rear) / J])
    return Row(
        equation="(4.1) C",
        printed="C(t)",
        derived="the same",
        evidence=[
            Evidence(
                measure="entries that differ, by algebra: the print from Lagrange's, Lagrange's from Newton's",
                printed=float(len(changes(C_PRINTED, C))),
                derived=float(len(changes(C, newton))),
                unit="1",
                tolerance=0.0,
                apart=1.0,
            )
        ],
        kind=RIGHT,
    )


def _gain() -> Row:
    """u = K x, K = −R⁻¹BᵀL, against the cost that it must have, ½ x0ᵀ L x0; other programs return −K."""
    A, B, _ = (numbers(matrix) if matrix.cols != 1 else None for matrix in derived())
    assert A is not None and B is not None
    car = HalfCar()
    Q, R = np.array(car.Q), np.array(car.R)
    L = solve_continuous_are(A, B, Q, R)
    K = -np.linalg.solve(R, B.T @ L)
    K_elsewhere = -control.lqr(A, B, Q, R)[0]

    def cost_off(gain: Array) -> float:
        """Cost ∫ xᵀQx + uᵀRu of u = gain x as a matrix, against L."""
        cost = solve_continuous_lyapunov((A + B @ gain).T, -(Q + gain.T @ R @ gain))
        return float(np.abs(cost - L).max() / np.abs(L).max())

    def growth(gain: Array) -> float:
        return float(np.linalg.norm(expm(5.0 * (A + B @ gain)), 2))

    return Row(
        equation="remark 4.1",
        printed="u = K x, K = −R⁻¹BᵀL",
        derived="the same; `lqr` elsewhere returns +R⁻¹BᵀL for u = −K x",
        evidence=[
            Evidence(
                measure="cost of u = K x against ½ xᵀ L x, largest difference over largest L; K as printed, and minus "
                "that of control.lqr",
                printed=cost_off(K),
                derived=cost_off(K_elsewhere),
                unit="1",
                tolerance=1e-9,
                apart=0.1,
            ),
            Evidence(
                measure="norm of the motion after 5 s over that at the start",
                printed=growth(K),
                derived=growth(K_elsewhere),
                unit="1",
                tolerance=1e-6,
                apart=1.0,
            ),
        ],
        kind=RIGHT,
        note=f"With u = −K x for this K the norm would be {growth(-K):.2g}.",
    )
