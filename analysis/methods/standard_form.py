"""The form that the methods of §2 and §3 work on, Eq. (2.1): x' = A x + f(t) + ε Φ(t, x).

A system is given by its equations, x' = F(x, w) with the input w(t); A, f = B w and Φ are the parts of F's power series
in (x, w) at rest. So parametric excitation (terms with w and x) is a part of Φ like any other. No car is known here or
in the methods: it enters in `car.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .polynomials import Array, Homogeneous, parts
from .power_series import Monomial, PowerSeries, cos, sin, variables

Function = Callable[[Any], Any]
Equations = Callable[[Sequence[Any], Sequence[Any], Function, Function], Sequence[Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class StandardForm:
    """x' = A x + B w + Σ_p εᵖ Φ_p(x, w), which for ε = 1 is the series of x' = F(x, w).

    names     : of the n states.
    A, B      : (n, n), (n, m).
    terms     : Φ_p by the power p of ε; each a sum of homogeneous polynomials in y = (x, w), n + m variables.
    equations : F(x, w, sin, cos) in any kind of number, with the functions of that kind.
    """

    names: tuple[str, ...]
    A: Array
    B: Array
    terms: Mapping[int, tuple[Homogeneous, ...]]
    equations: Equations

    def rate(self, x: NDArray[Any], w: NDArray[Any]) -> NDArray[Any]:
        """F(x, w) (n, …) for x (n, …) and w (m, …), numbers of numpy."""
        values = self.equations(list(x), list(w), np.sin, np.cos)
        return np.stack(np.broadcast_arrays(*values))

    def Phi(self, x: NDArray[Any], w: NDArray[Any], upto: int | None = None) -> NDArray[Any]:
        """Σ Φ_p(x, w) over the powers p ≤ upto (all if None), ε = 1; shapes as in `rate`."""
        y = np.concatenate([np.asarray(x), np.asarray(w)])
        chosen = [part for p, terms in self.terms.items() if upto is None or p <= upto for part in terms]
        return sum((part(y) for part in chosen), np.zeros_like(np.asarray(x)))


def standard_form(
    equations: Equations, states: Sequence[str], inputs: int, *, order: int = 3, powers: Mapping[int, int] | None = None
) -> StandardForm:
    """Expand F(x, w) at x = 0, w = 0 to a degree ≤ order.

    powers : the power of ε for each degree; by default ε is the square of the motion's size if only odd degrees
             occur, p = (d − 1)/2, otherwise its size, p = d − 1.

    Raises InputError if F(0, 0) ≠ 0: rest is then no motion.
    """
    n = len(states)
    found = _expanded(equations, n, inputs, order)
    linear = np.zeros((n, n + inputs))
    if 1 in found:
        linear[:, found[1].monomials[:, 0]] = found[1].coefficients
    higher = [degree for degree in found if degree > 1]
    halved = all(degree % 2 for degree in higher)
    power = powers or {degree: (degree - 1) // 2 if halved else degree - 1 for degree in higher}
    terms: dict[int, tuple[Homogeneous, ...]] = {}
    for degree in higher:
        terms[power[degree]] = (*terms.get(power[degree], ()), found[degree])
    return StandardForm(names=tuple(states), A=linear[:, :n], B=linear[:, n:], terms=terms, equations=equations)


def perturbed(form: StandardForm, perturbation: Equations, *, order: int = 3) -> StandardForm:
    """x' = F(x, w) + ε G(x, w): all of G's series to a degree ≤ order, its linear part too, becomes a part of ε Φ_1.

    Raises InputError if G(0, 0) ≠ 0.
    """
    states, inputs = form.B.shape
    added = _expanded(perturbation, states, inputs, order)

    def both(x: Sequence[Any], w: Sequence[Any], sine: Function, cosine: Function) -> Sequence[Any]:
        values = zip(form.equations(x, w, sine, cosine), perturbation(x, w, sine, cosine), strict=True)
        return [f + g for f, g in values]

    return replace(form, terms={**form.terms, 1: (*form.terms.get(1, ()), *added.values())}, equations=both)


def only(form: StandardForm, keep: Callable[[Monomial], bool]) -> StandardForm:
    """The form with those monomials of Φ that are to be kept; `equations` stay those of the whole system.

    Monomials are sorted indices in y = (x, w): max(monomial) < n keeps the terms without w, so that there is no
    parametric excitation.
    """
    terms: dict[int, tuple[Homogeneous, ...]] = {}
    for p, found in form.terms.items():
        for part in found:
            kept = np.array([keep(tuple(monomial)) for monomial in part.monomials.tolist()], bool)
            if kept.any():
                terms[p] = (*terms.get(p, ()), Homogeneous(part.monomials[kept], part.coefficients[:, kept]))
    return replace(form, terms=terms)


def _expanded(equations: Equations, states: int, inputs: int, order: int) -> dict[int, Homogeneous]:
    """The homogeneous parts of F(x, w) by degree, coefficients as floats. Raises InputError if F(0, 0) ≠ 0."""
    y = variables(states + inputs, order)
    values = equations(y[:states], y[states:], sin, cos)
    found = parts([value if isinstance(value, PowerSeries) else y[0] * 0 + value for value in values])
    if 0 in found:
        raise InputError(f"x' = F(x, w): wanted F(0, 0) = 0, got {found[0].coefficients[:, 0].tolist()}")
    return {degree: replace(part, coefficients=part.coefficients.astype(float)) for degree, part in found.items()}
