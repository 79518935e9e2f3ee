"""Vector functions that are homogeneous polynomials: Φ_i(y) = c_i(jk…) y_j y_k …, sparse, for many points at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .power_series import Monomial, PowerSeries

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Homogeneous:
    """n functions of degree d: coefficients (n, M) times the products of y at the rows of monomials (M, d)."""

    monomials: NDArray[np.intp]
    coefficients: NDArray[Any]

    @property
    def degree(self) -> int:
        """d."""
        return int(self.monomials.shape[1])

    def __call__(self, y: NDArray[Any]) -> NDArray[Any]:
        """Values (n, …) at y (variables, …), real or complex."""
        return np.tensordot(self.coefficients, np.prod(np.asarray(y)[self.monomials], axis=1), axes=1)

    def jacobian(self, y: NDArray[Any]) -> NDArray[Any]:
        """Derivatives (n, variables) at one point y (variables,), real or complex."""
        result = np.zeros((len(self.coefficients), len(y)), np.result_type(self.coefficients, y, float))
        values = y[self.monomials]
        for place in range(self.degree):
            slopes = self.coefficients * np.prod(np.delete(values, place, axis=1), axis=1)
            np.add.at(result.T, self.monomials[:, place], slopes.T)
        return result

    def tensor(self, variables: int) -> NDArray[Any]:
        """The symmetric tensor (n, variables, …, variables) with Φ_i(y) = t_ijk… y_j y_k …."""
        full = np.zeros((len(self.coefficients), *[variables] * self.degree), self.coefficients.dtype)
        for monomial, column in zip(self.monomials.tolist(), self.coefficients.T, strict=True):
            places = set(permutations(monomial))
            for place in places:
                full[(slice(None), *place)] = column / len(places)
        return full

    def entries(self) -> list[tuple[int, Monomial, Any]]:
        """All (i, monomial, coefficient) that are not zero, by row, then monomial."""
        rows, columns = np.nonzero(self.coefficients)
        found = [
            (int(i), tuple(self.monomials[j].tolist()), self.coefficients[i, j])
            for i, j in zip(rows, columns, strict=True)
        ]
        return sorted(found, key=lambda entry: entry[:2])


def homogeneous(rows: Sequence[Mapping[Monomial, Any]], degree: int) -> Homogeneous:
    """From a mapping monomial → coefficient for each of the n functions; monomials of other degrees are left out."""
    monomials = sorted({m for row in rows for m, value in row.items() if len(m) == degree and value != 0})
    coefficients = np.array([[row.get(m, 0) for m in monomials] for row in rows]).reshape(len(rows), len(monomials))
    return Homogeneous(np.array(monomials, dtype=np.intp).reshape(len(monomials), degree), coefficients)


def parts(functions: Sequence[PowerSeries]) -> dict[int, Homogeneous]:
    """The homogeneous parts of expanded functions, by degree; degrees that do not occur are left out."""
    rows = [function.terms for function in functions]
    degrees = sorted({len(m) for row in rows for m, value in row.items() if value != 0})
    return {degree: homogeneous(rows, degree) for degree in degrees}
