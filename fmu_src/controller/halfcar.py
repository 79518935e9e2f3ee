"""The car in the plane, two degrees of freedom, Eq. (4.1): x = (z, φ, ż, φ̇), x' = A x + B u + C(t).

Signs differ from §3, and are converted here and nowhere else:
  φ    is positive front-UP in §4, nose-DOWN in §3;
  u    is positive DOWN on the body in §4 (front axle u1, rear axle u2), the struts' forces are positive UP;
  c, b are per AXLE in §4, per wheel in §3 and in the parameters of all FMUs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

from ..quantities import PARAMETERS, refuse

Matrix = list[list[float]]
STATE_NAMES = ("body.heave", "body.pitch", "der(body.heave)", "der(body.pitch)")


@dataclass(frozen=True, slots=True, kw_only=True)
class HalfCar:
    """Parameters of the half car and of its cost, as the FMUs name them (struts per wheel), SI units.

    Raises ParameterError with every fault.
    """

    m: float = PARAMETERS["m"].start
    Jy: float = PARAMETERS["Jy"].start
    a: float = PARAMETERS["a"].start
    b: float = PARAMETERS["b"].start
    c1: float = PARAMETERS["c1"].start
    c2: float = PARAMETERS["c2"].start
    b1: float = PARAMETERS["b1"].start
    b2: float = PARAMETERS["b2"].start
    lam: float = PARAMETERS["lambda"].start
    H1: float = PARAMETERS["H1"].start

    def __post_init__(self) -> None:
        faults = [
            PARAMETERS["lambda" if f.name == "lam" else f.name].fault(getattr(self, f.name)) for f in fields(self)
        ]
        if self.a + self.b == 0:
            faults.append("a + b = 0.0 m: wanted a wheelbase > 0")
        refuse(faults)

    @property
    def changes(self) -> list[str]:
        """What is not at its default, in words."""
        table = {f.name: PARAMETERS["lambda" if f.name == "lam" else f.name] for f in fields(self)}
        values = {name: getattr(self, name) for name in table}
        return [f"{q.name} = {values[name]!r} {q.unit}" for name, q in table.items() if values[name] != q.start]

    @property
    def A(self) -> Matrix:
        """A of (4.1). Row 4: the print has −(a c1 + b c2)/J, −(a² c1 − b² c2)/J; energy asks for the other signs."""
        m, J, a, b = self.m, self.Jy, self.a, self.b
        c1, c2, b1, b2 = 2 * self.c1, 2 * self.c2, 2 * self.b1, 2 * self.b2
        return [
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [-(c1 + c2) / m, -(a * c1 - b * c2) / m, -(b1 + b2) / m, -(a * b1 - b * b2) / m],
            [
                -(a * c1 - b * c2) / J,
                -(a**2 * c1 + b**2 * c2) / J,
                -(a * b1 - b * b2) / J,
                -(a**2 * b1 + b**2 * b2) / J,
            ],
        ]

    @property
    def B(self) -> Matrix:
        """B of (4.1). Row 4: the print has −1/J, −1/J, which has no levers and makes the two controls one."""
        m, J = self.m, self.Jy
        return [[0.0, 0.0], [0.0, 0.0], [-1 / m, -1 / m], [-self.a / J, self.b / J]]

    @property
    def Q(self) -> Matrix:
        """State weight of the cost, λ diag(1, H1², 0, 0)."""
        return [[self.lam, 0.0, 0.0, 0.0], [0.0, self.lam * self.H1**2, 0.0, 0.0], [0.0] * 4, [0.0] * 4]

    @property
    def R(self) -> Matrix:
        """Control weight of the cost, the unit matrix."""
        return [[1.0, 0.0], [0.0, 1.0]]

    @property
    def cost(self) -> tuple[Matrix, Matrix, Matrix]:
        """Q, N (4 × 2), R of the cost ½ ∫ (xᵀQx + 2xᵀNu + uᵀRu) dt; nothing couples x and u."""
        return self.Q, [[0.0, 0.0]] * 4, self.R


def half_car_state(
    heave: float, pitch: float, heave_rate: float, pitch_rate: float
) -> tuple[float, float, float, float]:
    """x of (4.1) from the car's heave and nose-down pitch [m, rad] and their rates."""
    return heave, -pitch, heave_rate, -pitch_rate


def strut_forces(u: Sequence[float]) -> tuple[float, float, float, float]:
    """Forces [N] of the struts fl, fr, rl, rr, up on the body, from u1, u2 [N]: half of each axle's force a side."""
    u1, u2 = u
    return -0.5 * u1, -0.5 * u1, -0.5 * u2, -0.5 * u2
