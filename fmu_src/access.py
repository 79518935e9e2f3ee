"""How lists of references are read and written, worked out once for each list; what is called then runs in C.

Hosts use the same few lists again and again, each its own: all outputs in the FMU's order, one input at a time, some
inputs in the order of its connections.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from operator import itemgetter
from typing import Any

Cells = list[float]
Reader = tuple[Cells, Callable[[Cells], Any]]  # cells, and a function of them that gives the values
# a stretch of cells, and what of the values comes into it; None: the values themselves
Writer = tuple[slice, Callable[[Sequence[float]], Any] | None]
MOST = 256  # lists that are remembered


def remember(known: dict[tuple[int, ...], Any], references: list[int], way: Any) -> None:
    """Remember how to serve a list of references; a host that has ever new lists does not fill the memory."""
    if len(known) >= MOST:
        known.clear()
    known[(*references,)] = way


def reader(places: list[tuple[Cells, int]]) -> Reader:
    """How to read the values at these places, of which there is one at least."""
    cells, index = places[0][0], [i for _, i in places]
    stretch = range(index[0], index[0] + len(index))
    if any(each is not cells for each, _ in places):
        return cells, partial(_gathered, places)
    if index == [*stretch]:
        return cells, itemgetter(slice(stretch.start, stretch.stop))
    return cells, itemgetter(*index)


def writer(references: list[int], cells: Cells) -> Writer:
    """How to write to the cells of these numbers, of which there is one at least."""
    stretch, n = range(min(references), max(references) + 1), len(references)
    last = {reference: k for k, reference in enumerate(references)}  # of those that are there twice
    where = slice(stretch.start, stretch.stop)
    if references == [*stretch]:
        return where, None
    if sorted(references) == [*stretch]:
        return where, itemgetter(*(last[i] for i in stretch))
    return where, partial(_completed, cells, itemgetter(*(last.get(i, n + i) for i in stretch), 0))


def _gathered(places: list[tuple[Cells, int]], _: Cells) -> Cells:
    return [cells[i] for cells, i in places]


def _completed(cells: Cells, pick: Callable[..., Any], values: Sequence[float]) -> Any:
    """The values, and between them what the cells hold; the last that is picked makes it a tuple in any case."""
    return pick([*values, *cells])[:-1]
