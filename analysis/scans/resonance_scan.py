"""`python -m analysis resonances`: the table for a scenario, and its change with one parameter as numbers and a map."""

from __future__ import annotations

import csv
import io
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
from ..methods.resonance import SMALL, Resonance, Resonances, remark_as_printed, resonances
from ..methods.series import exact_series
from ..methods.signals import Piece, Signal, constant
from ..methods.standard_form import StandardForm
from ..parallel import mapped
from ..reference import Parameters
from ..scenario import read_scenario
from .car_scans import Variation, lasting_road, system_of, variation

SHOWN, MET = 15, 6  # rows, and frequencies that meet, on the terminal
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

    def curve(self, key: Key, attribute: str) -> Array:
        """An attribute of one resonance over the values; nan where it does not occur."""
        return np.array([getattr(table[key], attribute) if key in table else np.nan for table in self.tables])

    def nearest(self, attribute: str) -> list[Resonance]:
        """The one with the smallest attribute at each value, of those that change."""
        among = [[row for key, row in table.items() if key in self.changing] for table in self.tables]
        return [min(rows, key=lambda row: getattr(row, attribute)) for rows in among]

    def strongest(self) -> list[Resonance]:
        """The one with the largest gain at each value."""
        return [max(table.values(), key=lambda row: row.gain) for table in self.tables]


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """A value of the parameter at which an equality of frequencies holds, and the larger gain of its neighbours."""

    value: float
    row: Resonance  # at the neighbour

    def __str__(self) -> str:
        return f"{self.row} at {self.value:.4g}, gain {self.row.gain:.2g}"


def crossings(result: Scan) -> list[Crossing]:
    """Where detunings change their sign, by interpolation between neighbours; the strongest first."""
    found = []
    for key in result.changing:
        signed = _signed(key, result.frequencies, result.road)
        for i in np.flatnonzero((signed[:-1] < 0.0) != (signed[1:] < 0.0)).tolist():
            rows = [table[key] for table in result.tables[i : i + 2] if key in table]
            if len(rows) == 2:
                part = signed[i] / (signed[i] - signed[i + 1])
                value = (1.0 - part) * result.values[i] + part * result.values[i + 1]
                found.append(Crossing(value=float(value), row=max(rows, key=lambda row: row.gain)))
    return sorted(found, key=lambda crossing: -crossing.row.gain)


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
    )


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
    parameters = read_scenario(scenario).parameters
    if scanned is not None:
        variation(scanned)  # refuses an unknown one before anything is computed
    table = table_of(parameters)
    print("\n".join(lines(table, parameters)))
    if out:
        output_folder(out)
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


def lines(table: Resonances, parameters: Parameters) -> list[str]:
    """The nearest resonances in words, and what was left out."""
    form, _ = system_of(parameters)
    found = modes(form.A)
    beta = ", ".join(f"β{k} = {b:.3f}" for k, b in enumerate(found.beta[: len(found.beta) // 2], start=1))
    piece = lasting_road(parameters)
    omega = f"; Ω = {2.0 * np.pi / period_of(piece):.3f}" if piece else "; the road has no lasting waves"
    left_out = ", ".join(f"{count} with {waves} waves" for waves, count in table.trivial.items())
    occurring = table.occurring
    heads = (
        "equality",
        "off [rad/s]",
        "relative",
        "with damping [1/s]",
        "relative",
        "gain",
        "in remark 3.2",
    )
    text = [
        f"the passive car, actuators at rest: {beta}{omega} [rad/s]",
        f"{table.terms} terms state {len(table.rows)} equalities; {len(occurring)} of these occur in Φ. Left out as "
        f"identities (s_k s_j s_j+{len(found.beta) // 2}, s_k with opposite waves): {left_out}. Modes that do not "
        f"oscillate: {table.silent}.",
        "{:<24}{:>12}{:>10}{:>20}{:>10}{:>11}{:>15}".format(*heads),
    ]
    if not occurring:
        return text
    text += [_line(row) for row in occurring[:SHOWN]]
    nearest = min(occurring, key=lambda row: row.relative_distance)
    text.append(
        f"nearest with damping: {nearest}, {nearest.distance:.3g} 1/s ({nearest.relative_distance:.2g} relative)"
    )
    strongest = max(occurring, key=lambda row: row.gain)
    text.append(f"strongest: {strongest} adds {strongest.gain:.2g} of a motion of {table.size:.2g} (m, rad)")
    text += secular_lines(form, found, piece)
    three, four = remark_as_printed(found.eigenvalues)
    for name, remark in (("three", three), ("four", four)):
        i, j = int(np.argmin(remark.detuning)), int(np.argmin(remark.distance))
        text.append(
            f"remark 3.2 as printed, {name} modes ({len(remark.distance)}): nearest in frequency "
            f"{remark.detuning[i]:.3g} rad/s at {remark.indices[i].tolist()}, in the complex plane "
            f"{remark.distance[j]:.3g} 1/s at {remark.indices[j].tolist()}"
        )
    return text


def secular_lines(form: StandardForm, found: Modes, piece: Piece | None) -> list[str]:
    """Terms t exp(λt) of the first correction by name; from rest on the lasting road, else in a free motion."""
    n = len(found.eigenvalues)
    signal = Signal((piece,)) if piece else constant([0.0] * form.B.shape[1])
    start = np.zeros(n) if piece else (found.K @ np.full(n, SMALL)).real
    what = "from rest on this road" if piece else f"in a free motion of {SMALL:g} (m, rad) in each mode"
    terms = exact_series(form, found, signal, start, 1).secular
    text = [f"first correction of the series, {what}: {len(terms) or 'no'} terms that grow like t exp(λ_k t)"]
    if piece:
        text[0] += f"; σ = {', '.join(f'{s.imag:+.4g}i' for s in piece.exponents.tolist())} 1/s"
    return text + [f"  {term}, {abs(term.coefficient):.2g} (m, rad)/s times that" for term in terms[:SHOWN]]


def _line(row: Resonance) -> str:
    return (
        f"{row!s:<24}{row.detuning:>12.4f}{row.relative:>10.5f}{row.distance:>20.3f}{row.relative_distance:>10.4f}"
        f"{row.gain:>11.2g}{'yes' if row.in_print else 'no':>15}"
    )


def scan_lines(result: Scan) -> list[str]:
    """Where the nearest resonance is nearest and where farthest."""
    gains = [row.gain for row in result.strongest()]
    text = [
        f"{result.name} = {result.values[i]:.4g} {result.variation.unit}: the strongest adds {what}, {gains[i]:.2g}"
        for i, what in ((int(np.argmax(gains)), "most"), (int(np.argmin(gains)), "least"))
    ]
    span = f"{result.name} from {result.values[0]:.4g} to {result.values[-1]:.4g} {result.variation.unit}"
    met = crossings(result)
    strongest = f", the strongest: {'; '.join(map(str, met[:MET]))}" if met else ""
    text.append(f"{span}: {len(met) or 'no'} frequencies meet exactly{strongest}")
    text.append(f"of the {len(result.changing)} resonances that it detunes:")
    for attribute, words in (("relative", "in frequency"), ("relative_distance", "with damping")):
        nearest = result.nearest(attribute)
        sizes = [getattr(row, attribute) for row in nearest]
        for i, what in ((int(np.argmin(sizes)), "nearest"), (int(np.argmax(sizes)), "farthest")):
            if what == "farthest" or attribute != "relative" or not met:  # a sampled smallest detuning says nothing
                text.append(
                    f"{span}: the nearest is {what} {words} at {result.values[i]:.4g}: {nearest[i]}, {sizes[i]:.3g} "
                    "relative"
                )
    return text


# ------------------------------------------------------------------ files
def output_folder(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: nothing can be written there: {error}") from error


NUMBERS = ("detuning [rad/s]", "distance [1/s]", "scale [rad/s]", "relative detuning", "relative distance")


def _numbers(row: Resonance) -> list[float]:
    """In the order of NUMBERS."""
    return [row.detuning, row.distance, row.scale, row.relative, row.relative_distance]


def _rows(rows: Sequence[Resonance]) -> list[list[Any]]:
    heads = ["equality", *NUMBERS, "coefficient [1/s]", "gain", "in remark 3.2"]
    return [heads, *([str(r), *_numbers(r), r.coefficient, r.gain, r.in_print] for r in rows)]


def _scan_rows(result: Scan) -> list[list[Any]]:
    heads = [f"{result.name} [{result.variation.unit}]"]
    for words in ("in frequency", "with damping"):
        heads += [f"nearest {words}", *(f"{what}, {words}" for what in NUMBERS)]
    heads += ["strongest", "gain"]
    rows = []
    for i, value in enumerate(result.values.tolist()):
        pair = result.nearest("relative")[i], result.nearest("relative_distance")[i]
        strongest = result.strongest()[i]
        rows.append([value, *(x for r in pair for x in (str(r), *_numbers(r)))])
        rows[-1] += [str(strongest), strongest.gain]
    return [heads, *rows]


def as_csv(rows: list[list[Any]]) -> bytes:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()
