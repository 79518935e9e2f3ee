"""§4: the half car of (4.1) as printed, against its own energies, and evidence on the control."""

from __future__ import annotations

from functools import cache

import control
import numpy as np
import sympy as sp
from scipy.linalg import expm, solve_continuous_are, solve_continuous_lyapunov

from fmu_src.controller.halfcar import HalfCar
from fmu_src.vehicle.parameters import Car

from ..methods.polynomials import Array
from .differences import plain
from .rows import RIGHT, Evidence, Row
from .system import derived as full_car

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
    return [_state_matrix(), _control_matrix(), _excitation(), _gain(), _per_axle(), _pitch_sense()]


def changes(printed: sp.Matrix, right: sp.Matrix) -> list[tuple[int, int]]:
    """Places where the difference is not zero."""
    off = (printed - right).applyfunc(sp.expand)
    return [(i, j) for i in range(off.rows) for j in range(off.cols) if off[i, j] != 0]


def numbers(matrix: sp.Matrix) -> Array:
    """The matrix of the default half car, with stiffness and damping per axle."""
    car = HalfCar()
    values = (car.m, car.Jy, car.a, car.b, 2 * car.c1, 2 * car.c2, 2 * car.b1, 2 * car.b2)
    return np.array(matrix.subs(dict(zip(SYMBOLS, values, strict=True))).tolist(), dtype=float)


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
                measure="rank of A, half car with a = b and c1 = c2: 3 leaves a lasting offset in pitch",
                printed=_rank_of_symmetric_car(A_PRINTED),
                derived=_rank_of_symmetric_car(A),
                unit="1",
                expected=4.0,
                tolerance=0.0,
                apart=1.0,
            ),
        ],
        note=f"Largest eigenvalue as printed {np.linalg.eigvals(wrong).real.max():.3g} 1/s: the paper's curve without "
        "control would diverge.",
    )


def _rank_of_symmetric_car(matrix: sp.Matrix) -> float:
    return float(matrix.subs({b: a, c2: c1}).rank())


def _control_matrix() -> Row:
    A, B, _ = derived()
    before, after = _words(B_PRINTED, B)

    inertia = np.array([1.0, 1.0, HalfCar().m, HalfCar().Jy])[:, None]  # makes rows of like size

    def reached(state: sp.Matrix, control: sp.Matrix, powers: int) -> Array:
        """Singular values of [B AB …], over the largest."""
        A_, B_ = numbers(state), numbers(control)
        blocks = [np.linalg.matrix_power(A_, k) @ B_ for k in range(powers)]
        singular = np.linalg.svd(inertia * np.hstack(blocks), compute_uv=False)
        return np.asarray(singular / singular[0])

    def rank(singular: Array) -> float:
        return float(np.sum(singular > 1e-12))

    whole = reached(A_PRINTED, B_PRINTED, 4)

    return Row(
        equation="(4.1) B",
        printed=before,
        derived=after,
        evidence=[
            Evidence(
                measure="rank of B",
                printed=float(np.linalg.matrix_rank(numbers(B_PRINTED))),
                derived=float(np.linalg.matrix_rank(numbers(B))),
                unit="1",
                expected=2.0,
                tolerance=0.0,
                apart=1.0,
            ),
            Evidence(
                measure="rank of [B AB], A corrected: 4 if each of z and φ has a control of its own",
                printed=rank(reached(A, B_PRINTED, 2)),
                derived=rank(reached(A, B, 2)),
                unit="1",
                expected=4.0,
                tolerance=0.0,
                apart=1.0,
            ),
        ],
        note=f"A and B as printed: rank of [B AB A²B A³B] {rank(whole):.0f}, least singular value over the largest "
        f"{whole[-1]:.2g}; with both corrected {reached(A, B, 4)[-1]:.2g}.",
    )


def _excitation() -> Row:
    _, _, C = derived()
    wrong = float(len(changes(C_PRINTED, C)))
    return Row(
        equation="(4.1) C",
        printed="C(t)",
        derived="the same",
        evidence=[
            Evidence(
                measure="entries that differ, by algebra",
                printed=wrong,
                derived=0.0,
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


# ------------------------------------------------------------------ the same letters in §3 and §4
def _stiffness(axle: float) -> tuple[Array, Array]:
    """K of (z, φ) by the energies of (4.1) with c = axle · c of (3.1), and by (3.1), (3.6); on fixed wheels."""
    car = Car()
    values = (car.m, car.Jy, car.a, car.b, axle * car.c1, axle * car.c2, car.b1, car.b2)
    A, _, _ = derived()
    half = np.array(A.subs(dict(zip(SYMBOLS, values, strict=True))).tolist(), dtype=float)
    places = np.ix_([0, 2], [0, 2])
    return -np.diag([car.m, car.Jy]) @ half[2:, :2], full_car("A").linear.K[places]


def _per_axle() -> Row:
    def ratio(axle: float) -> float:
        half, full = _stiffness(axle)
        return float(half[0, 0] / full[0, 0])

    return Row(
        equation="§4, c1, c2, b1, b2",
        printed="the same letters as in (3.1)",
        derived="per axle in §4, per wheel in §3: twice as large",
        evidence=[
            Evidence(
                measure="heave stiffness of (4.1) over that of (3.1)",
                printed=ratio(1.0),
                derived=ratio(2.0),
                unit="1",
                expected=1.0,
                tolerance=1e-12,
                apart=0.4,
            )
        ],
    )


def _pitch_sense() -> Row:
    half, full = _stiffness(2.0)
    turned = np.diag([1.0, -1.0])
    return Row(
        equation="§4, φ",
        printed="the same letter as in (3.1)",
        derived="φ of §4 is −φ of §3: front up there, nose down here",
        evidence=[
            Evidence(
                measure="coupling of heave and pitch in (4.1) over that in (3.1)",
                printed=float(half[0, 1] / full[0, 1]),
                derived=float((turned @ half @ turned)[0, 1] / full[0, 1]),
                unit="1",
                expected=1.0,
                tolerance=1e-12,
                apart=1.0,
            )
        ],
    )
