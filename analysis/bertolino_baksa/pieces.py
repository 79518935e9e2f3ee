"""Polynomials near x_lin and near e on a piece of time, and the matrices that take their coefficients elsewhere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

from flint import arb, arb_mat, fmpq

from .balls import Array, column, matrix

MORE = 4  # terms of a defect's series beyond the polynomials' degree; what is left is enclosed


@dataclass(frozen=True)
class Piece:
    """Coefficients (n, degree + 1) of τᵏ near x_lin and near e, τ = (t − begin)/(end − begin); times exact [s]."""

    begin: fmpq
    end: fmpq
    linear: Array
    error: Array

    @property
    def duration(self) -> fmpq:
        """end − begin [s]."""
        return self.end - self.begin

    @property
    def terms(self) -> int:
        """Number of terms of series along the piece, MORE than its polynomials have."""
        return self.linear.shape[1] + MORE

    @cached_property
    def near_x_lin(self) -> arb_mat:
        """The polynomials near x_lin by powers of σ = 2τ − 1: balls (n, terms), the last MORE of a row 0."""
        return matrix(self.linear) * _to_middle(self.terms - MORE)

    @cached_property
    def near_x(self) -> arb_mat:
        """The same near x."""
        return self.near_x_lin + matrix(self.error) * _to_middle(self.terms - MORE)


@cache
def _to_middle(count: int) -> arb_mat:
    """What takes coefficients (count,) of τᵏ to those (count + MORE,) of σᵏ: τ = (1 + σ)/2."""
    return arb_mat([[arb(math.comb(j, k)) / 2**j for k in range(count + MORE)] for j in range(count)])


@cache
def everywhere(terms: int) -> arb_mat:
    """What takes coefficients (terms,) of σᵏ to those of (σ − s)ᵏ, at all |s| ≤ 1 at once."""
    powers = _powers_of_span(terms)
    rows = ([math.comb(j, k) * powers[j - k] if k <= j else arb(0) for k in range(terms)] for j in range(terms))
    return arb_mat(list(rows))


@cache
def span(terms: int) -> arb_mat:
    """Balls (terms, 1) around σᵏ of all |σ| ≤ 1."""
    return column(_powers_of_span(terms))


def _powers_of_span(terms: int) -> list[Any]:
    return [arb(1), *(arb(0, 1) if k % 2 else arb(0.5, 0.5) for k in range(1, terms))]


@cache
def derivative(terms: int) -> arb_mat:
    """What takes coefficients (terms,) of σᵏ to those of the derivative."""
    return arb_mat([[j if j == k + 1 else 0 for k in range(terms)] for j in range(terms)])
