"""Numbers that carry a power series in several variables, cut at an order: equations evaluated with them are expanded.

A monomial is the sorted tuple of its variables' indices, so () is the constant, (1, 1, 2) stands for x1² x2, and the
coefficient of a monomial is the entry of a tensor with those indices. Coefficients may be of any kind that adds,
multiplies and is divided by integers: floats, fractions, sympy expressions, balls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

Monomial = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class PowerSeries:
    """Σ coefficient · monomial over all monomials of a degree ≤ order."""

    terms: dict[Monomial, Any]
    order: int

    def __add__(self, other: Any) -> PowerSeries:
        terms = dict(self.terms)
        for monomial, value in _terms(other).items():
            terms[monomial] = terms[monomial] + value if monomial in terms else value
        return PowerSeries(terms, self.order)

    def __mul__(self, other: Any) -> PowerSeries:
        terms: dict[Monomial, Any] = {}
        factors = _terms(other).items()
        for left, a in self.terms.items():
            for right, b in factors:
                if len(left) + len(right) <= self.order:
                    monomial = tuple(sorted(left + right))
                    terms[monomial] = terms[monomial] + a * b if monomial in terms else a * b
        return PowerSeries(terms, self.order)

    def __truediv__(self, other: Any) -> PowerSeries:
        if not isinstance(other, PowerSeries):
            return PowerSeries({monomial: value / _exact(other) for monomial, value in self.terms.items()}, self.order)
        constant = other.terms.get((), 0)
        ratio = PowerSeries({m: -value / constant for m, value in other.terms.items() if m}, self.order)
        return _substituted([1] * (self.order + 1), ratio) * self / constant  # 1/(c + r) = Σ (−r/c)ᵏ / c

    def __neg__(self) -> PowerSeries:
        return self * -1

    def __sub__(self, other: Any) -> PowerSeries:
        return self + -other

    def __rsub__(self, other: Any) -> PowerSeries:
        return -self + other

    def __rtruediv__(self, other: Any) -> PowerSeries:
        return PowerSeries({(): other}, self.order) / self

    __radd__ = __add__
    __rmul__ = __mul__


def variables(count: int, order: int, one: Any = 1.0) -> list[PowerSeries]:
    """x0, x1, … as series up to the order; `one` is the unit of the coefficients' kind."""
    return [PowerSeries({(i,): one}, order) for i in range(count)]


def sin(x: PowerSeries) -> PowerSeries:
    """Sine of a series without a constant."""
    return _trigonometric(x, (0, 1, 0, -1))


def cos(x: PowerSeries) -> PowerSeries:
    """Cosine of a series without a constant."""
    return _trigonometric(x, (1, 0, -1, 0))


def _trigonometric(x: PowerSeries, derivatives: Sequence[int]) -> PowerSeries:
    """Σ f⁽ᵏ⁾(0) xᵏ/k!, with the derivatives repeating themselves."""
    if () in x.terms:
        raise ValueError("sine and cosine are expanded at 0 only: wanted a series without a constant")
    zero = next(iter(x.terms.values()), 0.0) * 0  # of the coefficients' kind
    return _substituted([(zero + derivatives[k % 4]) / math.factorial(k) for k in range(x.order + 1)], x)


def _substituted(coefficients: Sequence[Any], x: PowerSeries) -> PowerSeries:
    """Σ coefficients[k] xᵏ by Horner's rule."""
    value = PowerSeries({}, x.order)
    for c in reversed(coefficients):
        value = value * x if c == 0 else value * x + c
    return value


def _terms(other: Any) -> dict[Monomial, Any]:
    return other.terms if isinstance(other, PowerSeries) else {(): _exact(other)}


def _exact(number: Any) -> Any:
    """Literals such as 2.0 as integers, which leave fractions and symbols exact."""
    return int(number) if isinstance(number, float) and number.is_integer() else number
