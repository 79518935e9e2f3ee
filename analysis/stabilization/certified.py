"""Stability of A + B K over a whole box of parameters, proved: energies that change with them, in ball arithmetic."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from flint import arb, fmpq

from ..bertolino_baksa.balls import decimal, precision
from ..methods.polynomials import Array
from .energies import Energy, search

Plant = Callable[[Mapping[str, Any]], tuple[Sequence[Any], Sequence[Sequence[Any]], Sequence[Sequence[Any]]]]
"""parameters -> M (n), S (n, 2n), G (n, m) of M q̈ = S (q, q̇) + G u, M diagonal, in the parameters' kind of number."""
Box = Mapping[str, tuple[fmpq, fmpq]]


@dataclass(frozen=True, slots=True)
class Certified:
    """What became of the box, by shares of its volume, and in how many sub-boxes.

    proved   : A + B K is stable, whatever the parameters are, as long as they stay.
    unstable : it is not at all corners, in doubles.
    The rest is open: the budget ended.  witness: a corner at which it is not stable, the worst of its sub-box.
    """

    proved: float
    unstable: float
    boxes: int
    witness: dict[str, float] | None


def certify(plant: Plant, K: Array, box: Box, budget: int = 8) -> Certified:
    """Prove that A + B K is stable for all parameters in the box, halving it where it takes more than one function.

    plant : M, S and G affine in every single parameter, so that M and S + G K on a box are means of their values at
            the corners. K (m, 2n) is exactly as its doubles say.
    budget: sub-boxes that are looked at.

    On each sub-box an energy (see `energies`) is searched; at every corner V > 0 and V̇ < 0 are then shown with nothing
    rounded, and hold between them as both are affine in M and S + G K.
    """
    waiting, share = deque([(box, 1.0)]), {"proved": 0.0, "unstable": 0.0}
    boxes, witness = 0, None
    while waiting and boxes < budget:
        here, volume = waiting.popleft()
        boxes += 1
        corners = [_doubles(corner) for corner in _corners(here)]
        rates = np.array([growth(plant, K, corner) for corner in corners])
        if rates.max() >= 0.0:
            witness = witness or corners[int(rates.argmax())]
        if rates.max() < 0.0 and _proved(plant, K, here, rates):
            share["proved"] += volume
        elif rates.min() >= 0.0:
            share["unstable"] += volume
        else:
            waiting.extend((half, 0.5 * volume) for half in _halves(plant, K, here))
    return Certified(share["proved"], share["unstable"], boxes, witness)


def around(values: Mapping[str, float], spread: float) -> Box:
    """The box of each value's shortest decimal, more or less by the fraction `spread`."""
    less, more = 1 - decimal(spread), 1 + decimal(spread)
    return {name: (decimal(value) * less, decimal(value) * more) for name, value in values.items()}


def state_space(plant: Plant, values: Mapping[str, float]) -> tuple[Array, Array]:
    """A (2n, 2n), B (2n, m) of x' = A x + B u, x = (q, q̇), in doubles."""
    M, S, G = (np.array(matrix, dtype=float) for matrix in plant(values))
    n, m = len(M), G.shape[1]
    A = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), S / M[:, None]])
    return A, np.vstack([np.zeros((n, m)), G / M[:, None]])


def closed_loop(plant: Plant, K: Array, values: Mapping[str, float]) -> Array:
    """A + B K (2n, 2n) at these parameters, in doubles."""
    A, B = state_space(plant, values)
    closed: Array = A + B @ K
    return closed


def growth(plant: Plant, K: Array, values: Mapping[str, float]) -> float:
    """Largest real part of the eigenvalues of A + B K [1/s] at these parameters, in doubles."""
    return float(np.linalg.eigvals(closed_loop(plant, K, values)).real.max())


def _proved(plant: Plant, K: Array, box: Box, rates: Array) -> bool:
    """Whether an energy is found and proves this box; rates (2^k,) [1/s] the growth at its corners."""
    corners = _corners(box)
    systems = [_closed(plant, K, _doubles(corner)) for corner in corners]
    M, S = (np.array(part) for part in zip(*systems, strict=True))
    energy = search(M, S, np.argsort(-rates).tolist())
    if energy is None:
        return False
    with precision(1):
        gain, exact = _balls(K), Energy(*(_balls(part) for part in (energy.Y, energy.C, energy.X)))
        return all(_decreases(plant, gain, exact, corner) for corner in corners)


def _decreases(plant: Plant, gain: Array, energy: Energy, corner: Mapping[str, fmpq]) -> bool:
    """Whether V > 0 and V̇ < 0 at this corner, for all x ≠ 0; gain and energy of balls."""
    P, W = energy.forms(*_closed(plant, gain, {name: arb(value) for name, value in corner.items()}))
    return _is_positive(P.tolist()) and _is_positive((-W).tolist())


def _closed(plant: Plant, K: Array, values: Mapping[str, Any]) -> tuple[Array, Array]:
    """M (n,), S + G K (n, 2n), in the kind of number of K and of the values."""
    M, S, G = (np.array(matrix, dtype=K.dtype) for matrix in plant(values))
    return M, S + G @ K


def _balls(values: Array) -> Array:
    """Exactly these doubles."""
    return np.array([arb(value) for value in values.ravel().tolist()], dtype=object).reshape(values.shape)


def _is_positive(matrix: Sequence[Sequence[Any]]) -> bool:
    """Whether all pivots of a symmetric matrix of balls, taken from its upper half, are certainly > 0; then every
    symmetric matrix in it is positive definite."""
    rows = [list(row) for row in matrix]
    n = len(rows)
    for k in range(n):
        pivot = rows[k][k]
        if not pivot > 0:  # of a ball: of all its numbers
            return False
        for i in range(k + 1, n):
            factor = rows[k][i] / pivot
            for j in range(i, n):
                rows[i][j] -= factor * rows[k][j]
    return True


def _doubles(values: Mapping[str, fmpq]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items()}


def _corners(box: Box) -> list[dict[str, fmpq]]:
    return [dict(zip(box, values, strict=True)) for values in product(*box.values())]


def _halves(plant: Plant, K: Array, box: Box) -> list[Box]:
    """The box halved along the parameter that changes A + B K the most, in the metric of the modes at its middle."""
    middle = {name: (low + high) / 2 for name, (low, high) in box.items()}
    _, V = np.linalg.eig(closed_loop(plant, K, _doubles(middle)))
    inverse = np.linalg.pinv(V)

    def effect(name: str) -> float:
        ends = ({**middle, name: end} for end in box[name])
        first, last = (closed_loop(plant, K, _doubles(values)) for values in ends)
        return float(np.linalg.norm(inverse @ (last - first) @ V, 2))

    name = max(box, key=effect)
    low, high = box[name]
    return [{**box, name: (low, middle[name])}, {**box, name: (middle[name], high)}]
