"""The other side of a certificate: how far motions really get. No proof, but a number beside every proved one.

All motions are integrated at once (Runge–Kutta of order 4 on the full equations), in steps that meet the corners.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import expm

from ..methods.linear_response import linear_response
from ..methods.signals import Piece, Signal
from ..methods.standard_form import StandardForm
from .balls import Array
from .norms import Norm

STEP = 5e-4  # s, at most
SAMPLING = 5e-4  # s, of the true floor
CANDIDATES = 64  # starts that the linear part proposes
ROUNDS = 6  # of local search around the worst of them
CROWD = 48  # starts of a round
FEW = 8  # candidates are skipped for a picture: the best have neighbours nearly as good


def motions(
    form: StandardForm, signal: Signal, x0: Array, stop: float, step: float = STEP
) -> Iterator[tuple[float, Array]]:
    """(t, x (n, K)) of all motions from the starts x0 (n, K), step by step, from the signal's begin to `stop` [s]."""
    edges = [t for t in signal.edges if t < stop] + [stop]
    x, ones = x0, np.ones(x0.shape[1])
    yield edges[0], x
    for piece, begin, end in zip(signal.pieces, edges, edges[1:], strict=False):
        times = np.linspace(begin, end, int(np.ceil((end - begin) / step)) + 1)
        for t, later in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
            h = later - t
            w0, w1, w2 = (piece(s)[:, None] * ones for s in (t, t + 0.5 * h, later))
            k1 = form.rate(x, w0)
            k2 = form.rate(x + 0.5 * h * k1, w1)
            k3 = form.rate(x + 0.5 * h * k2, w1)
            k4 = form.rate(x + h * k3, w2)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            yield later, x


def excursions(
    form: StandardForm, signal: Signal, norms: Sequence[Norm], x0: Array, off: Array, stop: float, step: float = STEP
) -> Array:
    """sup N(x − x_lin) (norms, K) up to `stop` of the motions from x0 + off (n, K), x_lin from x0 (n,)."""
    found = np.zeros((len(norms), off.shape[1]))
    rows = list(motions(form, signal, x0[:, None] + off, stop, step))
    x_lin = linear_response(form.A, form.B, x0, signal, np.array([t for t, _ in rows]))
    for (_, x), lin in zip(rows, x_lin.T, strict=True):
        found = np.maximum(found, [norm(x - lin[:, None]) for norm in norms])
    return found


def reference_floor(form: StandardForm, signal: Signal, norms: Sequence[Norm], x0: Array, stop: float) -> Array:
    """sup N(x − x_lin) (norms,) up to `stop` [s] of the motion from x0 itself, tightly integrated: the true floor."""
    from scipy.integrate import solve_ivp  # takes a moment to import

    times, e = [], []
    edges, x = [t for t in signal.edges if t < stop] + [stop], np.asarray(x0, dtype=float)
    for piece, begin, end in zip(signal.pieces, edges, edges[1:], strict=False):

        def rate(t: float, y: Array, piece: Piece = piece) -> Sequence[float]:
            return form.equations(y.tolist(), piece(t).tolist(), math.sin, math.cos)

        at = np.linspace(begin, end, max(2, int((end - begin) / SAMPLING)))
        solution = solve_ivp(rate, (begin, end), x, "DOP853", at, rtol=1e-11, atol=1e-16)
        times.append(solution.t)
        e.append(solution.y)
        x = solution.y[:, -1]
    off = np.concatenate(e, axis=1) - linear_response(form.A, form.B, x0, signal, np.concatenate(times))
    return np.array([norm(off).max() for norm in norms])


def worst(
    form: StandardForm, signal: Signal, norm: Norm, x0: Array, delta: float, stop: float, rounds: int = ROUNDS
) -> tuple[float, Array]:
    """A large sup N(x − x_lin) over the starts with N(x(0) − x0) ≤ delta, and its start's offset (n,).

    The first starts are those that the linear part carries furthest, at many times; then a search around the worst.
    """
    rng = np.random.default_rng(0)
    vertices = _vertices(form, norm, stop)
    crowd = np.concatenate([vertices, -vertices], axis=1) * delta
    best, at = 0.0, crowd[:, 0]
    for k in range(rounds + 1):
        reached = excursions(form, signal, [norm], x0, crowd, stop)[0]
        if reached.max() > best:
            best, at = float(reached.max()), crowd[:, int(np.argmax(reached))]
        near = at[:, None] + delta * 0.5**k * rng.normal(size=(len(x0), CROWD)) / norm(np.eye(len(x0)))[:, None] / 4.0
        crowd = near * delta / norm(near)
    return best, at


def reached(
    form: StandardForm, signal: Signal, norms: Sequence[Norm], x0: Array, deltas: Sequence[Array], stop: float
) -> list[Array]:
    """For each norm, sup N(x − x_lin) (K,) up to `stop` [s] over starts at N(x(0) − x0) = its deltas (K,).

    Every FEW-th of the first starts of `worst`, without its search and all in one integration: for a picture.
    """
    crowds = []
    for norm, delta in zip(norms, deltas, strict=True):
        vertices = _vertices(form, norm, stop)[:, ::FEW]
        both = np.concatenate([vertices, -vertices], axis=1)
        crowds.append((both[:, None, :] * delta[:, None]).reshape(len(x0), -1))
    found = excursions(form, signal, norms, x0, np.concatenate(crowds, axis=1), stop)
    own = np.split(found, np.cumsum([crowd.shape[1] for crowd in crowds])[:-1], axis=1)
    return [own[i][i].reshape(len(delta), -1).max(axis=1) for i, delta in enumerate(deltas)]


def _vertices(form: StandardForm, norm: Norm, stop: float) -> Array:
    """Starts (n, ≤ CANDIDATES) with N = 1 that e^(At) carries furthest at the times when it carries furthest."""
    inverse = np.linalg.inv(norm.T)
    times = np.linspace(0.0, min(stop, 1.0), 400)
    carried = norm.T @ expm(times[:, None, None] * form.A) @ inverse
    if norm.largest:  # the furthest corner of the box for each row
        sizes = np.abs(carried).sum(axis=2)
        order = np.argsort(sizes, axis=None)[::-1][: 8 * CANDIDATES]
        corners = np.array([np.sign(carried.reshape(-1, carried.shape[2])[i]) for i in order])
    else:
        _, sizes, right = np.linalg.svd(carried)
        order = np.argsort(sizes[:, 0])[::-1][: 8 * CANDIDATES]
        corners = right[order, 0, :]
    chosen = corners[:: max(1, len(corners) // CANDIDATES)][:CANDIDATES]
    starts = inverse @ chosen.T
    return starts / norm(starts)
