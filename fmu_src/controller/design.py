"""A controller design as data: gains of u = K x for the infinite horizon and, by time to go, for the finite one.

The design for the default parameters is made when the FMU is built and stored in its resources; reading it and
looking up a gain take the standard library alone.
"""

from __future__ import annotations

import json
from bisect import bisect_right
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..quantities import ParameterError
from .halfcar import HalfCar
from .riccati import finite_horizon, infinite_horizon, riccati_rate

if TYPE_CHECKING:
    from .riccati import Array

Gain = tuple[float, ...]
"""K (2 × 4), row after row."""

FILE_NAME = "lqr_design.json"
# Of the fastest closed-loop time constant: the cubic between two entries is then right to 2e-8 of the gain.
RESOLUTION = 0.03

# Slowest closed-loop time constants to go: from there on the gain changes by less than e^-32.
SETTLED = 16.0
MOST_ENTRIES = 20_000


@dataclass(frozen=True, slots=True)
class GainTable:
    """K(s) and dK/ds at times to go s [s]; a cubic between them that has both, and the last gain beyond."""

    to_go: tuple[float, ...]
    gains: tuple[Gain, ...]
    slopes: tuple[Gain, ...]
    settled: bool  # whether the last gain is that of all longer times to go

    def gain(self, s: float) -> Gain:
        """K (2 × 4, row after row) at the time to go s; s is taken into the table's range."""
        s = min(max(s, 0.0), self.to_go[-1])
        i = min(bisect_right(self.to_go, s), len(self.to_go) - 1) - 1
        h = self.to_go[i + 1] - self.to_go[i]
        x = (s - self.to_go[i]) / h
        y = 1.0 - x
        f0, f1, d0, d1 = (1 + 2 * x) * y * y, (1 + 2 * y) * x * x, h * x * y * y, -h * x * x * y
        columns = zip(self.gains[i], self.gains[i + 1], self.slopes[i], self.slopes[i + 1], strict=True)
        return tuple(f0 * a + f1 * b + d0 * c + d1 * d for a, b, c, d in columns)


@dataclass(frozen=True, slots=True)
class Design:
    """Gains for one half car; a part that was not asked for is None."""

    car: HalfCar
    infinite: Gain | None = None
    finite: GainTable | None = None

    @classmethod
    def of(cls, data: dict[str, Any]) -> Design:
        """The design from its plain data (`dataclasses.asdict`, through JSON or not)."""
        forever, table = data["infinite"], data["finite"]
        if table is not None:
            gains, slopes = (tuple(map(tuple, table[key])) for key in ("gains", "slopes"))
            table = GainTable(tuple(table["to_go"]), gains, slopes, table["settled"])
        return cls(HalfCar(**data["car"]), None if forever is None else tuple(forever), table)

    def serves(self, car: HalfCar, horizon: str, span: float) -> bool:
        """Whether this design holds the gains for this car, horizon and span [s] of time to go."""
        if car != self.car:
            return False
        if horizon == "infinite":
            return self.infinite is not None
        return self.finite is not None and (self.finite.settled or span <= self.finite.to_go[-1])


def design(car: HalfCar, *, infinite: bool, span: float | None) -> Design:
    """Solve the Riccati equations of this half car: algebraic if `infinite`, backward over `span` [s] if given.

    Raises ImportError where numpy, scipy or (infinite horizon) control are missing, ParameterError, which names all
    that is not at its default, where there is no design.
    """
    import numpy as np

    A, B, Q, R = (np.array(M) for M in (car.A, car.B, car.Q, car.R))
    try:
        forever = tuple(infinite_horizon(A, B, Q, R)[1].ravel().tolist()) if infinite else None
        table = None if span is None else _gain_table(A, B, Q, R, span)
    except (ParameterError, np.linalg.LinAlgError) as error:
        raise ParameterError([f"{', '.join(car.changes) or 'the default half car'}: {error}"]) from error
    return Design(car, forever, table)


def _gain_table(A: Array, B: Array, Q: Array, R: Array, span: float) -> GainTable:
    """K(s) up to the span [s], or to where it has settled, on a grid that its fastest change asks for."""
    import numpy as np
    from scipy.linalg import solve_continuous_are

    try:
        closed = A - B @ np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R))
    except np.linalg.LinAlgError:  # no damping and no weight: L does not settle
        closed = A
    poles = np.linalg.eigvals(closed)
    slowest = -poles.real.max()
    reach = min(span, SETTLED / slowest) if slowest > 0.0 else span
    entries = 2 + int(min(reach * np.abs(poles).max() / RESOLUTION, 2.0 * MOST_ENTRIES))
    if entries > MOST_ENTRIES:
        raise ParameterError(
            [
                f"{span:g} s of control with poles up to {np.abs(poles).max():.3g}/s: wanted a slower "
                f"or shorter control, whose gain table has at most {MOST_ENTRIES} entries"
            ]
        )
    to_go = np.linspace(0.0, reach, entries)
    L = finite_horizon(A, B, Q, R, to_go)
    rates = np.array([riccati_rate(each, A, B, Q, R) for each in L])
    K, dK = (-np.linalg.solve(R, B.T) @ each for each in (L, rates))  # K = −R⁻¹ Bᵀ L
    gains, slopes = (tuple(tuple(k.ravel().tolist()) for k in table) for table in (K, dK))
    return GainTable(tuple(to_go.tolist()), gains, slopes, settled=bool(reach < span))


def store(made: Design, folder: Path) -> None:
    """Write the design as JSON (numbers as repr, read back bit for bit)."""
    (folder / FILE_NAME).write_text(json.dumps(asdict(made)), encoding="utf-8")


def stored(folder: Path) -> Design | None:
    """The design in this folder, if there is one."""
    path = folder / FILE_NAME
    if not path.is_file():
        return None
    return Design.of(json.loads(path.read_text(encoding="utf-8")))
