"""How far motions really get on inputs of a class through given rows: no proof, a number beside every proved one.

The inputs leave the chords between rows as far as the class lets them: not at all, to sides by chance, and for each
mode of the linear part to the sides that drive it in resonance, at PHASES.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..methods.modes import modes
from ..methods.standard_form import StandardForm
from .adversary import INSTANTS, STEP, by_deltas, crowds, slowest, stepped
from .balls import Array
from .input_rows import InputRows, RowClass
from .norms import Norm

PHASES = np.arange(8) * np.pi / 4.0


def reached(form: StandardForm, norms: Sequence[Norm], rows: InputRows, x0: Array) -> Array:
    """sup N(x − x_lin) (norms,) over these inputs, x and x_lin from x0 (n,)."""
    return _furthest(form, norms, rows, x0[:, None], x0[:, None], _signs(form, rows)).max(axis=1)


def reached_from(
    form: StandardForm, norms: Sequence[Norm], rows: InputRows, x0: Array, deltas: Sequence[Array]
) -> list[Array]:
    """For each norm, sup N(x − x_lin) (K,) over starts at N(x(0) − x0) = its deltas (K,), along the chords.

    Until the slowest mode's time constant: what goes furthest has gone there by then.
    """
    span = np.linspace(0.0, slowest(form), INSTANTS)
    early = rows.until(float(span[-1]))
    crowd = crowds(form, norms, deltas, span, np.zeros((len(x0), INSTANTS)))
    level = np.zeros((*early.slopes.shape, 1))
    return by_deltas(_furthest(form, norms, early, x0[:, None] + crowd, x0[:, None], level), deltas)


def _furthest(
    form: StandardForm, norms: Sequence[Norm], rows: InputRows, x: Array, x_lin: Array, signs: Array
) -> Array:
    """sup N(x − x_lin) (norms, K) from x, x_lin (n, K or 1) on, on heights to these sides (steps, k, K or 1)."""
    columns = max(x.shape[1], signs.shape[2])
    x, z = (np.repeat(y, columns if y.shape[1] == 1 else 1, axis=1) for y in (x, x_lin))
    found = np.zeros((len(norms), columns))
    for h, inputs in _steps(rows, signs):
        w = [np.broadcast_to(v, (len(v), columns)) for v in inputs]
        x = stepped(form.rate, x, h, *w)
        z = stepped(lambda y, v: form.A @ y + form.B @ v, z, h, *w)
        found = np.maximum(found, [norm(x - z) for norm in norms])
    return found


def _signs(form: StandardForm, rows: InputRows) -> Array:
    """Sides (steps, k, K) to which the heights leave the chords of the steps: −1, 0 or 1."""
    steps, k = rows.slopes.shape
    linear, middle = modes(form.A), (rows.times[:-1] + rows.times[1:]) / 2.0
    chance = np.random.default_rng(0).choice([-1.0, 1.0], (steps, k))
    found = [np.zeros((steps, k)), chance]
    for rate, row in zip(linear.eigenvalues, linear.K_inverse @ form.B[:, :k], strict=True):
        if rate.imag > 0.0:
            found += [np.sign(np.real(np.exp(1j * (phase - rate.imag * middle))[:, None] * row)) for phase in PHASES]
    return np.stack(found, axis=2)


def _steps(rows: InputRows, signs: Array) -> Iterator[tuple[float, list[Array]]]:
    """Steps [s] no longer than STEP, two or more from row to row, and w (m, K) at begin, middle and end of each."""
    for width, heights, slope, side in zip(rows.steps.tolist(), rows.heights, rows.slopes, signs, strict=False):
        parts = 2 * int(np.ceil(width / (2.0 * STEP)))
        h = width / parts
        for part in range(parts):
            inputs = []
            for s in (0.0, 0.5, 1.0):
                up, rate = beside(rows.between, width, (part + s) * h, slope[:, None], side)
                chord = heights[:, None] + (part + s) * h * slope[:, None]
                inputs.append(np.concatenate([chord + up, slope[:, None] + rate]))
            yield h, inputs


def beside(between: RowClass, width: float, s: float, slope: Array, side: Array) -> tuple[Array, Array]:
    """How far (k, K) a height of the class may be off its chord of this slope (k, 1), 0 ≤ s ≤ width, and its rate.

    side : (k, K) from −1 to 1, the share of the furthest height below or above, which is furthest at all s.
    """
    H, sign = between.bound, np.sign(side)
    if between.kind == "curv":
        return side * H * s * (width - s) / 2.0, side * H * (width / 2.0 - s)
    up, down = np.maximum(H - sign * slope, 0.0), np.maximum(H + sign * slope, 0.0)
    rising = s * up <= (width - s) * down
    return side * np.where(rising, s * up, (width - s) * down), side * np.where(rising, up, -down)
