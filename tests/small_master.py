"""A small master whose ways can be chosen: says in our own words what a foreign master does, on fmpy alone.

Also what the two exchange: a recording, as the foreign runners of tests/foreign write it.
"""

from __future__ import annotations

import contextlib
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.ssp.ssd import read_ssd

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Recording:
    """Rows of values at the times (n,); names are component.variable."""

    time: Array
    names: tuple[str, ...]
    rows: Array

    def columns(self, names: Sequence[str]) -> Array:
        return self.rows[:, [self.names.index(name) for name in names]]

    def between(self, first: int, last: int | None = None) -> Recording:
        return Recording(self.time[first:last], self.names, self.rows[first:last])

    def later(self, shift: float) -> Recording:
        return Recording(self.time + shift, self.names, self.rows)


def read_recording(path: Path) -> Recording:
    """A line 'time name name …', then rows of doubles."""
    header, _, data = path.read_bytes().partition(b"\n")
    names = header.decode().split()
    rows = np.frombuffer(data).reshape(-1, len(names))
    return Recording(rows[:, 0], tuple(names[1:]), rows[:, 1:])


def deviation(found: Recording, expected: Recording, names: Sequence[str] = ()) -> float:
    """Largest difference of any variable over its largest value; the times must be the same.

    The road's bows are small differences of its heights, to which they are added: they go over the heights' largest.
    """
    names = names or expected.names
    assert found.time.shape == expected.time.shape
    np.testing.assert_allclose(found.time, expected.time, rtol=0, atol=1e-10)
    a, b = found.columns(names), expected.columns(names)
    scale = np.abs(expected.columns([name.replace("road.bow_", "road.h_") for name in names])).max(axis=0)
    return float((np.abs(a - b).max(axis=0) / np.where(scale > 0, scale, 1.0)).max())


@dataclass(frozen=True)
class Ways:
    """How a master goes about it; the defaults are Jacobi's.

    initial : what the inputs of the first step are: values passed on in initialization mode, or zeros.
    after   : what follows a step: "hold" – read all outputs, and set the inputs just before the next step;
              "refresh" – read all, set all inputs at once, and record the outputs read again after that;
              "chain" – work off the connections pair of components by pair, each reading its source anew.
    """

    initial: str = "passed on"
    after: str = "hold"


@dataclass(frozen=True)
class _Pair:
    """The connections between two components."""

    start: FMU2Slave
    end: FMU2Slave
    sources: list[int]  # value references
    sinks: list[int]
    positions: list[int]  # of the sources in a row


class _Loop:
    def __init__(self, system: Path, folder: Path) -> None:
        with zipfile.ZipFile(system) as archive:
            archive.extractall(folder)
        ssd = read_ssd(system)
        self.fmus: dict[str, FMU2Slave] = {}
        references: dict[str, dict[str, int]] = {}
        self.outputs: dict[str, list[int]] = {}
        names: list[str] = []
        for c in ssd.system.elements:
            where = extract(str(folder / c.source), str(folder / c.name))
            d = read_model_description(where)
            references[c.name] = {v.name: v.valueReference for v in d.modelVariables}
            outputs = [v for v in d.modelVariables if v.causality == "output"]
            self.outputs[c.name] = [v.valueReference for v in outputs]
            names += [f"{c.name}.{v.name}" for v in outputs]
            self.fmus[c.name] = FMU2Slave(
                guid=d.guid,
                unzipDirectory=where,
                modelIdentifier=d.coSimulation.modelIdentifier,
                instanceName=c.name,
            )
        self.names = tuple(names)
        pairs = dict.fromkeys((k.startElement, k.endElement) for k in ssd.system.connections)
        self.pairs = [
            _Pair(
                self.fmus[start],
                self.fmus[end],
                [references[start][k.startConnector] for k in own],
                [references[end][k.endConnector] for k in own],
                [names.index(f"{start}.{k.startConnector}") for k in own],
            )
            for start, end in pairs
            if (own := [k for k in ssd.system.connections if (k.startElement, k.endElement) == (start, end)])
        ]

    def read(self) -> list[float]:
        return [x for name, fmu in self.fmus.items() for x in fmu.getReal(self.outputs[name])]

    def set_inputs(self, row: Sequence[float]) -> None:
        for pair in self.pairs:
            pair.end.setReal(pair.sinks, [row[i] for i in pair.positions])

    def chain(self) -> None:
        for pair in self.pairs:
            pair.end.setReal(pair.sinks, pair.start.getReal(pair.sources))

    @contextlib.contextmanager
    def running(self, initial: str) -> Iterator[None]:
        for fmu in self.fmus.values():
            fmu.instantiate()
            fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
        for _ in self.fmus if initial == "passed on" else ():
            self.set_inputs(self.read())
        for fmu in self.fmus.values():
            fmu.exitInitializationMode()
        yield
        for fmu in self.fmus.values():
            fmu.terminate()
        for fmu in self.fmus.values():
            fmu.freeInstance()


def run(system: Path, ways: Ways, count: int, step: float = 1e-3) -> Recording:
    """Run the system with its default parameters for `count` steps."""
    with tempfile.TemporaryDirectory(prefix="small_master_") as folder:
        loop = _Loop(system, Path(folder))
        with loop.running(ways.initial):
            rows = [loop.read()]
            held = rows[0] if ways.initial == "passed on" else [0.0] * len(loop.names)
            if ways.after != "hold":
                loop.set_inputs(held)
            for k in range(count):
                if ways.after == "hold":
                    loop.set_inputs(held)
                for fmu in loop.fmus.values():
                    fmu.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
                if ways.after == "chain":
                    loop.chain()
                held = loop.read()
                if ways.after == "refresh":
                    loop.set_inputs(held)
                rows.append(loop.read() if ways.after == "refresh" else held)
    return Recording(step * np.arange(count + 1), loop.names, np.array(rows))
