"""e = x − x_lin of the full equations by Picard's iteration: e' = A e + R(x_lin + e, w), R = F(x, w) − A x − B w.

As x_lin is known, the digits of e are its own. Each iteration asks for R at all times of a window at once, and
integrates e^(A(t − s)) R(s) by Simpson's rule, of order 4 in the step. The window is halved until iterations converge.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from ..errors import InputError
from .polynomials import Array
from .standard_form import StandardForm

WINDOW = 1024  # half steps, even: few iterations suffice, and its numbers stay in the cache
ITERATIONS = 25  # of a window, before it is halved
CLOSE, ROUND_OFF = 1e-10, 1e-15  # of the last change, over the largest of e, and of x and what A does to it in a step


def deviation(form: StandardForm, x_lin: Array, w: Array, start: Array, h: float) -> Array:
    """e (n, 2 N + 1) at even times a distance h [s] apart, from e = start (n,) at the first of them.

    x_lin (n, 2 N + 1) and w (m, 2 N + 1) there; w is smooth between the first and the last.

    Raises InputError where the motion cannot be integrated.
    """
    e, flow = np.zeros_like(x_lin), expm(h * form.A)
    e[:, 0] = start
    begin, width = 0, WINDOW
    while begin < x_lin.shape[1] - 1:
        window = slice(begin, begin + width + 1)
        found = _on_window(form, flow, x_lin[:, window], w[:, window], e[:, begin], h)
        if found is not None:
            e[:, window] = found
            begin += width
        elif width > 2:
            width //= 2
        else:
            raise InputError(f"the motion cannot be integrated in steps of {2.0 * h:g} s")
    return e


def _on_window(form: StandardForm, flow: Array, x_lin: Array, w: Array, start: Array, h: float) -> Array | None:
    """e (n, 2 K + 1) on a window, None if the iterations do not converge; flow = e^(A h)."""
    e, twice, back = np.broadcast_to(start[:, None], x_lin.shape), flow @ flow, np.linalg.inv(flow)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(ITERATIONS):
            x = x_lin + e
            R = form.rate(x, w) - form.A @ x - form.B @ w
            first, middle, last = R[:, :-1:2], R[:, 1::2], R[:, 2::2]
            new = np.empty_like(x)
            step = (twice @ first + 4.0 * (flow @ middle) + last) * (h / 3.0)
            new[:, ::2] = _chained(twice, np.column_stack([start, step]))
            half = (5.0 * (flow @ first) + 8.0 * middle - back @ last) * (h / 12.0)  # of the parabola through all three
            new[:, 1::2] = flow @ new[:, :-1:2] + half
            change, size, whole, moved = (np.abs(v).max() for v in (new - e, new, x, h * (form.A @ x)))
            if change <= CLOSE * size + ROUND_OFF * (whole + moved):
                return new
            e = new
    return None


def _chained(flow: Array, added: Array) -> Array:
    """v_k = flow v_(k−1) + added_k for all columns: sums over 2, 4, 8 … of them."""
    v, span = added.copy(), 1
    while span < v.shape[1]:
        v[:, span:] += flow @ v[:, :-span]
        flow, span = flow @ flow, 2 * span
    return v
