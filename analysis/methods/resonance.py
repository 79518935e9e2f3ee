"""Resonances of the modes with each other (remark 3.2) and with the waves of the road, by their distance.

A term u_a u_b … E_μ … of Φ_k resonates if Σ λ + i Σ ω = λ_k. Terms that state the same equality of frequencies,
n_1 β_1 + n_2 β_2 + … + ν Ω = 0 with whole numbers, are one row. Equalities that hold whatever the frequencies are
(s_k s_j s_(j + n/2), s_k with opposite waves) are no resonances: they are counted and left out. Sums
of frequencies that cannot vanish are left out too, and modes that do not oscillate.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from .exponentials import Integers, distinct
from .floquet import period_of
from .modal_polynomials import Waves, all_monomials, exponents, modal_parts, waves
from .modes import Complex, Modes, modes
from .polynomials import Array, Homogeneous
from .signals import Piece
from .standard_form import StandardForm

SMALL = 0.01  # m or rad
NEAR = 0.1  # relative detuning up to which a combination is called near to resonance, whatever its damping
POINTS, FAR = (
    33,
    1e3,
)  # times at which a largest response is looked for; the end of those that only rise, over their begin
TINY = 1e-8  # |x| below which (exp(x) − 1)/x is 1 as near as matters
SILENT = 1e-12  # of the largest coefficient of Φ: terms as small as this do not occur


@dataclass(frozen=True, slots=True, kw_only=True)
class Resonance:
    """One equality Σ n_k β_k + ν Ω = 0 and how far from it the system is.

    modes, road : n (n/2,) and ν, the first that is not 0 positive.
    detuning    : |Σ n_k β_k + ν Ω| [rad/s].
    distance    : smallest |Σ λ + i Σ ω − λ_k| [1/s] of its terms (of those in Φ, if any): damping counted.
    scale       : largest frequency in it [rad/s], by which both are made relative.
    coefficient : largest of its terms in Φ_k, on this road, with all |s| = size, over size [1/s]; 0 if there is none.
    gain        : largest that one of its terms adds to a motion, at any time, relative to it; see `largest_forced`.
                  Far off resonance too a term adds something, the more the larger the motion is.
    near_gain   : the gain if the relative detuning is below NEAR; else of those terms alone that are detuned by less
                  than the damping in them, 0 if there is none.
    """

    modes: tuple[int, ...]
    road: int
    detuning: float
    distance: float
    scale: float
    coefficient: float
    gain: float
    near_gain: float

    @property
    def relative(self) -> float:
        """Detuning over the largest frequency in it."""
        return self.detuning / self.scale

    @property
    def relative_distance(self) -> float:
        """Distance over the largest frequency in it."""
        return self.distance / self.scale

    @property
    def in_print(self) -> bool:
        """Whether remark 3.2 names it: β_j + β_k = β_l or β_j + β_k + β_l = β_m."""
        minus = -sum(n for n in self.modes if n < 0)
        return self.road == 0 and minus == 1 and sum(self.modes) in (1, 2)

    def __str__(self) -> str:
        sides = []
        for sign in (1, -1):
            names = [(sign * n, f"β{k}") for k, n in enumerate(self.modes, start=1)] + [(sign * self.road, "Ω")]
            sides.append(" + ".join(f"{n if n > 1 else ''}{name}" for n, name in names if n > 0) or "0")
        return " = ".join(sides)


@dataclass(frozen=True, slots=True, kw_only=True)
class Resonances:
    """Rows by rising relative detuning; how many terms stood for them, and identities left out, by number of waves.

    size : |s| for which coefficients and gains hold [m or rad].
    """

    rows: tuple[Resonance, ...]
    size: float
    terms: int
    trivial: dict[int, int]
    silent: int  # modes that do not oscillate

    @property
    def occurring(self) -> tuple[Resonance, ...]:
        """Rows whose terms Φ has (or the direct excitation)."""
        return tuple(row for row in self.rows if row.coefficient > 0.0)


def resonances(
    form: StandardForm,
    piece: Piece | None = None,
    *,
    found: Modes | None = None,
    degrees: Collection[int] = (2, 3),
    size: float | None = None,
) -> Resonances:
    """All resonances of terms of these degrees in (s, waves), and of each wave with each mode.

    Degree 2 gives the three-mode, degree 3 the four-mode combinations of remark 3.2, and with the input's waves the
    external ones. size: amplitude of the modes that coefficients are for; by default that of the forced motion, without
    an input SMALL. Raises InputError for an input that is not periodic.
    """
    m = found or modes(form.A)
    w = waves(form, m, piece)
    wanted = {p: tuple(part for part in terms if part.degree in degrees) for p, terms in form.terms.items()}
    parts = {part.degree: part for p in wanted for part in modal_parts(replace(form, terms=wanted), m, w, p)}
    columns = np.arange(len(m.K), len(m.K) + len(w.frequencies), dtype=np.intp)[:, None]
    tables = [Homogeneous(columns, m.K_inverse @ form.B @ w.inputs)] if columns.size else []
    for degree in sorted(degrees):
        monomials = all_monomials(len(m.K) + len(w.frequencies), degree)
        tables.append(parts.get(degree, Homogeneous(monomials, np.zeros((len(m.K), len(monomials))))))
    size = size or float(np.abs(w.forced).max(initial=0.0)) or SMALL
    return _grouped(m, w, period_of(piece) if piece and w.frequencies.any() else math.inf, tables, size)


@dataclass(frozen=True, slots=True)
class _Terms:
    """Terms (R,) of Φ_k for all k: their equality (R, n/2 + 1), distance and coefficient [1/s], gain, and waves.

    damped_gains: of those that are detuned by less than their damping, else 0.
    """

    equalities: Integers
    distances: Array
    coefficients: Array
    gains: Array
    damped_gains: Array
    waves: NDArray[np.intp]


def _grouped(m: Modes, w: Waves, period: float, tables: list[Homogeneous], size: float) -> Resonances:
    half = len(m.K) // 2
    oscillating: NDArray[np.bool_] = np.greater(m.beta[:half], 0.0)
    unit = _unit_vectors(half, w, period)
    found = [_terms(m, exponents(m, w), table, unit, oscillating, size) for table in tables]
    every = _Terms(*(np.concatenate([getattr(t, f.name) for t in found]) for f in fields(_Terms)))
    trivial = ~every.equalities.any(axis=1)
    counts = np.unique(every.waves[trivial], return_counts=True)
    kept = _Terms(*(getattr(every, f.name)[~trivial] for f in fields(_Terms)))
    return Resonances(
        rows=_rows(kept, np.append(m.beta[:half], 2.0 * np.pi / period)),
        size=size,
        terms=len(every.waves),
        trivial={int(k): int(c) for k, c in zip(*counts, strict=True)},
        silent=int(np.count_nonzero(~oscillating)),
    )


def _terms(
    m: Modes, rho: Complex, table: Homogeneous, unit: Integers, oscillating: NDArray[np.bool_], size: float
) -> _Terms:
    """Of one degree; only with modes that oscillate. A wave alone excites linearly, which is no gain of Φ."""
    n, targets = len(m.K), np.flatnonzero(oscillating)
    usable = np.concatenate([oscillating, oscillating, np.ones(len(rho) - n, bool)])
    used = usable[table.monomials].all(axis=1)
    monomials = table.monomials[used]
    equalities = unit[monomials].sum(axis=1)[None] - unit[targets][:, None]
    offs = (rho[monomials].sum(axis=1)[None] - m.eigenvalues[targets][:, None]).ravel()
    count = np.count_nonzero(monomials >= n, axis=1)
    values = (np.abs(table.coefficients[targets][:, used]) * size ** (table.degree - count - 1.0)).ravel()
    values = np.where(values > SILENT * values.max(initial=0.0), values, 0.0)
    gains = np.zeros_like(values)
    if table.degree > 1:
        forcing, mode = np.broadcast_arrays(rho[monomials].sum(axis=1)[None], m.eigenvalues[targets][:, None])
        occurs = values > 0.0
        gains[occurs] = values[occurs] * largest_forced(forcing.ravel()[occurs], mode.ravel()[occurs])
    return _Terms(
        equalities=equalities.reshape(-1, unit.shape[1]),
        distances=np.abs(offs),
        coefficients=values,
        gains=gains,
        damped_gains=np.where(np.abs(offs.imag) < np.abs(offs.real), gains, 0.0),
        waves=np.tile(count, len(targets)),
    )


def largest_forced(forcing: Complex, eigenvalues: Complex) -> Array:
    """max |exp(σt) − exp(λt)|/|σ − λ| (R,) [s] over t ≥ 0, σ and λ (R,) [1/s]: of ξ' = λ ξ + exp(σt) from ξ(0) = 0.

    Towards σ = λ this is 1/(e |Re λ|), not infinite: a decaying mode forgets what it was given. With a = Re σ,
    b = Re λ, q = Im(σ − λ), its square is (exp(at) − exp(bt))² + 2 exp((a + b)t) (1 − cos qt), two humps with one top
    each before π/|q|, behind which it falls below what it is there; so the largest value lies between the tops.
    """
    a, b, q = forcing.real, eigenvalues.real, np.abs(forcing.imag - eigenvalues.imag)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        r = np.where(a == b, 0.0, (b - a) / a)
        first = np.where(r == 0.0, 1.0, np.log1p(r) / np.where(r == 0.0, 1.0, r)) / np.abs(a)
        first = np.where((a == 0.0) | (b == 0.0), np.inf, first)
        second = np.where(q == 0.0, -2.0 / (a + b), 2.0 * np.arctan2(q, -(a + b)) / q)
        latest = np.pi / q
        begin, end = (np.minimum(f(first, second), latest) for f in (np.minimum, np.maximum))
        end = np.where(np.isinf(end) & np.isfinite(begin), begin * FAR, end)
        t = begin * (end / begin) ** np.linspace(0.0, 1.0, POINTS)[:, None]
        d = 1j * q - np.abs(a - b)  # seen from the one that decays more slowly
        size = np.where(np.abs(d * t) < TINY, t, np.abs(np.expm1(d * t) / np.where(d == 0.0, 1.0, d)))
        found = (np.exp(np.maximum(a, b) * t) * size).max(axis=0)
    grows = (np.maximum(a, b) > 0.0) | (np.isinf(begin))
    return np.where(grows, np.inf, found)


def _unit_vectors(half: int, w: Waves, period: float) -> Integers:
    """Whole numbers (n + M, n/2 + 1) that say what each variable of (u, E) adds to n_1 … n_(n/2), ν."""
    multiples = np.round(w.frequencies / (2.0 * np.pi / period)) if np.isfinite(period) else 0.0 * w.frequencies
    unit = np.zeros((2 * half + len(multiples), half + 1), np.int64)
    unit[:half, :half], unit[half : 2 * half, :half] = np.eye(half), -np.eye(half)
    unit[2 * half :, half] = multiples
    return unit


def _rows(terms: _Terms, frequencies: Array) -> tuple[Resonance, ...]:
    """One row for each equality, the nearest first."""
    equalities = terms.equalities // np.gcd.reduce(terms.equalities, axis=1)[:, None]
    first = np.take_along_axis(equalities, np.argmax(equalities != 0, axis=1)[:, None], axis=1)
    possible = equalities.min(axis=1) * equalities.max(axis=1) < 0  # a sum of frequencies alone never vanishes
    unique, group = distinct(equalities[possible] * np.sign(first[possible]))
    distances, coefficients = terms.distances[possible], terms.coefficients[possible]
    nearest, occurring = np.full((2, len(unique)), np.inf)
    largest, gain, damped_gain = np.zeros((3, len(unique)))
    np.minimum.at(nearest, group, distances)
    np.minimum.at(occurring, group, np.where(coefficients > 0.0, distances, np.inf))
    np.maximum.at(largest, group, coefficients)
    np.maximum.at(gain, group, terms.gains[possible])
    np.maximum.at(damped_gain, group, terms.damped_gains[possible])
    nearest = np.where(np.isfinite(occurring), occurring, nearest)
    detunings = np.abs(unique @ frequencies)
    taking_part = (unique != 0).astype(float)
    taking_part[:, -1] = np.abs(unique[:, -1])  # νΩ is one frequency, 2β_k is β_k twice
    scales = np.max(taking_part * frequencies, axis=1)
    near_gain = np.where(detunings < NEAR * scales, gain, damped_gain)
    order = np.lexsort((nearest, detunings / scales))
    return tuple(
        Resonance(
            modes=tuple(unique[i, :-1].tolist()),
            road=int(unique[i, -1]),
            detuning=float(detunings[i]),
            distance=float(nearest[i]),
            scale=float(scales[i]),
            coefficient=float(largest[i]),
            gain=float(gain[i]),
            near_gain=float(near_gain[i]),
        )
        for i in order
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """One line of remark 3.2 as printed: indices (R, 3 or 4) from 1, |λ_j + … − λ_m| [1/s], |β_j + … − β_m| [rad/s]."""

    indices: NDArray[np.intp]
    distance: Array
    detuning: Array


def remark_as_printed(eigenvalues: Complex) -> tuple[Remark, Remark]:
    """Both lines of remark 3.2 for λ (n,) in the paper's order: three and four modes, each with one minus sign.

    Modes that do not oscillate, the last ones, are left out: with β = 0 the equalities hold of themselves.
    """
    lam = eigenvalues[eigenvalues.imag > 0.0]
    return _remark(lam, 2), _remark(lam, 3)


def _remark(lam: Complex, sources: int) -> Remark:
    sums = all_monomials(len(lam), sources)
    value = (lam[sums].sum(axis=1)[:, None] - lam).ravel()
    last = np.tile(np.arange(len(lam)), len(sums))
    indices = np.column_stack([np.repeat(sums, len(lam), axis=0), last]) + 1
    return Remark(indices=indices, distance=np.abs(value), detuning=np.abs(value.imag))
