"""The car with seven degrees of freedom, linearized at rest, and the cost that carries section 4 over to it.

    ½ ∫ [ λ (z² + H1² φ² + H2² ψ²) + λs Σ Δ² + λt Σ δ² + λw Σ ż_w² + λa (z̈² + H1² φ̈² + H2² ψ̈²) + 2 Σ u² ] dt

over four struts (travel Δ, force u) and four wheels (tyre deflection δ over a level road, vertical speed ż_w). Two
equal forces u make an axle's 2u, and 2 (u² + u²) = (2u)²: they cost what the axle's force costs in the half car, to
which the design for heave and pitch tends with stiff tyres under light wheels. x = (q, q̇), u up on the body.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields

from ..quantities import PARAMETERS, Quantity, refuse
from ..vehicle.linear import Matrix, extensions, linearized, wheel_heights
from ..vehicle.parameters import Car

N_STATES, N_STRUTS = 14, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class FullCar:
    """A car and the weights of its cost, SI units. Raises ParameterError with every fault."""

    car: Car = field(default_factory=Car)
    lam: float = PARAMETERS["lambda"].start
    H1: float = PARAMETERS["H1"].start
    H2: float = PARAMETERS["H2"].start
    lambda_travel: float = 0.0
    lambda_tyre: float = 0.0
    lambda_hop: float = 0.0
    lambda_acceleration: float = 0.0

    def __post_init__(self) -> None:
        refuse(q.fault(value) for q, value in self._weights())

    @property
    def changes(self) -> list[str]:
        """What is not at its default, in words."""
        car = [(PARAMETERS[f.name], getattr(self.car, f.name)) for f in fields(Car)]
        return [f"{q.name} = {value!r} {q.unit}" for q, value in (*car, *self._weights()) if value != q.start]

    def _weights(self) -> list[tuple[Quantity, float]]:
        names = [f.name for f in fields(self) if f.name != "car"]
        return [(PARAMETERS["lambda" if name == "lam" else name], getattr(self, name)) for name in names]

    @property
    def A(self) -> Matrix:
        """A (14 × 14) of x' = A x + B u, the linear part of (3.10)."""
        return linearized(self.car).A

    @property
    def B(self) -> Matrix:
        """B (14 × 4): forces of the struts fl, fr, rl, rr, up on the body."""
        return linearized(self.car).Bu

    @property
    def cost(self) -> tuple[Matrix, Matrix, Matrix]:
        """Q (14 × 14), N (14 × 4), R (4 × 4) of the cost ½ ∫ (xᵀQx + 2xᵀNu + uᵀRu) dt."""
        n, size = N_STATES, N_STATES + N_STRUTS
        W = [[0.0] * size for _ in range(size)]
        for weight, row in self._forms():
            for i in (i for i, x in enumerate(row) if weight and x):
                for j, y in enumerate(row):
                    W[i][j] += weight * row[i] * y
        return [row[:n] for row in W[:n]], [row[n:] for row in W[:n]], [row[n:] for row in W[n:]]

    def _forms(self) -> Iterator[tuple[float, Sequence[float]]]:
        """Weights, each with the linear form of (x, u) (18) whose square it is the weight of."""
        at_rest, still, no_force = [0.0] * 7, [0.0] * 7, [0.0] * N_STRUTS
        linear = linearized(self.car)
        for i, arm in enumerate((1.0, self.H2, self.H1)):  # heave, roll, pitch
            yield self.lam * arm**2, [float(j == i) for j in range(N_STATES + N_STRUTS)]
            yield self.lambda_acceleration * arm**2, [*linear.A[7 + i], *linear.Bu[7 + i]]
        for travel, wheel in zip(extensions(self.car), wheel_heights(self.car), strict=True):
            yield self.lambda_travel, [*travel, *still, *no_force]
            yield self.lambda_tyre, [*wheel, *still, *no_force]
            yield self.lambda_hop, [*at_rest, *wheel, *no_force]
        for k in range(N_STRUTS):
            yield 2.0, [float(j == N_STATES + k) for j in range(N_STATES + N_STRUTS)]
