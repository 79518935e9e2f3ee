"""The series (3.15)–(3.16) for any input: each order by quadrature of its Duhamel integral, step by step.

On a step of length h the recursion's right-hand side g is interpolated at Gauss's nodes, and what is left of
∫ exp(λ(t − s)) g(s) ds is done exactly (an exponential integrator with dense output). λ h may be of any size. The first
order of an input that is a cubic on each step is exact; every order is of order NODES + 1 = 5 in h (tests measure it).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .modes import Complex, Modes
from .polynomials import Array
from .series import forcings
from .standard_form import StandardForm

NODES = 4
BLOCK = 256  # steps whose products are held at a time
_POINTS = 0.5 + 0.5 * np.polynomial.legendre.leggauss(NODES)[0]
# Coefficients [power, node] of Lagrange's polynomials over the nodes.
_LAGRANGE = np.linalg.inv(np.vander(_POINTS, increasing=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledSeries:
    """ξ⁽⁰⁾, ξ⁽¹⁾, … on steps between the times `grid` (N + 1,) [s].

    starts : values at the begin of each step (orders, n, N); forcing : right-hand sides at its nodes
    (orders, n, N, NODES).
    """

    modes: Modes
    grid: Array
    starts: Complex
    forcing: Complex

    def modal(self, t: ArrayLike) -> Complex:
        """ξ⁽ᵏ⁾ (orders, n, len(t)) at the times t [s] within the grid, in any order."""
        times = np.asarray(t, dtype=float)
        step = np.clip(np.searchsorted(self.grid, times, side="right") - 1, 0, len(self.grid) - 2)
        h = np.diff(self.grid)[step]
        z, part = np.multiply.outer(self.modes.eigenvalues, h), (times - self.grid[step]) / h
        integral = np.einsum("jnt,kntj->knt", _weights(z, part), self.forcing[:, :, step])
        return np.exp(z * part) * self.starts[:, :, step] + h * integral

    def physical(self, t: ArrayLike) -> Array:
        """x⁽ᵏ⁾ = K ξ⁽ᵏ⁾ (orders, n, len(t)), real."""
        return (self.modes.K @ self.modal(t)).real


def sampled_series(
    form: StandardForm, modes: Modes, w: Callable[[Array], Array], grid: Array, x0: ArrayLike, order: int
) -> SampledSeries:
    """The series up to εᵒʳᵈᵉʳ under the input w(t), (m, len(t)) at times (…,), from x0 (n,) at grid[0].

    grid : edges of the steps [s]; where w or its derivatives jump, an edge is wanted.
    """
    start: list[Complex] = [modes.K_inverse @ np.asarray(x0, float)]
    start += [np.zeros_like(start[0])] * order
    starts, forcing = [], []
    for first in range(0, len(grid) - 1, BLOCK):
        begins, g, start = _on_steps(form, modes, w, grid[first : first + BLOCK + 1], start)
        starts.append(begins)
        forcing.append(g)
    return SampledSeries(
        modes=modes, grid=grid, starts=np.concatenate(starts, axis=2), forcing=np.concatenate(forcing, axis=2)
    )


def _on_steps(
    form: StandardForm, modes: Modes, w: Callable[[Array], Array], grid: Array, start: list[Complex]
) -> tuple[Complex, Complex, list[Complex]]:
    """`starts` and `forcing` on a few steps, and the values (n,) of each order at their end."""
    h, n = np.diff(grid), len(modes.eigenvalues)
    z = np.multiply.outer(modes.eigenvalues, h)
    to_nodes = [(_weights(z, np.full(len(h), c)), np.exp(z * c)) for c in _POINTS]
    to_end, decay = _weights(z, np.ones(len(h))), np.exp(z)
    inputs = w((grid[:-1, None] + h[:, None] * _POINTS).ravel())
    orders: list[Complex] = []
    begins, kept, ends = [], [], []
    for k, flat in enumerate(forcings(form, modes, inputs, orders, len(start))):
        g = np.asarray(flat, complex).reshape(n, len(h), NODES)
        begin, end = _chained(start[k], decay, h * np.einsum("jnt,ntj->nt", to_end, g))
        values = [fade * begin + h * np.einsum("jnt,ntj->nt", weights, g) for weights, fade in to_nodes]
        orders.append(np.stack(values, axis=-1).reshape(n, -1))
        begins.append(begin)
        kept.append(g)
        ends.append(end)
    return np.array(begins), np.array(kept), ends


def _chained(start: Complex, decay: Complex, added: Complex) -> tuple[Complex, Complex]:
    """Values at the begin of each step, and after the last: ξ ← decay · ξ + added, step by step."""
    values = np.empty_like(added)
    xi = start
    for step in range(added.shape[1]):
        values[:, step] = xi
        xi = decay[:, step] * xi + added[:, step]
    return values, xi


def _weights(z: Complex, part: Array) -> Complex:
    """∫_0^θ exp(z(θ − u)) ℓ_j(u) du (NODES, n, N) for z (n, N) and θ = part (N,)."""
    phi = _phi(z * part)
    moments = [math.factorial(m) * part ** (m + 1) * phi[m + 1] for m in range(NODES)]
    return np.einsum("mj,mnt->jnt", _LAGRANGE, np.array(moments))


def _phi(z: Complex) -> list[Complex]:
    """φ_0 = exp, …, φ_NODES with φ_k = z φ_(k+1) + 1/k!: by Taylor's series for |z| < 1, by the recurrence beyond."""
    small = np.abs(z) < 1.0
    near, far = np.where(small, z, 0.0), np.where(small, 1.0, z)
    series = np.zeros_like(near)
    for i in reversed(range(18)):
        series = series * near + 1.0 / math.factorial(NODES + i)
    down, up = [series], [np.exp(far)]
    for k in reversed(range(NODES)):
        down.insert(0, near * down[0] + 1.0 / math.factorial(k))
    for k in range(NODES):
        up.append((up[k] - 1.0 / math.factorial(k)) / far)
    return [np.where(small, a, b) for a, b in zip(down, up, strict=True)]
