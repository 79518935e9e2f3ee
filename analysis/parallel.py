"""The same function at many points, on all cores, with a progress bar on a terminal."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import TypeVar

from tqdm import tqdm

Point = TypeVar("Point")
Value = TypeVar("Value")


def mapped(function: Callable[[Point], Value], points: Sequence[Point], what: str) -> list[Value]:
    """function at each point, in their order; both go to other processes, so no lambdas. Raises what it raises."""
    workers = min(os.cpu_count() or 1, len(points))
    with _one_thread_each(), ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        results = pool.map(function, points, chunksize=max(1, len(points) // (8 * workers)))
        return list(tqdm(results, total=len(points), desc=what, leave=False, disable=None))


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started within do their linear algebra in one thread: else all cores are fought for by all of them."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
