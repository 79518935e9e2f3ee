"""Stability of A + B K over a whole box of parameters, proved: quadratic Lyapunov functions, in ball arithmetic."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from flint import arb, arb_mat, fmpq

from ..bertolino_baksa.balls import decimal, precision
from ..methods.polynomials import Array

Plant = Callable[[Mapping[str, Any]], tuple[Sequence[Sequence[Any]], Sequence[Sequence[Any]]]]
Box = Mapping[str, tuple[fmpq, fmpq]]


@dataclass(frozen=True, slots=True)
class Certified:
    """What became of the box, by shares of its volume, and in how many sub-boxes.

    proved   : A + B K is stable, also if the parameters move about within a sub-box while the system runs.
    unstable : it is not at the middle and at all corners, in doubles.
    The rest is open: the budget ended.  witness: the first middle at which it is not stable.
    """

    proved: float
    unstable: float
    boxes: int
    witness: dict[str, float] | None


def certify(plant: Plant, K: Array, box: Box, budget: int = 300) -> Certified:
    """Prove that A + B K is stable for all parameters in the box, halving it where it takes more than one function.

    plant : parameters -> (A, B), each entry affine in every single parameter or in every single one's reciprocal, so
            that A + B K on a box is a mean of its values at the corners. K (m, n) is exactly as its doubles say.
    budget: sub-boxes that are looked at.

    On each sub-box P is the metric in which the modes at its middle are orthonormal; at every corner
    P (A + B K) + (A + B K)ᵀ P < 0 is then shown with nothing rounded, and holds between them as it is linear in A + BK.
    """
    waiting, share = deque([(box, 1.0)]), {"proved": 0.0, "unstable": 0.0}
    boxes, witness = 0, None
    while waiting and boxes < budget:
        here, volume = waiting.popleft()
        boxes += 1
        middle = {name: float(low + high) / 2.0 for name, (low, high) in here.items()}
        values, V = np.linalg.eig(closed_loop(plant, K, middle))
        stable = values.real.max() < 0.0
        if not stable:
            witness = witness or middle
        if stable and _proved(plant, K, here, V):
            share["proved"] += volume
        elif not stable and all(growth(plant, K, _doubles(corner)) >= 0.0 for corner in _corners(here)):
            share["unstable"] += volume
        else:
            waiting.extend((half, 0.5 * volume) for half in _halves(plant, K, here, V))
    return Certified(share["proved"], share["unstable"], boxes, witness)


def around(values: Mapping[str, float], spread: float) -> Box:
    """The box of each value's shortest decimal, more or less by the fraction `spread`."""
    less, more = 1 - decimal(spread), 1 + decimal(spread)
    return {name: (decimal(value) * less, decimal(value) * more) for name, value in values.items()}


def closed_loop(plant: Plant, K: Array, values: Mapping[str, float]) -> Array:
    """A + B K (n, n) at these parameters, in doubles."""
    A, B = (np.array(matrix, dtype=float) for matrix in plant(values))
    closed: Array = A + B @ K
    return closed


def growth(plant: Plant, K: Array, values: Mapping[str, float]) -> float:
    """Largest real part of the eigenvalues of A + B K [1/s] at these parameters, in doubles."""
    return float(np.linalg.eigvals(closed_loop(plant, K, values)).real.max())


def _proved(plant: Plant, K: Array, box: Box, V: Any) -> bool:
    inverse = np.linalg.inv(V / np.linalg.norm(V, axis=0))
    P = (inverse.conj().T @ inverse).real
    P = 0.5 * (P + P.T) / np.abs(P).max()
    for corner in _corners(box):  # in doubles first: that sorts out the most
        PA = P @ closed_loop(plant, K, _doubles(corner))
        if np.linalg.eigvalsh(PA + PA.T)[-1] >= 0.0:
            return False
    with precision(1):
        exact, gain = _balls(P.tolist()), _balls(K.tolist())
        return _is_positive(exact) and all(_decreases(plant, gain, exact, corner) for corner in _corners(box))


def _decreases(plant: Plant, gain: Any, P: Any, corner: Mapping[str, fmpq]) -> bool:
    """Whether −(P (A + B K) + (A + B K)ᵀ P) is positive definite at this corner."""
    A, B = (_balls(matrix) for matrix in plant({name: arb(value) for name, value in corner.items()}))
    PA = P * (A + B * gain)
    return _is_positive(-(PA + PA.transpose()))


def _balls(matrix: Sequence[Sequence[Any]]) -> Any:
    return arb_mat([[arb(entry) for entry in row] for row in matrix])


def _is_positive(matrix: Any) -> bool:
    """Whether all pivots of a symmetric matrix of balls are certainly > 0; then every matrix in it is positive
    definite."""
    rows = matrix.tolist()
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


def _halves(plant: Plant, K: Array, box: Box, V: Any) -> list[Box]:
    """The box halved along the parameter that changes A + B K the most, in the modes' metric."""
    middle = {name: (low + high) / 2 for name, (low, high) in box.items()}
    inverse = np.linalg.inv(V)

    def effect(name: str) -> float:
        ends = ({**middle, name: end} for end in box[name])
        first, last = (closed_loop(plant, K, _doubles(values)) for values in ends)
        return float(np.linalg.norm(inverse @ (last - first) @ V, 2))

    name = max(box, key=effect)
    low, high = box[name]
    return [{**box, name: (low, middle[name])}, {**box, name: (middle[name], high)}]
