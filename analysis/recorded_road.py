"""The road under the wheels as a run exported it: between the rows, the cubic on which the vehicle drove."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PPoly

from fmu_src.quantities import ROAD_BOWS, ROAD_HEIGHTS, ROAD_RATES

from .trajectory import Trajectory


def recorded_road(trajectory: Trajectory) -> PPoly:
    """Heights (…, 4) [m] under fl, fr, rl, rr at times (…) [s]; its derivative is the rate.

    Within a step it is the cubic of height and rate at the start, of the bow, and of the height at the end. The rate at
    the end, a right-hand limit, would be wrong where the step ends on a corner.
    """
    tables = (ROAD_HEIGHTS, ROAD_RATES, ROAD_BOWS)
    h, dh, bow = (trajectory.columns([q.name for q in table]) for table in tables)
    step, bows = np.diff(trajectory.time)[:, None], 8.0 * bow[1:]
    quadratic = np.diff(h, axis=0) - step * dh[:-1] + bows
    return PPoly(np.array([-bows / step**3, quadratic / step**2, dh[:-1], h[:-1]]), trajectory.time)
