"""A floor in under a second: the scalar comparison V' = −α V + ‖R̄(|x_lin| + n V)‖_S, with no reference but x_lin.

It proves as much as it says, for all t ≥ 0 on a road that ends flat, but it says too much by a factor of 2 to 5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import fmpq

from .balls import ExactSystem, NotProvedError
from .cells import inputs, ranges, widths
from .growth import perturbed
from .majorant import majorant
from .norms import Metric, Norm
from .proof import rest_growth
from .taylor import find_pieces
from .tube import at_end, prove_linear

ROOM = 2.0  # of the box, over x_lin


def quick_floors(
    system: ExactSystem, metric: Metric, norms: Sequence[Norm], x0: Sequence[float], stop: fmpq
) -> list[float]:
    """l in each norm. Raises NotProvedError if the road never ends, or the motion is too large for this comparison."""
    if system.period != 0:
        raise NotProvedError("the quick comparison needs a road that ends flat")
    pieces = tuple(find_pieces(system, x0, stop, linear_only=True))
    off = prove_linear(system, metric, pieces)
    spread = np.hstack([ranges(pieces, off, metric), inputs(system, metric, pieces)])
    bound = majorant(system, ROOM * spread.max(axis=0) + 1e-9)
    start = np.zeros_like(spread)
    top, end = perturbed(metric, bound, widths(pieces, metric), start, spread[:, :, None], np.zeros(1))
    last = metric.length(at_end(pieces[-1].linear)) + float(off[-1])
    size = (last + float(end[0])) * (1.0 + 1e-12)
    L = rest_growth(system, metric, size)
    if not metric.alpha > L:
        raise NotProvedError("the quick comparison cannot follow so large a motion")
    later = float(end[0]) + L * size / (metric.alpha - L)
    return [metric.of(norm) * max(float(top.max()), later) * (1.0 + 1e-9) for norm in norms]
