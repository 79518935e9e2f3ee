"""JSON read strictly: what a file's format does not say is refused, and no value is taken for one of another kind."""

from __future__ import annotations

import json
from collections.abc import Collection
from decimal import Decimal, InvalidOperation
from typing import Any, NoReturn

import numpy as np
from flint import fmpq

from .balls import Array


def loads(data: bytes) -> Any:
    """Plain data. Raises ValueError for a key that stands twice, nan, and digits that a double does not hold."""
    return json.loads(data, object_pairs_hook=_once, parse_float=_held, parse_constant=_no_number)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"{next(key for key in keys if keys.count(key) > 1)!r} stands twice")
    return found


def _held(text: str) -> float:
    value = float(text)
    if repr(value) == text:
        return value
    try:
        held = Decimal(text) == Decimal(repr(value))
    except InvalidOperation:  # an exponent beyond all measure
        held = False
    if not held:
        raise ValueError(f"{text[:60]} is no double's number; the nearest is {value!r}")
    return value


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"{text} is no number")


def of_keys(value: Any, keys: Collection[str], optional: Collection[str] = ()) -> dict[str, Any]:
    """The object itself. Raises ValueError unless it has these keys and no others."""
    if not isinstance(value, dict) or not set(keys) <= set(value) <= {*keys, *optional}:
        got = sorted(value) if isinstance(value, dict) else value
        raise ValueError(f"wanted the keys {', '.join(keys)}, got {str(got)[:120]}")
    return value


def numbers(values: Any, dimensions: int) -> Array:
    """An array of finite numbers, each written as a double; raises ValueError for anything else."""
    if not _doubles(values, dimensions) or not np.isfinite(array := np.array(values, dtype=float)).all():
        raise ValueError(f"wanted {dimensions}-dimensional finite numbers, got {str(values)[:60]}")
    return array


def _doubles(values: Any, dimensions: int) -> bool:
    if dimensions == 0:
        return type(values) is float
    return isinstance(values, list) and all(_doubles(v, dimensions - 1) for v in values)


def truth(value: Any) -> bool:
    """True or false itself; raises ValueError for anything else."""
    if not isinstance(value, bool):
        raise ValueError(f"wanted true or false, got {value!r}")
    return value


def text(value: Any) -> str:
    """A string itself; raises ValueError for anything else."""
    if not isinstance(value, str):
        raise ValueError(f"wanted a string, got {value!r}")
    return value


def fraction(value: Any) -> fmpq:
    """An exact number from "n" or "n/d" in lowest terms; raises ValueError for anything else."""
    found = fmpq(*map(int, text(value).split("/")))
    if str(found) != value:
        raise ValueError(f"wanted a fraction in lowest terms, {found}, got {value!r}")
    return found


def theorem(value: Any, ours: str) -> None:
    """Raise ValueError unless the text is the theorem that is proved."""
    if value != ours:
        raise ValueError(f"states another theorem than the one that is proved: {str(value)[:60]!r} ...")
