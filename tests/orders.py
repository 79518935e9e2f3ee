"""Observed order of an error: slope in the log-log plane, and how straight the line is."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np


def observed_order(error_at: Callable[[float], float], sizes: Sequence[float]) -> tuple[float, float]:
    """Slope of log error over log size, and the largest departure from that line (in natural logarithms)."""
    x, y = np.log(sizes), np.log([error_at(size) for size in sizes])
    slope, intercept = np.polyfit(x, y, 1)
    return float(slope), float(np.abs(y - slope * x - intercept).max())
