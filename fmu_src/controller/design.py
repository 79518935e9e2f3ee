"""A controller design as data: gains of u = K x for the infinite horizon and, by time to go, for the finite one.

The designs for the default parameters lie in `designs`, and in the FMU's resources; reading one and looking up a gain
take the standard library alone.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..quantities import ParameterError
from ..vehicle.parameters import Car
from .fullcar import FullCar
from .gain_table import Gain, GainTable, tabulated
from .halfcar import HalfCar
from .riccati import flow, infinite_horizon, without_cross

if TYPE_CHECKING:
    from .riccati import Array

Model = HalfCar | FullCar

FILE_NAMES = {HalfCar: "lqr_design.json", FullCar: "lqr_design_full_car.json"}
# Slowest closed-loop time constants to go: from there on the gain changes by less than e^-32.
SETTLED = 16.0


@dataclass(frozen=True, slots=True)
class Design:
    """Gains for one model of the car; a part that was not asked for is None."""

    car: Model
    infinite: Gain | None = None
    finite: GainTable | None = None

    @classmethod
    def of(cls, data: dict[str, Any]) -> Design:
        """The design from its plain data (`dataclasses.asdict`, through JSON or not)."""
        model, forever, table = dict(data["car"]), data["infinite"], data["finite"]
        car = FullCar(**{**model, "car": Car(**model["car"])}) if "car" in model else HalfCar(**model)
        return cls(car, None if forever is None else tuple(forever), None if table is None else GainTable.of(table))

    def serves(self, car: Model, horizon: str, span: float) -> bool:
        """Whether this design holds the gains for this car, horizon and span [s] of time to go."""
        if car != self.car:
            return False
        if horizon == "infinite":
            return self.infinite is not None
        return self.finite is not None and (self.finite.settled or span <= self.finite.edges[-1])


def problem(car: Model) -> tuple[Array, Array, Array, Array, Array]:
    """A, B, Q, R of x' = A x + B v with the cost ½ ∫ (xᵀQx + vᵀRv) dt, and K0 of u = v + K0 x, as arrays."""
    import numpy as np

    A, B = np.array(car.A), np.array(car.B)
    Q, N, R = map(np.array, car.cost)
    A, Q, K0 = without_cross(A, B, Q, R, N)
    return A, B, Q, R, K0


def design(car: Model, *, infinite: bool, span: float | None) -> Design:
    """Solve the Riccati equations of this car: algebraic if `infinite`, backward over `span` [s] if given.

    Raises ImportError where numpy or scipy are missing, ParameterError, which names all that is not at its default,
    where there is no design.
    """
    import numpy as np

    try:
        with np.errstate(over="raise", invalid="raise"):
            A, B, Q, R, K0 = problem(car)
            forever = tuple((K0 + infinite_horizon(A, B, Q, R)[1]).ravel().tolist()) if infinite else None
            table = None if span is None else _gain_table(A, B, Q, R, K0, span)
    except FloatingPointError as error:
        raise ParameterError([f"{', '.join(car.changes)}: the design leaves the finite numbers: {error}"]) from error
    except (ParameterError, np.linalg.LinAlgError) as error:
        raise ParameterError([f"{', '.join(car.changes) or 'the default car'}: {error}"]) from error
    return Design(car, forever, table)


def _gain_table(A: Array, B: Array, Q: Array, R: Array, K0: Array, span: float) -> GainTable:
    """K(s) up to the span [s], or to where it has settled."""
    import numpy as np

    later, poles = flow(A, B, Q, R)
    settled = float(SETTLED / -poles.real.max())
    K = np.linalg.solve(R, B.T)
    edges, coefficients = tabulated(later, lambda L: K0 - K @ L, len(A), min(span, settled))  # K = −R⁻¹ Bᵀ L
    return GainTable(edges, coefficients, settled < span)


def store(made: Design, folder: Path) -> Path:
    """Write the design as JSON (numbers as repr, read back bit for bit); returns the file."""
    path = folder / FILE_NAMES[type(made.car)]
    path.write_text(json.dumps(asdict(made)), encoding="utf-8")
    return path


@lru_cache(maxsize=4)
def stored(path: Path) -> Design | None:
    """The design in this file, if there is one."""
    if not path.is_file():
        return None
    return Design.of(json.loads(path.read_text(encoding="utf-8")))
