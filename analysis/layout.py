"""Where each component's numbers lie in the table of rows that a co-simulation fills: wiring without copies.

One row per communication point, one column per output. A component writes its outputs into its columns of the new
row, and reads its inputs from where their sources wrote them: the new row, or the one before. Rows follow each other
in memory, so the end of one row and the beginning of the next are one stretch; the order of the blocks is chosen so
that as many components as possible find their inputs in one stretch and need no gathering.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise, permutations

from .wiring import Port

MAX_ORDERS = 720  # orders of the blocks that are tried: all of them up to six components


@dataclass(frozen=True, slots=True)
class Layout:
    """columns: of each output.  inputs: per component, positions of its inputs relative to the start of the new row."""

    width: int
    columns: dict[Port, int]
    inputs: dict[str, tuple[int, ...]]

    def stretch(self, component: str) -> bool:
        """Whether the component's inputs follow each other in memory."""
        where = self.inputs[component]
        return all(b - a == 1 for a, b in pairwise(where))


def lay_out(
    outputs: Mapping[str, Sequence[str]], feeds: Mapping[str, Sequence[Port]], order: Sequence[str], coupling: str
) -> Layout:
    """Choose the order of the blocks.

    outputs : variables that each component writes.  feeds : sources of each component's inputs, in the inputs' order.
    order   : in which the components are stepped; with Gauss–Seidel coupling a component reads from the new row what
              components before it have written there, with Jacobi coupling everything from the row before.
    """
    candidates = (_arranged(blocks, outputs, feeds, order, coupling) for blocks in permutations(order))
    return max(islice(candidates, MAX_ORDERS), key=lambda layout: sum(map(layout.stretch, order)))


def _arranged(
    blocks: Sequence[str],
    outputs: Mapping[str, Sequence[str]],
    feeds: Mapping[str, Sequence[Port]],
    order: Sequence[str],
    coupling: str,
) -> Layout:
    ports = [Port(name, variable) for name in blocks for variable in outputs[name]]
    columns = {port: i for i, port in enumerate(ports)}
    width = len(ports)

    def position(reader: str, source: Port) -> int:
        fresh = coupling == "gauss-seidel" and order.index(source.component) < order.index(reader)
        return columns[source] - (0 if fresh else width)

    inputs = {name: tuple(position(name, source) for source in feeds[name]) for name in order}
    return Layout(width, columns, inputs)
