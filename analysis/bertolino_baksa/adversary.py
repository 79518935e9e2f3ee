"""The other side of a certificate: how far motions really get. No proof, but a number beside every proved one.

All motions are integrated at once (Runge–Kutta of order 4 on the full equations), in steps that meet the corners.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.linalg import expm

from ..methods.deviation import deviation
from ..methods.linear_response import linear_response
from ..methods.signals import Piece, Signal
from ..methods.standard_form import StandardForm
from .balls import Array
from .norms import Norm

STEP = 5e-4  # s, at most
TURN, MOST = 0.02, 400_000  # rad that the fastest mode turns from time to time, and how many times, at most
LAST, LAST_OF_ENDLESS = 3.0, 8.0  # times 1/α after the last corner
CANDIDATES = 64  # starts that the linear part proposes
SPREAD = 8  # times as many are in the running: the best have neighbours nearly as good
FEW = 12  # of them for a picture
HORIZON, INSTANTS = 1.0, 400  # s, and number, of the times at which the linear part is asked
ASCENTS = 60  # of a start on the sphere, at one time
ROUNDS = 4  # of linearising around the worst motion
DIFFERENCE = 1e-6  # of delta, for that
PEAKS = 6  # of that motion, each of which is pushed further


def motions(
    form: StandardForm, signal: Signal, x0: Array, stop: float, step: float = STEP
) -> Iterator[tuple[float, Array]]:
    """(t, x (n, K)) of all motions from the starts x0 (n, K), step by step, from the signal's begin to `stop` [s]."""
    x, ones = x0, np.ones(x0.shape[1])
    yield signal.edges[0], x
    for piece, times in _steps(signal, stop, step):
        for t, later in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
            h = later - t
            x = stepped(form.rate, x, h, *(piece(s)[:, None] * ones for s in (t, t + 0.5 * h, later)))
            yield later, x


def stepped(rate: Callable[[Array, Array], Array], x: Array, h: float, w0: Array, w1: Array, w2: Array) -> Array:
    """x (n, K) of x' = rate(x, w) a Runge–Kutta step h later, for inputs (m, K) at its begin, middle and end."""
    k1 = rate(x, w0)
    k2 = rate(x + 0.5 * h * k1, w1)
    k3 = rate(x + 0.5 * h * k2, w1)
    k4 = rate(x + h * k3, w2)
    return np.asarray(x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))


def slowest(form: StandardForm) -> float:
    """1/α [s], the time constant of the linear part's slowest mode."""
    return 1.0 / -float(np.linalg.eigvals(form.A).real.max())


def _steps(signal: Signal, stop: float, step: float) -> Iterator[tuple[Piece, Array]]:
    """Times from corner to corner, no further apart than `step`."""
    edges = [t for t in signal.edges if t < stop] + [stop]
    for piece, begin, end in zip(signal.pieces, edges, edges[1:], strict=False):
        yield piece, np.linspace(begin, end, int(np.ceil((end - begin) / step)) + 1)


def reference_error(form: StandardForm, signal: Signal, x0: Array, stop: float, step: float) -> tuple[Array, Array]:
    """Times (N,) [s], those of `motions`, and e = x − x_lin (n, N) of the motion from x0 itself, tightly integrated."""
    finer, steps = 2 * int(np.ceil(step / STEP)), list(_steps(signal, stop, step))
    times = [np.linspace(at[0], at[-1], finer * (len(at) - 1) + 1) for _, at in steps]
    x_lin = linear_response(form.A, form.B, x0, signal, np.concatenate(times))
    by_pieces = np.split(x_lin, np.cumsum([len(t) for t in times])[:-1], axis=1)
    e = [np.zeros((len(x0), 1))]
    for (piece, _), t, along in zip(steps, times, by_pieces, strict=True):
        e.append(deviation(form, along, piece(t), e[-1][:, -1], t[1] - t[0])[:, finer::finer])
    return np.concatenate([signal.edges[:1], *(at[1:] for _, at in steps)]), np.concatenate(e, axis=1)


def _offsets(
    form: StandardForm, signal: Signal, x0: Array, off: Array, stop: float, step: float = STEP
) -> Iterator[Array]:
    """x − x_lin (n, K) of the motions from x0 + off (n, K), at each time of `motions`; x_lin from x0.

    It is e of the motion from x0 and the difference to that motion, in which Runge–Kutta's error at x0 drops out.
    """
    _, e = reference_error(form, signal, x0, stop, step)
    starts = x0[:, None] + np.hstack([np.zeros((len(x0), 1)), off])
    for (_, x), own in zip(motions(form, signal, starts, stop, step), e.T, strict=True):
        yield x[:, 1:] - x[:, :1] + own[:, None]


def excursions(
    form: StandardForm, signal: Signal, norms: Sequence[Norm], x0: Array, off: Array, stop: float, step: float = STEP
) -> Array:
    """sup N(x − x_lin) (norms, K) up to `stop` of the motions from x0 + off (n, K), x_lin from x0 (n,)."""
    found = np.zeros((len(norms), off.shape[1]))
    for each in _offsets(form, signal, x0, off, stop, step):
        found = np.maximum(found, [norm(each) for norm in norms])
    return found


def reference_floor(form: StandardForm, signal: Signal, norms: Sequence[Norm], x0: Array, stop: float) -> Array:
    """sup N(x − x_lin) (norms,) up to `stop` [s] of the motion from x0 itself, tightly integrated: the true floor."""
    fastest = float(np.abs(np.linalg.eigvals(form.A)).max())
    step = min(STEP, max(TURN / fastest, (stop - signal.begin) / MOST))
    _, e = reference_error(form, signal, x0, stop, step)
    return np.array([norm(e).max() for norm in norms])


def long_enough(form: StandardForm, signal: Signal) -> float:
    """A time [s] by which the motion from x0 has been furthest off, or as good as; w may end or go on for ever."""
    times = LAST if not signal.pieces[-1].amplitudes.any() else LAST_OF_ENDLESS
    return signal.edges[-1] + times * slowest(form)


def worst(
    form: StandardForm, signal: Signal, norm: Norm, x0: Array, delta: float, stop: float, rounds: int = ROUNDS
) -> tuple[float, Array]:
    """A large sup N(x − x_lin) over the starts with N(x(0) − x0) ≤ delta, and its start's offset (n,).

    The first starts are those that the linear part carries furthest from e on, at many times. From the worst of them
    on, the full equations are linearised around their own motion, whose furthest start is the next.
    """
    crowd = furthest_starts(form, norm, delta, *_errors(form, signal, x0, stop), CANDIDATES)
    best, at = 0.0, crowd[:, 0]
    for _ in range(rounds + 1):
        off = np.stack(list(_offsets(form, signal, x0, crowd, stop)), axis=1)
        sizes = norm(off)  # (times, K)
        if not sizes.max() > best:
            break
        k = int(np.argmax(sizes.max(axis=0)))
        best, at = float(sizes.max()), crowd[:, k]
        if rounds:
            crowd = _from_its_own_motion(form, signal, norm, x0, at, delta, stop)
    return best, at


def _from_its_own_motion(
    form: StandardForm, signal: Signal, norm: Norm, x0: Array, at: Array, delta: float, stop: float
) -> Array:
    """Starts (n, few) furthest by the equations' derivatives along the motion from x0 + at, at its highest peaks."""
    small, inverse = DIFFERENCE * delta, np.linalg.inv(norm.T)
    beside = at[:, None] + np.hstack([np.zeros((len(at), 1)), small * inverse])
    off = np.stack(list(_offsets(form, signal, x0, beside, stop)), axis=1)
    sizes = norm(off[:, :, 0])
    peaks = [i for i in range(len(sizes)) if sizes[i] == sizes[max(i - 1, 0) : i + 2].max()]
    peaks = sorted(peaks, key=lambda i: -sizes[i])[:PEAKS]
    M = np.stack([norm.T @ (off[:, i, 1:] - off[:, i, :1]) / small for i in peaks])
    e = np.stack([norm.T @ off[:, i, 0] for i in peaks]) - M @ (norm.T @ at)
    z, _ = directions(norm, e, M, delta)
    starts = inverse @ z.T
    return starts * delta / norm(starts)


def reached(
    form: StandardForm, signal: Signal, norms: Sequence[Norm], x0: Array, deltas: Sequence[Array], stop: float
) -> list[Array]:
    """For each norm, sup N(x − x_lin) (K,) up to `stop` [s] over starts at N(x(0) − x0) = its deltas (K,).

    By FEW first starts like those of `worst`, without its rounds and all in one integration.
    """
    crowd = crowds(form, norms, deltas, *_errors(form, signal, x0, stop))
    return by_deltas(excursions(form, signal, norms, x0, crowd, stop), deltas)


def crowds(form: StandardForm, norms: Sequence[Norm], deltas: Sequence[Array], times: Array, e: Array) -> Array:
    """FEW starts (n, …) for each norm's deltas, one after the other, by e (n, N) at the times."""
    pairs = [(norm, d) for norm, delta in zip(norms, deltas, strict=True) for d in delta.tolist()]
    return np.concatenate([furthest_starts(form, norm, d, times, e, FEW) for norm, d in pairs], axis=1)


def by_deltas(found: Array, deltas: Sequence[Array]) -> list[Array]:
    """The largest of what each delta's starts of `crowds` reach in its norm, from all that they reach (norms, …)."""
    own = np.split(found, np.cumsum([FEW * len(delta) for delta in deltas])[:-1], axis=1)
    return [own[i][i].reshape(len(delta), -1).max(axis=1) for i, delta in enumerate(deltas)]


def _errors(form: StandardForm, signal: Signal, x0: Array, stop: float) -> tuple[Array, Array]:
    """Times (N,) [s] and e (n, N) of the motion from x0 itself, at INSTANTS even times or so."""
    return reference_error(form, signal, x0, min(stop, HORIZON), min(stop, HORIZON) / INSTANTS)


def furthest_starts(form: StandardForm, norm: Norm, delta: float, times: Array, e: Array, count: int) -> Array:
    """Starts (n, count) with N = delta for which N(e + e^(At) y) is largest at the times when it is largest."""
    inverse = np.asarray(np.linalg.inv(norm.T), dtype=float)
    carried = norm.T @ expm((times - times[0])[:, None, None] * form.A) @ inverse
    z, sizes = directions(norm, (norm.T @ e).T, carried, delta)
    order = np.argsort(sizes)[::-1][: SPREAD * count]
    starts = inverse @ z[order[:: max(1, len(order) // count)][:count]].T
    return np.asarray(starts * delta / norm(starts))


def directions(norm: Norm, e: Array, M: Array, delta: float) -> tuple[Array, Array]:
    """z (L, n) that make N(e + M z) large, at each of e (N, n) and M (N, n, n), T left out, and how large it is (L,).

    Where the norm is a maximum, the furthest corner for each row and sign; else ascents from the singular vectors.
    """
    if norm.largest:
        z = delta * np.concatenate([np.sign(M), -np.sign(M)], axis=1)
        sizes = np.concatenate([e, -e], axis=1) + delta * np.tile(np.abs(M).sum(axis=2), 2)
        return z.reshape(-1, M.shape[2]), sizes.ravel()
    first = np.linalg.svd(M)[2][:, :2]
    z = delta * np.concatenate([first, -first], axis=1)  # (N, 4, n)
    for _ in range(ASCENTS):  # the size rises at every step, as it is convex
        z = (e[:, None, :] + z @ M.swapaxes(1, 2)) @ M
        z *= delta / np.sqrt((z**2).sum(axis=2))[:, :, None]
    sizes = np.sqrt(((e[:, None, :] + z @ M.swapaxes(1, 2)) ** 2).sum(axis=2))
    return z.reshape(-1, M.shape[2]), sizes.ravel()
