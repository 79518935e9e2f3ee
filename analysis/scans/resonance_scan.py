"""`python -m analysis resonances`: the table for a scenario, and its change with one parameter as numbers and a map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..files import write_whole
from ..methods.floquet import period_of
from ..methods.modes import Modes, modes
from ..methods.polynomials import Array
from ..methods.resonance import Resonance, Resonances, resonances
from ..parallel import mapped
from ..reference import Parameters
from ..scenario import read_scenario
from .car_scans import Variation, lasting_road, system_of, variation
from .meetings import Meeting, meetings
from .tables import as_csv, output_folder

STILL = 1e-9  # of the largest frequency: detunings that change by less do not change
POINTS = 61  # of a scan, from half to twice the scenario's value

Key = tuple[tuple[int, ...], int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """Resonances that occur, at each value (V,) of a parameter; frequencies (V, n/2) and road (V,), nan if none."""

    name: str
    variation: Variation
    here: float
    values: Array
    frequencies: Array
    road: Array
    tables: tuple[dict[Key, Resonance], ...]
    changing: frozenset[Key]  # those that the parameter detunes at all
    meetings: tuple[Meeting, ...]  # of two modes

    def curve(self, key: Key, attribute: str) -> Array:
        """An attribute of one resonance over the values; nan where it does not occur."""
        return np.array([getattr(table[key], attribute) if key in table else np.nan for table in self.tables])

    def nearest(self, attribute: str) -> list[Resonance]:
        """The one with the smallest attribute at each value, of those that change."""
        among = [[row for key, row in table.items() if key in self.changing] for table in self.tables]
        return [min(rows, key=lambda row: getattr(row, attribute)) for rows in among]

    def strongest(self) -> list[Resonance]:
        """The one with the largest gain near resonance at each value."""
        return [max(table.values(), key=lambda row: row.near_gain) for table in self.tables]


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """A value of the parameter at which an equality of frequencies holds, and the larger gain of its neighbours."""

    value: float
    row: Resonance  # at the neighbour

    def __str__(self) -> str:
        return f"{self.row} at {self.value:.4g}, gain {self.row.gain:.2g}"


def crossings(result: Scan) -> list[Crossing]:
    """Where two modes meet, and where other detunings change their sign, by interpolation; the strongest first."""
    found, half = [], result.frequencies.shape[1]
    for met in result.meetings:
        before, after = result.tables[met.step : met.step + 2]
        sides = (before, _equal(met.before, half)), (after, _equal(met.after, half))
        rows = [table[key] for table, key in sides if key in table and key in result.changing]
        if len(rows) == 2:
            found.append(Crossing(value=met.value, row=max(rows, key=lambda row: row.gain)))
    for key in result.changing:
        if _is_pair(key):  # β_j − β_k of modes that are numbered by β does not change its sign
            continue
        signed = _signed(key, result.frequencies, result.road)
        for i in np.flatnonzero((signed[:-1] < 0.0) != (signed[1:] < 0.0)).tolist():
            rows = [table[key] for table in result.tables[i : i + 2] if key in table]
            if len(rows) == 2:
                part = signed[i] / (signed[i] - signed[i + 1])
                value = (1.0 - part) * result.values[i] + part * result.values[i + 1]
                found.append(Crossing(value=float(value), row=max(rows, key=lambda row: row.gain)))
    return sorted(found, key=lambda crossing: -crossing.row.gain)


def _equal(pair: tuple[int, int], half: int) -> Key:
    """The key of β_j = β_k among n/2 modes."""
    numbers = [0] * half
    numbers[min(pair)], numbers[max(pair)] = 1, -1
    return tuple(numbers), 0


def _is_pair(key: Key) -> bool:
    return key[1] == 0 and sorted(n for n in key[0] if n) == [-1, 1]


def _signed(key: Key, frequencies: Array, road: Array) -> Array:
    """Σ n_k β_k + ν Ω (V,) [rad/s] at the values of a scan."""
    numbers, nu = key
    return frequencies @ np.array(numbers) + (nu * road if nu else 0.0)


def table_of(parameters: Parameters) -> Resonances:
    """Resonances of the passive car that these parameters describe, on their road if it lasts."""
    form, _ = system_of(parameters)
    return resonances(form, lasting_road(parameters))


def scan(parameters: Parameters, name: str, points: int) -> Scan:
    """Half to twice the parameter's value, in even ratios.

    Raises InputError for an unknown parameter, and for one that changes nothing.
    """
    varied = variation(name)
    if name == "speed" and lasting_road(parameters) is None:
        raise InputError("--scan speed: wanted a road of lasting waves; elsewhere speed changes nothing")
    here = varied.value(parameters)
    values = here * np.geomspace(0.5, 2.0, points)
    changed = [varied.changed(parameters, value) for value in values.tolist()]
    found = mapped(_at, changed, f"resonances over {name}")
    frequencies, road = (np.array([point[i] for point in found]) for i in (0, 1))
    tables = tuple(point[2] for point in found)
    least = STILL * float(frequencies.max())
    keys = {key for table in tables for key in table}
    changing = frozenset(key for key in keys if np.ptp(_signed(key, frequencies, road)) > least)
    if not all(changing & table.keys() for table in tables):
        raise InputError(f"--scan {name}: wanted a parameter that detunes a resonance, got one that changes none")
    return Scan(
        name=name,
        variation=varied,
        here=here,
        values=values,
        frequencies=frequencies,
        road=road,
        tables=tables,
        changing=changing,
        meetings=tuple(meetings(lambda value: modes_of(varied.changed(parameters, value)), values)),
    )


def modes_of(parameters: Parameters) -> Modes:
    """Modes of the passive car that these parameters describe."""
    return modes(system_of(parameters, order=1)[0].A)


def _at(parameters: Parameters) -> tuple[Array, float, dict[Key, Resonance]]:
    """β (n/2,), Ω (nan if none), and the resonances that occur."""
    form, piece = system_of(parameters)[0], lasting_road(parameters)
    found = modes(form.A)
    rows = resonances(form, piece, found=found).occurring
    if not rows:
        raise InputError("resonances: wanted two modes that oscillate at each point of the scan, got none; damp less")
    Omega = 2.0 * np.pi / period_of(piece) if piece else np.nan
    return found.beta[: len(found.beta) // 2], Omega, {(row.modes, row.road): row for row in rows}


# ------------------------------------------------------------------ on the terminal
def command(scenario: str, scanned: str | None, out: Path | None) -> int:
    """The verb `resonances`; returns the exit status."""
    from .resonance_words import lines, scan_lines

    parameters = read_scenario(scenario).parameters
    if scanned is not None:
        variation(scanned)  # refuses an unknown one before anything is computed
    if out:
        output_folder(out)  # refuses a file before anything is computed
    table = table_of(parameters)
    print("\n".join(lines(table, parameters)))
    if out:
        write_whole(out / "resonances.csv", as_csv(_rows(table.rows)))
        print(f"{out / 'resonances.csv'}: written")
    if scanned is None:
        return 0
    result = scan(parameters, scanned, POINTS)
    print("\n".join(scan_lines(result)))
    if out:
        from .resonance_figure import draw

        stem = f"resonances-{scanned.replace('/', '-')}"
        write_whole(out / f"{stem}.csv", as_csv(_scan_rows(result)))
        write_whole(out / f"{stem}.svg", draw(result))
        print(f"{out / stem}.csv, .svg: written")
    return 0


# ------------------------------------------------------------------ files
NUMBERS = ("detuning [rad/s]", "distance [1/s]", "scale [rad/s]", "relative detuning", "relative distance")


def _numbers(row: Resonance) -> list[float]:
    """In the order of NUMBERS."""
    return [row.detuning, row.distance, row.scale, row.relative, row.relative_distance]


def _rows(rows: Sequence[Resonance]) -> list[list[Any]]:
    heads = ["equality", *NUMBERS, "coefficient [1/s]", "gain", "gain near resonance", "in remark 3.2"]
    return [heads, *([str(r), *_numbers(r), r.coefficient, r.gain, r.near_gain, r.in_print] for r in rows)]


def _scan_rows(result: Scan) -> list[list[Any]]:
    heads = [f"{result.name} [{result.variation.unit}]"]
    for words in ("in frequency", "with damping"):
        heads += [f"nearest {words}", *(f"{what}, {words}" for what in NUMBERS)]
    heads += ["strongest near resonance", "gain near resonance"]
    rows = []
    for i, value in enumerate(result.values.tolist()):
        pair = result.nearest("relative")[i], result.nearest("relative_distance")[i]
        strongest = result.strongest()[i]
        rows.append([value, *(x for r in pair for x in (str(r), *_numbers(r)))])
        rows[-1] += [str(strongest), strongest.near_gain]
    return [heads, *rows]
