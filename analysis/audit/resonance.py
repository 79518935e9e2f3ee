"""§3.3 and remark 3.2: which frequencies are in resonance by the print, by a criterion for cubic systems, in fact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

from .averaging import A_corrected, missed, pair_sum, still, textbook
from .rows import FAILS, Evidence, Row

Cases = Sequence[tuple[Sequence[int], int]]  # β, Ω (0: flat road)
Criterion = Callable[[Sequence[int], int], bool]


def printed_condition(beta: Sequence[int], W: int) -> bool:
    """Before (3.20): resonance if β_k = β_l, k ≠ l, or β_k = νΩ (the road has ν = 1 only)."""
    return len(set(beta)) < len(beta) or W in beta


def printed_internal(beta: Sequence[int], _: int) -> bool:
    """Remark 3.2, of its equalities the imaginary parts: β_j + β_k = β_l or β_j + β_k + β_l = β_m."""
    sums = {sum(chosen) for count in (2, 3) for chosen in product(beta, repeat=count)}
    return bool(sums & set(beta))


def cubic_condition(beta: Sequence[int], W: int) -> bool:
    """Resonance if ±ω_1 ± ω_2 ± ω_3 = β_i, each ω a β or the road's (W > 0), but by pairs that cancel."""
    signed = [sign * b for b in (*beta, *([W] if W else [])) for sign in (1, -1)]
    for i, target in enumerate(beta):
        allowed = _cancelling(signed, 2 * i)
        for places in product(range(len(signed)), repeat=3):
            if tuple(sorted(places)) not in allowed and sum(signed[k] for k in places) == target:
                return True
    return False


def _cancelling(signed: Sequence[int], own: int) -> set[tuple[int, ...]]:
    """The mode itself with any frequency and its opposite."""
    return {tuple(sorted((own, k, k + 1))) for k in range(0, len(signed), 2)}


def is_resonant(beta: Sequence[int], W: int) -> bool:
    """By quadrature: whether the mean of R_i has more than the corrected (3.20)."""
    x = textbook(beta, W or 1)
    x = x if W else still(x)
    formula = x.s * (A_corrected(x.alpha_bar, x.P, x.psi) + pair_sum(x, halved=True))
    return missed(x.R_mean(), formula) > 1e-9


def wrong_verdicts(criterion: Criterion, cases: Cases) -> float:
    """How many of the cases a criterion judges otherwise than quadrature."""
    return float(sum(criterion(beta, W) != is_resonant(beta, W) for beta, W in cases))


FORCED = [((b1, b2), W) for b1, b2, W in product((3, 4, 5), (7, 9, 11, 15), (2, 5, 7, 9))]
FREE = [((b1, b2, b3), 0) for b1, b2, b3 in product((3, 4), (5, 6, 7, 8), (9, 10, 12))]


def rows() -> list[Row]:
    """The no-resonance condition and remark 3.2."""

    def row(equation: str, text: str, better: str, criterion: Criterion, cases: Cases) -> Row:
        example = next(c for c in cases if criterion(*c) != is_resonant(*c))
        return Row(
            equation=equation,
            printed=text,
            derived=better,
            kind=FAILS,
            evidence=[
                Evidence(
                    measure=f"wrong verdicts on {len(cases)} systems, whether (3.20) misses a part of the mean",
                    printed=wrong_verdicts(criterion, cases),
                    derived=wrong_verdicts(cubic_condition, cases),
                    unit="1",
                    tolerance=0.0,
                    apart=1.0,
                )
            ],
            note=f"The first: β = {', '.join(map(str, example[0]))}" + (f", Ω = {example[1]}." if example[1] else "."),
        )

    return [
        row(
            "no-resonance condition before (3.20)",
            "β_k ≠ β_l, β_k ≠ νΩ",
            "no β_i = ±ω_1 ± ω_2 ± ω_3, each ω a β_j or a νΩ, but by pairs that cancel (so β_i ± β_j ≠ (μ ± ν)Ω too)",
            printed_condition,
            FORCED,
        ),
        row(
            "remark 3.2",
            "λ_j + λ_k − λ_l = 0, λ_j + λ_k + λ_l − λ_m = 0",
            "of the imaginary parts, in an odd system β_j + β_k + β_l = β_m and β_j + β_k = β_l + β_m but by equal "
            "pairs; never the first",
            printed_internal,
            FREE,
        ),
    ]
