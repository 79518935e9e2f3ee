"""Φ(t, 0) of y' = A(t) y over short cells: by exponentials while A rests, by series in time while it changes.

A changes with some inputs w_k of the system, affinely: A(w) = A_0 + Σ w_k A_k, and these are polynomials in time on
each piece. The series of Φ over a cell is summed until a bound of all that follows is as small as a rounding.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, arb_mat, arb_series, fmpq

from ..methods.power_series import PowerSeries, cos, sin, variables
from .balls import Array, Balls, ExactSystem, NotProvedError, above, coefficients, magnitudes, precision, rounded
from .cells import Decay, counts, widths
from .norms import Metric
from .tube import Piece, over

TERMS = 12  # coefficients of an input that changes A, the last of which must be 0
CRUMB = 1e-22  # of Φ's size over a cell, below which terms are bounded together
MOST = 400  # terms of Φ


@dataclass(frozen=True, slots=True)
class Matrices:
    """A(w) = A_0 + Σ w_k A_k: `rest` is A_0 (n, n), `by_input` holds the entries (i, j, A_k[i, j]) of each A_k."""

    rest: arb_mat
    by_input: Mapping[int, tuple[tuple[int, int, Any], ...]]

    def at(self, w: Balls) -> arb_mat:
        """A over balls w (m,)."""
        return self.rest + self.change(w)

    def change(self, w: Balls) -> arb_mat:
        """Σ w_k A_k."""
        n = self.rest.nrows()
        found = arb_mat(n, n)
        for k, entries in self.by_input.items():
            for i, j, value in entries:
                found[i, j] += w[k] * value
        return found

    def series(self, inputs: Any, begin: fmpq, width: fmpq) -> list[arb_mat]:
        """A_i (n, n) of A(w(begin + s)) = Σ A_i sⁱ over 0 ≤ s ≤ width, a polynomial.

        Raises NotProvedError where it is not proved to be one of fewer than TERMS coefficients.
        """
        with precision(TERMS):
            at, along = (
                [coefficients(w, TERMS) for w in inputs(arb_series([arb(begin) + s, 1], prec=TERMS))]
                for s in (arb(0), arb(width) * arb(0.5, 0.5))
            )
        if not all(along[k][-1] == 0 for k in self.by_input):
            raise NotProvedError(f"from t = {float(begin):g} s on the linear part is not proved to be a polynomial")
        found = [self.at([c[0] for c in at])]
        for i in range(1, TERMS - 1):
            if all(c[i] == 0 for k, c in enumerate(at) if k in self.by_input):
                continue
            found += [arb_mat(*[self.rest.nrows()] * 2)] * (i - len(found))
            found.append(self.change([c[i] for c in at]))
        return found


def matrices(n: int, m: int, linear: Any) -> Matrices:
    """A(w) of the rates linear(x, w, sin, cos). Raises NotProvedError unless these are A(w) x + B w, A affine in w."""
    y = variables(n + m, 3, arb(1))
    rest, by_input = arb_mat(n, n), dict[int, list[tuple[int, int, Any]]]()
    for i, rate in enumerate(linear(y[:n], y[n:], sin, cos)):
        for monomial, value in (rate.terms if isinstance(rate, PowerSeries) else {(): arb(rate)}).items():
            zero = arb(value) == 0
            match [j for j in monomial if j < n], [j - n for j in monomial if j >= n]:
                case [j], []:
                    rest[i, j] = value
                case [j], [k]:
                    by_input.setdefault(k, []).append((i, j, value))
                case states, inputs if not zero and (len(states), len(inputs)) != (0, 1):
                    raise NotProvedError(f"row {i} of the linear part has a term that is not of A(w) x + B w")
    return Matrices(rest, {k: tuple(entries) for k, entries in by_input.items()})


def constant(system: ExactSystem, changing: Matrices, pieces: Sequence[Piece], w: Balls) -> bool:
    """Whether A is proved to be the same over all of the pieces as at these inputs (m,)."""
    every = (over(system, piece) for piece in pieces)
    return all(arb(found[k]) == arb(w[k]) for found in every for k in changing.by_input)


def by_series(
    system: ExactSystem,
    changing: Matrices,
    metric: Metric,
    pieces: Sequence[Piece],
    rates: Array,
    start: arb_mat,
    dropped: float,
) -> tuple[Decay, arb_mat, float]:
    """What `cells.carried_on` gives, of an A that changes; rates (N,): bounds of its logarithmic norm over cells."""
    centre, off = rounded(start)
    ends, curve, now = [centre], [], start
    S, most, growth = np.abs(metric.S), dropped, np.exp(rates * widths(pieces, metric)) * (1 + 1e-12)
    S_size = float(np.linalg.norm(S)) * (1 + 1e-12)
    cells = (
        (p, p.duration / count, k)
        for p, count in zip(pieces, counts(pieces, metric), strict=True)
        for k in range(count)
    )
    for (piece, width, k), factor in zip(cells, growth.tolist(), strict=True):
        begin = piece.begin + width * k
        A = changing.series(system.inputs_over(piece.begin, piece.end), begin, width)
        reached, second = _over_cell([a * arb(width) ** (i + 1) for i, a in enumerate(A)], now, metric)
        centre, rest = rounded(reached)
        ends.append(centre)
        curve.append(second / 8.0 * (1 + 1e-9))
        off, most = max(off, rest), max(most, dropped * factor)
        dropped = (dropped * factor + S_size * above(sum((v.rad() for v in reached.entries()), arb(0)))) * (1 + 1e-12)
        most, now = max(most, dropped), reached.mid()
    off += float(np.linalg.norm(metric.reach)) * most * (1 + 1e-9)
    return Decay(widths(pieces, metric), np.array(ends), np.array(curve), off), now, dropped


def _over_cell(A: Sequence[arb_mat], start: arb_mat, metric: Metric) -> tuple[arb_mat, Array]:
    """Φ at τ = 1 and ≥ sup |Φ''| (n, n) over 0 ≤ τ ≤ 1, for dΦ/dτ = Σ A_i τⁱ Φ, Φ(0) = start.

    The terms D_j of Φ obey (j + 1) D_{j+1} = Σ A_i D_{j−i}. From a j on with Σ ‖A_i‖ ≤ (j + 1)/2, each is at most half
    the largest of the p = len(A) before it; so what follows is p times that in all, and with weights j (j − 1)
    p times Σ (j + p k)² 2⁻ᵏ over k ≥ 1.
    """
    S, p = np.abs(metric.S), len(A)
    size = sum(metric.size(a) for a in A) * (1 + 1e-12)
    terms, reached, second, sizes = [start], start, np.zeros(metric.S.shape), [np.linalg.norm(S @ magnitudes(start))]
    for j in range(MOST):
        total = A[0] * terms[j]
        for i in range(1, min(p, j + 1)):
            total += A[i] * terms[j - i]
        terms.append(total / (j + 1))
        reached += terms[-1]
        bound = magnitudes(terms[-1])
        second += (j + 1) * j * bound
        sizes.append(np.linalg.norm(S @ bound))
        last = max(sizes[-p:]) * (1 + 1e-9)
        if j + 2 >= 2.0 * size and len(sizes) > p and last <= CRUMB * max(sizes):
            break
    else:
        raise NotProvedError(f"the linear part is too fast for a cell: its series has more than {MOST} terms")
    rest, J = metric.reach[:, None] * np.full(S.shape, p * last), j + 1
    n = len(S)
    balls = arb_mat(n, n, [arb(0, 2.0 * r) for r in rest.ravel().tolist()])
    return reached + balls, second * (1 + 1e-9) + 2.0 * rest * (J * J + 4 * J * p + 6 * p * p)
