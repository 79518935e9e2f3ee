"""Proved bounds in print: rounded to the side on which they stay true."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal


def at_most(value: float, digits: int = 4) -> str:
    """A number that something does not exceed (l, ε, a state's bound), to so many digits, not below it."""
    return _rounded(value, digits, ROUND_CEILING)


def at_least(value: float, digits: int = 4) -> str:
    """A number up to which something holds (δ, A, a smallest load), to so many digits, not above it."""
    return _rounded(value, digits, ROUND_FLOOR)


def _rounded(value: float, digits: int, side: str) -> str:
    return f"{float(Context(prec=digits, rounding=side).create_decimal(Decimal(value))):.{digits}g}"
