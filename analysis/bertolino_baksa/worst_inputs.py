"""The other side of `bounded_inputs`: inputs within the bounds that carry the motion far. No proof, but a number."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.linalg import expm
from scipy.optimize import linprog
from scipy.sparse import diags, vstack

from ..methods.standard_form import StandardForm
from .adversary import FEW, directions, slowest, stepped
from .balls import Array
from .bounded_inputs import Bounds
from .norms import Norm

MEMORY = 4.0  # slowest time constants that the worst input is made for
SAMPLES = 1200  # over them
TURNS, TURNS_TIED = 12, 3  # of the search for the worst input in a norm
STARTS = 2  # of it where the inputs are tied
LAST = (4, 12, 36, 108, 324)  # steps: of the inputs' last parts, under which starts are carried


def worst_inputs(form: StandardForm, norm: Norm, bounds: Bounds) -> Array:
    """Inputs (SAMPLES + 1, m) within the bounds at even times that the linear part makes a large N of at the end.

    The best for c x(T) is found for directions c in which N grows, over and over: of independent inputs, which are held
    over a step, by the signs of their kernel, and of heights that run straight from time to time by linear programming.
    """
    step = MEMORY * slowest(form) / SAMPLES
    over, kernel = expm(form.A * step), np.empty((SAMPLES, *form.B.shape))
    kernel[-1] = expm(form.A * step / 2.0) @ form.B * step
    for k in range(SAMPLES - 1, 0, -1):
        kernel[k - 1] = over @ kernel[k]
    best, found = 0.0, np.zeros((SAMPLES + 1, len(bounds.sizes)))
    gained = np.abs(np.einsum("pn,knm->kpm", norm.T, kernel)).sum(axis=0) @ bounds.sizes
    for row in norm.T[np.argsort(-gained)[: STARTS if bounds.tied else len(gained)]]:
        c = row
        for _ in range(1 if norm.largest else TURNS_TIED if bounds.tied else TURNS):
            tried = (_ramps if bounds.tied else _switches)(np.tensordot(c, kernel, (0, 1)), bounds.sizes, step)
            end = np.einsum("knm,km->n", kernel, (tried[:-1] + tried[1:]) / 2.0 if bounds.tied else tried[:-1])
            if norm(end) > best:
                best, found = float(norm(end)), tried
            c = norm.T.T @ (norm.T @ end)
    return found


def _switches(weights: Array, W: Array, step: float) -> Array:
    signs = np.where(weights < 0.0, -1.0, 1.0)
    return W * np.concatenate([signs, signs[-1:]])


def _ramps(weights: Array, W: Array, step: float) -> Array:
    """Σ weights (w_k + w_(k+1))/2 made largest over heights with h_0 = 0, |h_k| ≤ A, |h_(k+1) − h_k| ≤ V step."""
    half, steps = len(W) // 2, len(weights)
    found = np.zeros((steps + 1, 2 * half))
    difference = diags([-np.ones(steps), np.ones(steps)], [0, 1], shape=(steps, steps + 1), format="csr")
    for i, (A, V) in enumerate(zip(W[:half].tolist(), W[half:].tolist(), strict=True)):
        value = np.convolve(weights[:, i], [0.5, 0.5]) + difference.T @ weights[:, half + i] / step
        limits = [(0.0, 0.0), *[(-A, A)] * steps]
        rows = vstack([difference, -difference])
        h = linprog(-value, rows, np.full(2 * steps, V * step), bounds=limits, method="highs").x
        found[:, i], found[:-1, half + i] = h, np.diff(h) / step
    found[-1, half:] = found[-2, half:]
    return found


def reached(form: StandardForm, norm: Norm, bounds: Bounds, inputs: Array) -> float:
    """sup N(x) of the motion from rest under inputs that `worst_inputs` made."""
    return _furthest(form, norm, bounds, inputs, np.zeros((len(form.A), 1)))


def reached_from(form: StandardForm, norm: Norm, bounds: Bounds, inputs: Array, delta: float) -> float:
    """sup N(x) over starts at N(x(0)) = delta that the linear part carries furthest together with the inputs' last
    parts, which are 0 where they must begin at 0."""
    step, inverse, most = MEMORY * slowest(form) / SAMPLES, np.linalg.inv(norm.T), 0.0
    for count in LAST:
        part = inputs[-count - 1 :] * (0.0 if bounds.tied else 1.0)
        end, flow = np.zeros((len(form.A), 1)), expm(form.A * step)
        for w in part[:-1]:
            end = flow @ end + step * (form.B @ w)[:, None]
        M = norm.T @ expm(form.A * step * count) @ inverse
        z, sizes = directions(norm, (norm.T @ end).T, M[None], delta)
        starts = inverse @ z[np.argsort(sizes)[::-1][:FEW]].T
        most = max(most, _furthest(form, norm, bounds, part, starts * delta / norm(starts)))
    return most


def _furthest(form: StandardForm, norm: Norm, bounds: Bounds, inputs: Array, x: Array) -> float:
    """sup N(x) of motions from x (n, K) under these inputs."""
    step, ones = MEMORY * slowest(form) / SAMPLES, np.ones(x.shape[1])
    most, heights = float(norm(x).max()), np.arange(inputs.shape[1]) < inputs.shape[1] // 2
    for before, after in pairwise(inputs):
        last = np.where(heights & bounds.tied, after, before)
        x = stepped(form.rate, x, step, *(v[:, None] * ones for v in (before, (before + last) / 2.0, last)))
        most = max(most, float(norm(x).max()))
    return most
