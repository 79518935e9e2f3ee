"""How far R(x, w) = F(x, w) − A x − B w can change: a majorant, a polynomial with coefficients ≥ 0 and a bounded tail.

If |x_j| ≤ X_j and |y_j| ≤ Y_j then |R(x + y, w) − R(x, w)| ≤ R̄(X + Y, W) − R̄(X, W), row by row, where R̄ has the
absolute values of R's coefficients. Up to ORDER these are computed with balls. The rest is bounded by evaluating the
equations with numbers that keep only the sizes of coefficients (sin → sinh, cos → cosh) and see no terms cancel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, arb_series
from numpy.typing import NDArray

from ..methods.power_series import PowerSeries, cos, sin, variables
from .balls import Array, ExactSystem, NotProvedError, above, coefficients, precision, refuse_unrest

ORDER = 5
ROOM = 2.5  # of the box on which the equations are bounded, over the largest motion; 1.5 to 8 hardly change δ_max
ROOM_INPUT = 10.0  # the same for inputs, so that a quiet motion under a large input is not taken for a large one
SECANT = 0.125  # of a box's side
CRUMB = 1e-18  # coefficients below it are lumped together
SLACK = 1e-12  # relative; a few hundred roundings of numbers ≥ 0 make less than 1e-13


@dataclass(frozen=True, slots=True)
class Sizes:
    """A power series: its constant, a ball, and a series in s that bounds the rest, coefficient by coefficient."""

    constant: Any
    rest: Any

    def __add__(self, other: Any) -> Sizes:
        c, r = _parts(other)
        return Sizes(self.constant + c, self.rest + r)

    def __sub__(self, other: Any) -> Sizes:
        c, r = _parts(other)
        return Sizes(self.constant - c, self.rest + r)

    def __rsub__(self, other: Any) -> Sizes:
        return Sizes(other - self.constant, self.rest)

    def __neg__(self) -> Sizes:
        return Sizes(-self.constant, self.rest)

    def __mul__(self, other: Any) -> Sizes:
        c, r = _parts(other)
        rest = r * _size(self.constant) + self.rest * _size(c) + self.rest * r
        return Sizes(self.constant * c, rest)

    def __truediv__(self, other: Any) -> Sizes:
        c, r = _parts(other)
        inverse = 1 / arb(c)
        if not coefficients(r, 1)[0] * _size(inverse) < 1:
            raise NotProvedError("a divisor may be 0 on the box, as far as the sizes of its terms say")
        bound = 1 / (1 - r * _size(inverse))  # 1/(c + r) = Σ (−r/c)ᵏ/c
        return self * Sizes(inverse, (bound - 1) * _size(inverse))

    def __rtruediv__(self, other: Any) -> Sizes:
        return Sizes(arb(other), arb_series([0])) / self

    __radd__ = __add__
    __rmul__ = __mul__


def _parts(x: Any) -> tuple[Any, Any]:
    return (x.constant, x.rest) if isinstance(x, Sizes) else (arb(x), arb_series([0]))


def _size(x: Any) -> Any:
    return arb(x).abs_upper()


def _sinh(x: Sizes) -> Sizes:
    _at_zero(x)
    return Sizes(arb(0), (x.rest.exp() - (-x.rest).exp()) / 2)


def _cosh(x: Sizes) -> Sizes:
    _at_zero(x)
    return Sizes(arb(1), (x.rest.exp() + (-x.rest).exp()) / 2 - 1)


def _at_zero(x: Sizes) -> None:
    if not x.constant == 0:
        raise NotProvedError("sine and cosine are bounded around 0 only")


@dataclass(frozen=True, slots=True)
class Majorant:
    """R̄ of a system: monomials (M, ORDER) of y = (x, w, 1), coefficients ≥ 0 (n, M), and its tail on a box."""

    monomials: NDArray[np.intp]
    coefficients: Array
    signed: Array  # (n, M), R's own coefficients, rounded
    box: Array  # (n + m,)
    crumbs: Array  # (n,), bound on the box of all terms whose coefficients are but rounding
    slope: Array  # (n, n + m), bound of the tail's derivatives on the box; on s · box, s ≤ 1, s^ORDER times that

    def __call__(self, Y: Array) -> Array:
        """R̄ (n, K) at sizes Y (n + m, K) ≥ 0, its tail left out; right but for SLACK."""
        return self.coefficients @ self._products(Y)

    def expansion(self, y: Array) -> Array:
        """R (n, K) at y (n + m, K), its tail left out; right but for SLACK times R̄(|y|)."""
        return self.signed @ self._products(y)

    def _products(self, y: Array) -> Array:
        factors = np.concatenate([y, np.ones((1, y.shape[1]))])
        first, *others = self.monomials.T
        products = factors[first]
        for each in others:
            products *= factors[each]
        return products

    def _derivatives(self, coefficients: Array, y: Array) -> Array:
        """∂/∂y (n, n + m, K) of the polynomials with these coefficients (n, M) at y (n + m, K), the tail left out."""
        factors = np.concatenate([y, np.ones((1, y.shape[1]))])[self.monomials]
        found = np.zeros((len(coefficients), *y.shape))
        for k in range(ORDER):
            others = np.multiply.reduce(np.delete(factors, k, axis=1), axis=1)
            of = self.monomials[:, k] == np.arange(len(y))[:, None]
            found += (coefficients[:, None, :] * of) @ others
        return found

    def tail(self, far: Array, Y: Array) -> Array:
        """Bound (n, K) of how the tail changes by Y (n + m, K) on the box far (n + m, K), inf out of the whole box."""
        s = (far / self.box[:, None]).max(axis=0)
        return np.where(s <= 1.0, s**ORDER * (self.slope @ Y), np.inf) + self.crumbs[:, None]

    def change(self, X: Array, at_X: Array, Y: Array) -> Array:
        """Bound (n, K) of |R(x + y, w) − R(x, w)|, inf out of the box.

        X (n + m, K or 1) bounds (x, w), Y (n + m, K) bounds (y, 0); at_X (n, K or 1) is R̄(X).
        """
        far = X + Y
        return (self(far) * (1.0 + SLACK) - at_X * (1.0 - SLACK) + self.tail(far, Y)) * (1.0 + SLACK)

    def change_near(self, middle: Array, radius: Array, Y: Array) -> Array:
        """Bound (n, K) of |R(z + y) − R(z)| for |z − middle| ≤ radius and |y| ≤ Y (n + m, K), inf out of the box.

        By R's derivatives in the middle, of which terms may cancel, and by those of R̄ for how they change.
        """
        sizes = np.abs(middle)
        by_own = np.einsum("ijk,jk->ik", np.abs(self._derivatives(self.signed, middle)), Y)
        by_sizes = np.einsum("ijk,jk->ik", self._derivatives(self.coefficients, sizes), Y)
        far = sizes + radius + Y
        total = self(far)
        changed = by_own - by_sizes + total - self(sizes + radius)
        return np.asarray((changed + 4.0 * SLACK * total) * (1.0 + SLACK) + self.tail(far, Y))


def majorant(system: ExactSystem, box: Array) -> Majorant:
    """R̄ of the system, its tail bounded on |y_j| ≤ box_j (n + m,), all > 0.

    Raises NotProvedError where a divisor may be 0 on the box, or sine or cosine is not around 0; unless F(0, 0) = 0.
    """
    refuse_unrest(system)
    y = variables(system.n + system.m, ORDER, arb(1))
    rates = system.equations(y[: system.n], y[system.n :], sin, cos)
    rows = [rate.terms if isinstance(rate, PowerSeries) else {} for rate in rates]
    found = sorted({m for row in rows for m in row if len(m) > 1})
    one = system.n + system.m
    monomials = np.array([[*m, *[one] * (ORDER - len(m))] for m in found], dtype=np.intp).reshape(len(found), ORDER)
    values = np.array([[above(row[m]) if m in row else 0.0 for m in found] for row in rows])
    signed = np.array([[float(arb(row[m]).mid()) if m in row else 0.0 for m in found] for row in rows])
    used = (values > CRUMB).any(axis=0)
    crumbs = (values[:, ~used] * np.prod(np.append(box, 1.0)[monomials[~used]], axis=1)).sum(axis=1)
    kept = monomials[used], values[:, used], signed[:, used]
    return Majorant(*kept, box, crumbs * (1.0 + SLACK), _tail_slope(system, box))


def roomy(system: ExactSystem, X: Array) -> Majorant:
    """The majorant on a box with room around motions and inputs within X (n + m,); raises as `majorant`."""
    return majorant(system, np.concatenate([ROOM * X[: system.n], ROOM_INPUT * X[system.n :]]) + 1e-9)


def _tail_slope(system: ExactSystem, box: Array) -> Array:
    """Derivatives of the tail at the box: it is convex in every variable, so a secant beyond the box is steeper."""
    here, columns = _tail(system, box), []
    for j, size in enumerate(box.tolist()):
        beyond = box.copy()
        beyond[j] += SECANT * size
        rise = [b - a for a, b in zip(here, _tail(system, beyond), strict=True)]
        columns.append([above(r) / (SECANT * size) * (1.0 + SLACK) for r in rise])
    return np.array(columns).T


def _tail(system: ExactSystem, box: Array) -> list[Any]:
    """Σ of all terms of a degree > ORDER at the box: the whole minus its first terms."""
    with precision(ORDER + 1):
        first = _sizes(system, [arb_series([0, arb(v)]) for v in box.tolist()])
    with precision(1):
        whole = _sizes(system, [arb_series([arb(v)]) for v in box.tolist()])
    return [total - terms for total, terms in zip(whole, first, strict=True)]


def _sizes(system: ExactSystem, rests: list[Any]) -> list[Any]:
    """Sums of the rates' bounds, constants left out."""
    y = [Sizes(arb(0), rest) for rest in rests]
    rates = system.equations(y[: system.n], y[system.n :], _sinh, _cosh)
    return [sum(coefficients(rate.rest, ORDER + 1), arb(0)) if isinstance(rate, Sizes) else arb(0) for rate in rates]
