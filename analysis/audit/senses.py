"""§4 beside §3: letters whose sense changes between them, by the stiffness of both cars on fixed wheels."""

from __future__ import annotations

import numpy as np

from fmu_src.vehicle.parameters import Car

from ..methods.polynomials import Array
from .rows import READING, Evidence, Row
from .section4 import SYMBOLS, derived
from .system import derived as full_car


def rows() -> list[Row]:
    """Stiffness and damping, and the angle of pitch."""
    return [_per_axle(), _pitch_sense()]


def _stiffnesses(axle: float) -> tuple[Array, Array]:
    """K of (z, φ) by the energies of (4.1) with c = axle · c of (3.1), and by (3.1), (3.6); on fixed wheels."""
    car = Car()
    values = (car.m, car.Jy, car.a, car.b, axle * car.c1, axle * car.c2, car.b1, car.b2)
    A, _, _ = derived()
    half = np.array(A.subs(dict(zip(SYMBOLS, values, strict=True))).tolist(), dtype=float)
    places = np.ix_([0, 2], [0, 2])
    return -np.diag([car.m, car.Jy]) @ half[2:, :2], full_car("A").linear.K[places]


def _per_axle() -> Row:
    def ratio(axle: float) -> float:
        half, full = _stiffnesses(axle)
        return float(half[0, 0] / full[0, 0])

    return Row(
        equation="§4, c1, c2, b1, b2",
        printed="the same letters as in (3.1)",
        derived="per axle in §4, per wheel in §3: twice as large",
        kind=READING,
        evidence=[
            Evidence(
                measure="heave stiffness of (4.1) over that of (3.1), c1, c2 read as those of (3.1) and as twice those",
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
    half, full = _stiffnesses(2.0)
    turned = np.diag([1.0, -1.0])
    return Row(
        equation="§4, φ",
        printed="an angle φ of pitch, set in another shape of the letter than that of (3.1)",
        derived="−φ of (3.1): front up in §4, nose down in §3",
        kind=READING,
        evidence=[
            Evidence(
                measure="coupling of heave and pitch in (4.1) over that in (3.1), angle read as φ and as −φ of (3.1)",
                printed=float(half[0, 1] / full[0, 1]),
                derived=float((turned @ half @ turned)[0, 1] / full[0, 1]),
                unit="1",
                expected=1.0,
                tolerance=1e-12,
                apart=1.0,
            )
        ],
    )
