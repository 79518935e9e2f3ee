"""The largest number for which something can be proved."""

from __future__ import annotations

import math
from collections.abc import Callable

from .balls import NotProvedError

CLOSE = 1.01  # ratio at which a bisection stops
LEAST = 1e-6  # of the first number: where a search ends


def largest(proved: Callable[[float], object], first: float, close: float = CLOSE) -> float:
    """Largest number, to the ratio `close`, for which proved(number) raises no NotProvedError; 0.0 if none is found.

    From `first` on up or down.
    """
    good, bad, middle = 0.0, math.inf, first
    while bad > close * good and middle > LEAST * first:
        try:
            proved(middle)
            good = middle
        except NotProvedError:
            bad = middle
        middle = 2.0 * good if bad == math.inf else (math.sqrt(good * bad) if good else bad / 2.0)
    return good
