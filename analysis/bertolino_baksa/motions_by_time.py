"""Motions of a system whose linear part changes in time, many at once, and starts that get far; no proof."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .adversary import SPREAD, directions
from .balls import Array
from .norms import Norm

SOME = 10  # steps apart at least are the times at which the linear part is asked
Rate = Callable[[float, Array], Array]


@dataclass(frozen=True)
class Motions:
    """x' = full(t, x) beside x_lin' = linear(t, x), smooth but at the corners; both from t = 0 to `stop` [s]."""

    full: Rate
    linear: Rate
    corners: Sequence[float]
    stop: float
    step: float

    def of(self, rate: Rate, x: Array) -> Array:
        """x (times, n, K) from the starts x (n, K), by Runge–Kutta steps that meet the corners."""
        found = [x]
        for begin, end in pairwise([0.0, *(c for c in self.corners if 0.0 < c < self.stop), self.stop]):
            for t, later in pairwise(np.linspace(begin, end, int(np.ceil((end - begin) / self.step)) + 1).tolist()):
                h = later - t
                inside = t + 1e-9 * h, t + 0.5 * h, later - 1e-9 * h  # a corner's rate is that of its own side
                k1 = rate(inside[0], x)
                k2 = rate(inside[1], x + 0.5 * h * k1)
                k3 = rate(inside[1], x + 0.5 * h * k2)
                x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + rate(inside[2], x + h * k3))
                found.append(x)
        return np.stack(found)

    def off(self, starts: Array) -> Array:
        """x − x_lin (times, n, K) of starts (n, K), x_lin from rest."""
        rest = np.zeros((len(starts), 1))
        return self.of(self.full, starts) - self.of(self.linear, rest)

    def worst(self, norms: Sequence[Norm], deltas: Sequence[Array], few: int = 24) -> list[Array]:
        """For each norm a large sup N(x − x_lin) (K,) over N(x(0)) = its deltas (K,), by starts that Φ(t, 0) carries
        furthest from e on."""
        n = len(norms[0].T)
        flow = self.of(self.linear, np.eye(n)) - self.of(self.linear, np.zeros((n, 1)))
        e = self.off(np.zeros((n, 1)))[:, :, 0]
        pairs = [(norm, delta) for norm, own in zip(norms, deltas, strict=True) for delta in own.tolist()]
        crowd = [_furthest(norm, delta, e, flow, few) for norm, delta in pairs]
        off = np.split(self.off(np.concatenate(crowd, axis=1)), np.cumsum([c.shape[1] for c in crowd])[:-1], axis=2)
        found = np.array([max(norm(x).max() for x in own) for (norm, _), own in zip(pairs, off, strict=True)])
        return np.split(found, np.cumsum([len(own) for own in deltas])[:-1])


def _furthest(norm: Norm, delta: float, e: Array, flow: Array, few: int) -> Array:
    """Starts (n, few or so) with N = delta for which N(e + Φ y) is largest, at times when that is large; e (N, n)."""
    inverse = np.linalg.inv(norm.T)
    near, M = e @ norm.T.T, norm.T @ flow @ inverse
    sizes = np.abs(near).max(axis=1) + delta * np.linalg.norm(M, np.inf if norm.largest else 2, axis=(1, 2))
    some = np.argsort(sizes)[::-1][: SOME * few : SOME]
    z, reach = directions(norm, near[some], M[some], delta)
    starts = inverse @ z[np.argsort(reach)[::-1][: SPREAD * few : SPREAD]].T
    return np.asarray(starts * delta / norm(starts))
