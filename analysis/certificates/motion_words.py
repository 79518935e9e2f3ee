"""What is proved, in words: l and δ in each norm beside what a motion reaches, and of the motion from x0 itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fmu_src.quantities import CORNER_WORDS, STATES

from ..bertolino_baksa.balls import ExactSystem, precision
from ..bertolino_baksa.cells import errors_of_states, outputs
from ..bertolino_baksa.certificate import Claim
from ..bertolino_baksa.norms import Metric
from ..bertolino_baksa.open_inputs import Open
from ..bertolino_baksa.tube import Tube
from ..methods.polynomials import Array
from ..reference import Parameters, car_of
from ..tyres import static_loads_of, tyre_heights
from .certificate_words import refuse_exceeded
from .directed import at_least, at_most
from .exact_car import exact_car

Tubes = Sequence[tuple[Tube, Metric]]


def claim_words(
    claims: Sequence[Claim], reached: Array, which: str, who: str = "a reference motion reaches"
) -> list[str]:
    """l and the largest δ, each l beside what a reference motion reaches (claims,), nan where there is none.

    which : x_lin it is, that it is almost stable, and for which times.  who : reaches that.

    Raises NotProvedError if that exceeds it: no proof says so, but a fault in one would.
    """
    lines = [f"x_lin {which} and every eps >= l,"]
    for claim, floor in zip(claims, reached.tolist(), strict=True):
        epsilon, delta = claim.table[-1].tolist()
        refuse_exceeded(claim, floor)
        ratio = f": ratio {claim.floor / floor:.4f}" if floor else ""
        beside = "no reference motion" if np.isnan(floor) else f"{who} {floor:.6g}{ratio}"
        lines.append(
            f"  {claim.norm.name} norm: l <= {at_most(claim.floor, 6)} ({beside}); "
            f"delta up to {at_least(delta)}, at eps = {at_most(epsilon)}"
        )
    return lines


def along(
    parameters: Parameters, system: ExactSystem, tubes: Tubes, which: str, known: Open | None = None
) -> list[str]:
    """Of the motion in the tubes alone: |x − x_lin|, and whether the springs of its tyres only push; not of a tail.

    which : motion, and for how long.  known : of an input that is not known exactly, what that changes.
    """
    bounds = np.max([errors_of_states(*each) for each in tubes], axis=0)
    if known is not None:
        bounds += known.rows(np.eye(system.n)).max(axis=0)
    wider = None if known is None else known.wider
    named = ", ".join(f"{q.name} {at_most(b, 3)} {q.unit}" for q, b in zip(STATES[:7], bounds.tolist(), strict=False))
    low = np.min([_loads(parameters, system, *each, wider) for each in tubes], axis=0)
    worst = int(np.argmin(low))
    load = f"each tyre's load is at least {at_least(low[worst])} N ({CORNER_WORDS[worst]})"
    contact = (
        "so that it stays on the ground; of other starts within delta this is not said"
        if low[worst] > 0.0
        else "so that contact is not proved: where a load is negative the certificate speaks of springs that pull"
    )
    return [f"  of the motion {which}:", f"    |x - x_lin| at most {named}", f"    {load}, {contact}"]


def _loads(parameters: Parameters, system: ExactSystem, tube: Tube, metric: Metric, wider: Array | None) -> Array:
    """Smallest loads (4,) [N] of the tyres in a tube."""
    car = exact_car(car_of(parameters))
    cp, bp = (car.cp1, car.cp1, car.cp2, car.cp2), (car.bp1, car.bp1, car.bp2, car.bp2)

    def forces(x: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> list[Any]:
        heights, rates = tyre_heights(car, x[:7], x[7:], sin, cos)
        return [
            c * (h - height) + b * (dh - rate)
            for c, b, h, dh, height, rate in zip(cp, bp, w[:4], w[4:8], heights, rates, strict=True)
        ]

    with precision(2):
        return outputs(system, tube, metric, forces, wider)[0] + static_loads_of(car_of(parameters))
