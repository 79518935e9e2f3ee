"""The algebra of exponential polynomials Σ c sʲ exp(μ s): closed under sums, products and linear oscillators.

An exponent μ is a sum of a few rates with whole multiples, and is kept as those multiples: equal sums are one term
exactly, not to round-off. The power j of time is one more multiple, so a product adds rows of integers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .modes import Complex
from .polynomials import Array

Integers = NDArray[np.int64]

NEAR = 0.01, 0.1  # a forcing exponent this close to λ, over 1/time scale of λ, is expanded about λ: steady, secular
PATIENCE = 1e3  # the time scale of λ is 1/|Re λ|, or this over |λ| where damping is weaker
EQUAL = 1e-13  # exponents are equal that differ by less than this of the sum of their parts' sizes
NEGLIGIBLE = 1e-18  # terms of the expansion about λ that are smaller, over its first term, are left out
BLOCK = 2**20  # values of single terms that are held at a time


@dataclass(frozen=True, slots=True, eq=False)
class Exponentials:
    """n functions f_i(s) = Σ_e coefficients[e, i] s^multiples[e, 0] exp(s Σ_r multiples[e, 1 + r] rates[r]).

    rates (R,) [1/s]; multiples (E, 1 + R), rows distinct; coefficients (E, n). Indices and matrices act on the
    functions as they do on an array (n, …) of their values: f[[0, 0, 2]], matrix @ f, f * g, f + g.
    """

    rates: Complex
    multiples: Integers
    coefficients: Complex

    __array_ufunc__ = None  # so that `matrix @ f` comes here

    def __getitem__(self, functions: Any) -> Exponentials:
        return replace(self, coefficients=self.coefficients[:, functions])

    def __rmatmul__(self, matrix: NDArray[Any]) -> Exponentials:
        return without_zeros(replace(self, coefficients=self.coefficients @ matrix.T))

    def __add__(self, other: Exponentials) -> Exponentials:
        multiples, where = distinct(np.concatenate([self.multiples, other.multiples]))
        coefficients = np.zeros((len(multiples), self.coefficients.shape[1]), complex)
        coefficients[where[: len(self.multiples)]] = self.coefficients
        coefficients[where[len(self.multiples) :]] += other.coefficients
        return without_zeros(Exponentials(self.rates, multiples, coefficients))

    def __mul__(self, other: Exponentials) -> Exponentials:
        """f_i g_i for each i."""
        long, short = (self, other) if len(self.multiples) >= len(other.multiples) else (other, self)
        multiples, where = _sums(short.multiples, long.multiples)
        coefficients = np.zeros((len(multiples), self.coefficients.shape[1]), complex)
        for rows, factors in zip(where, short.coefficients, strict=True):  # no row of the product comes twice here
            coefficients[rows] += long.coefficients * factors
        return without_zeros(Exponentials(self.rates, multiples, coefficients))

    def __call__(self, s: Array) -> Complex:
        """Values (n, len(s)) at the times s [s]."""
        values = np.empty((self.coefficients.shape[1], len(s)), complex)
        half = 1 + len(self.rates) // 2  # each exponential is a product of two out of two short lists
        left, i = distinct(self.multiples[:, 1:half])
        right, j = distinct(self.multiples[:, half:])
        degrees, powers = self.multiples[:, :1], bool(self.multiples[:, 0].any())
        size = max(1, BLOCK // max(1, len(self.multiples)))
        for begin in range(0, len(s), size):
            time = s[begin : begin + size]
            waves = np.exp(np.multiply.outer(left @ self.rates[: half - 1], time))[i]
            waves *= np.exp(np.multiply.outer(right @ self.rates[half - 1 :], time))[j]
            if powers:
                waves *= time**degrees
            values[:, begin : begin + size] = self.coefficients.T @ waves
        return values


class Resonance(NamedTuple):
    """A forcing term coefficient · sʲ exp(μ s) of mode k, with μ = λ_k or so close that it is expanded about λ_k."""

    mode: int  # k, from 0
    multiples: tuple[int, ...]  # of μ over the rates
    degree: int  # j
    distance: complex  # μ − λ_k [1/s]; 0 if they are equal to round-off
    coefficient: complex


def forced_modes(f: Exponentials, start: Complex) -> tuple[Exponentials, list[Resonance]]:
    """Solution of ξ_k' = λ_k ξ_k + f_k(s), ξ(0) = start (n,), where λ_k is the k-th of f's rates; and the resonances.

    A term c sʲ exp(μs) far from λ_k gives a polynomial of degree j times exp(μs). Near λ_k that would be a small
    difference of large numbers; there exp((μ − λ_k)s) is expanded instead, and the term gives powers of s, from the
    (j + 1)-th, times exp(λ_k s): secular terms. The error of one term is then below 1e-9 of its largest value within
    ten time scales of λ_k; in the first half period below 1e-11 for j = 0, but 1e-5 for j = 2 (tests measure it).
    """
    n = len(start)
    exponents, where = distinct(f.multiples[:, 1:])
    forcing = np.zeros((1 + f.multiples[:, 0].max(initial=0), len(exponents), n), complex)
    forcing[f.multiples[:, 0], where] = f.coefficients
    gap = _gaps(exponents, f.rates, n)
    secular = forcing[1:].any(axis=(0, 2))
    near = np.abs(gap) <= np.where(secular, *NEAR[::-1])[:, None] / time_scales(f.rates[:n])
    solution = np.zeros_like(forcing)
    later = np.zeros_like(gap)
    for j in reversed(range(len(forcing))):  # (Σ a_j sʲ exp(δs))' = Σ c_j sʲ exp(δs)
        later = np.where(near, 0.0, (forcing[j] - (j + 1) * later) / np.where(near, 1.0, gap))
        solution[j] = later
    resonances = [
        Resonance(k, tuple(exponents[e].tolist()), j, complex(gap[e, k]), complex(forcing[j, e, k]))
        for j, e, k in np.argwhere(near & (forcing != 0.0)).tolist()
    ]
    particular = Exponentials(
        f.rates,
        np.concatenate([_with_degree(j, exponents) for j in range(len(forcing))]),
        solution.reshape(-1, n),
    )
    return particular + _at_eigenvalues(f.rates, start - solution[0].sum(axis=0), resonances), resonances


def _gaps(exponents: Integers, rates: Complex, n: int) -> Complex:
    """μ − λ_k (E, n), 0 if that is round-off."""
    gap = (exponents @ rates)[:, None] - rates[:n]
    gap[np.abs(gap) <= EQUAL * (np.abs(exponents) @ np.abs(rates))[:, None]] = 0.0
    return gap


def time_scales(eigenvalues: Complex) -> Array:
    """Time [s] in which a mode decays, grows or, if it hardly does either, in which it is looked at."""
    with np.errstate(divide="ignore"):
        return 1.0 / np.maximum(np.abs(eigenvalues.real), np.abs(eigenvalues) / PATIENCE)


def _at_eigenvalues(rates: Complex, free: Complex, resonances: Iterable[Resonance]) -> Exponentials:
    """free_k exp(λ_k s) and what resonances add: c ∫ sʲ exp(δs) ds exp(λ_k s) = c Σ δⁱ s^(i+j+1)/(i! (i+j+1)) …."""
    terms: dict[tuple[int, int], complex] = {(0, k): value for k, value in enumerate(free.tolist())}
    scales = time_scales(rates[: len(free)])
    for k, _, j, gap, c in resonances:
        ratio = abs(gap * scales[k]) if gap else 0.0
        for i in range(1 if ratio == 0.0 else math.ceil(math.log(NEGLIGIBLE) / math.log(ratio))):
            place = (i + j + 1, k)
            terms[place] = terms.get(place, 0.0) + c * gap**i / (math.factorial(i) * (i + j + 1))
    multiples = np.zeros((len(terms), 1 + len(rates)), np.int64)
    coefficients = np.zeros((len(terms), len(free)), complex)
    for row, ((power, k), value) in enumerate(terms.items()):
        multiples[row, 0], multiples[row, 1 + k], coefficients[row, k] = power, 1, value
    return Exponentials(rates, multiples, coefficients)


def without_zeros(f: Exponentials) -> Exponentials:
    """Without the terms that are exactly zero in all functions."""
    kept = f.coefficients.any(axis=1)
    return f if kept.all() else Exponentials(f.rates, f.multiples[kept], f.coefficients[kept])


def distinct(rows: Integers) -> tuple[Integers, NDArray[np.intp]]:
    """The distinct rows, and for each row the number of its like among them."""
    if not rows.size:
        return rows[:1], np.zeros(len(rows), np.intp)
    low = rows.min(axis=0)
    keys = (rows - low) @ _weights(rows.max(axis=0) - low + 1)
    _, first, where = np.unique(keys, return_index=True, return_inverse=True)
    return rows[first], where


def _sums(a: Integers, b: Integers) -> tuple[Integers, NDArray[np.intp]]:
    """The distinct sums of a row of a and a row of b, and the number (len(a), len(b)) of each sum among them."""
    if not (a.size and b.size):
        return a[:0], np.zeros((len(a), len(b)), np.intp)
    low_a, low_b = a.min(axis=0), b.min(axis=0)
    weights = _weights(a.max(axis=0) - low_a + b.max(axis=0) - low_b + 1)
    keys = np.add.outer((a - low_a) @ weights, (b - low_b) @ weights)
    _, first, where = np.unique(keys, return_index=True, return_inverse=True)
    i, j = np.divmod(first, len(b))
    return a[i] + b[j], where.reshape(keys.shape)


def _weights(widths: Integers) -> Integers:
    """Place values of a number system in which the digit r has widths[r] values: one whole number for a row."""
    places = [1]
    for width in widths.tolist():
        places.append(places[-1] * width)
    if places[-1] >= 2**63:
        raise InputError(f"{places[-1]:.1e} exponents may occur, more than can be numbered; ask for a lower order")
    return np.array(places[:-1], np.int64)


def _with_degree(j: int, exponents: Integers) -> Integers:
    return np.insert(exponents, 0, j, axis=1)
