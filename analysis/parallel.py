"""The same function at many points, on all cores, with a progress bar on a terminal."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

from tqdm import tqdm

Point = TypeVar("Point")
Value = TypeVar("Value")


def mapped(function: Callable[[Point], Value], points: Sequence[Point], what: str) -> list[Value]:
    """function at each point, in their order; both go to other processes, so no lambdas. Raises what it raises."""
    workers = min(os.cpu_count() or 1, len(points))
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        results = pool.map(function, points, chunksize=max(1, len(points) // (8 * workers)))
        return list(tqdm(results, total=len(points), desc=what, leave=False, disable=None))
