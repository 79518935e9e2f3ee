"""Ball arithmetic (python-flint): exact constants, upper bounds, series and matrices of balls.

Everything that a proof rests on is computed with balls that hold the exact value, rounding included. A ball that is not
finite proves nothing: `above` refuses it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, arb_mat, arb_series, ctx, fmpq
from numpy.typing import NDArray

Array = NDArray[np.float64]
Balls = Sequence[Any]
BITS = 96
UNIT, TINY = 2.0**-52, 1e-300  # rounding of a float, relative and, of few of them, where they are denormal
Inputs = Callable[[Any], list[Any]]


class NotProvedError(ArithmeticError):
    """An enclosure is too wide, or not finite, for what was to be proved."""


@dataclass(frozen=True, slots=True)
class ExactSystem:
    """x' = F(x, w(t)) with nothing rounded.

    equations : F(x, w, sin, cos), its constants balls or exact numbers; n states, m inputs.
    pieces    : (begin [s], w as a function of the time [s], a ball or a series of balls), in the order of time; the
                last holds for ever.
    period    : of w from the last piece's begin on [s]; 0 if w is 0 from there on.
    """

    n: int
    m: int
    equations: Callable[..., Sequence[Any]]
    pieces: tuple[tuple[fmpq, Inputs], ...]
    period: fmpq

    def inputs_at(self, t: fmpq) -> Inputs:
        """w of the piece in which t lies."""
        return [inputs for begin, inputs in self.pieces if begin <= t][-1]

    def inputs_over(self, begin: fmpq, end: fmpq) -> Inputs:
        """w on all of begin ≤ t ≤ end. Raises NotProvedError if these are no interval, or lie across a corner of w."""
        if not begin < end:
            raise NotProvedError(f"a piece runs from t = {float(begin):g} s to {float(end):g} s")
        for corner, _ in self.pieces:
            if begin < corner < end:
                raise NotProvedError(f"the piece from t = {float(begin):g} s on lies across a corner of the input")
        return self.inputs_at(begin)


def refuse_unrest(system: ExactSystem) -> None:
    """Raise NotProvedError unless F(0, 0) = 0 exactly, as bounds of F(x, w) − A x − B w from its terms in x, w need."""
    rates = system.equations([arb(0)] * system.n, [arb(0)] * system.m, sine, cosine)
    for i, rate in enumerate(rates):
        if not arb(rate) == 0:
            raise NotProvedError(f"row {i} of F(0, 0) is {rate}; wanted exactly 0, a system that rests without input")


@contextmanager
def precision(terms: int) -> Iterator[None]:
    """Work with BITS bits and series of this many terms."""
    cap, bits = ctx.cap, ctx.prec
    ctx.cap, ctx.prec = terms, BITS
    try:
        yield
    finally:
        ctx.cap, ctx.prec = cap, bits


def decimal(value: float) -> fmpq:
    """The number that a float's shortest decimal says, exactly: 0.1 is 1/10."""
    ratio = Fraction(repr(float(value)))
    return fmpq(ratio.numerator, ratio.denominator)


def above(x: Any) -> float:
    """A float that is not below |x|. Raises NotProvedError unless that is finite."""
    value = math.nextafter(float(arb(x).abs_upper()), math.inf)
    if not value < math.inf:
        raise NotProvedError(f"no finite bound: {x}")
    return value


def below(x: Any) -> float:
    """A float that is not above x. Raises NotProvedError unless that is finite."""
    value = math.nextafter(float(arb(x).lower()), -math.inf)
    if not abs(value) < math.inf:
        raise NotProvedError(f"no finite bound: {x}")
    return value


def length(values: Iterable[Any]) -> float:
    """Upper bound of √(Σ v²)."""
    return above(sum((v * v for v in values), arb(0)).abs_upper().sqrt())  # v * v may reach below 0: root of the top


def sine(x: Any) -> Any:
    """Sine of a ball or of a series of balls."""
    return x.sin()


def cosine(x: Any) -> Any:
    """Cosine of a ball or of a series of balls."""
    return x.cos()


def matrix(values: Any) -> arb_mat:
    """Matrix of exact doubles."""
    rows = np.asarray(values, dtype=float)
    return arb_mat(*rows.shape, [arb(v) for v in rows.ravel().tolist()])


def column(values: Sequence[Any]) -> arb_mat:
    """Column of balls."""
    return arb_mat(len(values), 1, list(values))


def magnitudes(m: arb_mat) -> Array:
    """Upper bounds of the entries' absolute values, as floats."""
    return np.array([above(v) for v in m.entries()]).reshape(m.nrows(), m.ncols())


def rounded(m: arb_mat) -> tuple[Array, float]:
    """Exact floats near the entries, and a bound of the sum of what is left (hence of its norms).

    What is left are the balls' radii, of which a row's sum has at least as much, and half a unit of each float, or one.
    Raises NotProvedError unless that is finite.
    """
    centre = np.array([float(v) for v in m.entries()]).reshape(m.nrows(), m.ncols())
    sums = m * arb_mat([[1]] * m.ncols())
    rest = above(sum((v.rad() for v in sums.entries()), arb(0))) + UNIT * float(np.abs(centre).sum())
    if not rest < math.inf:
        raise NotProvedError(f"no finite bound: {m}")
    return centre, rest * (1.0 + 1e-9) + TINY


def coefficients(series: Any, length: int) -> list[Any]:
    """The first coefficients of a series (or of a constant), zeros appended."""
    found = series.coeffs() if isinstance(series, arb_series) else [arb(series)]
    return [*found[:length], *[arb(0)] * (length - len(found))]


def jacobian(system: ExactSystem, x: Balls, w: Balls, *, inputs: bool = False) -> arb_mat:
    """∂F/∂x (n, n), or ∂F/∂w (n, m), over the balls x and w.

    The increments of k variables are s^k … s^(2k − 1) in a series in s of 2k terms, which drops their products: all
    columns come from one pass.
    """
    moved = w if inputs else x
    k = len(moved)
    with precision(2 * k):
        series = [arb_series([v, *[0] * (k - 1 + j), 1]) for j, v in enumerate(moved)]
        rates = system.equations(*((x, series) if inputs else (series, w)), sine, cosine)
        return arb_mat([coefficients(rate, 2 * k)[k:] for rate in rates])


def two_norm(m: Array) -> Array:
    """Upper bounds (…) of the spectral norms of float matrices (…, p, q) whose entries are exact.

    With |VᵀV − 1| ≤ η, |M|² ≤ |VᵀMᵀMV|/(1 − η), and Gershgorin's rows bound both; V is nearly orthogonal. The products
    are rounded: each entry by less than 1e-13 of the largest norm in the product, which 1e-11 covers. Raises
    NotProvedError if V is not what it should be.
    """
    gram = np.swapaxes(m, -1, -2) @ m
    V = np.linalg.eigh(gram)[1]
    V_T = np.swapaxes(V, -1, -2)
    off = _rows(V_T @ V - np.eye(V.shape[-1]))
    if not np.all(off < 1e-3):
        raise NotProvedError("no bound of a spectral norm: its eigenvectors are not orthogonal, or no numbers")
    return np.asarray(np.sqrt(_rows(V_T @ gram @ V) / (1.0 - off)) * (1.0 + 1e-11))


def _rows(m: Array) -> Array:
    """Largest sums of sizes of rows of matrices (…, n, n)."""
    return np.asarray(np.abs(m).sum(axis=-1).max(axis=-1))
