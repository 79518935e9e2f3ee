"""The series in the small parameter, Eqs. (3.15)–(3.16), for any order: ξ = ξ⁽⁰⁾ + ε ξ⁽¹⁾ + ε² ξ⁽²⁾ + ….

Inserted into x' = A x + B w + Σ_p εᵖ Φ_p(x, w), the powers of ε give, in modal coordinates,

    ξ⁽ᵏ⁾' = Λ ξ⁽ᵏ⁾ + K⁻¹ Σ_p [Φ_p(x⁽⁰⁾ + ε x⁽¹⁾ + …, w)]_(k−p),   ξ⁽ᵏ⁾(t0) = 0 for k > 0,

which for a cubic Φ_1 alone is (3.16). Where w is a sum of exponentials, every order is one of exponentials times
powers of time, piece by piece: it is formed exactly, and its value at any time takes no time stepping.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .exponentials import Exponentials, Integers, Resonance, distinct, forced_modes
from .modes import Complex, Modes
from .polynomials import Array, Homogeneous
from .signals import Piece, Signal
from .standard_form import StandardForm

CANCELLED = 1e-10  # secular terms of one mode that sum to less than this of their sizes' sum are no growth
LARGEST_DENOMINATOR = 1000  # of ratios of input frequencies that are taken for rational


@dataclass(frozen=True, slots=True, kw_only=True)
class Secular:
    """A term of the series that grows like a power of time times exp(λ_k t), and the sum of exponents that makes it.

    λ_1 = λ_1 + σ_1 + σ_2 with σ_2 = −σ_1, say, is the drift of an amplitude by a wave and its conjugate: A_k + B_k of
    (3.20).
    """

    order: int
    begin: float  # of the piece [s]
    mode: int  # k, from 1
    combination: tuple[tuple[int, str], ...]  # multiples of λ_1, …, and of the input's exponents σ_1, …
    power: int  # of time
    distance: complex  # of the combination from λ_k [1/s], 0 if equal to round-off
    coefficient: complex  # of time's power [m or rad / s^power]

    def __str__(self) -> str:
        total = " + ".join(name if count == 1 else f"{count} {name}" for count, name in self.combination)
        equals = "=" if self.distance == 0 else "≈"
        apart = "" if self.distance == 0 else f" (apart by {self.distance:.2g} 1/s)"
        power = "t" if self.power == 1 else f"t^{self.power}"
        return (
            f"order {self.order}, from t = {self.begin:g} s: λ_{self.mode} {equals} {total}{apart}: "
            f"grows like {power} exp(λ_{self.mode} t)"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """ξ⁽⁰⁾, ξ⁽¹⁾, … as exact sums: per piece from edges[i] [s] on, per order, n functions of the time since then."""

    modes: Modes
    edges: tuple[float, ...]
    pieces: tuple[tuple[Exponentials, ...], ...]
    secular: tuple[Secular, ...]

    def modal(self, t: ArrayLike) -> Complex:
        """ξ⁽ᵏ⁾ (orders, n, len(t)) at the times t [s], none before the first edge, in any order."""
        times = np.asarray(t, dtype=float)
        n = len(self.modes.eigenvalues)
        values = np.empty((len(self.pieces[0]), n, len(times)), complex)
        upper, lower = np.flatnonzero(self.modes.beta >= 0), np.flatnonzero(self.modes.beta < 0)
        index = np.searchsorted(self.edges, times, side="right") - 1
        for i, (begin, orders) in enumerate(zip(self.edges, self.pieces, strict=True)):
            inside = index == i
            for k, xi in enumerate(orders):
                values[k, upper[:, None], np.flatnonzero(inside)] = xi[upper](times[inside] - begin)
        values[:, lower] = values[:, lower - n // 2].conj()
        return values

    def physical(self, t: ArrayLike) -> Array:
        """x⁽ᵏ⁾ = K ξ⁽ᵏ⁾ (orders, n, len(t)), real."""
        return (self.modes.K @ self.modal(t)).real


def partial_sums(terms: Array, epsilon: float = 1.0) -> Array:
    """x⁽⁰⁾, x⁽⁰⁾ + ε x⁽¹⁾, … (orders, n, …): the approximations of order 0, 1, … from the terms (orders, n, …)."""
    return np.cumsum([term * epsilon**k for k, term in enumerate(terms)], axis=0)


def successive_ratios(modal: Complex) -> Array:
    """sup |ξ⁽ᵏ⁺¹⁾| / sup |ξ⁽ᵏ⁾| (orders − 1,) over all coordinates and the times of ξ (orders, n, times).

    The series is of use for |ε| well below the reciprocal of the last one, its practical radius; where ε stands for
    the square of a size, as in an odd system, for sizes times less than the square root of that.
    """
    sizes = np.abs(modal).max(axis=(1, 2))
    return sizes[1:] / sizes[:-1]


def exact_series(form: StandardForm, modes: Modes, signal: Signal, x0: ArrayLike, order: int) -> Series:
    """The series up to εᵒʳᵈᵉʳ under the input of the signal, from x0 (n,) at its begin.

    Which terms Φ has decides what it is a series of: see `standard_form.only` to leave some out (§3.3 is without
    the terms that hold w). Raises InputError if the sums would have more terms than can be numbered.
    """
    start: list[Complex] = [modes.K_inverse @ np.asarray(x0, float)]
    start += [np.zeros_like(start[0])] * order
    pieces, secular = [], []
    for piece, end in zip(signal.pieces, [*signal.edges[1:], math.inf], strict=True):
        orders, found = _on_piece(form, modes, piece, start)
        pieces.append(orders)
        secular += found
        if end < math.inf:
            start = [xi(np.array([end - piece.begin]))[:, 0] for xi in orders]
    return Series(modes=modes, edges=tuple(signal.edges), pieces=tuple(pieces), secular=tuple(secular))


def _on_piece(
    form: StandardForm, modes: Modes, piece: Piece, start: Sequence[Complex]
) -> tuple[tuple[Exponentials, ...], list[Secular]]:
    w = _input(modes.eigenvalues, piece)
    orders: list[Exponentials] = []
    secular: list[Secular] = []
    for k, forcing in enumerate(forcings(form, modes, w, orders, len(start))):
        xi, resonances = forced_modes(forcing, start[k])
        orders.append(xi)
        secular += _secular(k, piece.begin, modes, resonances)
    return tuple(orders), secular


def forcings(form: StandardForm, modes: Modes, w: Any, orders: Sequence[Any], count: int) -> Any:
    """The right-hand sides of the recursion in modal coordinates, order by order, without Λ ξ⁽ᵏ⁾.

    `orders` is to hold ξ⁽⁰⁾ … ξ⁽ᵏ⁻¹⁾ when the k-th is asked for. They and w are functions of time of any kind that
    index, add and multiply like arrays of their values: sums of exponentials, or samples.
    """
    n, m = form.B.shape
    of_x, of_w = np.eye(n + m)[:, :n] @ modes.K, np.eye(n + m)[:, n:]
    y: list[Any] = []  # (x, w) by powers of ε; w is of power 0
    expansions = [(p, expansion(part, y)) for p, parts in form.terms.items() for part in parts]
    yield modes.K_inverse @ form.B @ w
    for k in range(1, count):
        y.append(of_x @ orders[k - 1] + of_w @ w if k == 1 else of_x @ orders[k - 1])
        nothing = np.zeros((n, n + m)) @ y[0]
        yield modes.K_inverse @ sum((part(k - p) for p, part in expansions if p <= k), nothing)


def expansion(part: Homogeneous, y: Sequence[Any]) -> Callable[[int], Any]:
    """k → the coefficient of εᵏ in part(y[0] + ε y[1] + …); y may still grow between the calls."""

    levels = []  # per place: the last factor of each distinct beginning of a monomial, and what it is multiplied with
    before = np.zeros(len(part.monomials), np.intp)
    for place in range(part.degree):
        beginnings = part.monomials[:, : place + 1]
        _, first, where = np.unique(beginnings, axis=0, return_index=True, return_inverse=True)
        levels.append((beginnings[first, place], before[first]))
        before = where.reshape(-1)
    coefficients = np.zeros((len(part.coefficients), len(levels[-1][0])))
    np.add.at(coefficients.T, before, part.coefficients.T)

    @cache
    def product(place: int, k: int) -> Any:
        factors, earlier = levels[place]
        if place == 0:
            return y[k][factors]
        values = [product(place - 1, k - j)[earlier] * y[j][factors] for j in range(k + 1)]
        return sum(values[1:], values[0])

    return lambda k: coefficients @ product(part.degree - 1, k)


def _secular(order: int, begin: float, modes: Modes, resonances: Sequence[Resonance]) -> list[Secular]:
    """The resonances by name: of conjugate modes the first one, and none where they cancel."""
    n = len(modes.eigenvalues)
    growth: dict[tuple[int, int], list[complex]] = {}
    for r in resonances:
        growth.setdefault((r.mode, r.degree), []).append(r.coefficient)
    found = []
    for r in resonances:
        sizes = growth[r.mode, r.degree]
        if modes.beta[r.mode] < 0 or abs(sum(sizes)) <= CANCELLED * sum(map(abs, sizes)):
            continue
        names = [f"λ_{i + 1}" if i < n else f"σ_{i - n + 1}" for i in range(len(r.multiples))]
        found.append(
            Secular(
                order=order,
                begin=begin,
                mode=r.mode + 1,
                combination=tuple((count, name) for count, name in zip(r.multiples, names, strict=True) if count),
                power=r.degree + 1,
                distance=r.distance,
                coefficient=r.coefficient / (r.degree + 1),
            )
        )
    return found


def _input(eigenvalues: Complex, piece: Piece) -> Exponentials:
    """w on the piece, over the rates λ_1, …, λ_n, σ_1, …."""
    used = piece.amplitudes.any(axis=0)
    rates, multiples = common_rates(piece.exponents[used])
    none = np.zeros((len(multiples), 1 + len(eigenvalues)), np.int64)
    together, where = distinct(np.concatenate([none, multiples], axis=1))
    amplitudes = np.zeros((len(together), len(piece.amplitudes)), complex)
    np.add.at(amplitudes, where, piece.amplitudes.T[used])
    return Exponentials(np.concatenate([eigenvalues, rates]), together, amplitudes)


def common_rates(exponents: Complex) -> tuple[Complex, Integers]:
    """Rates σ (R,) as few as found, and whole multiples (K, R) >= 0 of them that are the exponents (K,).

    Exponents in a positive rational ratio (the harmonics of a road) share a rate, so that sums of them that are equal
    are found to be so. Opposite waves, and a constant, have rates of their own: where they cancel each other in a sum,
    or add nothing to it, its name still says that they were in it.
    """
    firsts: list[complex] = []
    ratios: list[dict[int, Fraction]] = []
    for place, sigma in enumerate(exponents.tolist()):
        for first, members in zip(firsts, ratios, strict=True):
            if (ratio := _ratio(sigma, first)) is not None:
                members[place] = ratio
                break
        else:
            firsts.append(sigma)
            ratios.append({place: Fraction(1)})
    multiples = np.zeros((len(exponents), len(firsts)), np.int64)
    rates = np.zeros(len(firsts), complex)
    for r, (first, members) in enumerate(zip(firsts, ratios, strict=True)):
        parts = math.lcm(*(ratio.denominator for ratio in members.values()))
        rates[r] = first / parts
        for place, ratio in members.items():
            multiples[place, r] = int(ratio * parts)
    return rates, multiples


def _ratio(sigma: complex, first: complex) -> Fraction | None:
    """sigma/first if that is rational and positive."""
    if 0 in (sigma, first):
        return Fraction(1) if sigma == first else None
    ratio = sigma / first
    near = Fraction(ratio.real).limit_denominator(LARGEST_DENOMINATOR)
    return near if near > 0 and abs(ratio - float(near)) <= 1e-14 * abs(ratio) else None
