"""Times that an export prints to a few digits: a row is of a motion at another time than it says, by a little.

What a motion can do in that little time counts as a part of what the rows' own digits leave open. ROOM is a margin for
what is not linear, no enclosure: proofs from such a file rest on it, those from exact times do not.
"""

from __future__ import annotations

import numpy as np

from ..bertolino_baksa.balls import Array
from ..errors import InputError
from ..methods.signals import Signal
from ..methods.standard_form import StandardForm

ROOM = 2.0  # over the linear part's slopes, for the full equations', and over the input's change that samples show
STIFF = 0.5  # the most that ROOM |A| may do to |x'| within the time left open, by its spectral radius


def moved(form: StandardForm, x: Array, digits: Array, late: Array, w: Array, loose: Array) -> Array:
    """How far (N, n) motions get within times late (N,) [s] of rows x (N, n), which their digits (N, n) leave open.

    w, loose : (N, m), the input at the rows and how far it gets from that.

        |x'| ≤ s where s ≥ |F(x, w)| + |∂F/∂w| loose + |∂F/∂x| (digits + late s),  and |x(t + late) − x(t)| ≤ late s

    Raises InputError for times so coarse that this bounds nothing.
    """
    if not late.any():
        return np.zeros_like(x)
    A, B, most = ROOM * np.abs(form.A), ROOM * np.abs(form.B), float(late.max())
    if not most * np.abs(np.linalg.eigvals(A)).max() < STIFF:
        raise InputError(f"column 'time': times are printed to {most:g} s, too coarse for this car; wanted more digits")
    known = np.abs(form.rate(x.T, w.T).T) + loose @ B.T + digits @ A.T
    return np.asarray(late[:, None] * np.linalg.solve(np.eye(len(A)) - most * A, known.T).T)


def input_within(signal: Signal, times: Array, late: Array) -> tuple[Array, Array]:
    """A known input at the times (N, m), and how far it gets from that within `late` (N,), corners among it."""
    before, at, after = (signal(np.maximum(times + k * late, 0.0)).T for k in (-1.0, 0.0, 1.0))
    three = np.stack([before, at, after])
    return at, ROOM * (three.max(axis=0) - three.min(axis=0))


def steepest(times: Array, late: Array, heights: Array, digits: Array, bound: float, curved: bool) -> Array:
    """Bounds (N, 4) of |ḣ| around the rows: `bound` [m/s] itself, or as of heights of |ḧ| ≤ bound [m/s²] in each cell.

    Raises InputError where printed times do not tell rows apart.
    """
    if not curved:
        return np.full_like(heights, bound)
    steps, open_ = np.diff(times), 2.0 * np.maximum(late[:-1], late[1:])
    if not np.all(open_ < steps):
        raise InputError(
            f"column 'time': rows {steps.min():g} s apart, printed to {late.max():g} s; wanted more digits"
        )
    rises = np.abs(np.diff(heights, axis=0)) + 2.0 * np.maximum(digits[:-1], digits[1:])
    slopes = rises / (steps - open_)[:, None] + bound * (steps + open_)[:, None]
    return np.maximum(np.vstack([slopes[:1], slopes]), np.vstack([slopes, slopes[-1:]]))
