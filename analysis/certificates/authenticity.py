"""Is an export authentic: do its rows as a whole obey the equations of motion between them?

Quintics have the rows' q, q̇ and the accelerations that the equations give there. Along them the equations are obeyed
but for what a quintic misses of a motion, what the road leaves open, and what digits and integrator changed. Nothing is
integrated, so no row spoils the verdict on others: a defect shows in its own cell, between two rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fmu_src.road.profiles import SNAP
from fmu_src.vehicle.equations import equations_of_motion
from fmu_src.vehicle.parameters import Car

from ..bertolino_baksa.balls import NotProvedError
from ..bertolino_baksa.hermite import NODES, quintics, responses
from ..bertolino_baksa.sampled import Samples
from ..car import car_form
from ..discrepancy import scales
from ..methods.polynomials import Array
from ..methods.signals import Signal

MISSED = 2.0 / 1920.0  # of the fourth difference of q̈: sup |(s³(1 − s)³)''|/720; twice, as it is that of rows around
GROWS = 4.0  # an integrator's error is made in a quarter of a radian or more: its defect is so much of q̈'s maximum
INSIDE = 1e-6  # of a step: inputs at rows are taken so far inside the cell, on its own side of a corner


@dataclass(frozen=True, slots=True)
class KnownRoad:
    """What is known of w = (h, ḣ) in each cell: at both rows and at the nodes, and how far it may be off."""

    ends: Array  # (cells, 2, 8)
    nodes: Array  # (cells, 8, 7)
    peak: Array  # (cells, 8)
    mean: Array  # (cells, 8)
    smooth: Array  # (cells,), False for cells with a corner of the road inside, which no quintic can follow
    after: Array  # (8,), just after the last row


def profile(signal: Signal, corners: Sequence[float], times: Array) -> KnownRoad:
    """A road that is known exactly, its corners too [s]. Raises NotProvedError for times before the signal's."""
    if times[0] < signal.begin:
        raise NotProvedError(f"the export begins at {times[0]:g} s, before the road is known")
    steps, cells = np.diff(times), len(times) - 1
    inside = times[:-1, None] + steps[:, None] * np.array([INSIDE, 1.0 - INSIDE])
    nodes = times[:-1, None] + steps[:, None] * (1.0 + NODES) / 2.0
    ends, at_nodes = (signal(t.ravel()).reshape(8, cells, -1) for t in (inside, nodes))
    smooth = np.ones(cells, dtype=bool)
    for corner in corners:
        smooth &= (corner < times[:-1] + SNAP) | (corner > times[1:] - SNAP)
    none, after = np.zeros((cells, 8)), signal(times[-1] + INSIDE * steps[-1])[:, 0]
    return KnownRoad(ends.transpose(1, 2, 0), at_nodes.swapaxes(0, 1), none, none, smooth, after)


def sampled(rows: Samples) -> KnownRoad:
    """A road whose heights are known at the rows."""
    left, right = rows.inputs[:, 0, :, None], rows.inputs[:, 1, :, None]
    nodes = left + (right - left) * (1.0 + NODES) / 2.0
    return KnownRoad(rows.inputs, nodes, rows.peak, rows.mean, np.ones(len(nodes), dtype=bool), right[-1, :, 0])


@dataclass(frozen=True, slots=True)
class Defect:
    """The largest defect of the equations over what is allowed, and where."""

    ratio: float
    cell: int  # between the rows `cell` and `cell` + 1, from 0
    coordinate: int
    size: float  # [m/s² or rad/s²]
    out: int  # number of cells that are out of what is allowed


@dataclass(frozen=True, slots=True)
class Export:
    """Rows (N,) that are judged, and how good they are."""

    times: Array  # [s]
    x: Array  # (N, 14)
    digits: Array  # (N, 14), what the printed digits leave open
    accelerations: Array | None  # (N, 7), where they are exported too,
    their_digits: Array | None  # (N, 7)
    own: float  # what the run may deviate from a motion, over each state's maximum


def defect(car: Car, road: KnownRoad, export: Export) -> Defect:
    """The defect along the quintics, and that of the exported accelerations at each cell's end."""
    x = export.x
    ends = np.stack([x[:-1], x[1:]], axis=2)
    rates = _accelerations(car, ends, road.ends.swapaxes(1, 2))
    found = quintics(export.times, x, rates.swapaxes(1, 2))
    sizes = np.abs(_accelerations(car, found.values, road.nodes) - found.slopes[:, 7:]).max(axis=2)
    last = _accelerations(car, x[-1:, :, None], road.after[None, :, None])[:, :, 0]
    behind = np.concatenate([rates[:, :, 0], last])  # at corners, of the road behind them
    allowed = MISSED * _fourth_differences(rates[:, :, 0]) + GROWS * export.own * scales(behind)
    allowed += _digits(car, found.half, export.digits) + _open(car, road)
    if export.accelerations is not None and export.their_digits is not None:
        wrong = [np.abs(export.accelerations[1:] - side) for side in (rates[:, :, 1], behind[1:])]
        sizes = np.maximum(sizes, np.min(wrong, axis=0))
        allowed += export.their_digits[1:]
    ratio = np.where(road.smooth[:, None], sizes / allowed, 0.0)
    cell, coordinate = (int(i) for i in np.unravel_index(np.argmax(ratio), ratio.shape))
    out = int(np.count_nonzero(~(ratio <= 1.0).all(axis=1)))
    return Defect(float(ratio[cell, coordinate]), cell, coordinate, float(sizes[cell, coordinate]), out)


def _accelerations(car: Car, x: Array, w: Array) -> Array:
    """q̈ (cells, 7, k) of states (cells, 14, k) and inputs (cells, 8, k)."""
    q, v, h, dh = (part.swapaxes(0, 1) for part in (x[:, :7], x[:, 7:], w[:, :4], w[:, 4:]))
    found, _, _ = equations_of_motion(car, np.sin, np.cos)(q, v, np.zeros(4), h, dh)
    return np.stack(found, axis=1)


def _fourth_differences(rates: Array) -> Array:
    """Largest |Δ⁴| (cells, 7) among rows around each cell, from values (cells, 7) at the cells' first rows."""
    if len(rates) < 5:
        return np.full(rates.shape, np.abs(rates).max(axis=0) * 2.0**4)
    found = np.pad(np.abs(np.diff(rates, 4, axis=0)), ((4, 4), (0, 0)), mode="edge")
    return np.asarray(sliding_window_view(found, 5, axis=0).max(axis=2))


def _digits(car: Car, half: Array, digits: Array) -> Array:
    """What the rows' digits may do to the defect (cells, 7)."""
    A, most, h = np.abs(car_form(car, order=1).A[7:]), np.maximum(digits[:-1], digits[1:]), half[:, None]
    at_rows = np.stack([most[:, :7], h * most[:, 7:], h**2 * (most @ A.T)])
    q, v, a = (
        np.tensordot(np.abs(responses(order)).max(axis=0).reshape(2, 3).sum(axis=0), at_rows, 1) / h**order
        for order in range(3)
    )
    return np.asarray(a + np.hstack([q, v]) @ A.T)


def _open(car: Car, road: KnownRoad) -> Array:
    """What the open road may do to the defect (cells, 7): it moves the car from the first row to the second."""
    B = np.abs(car_form(car, order=1).B[7:])
    at_q, at_v, _ = np.abs(responses(2)).max(axis=0)[3:]
    # over a width 2h by at most mean · 2h in velocity and mean · 2h² in position, here in u
    return np.asarray(road.peak @ B.T + 2.0 * (at_q + at_v) * (road.mean @ B.T))
