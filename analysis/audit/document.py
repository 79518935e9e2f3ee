"""The audit as a whole: gathered, and written as text, Markdown, JSON and figures."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from ..figures import BLUE, DASHED, READING, RED, Axes, Subject, axis_label, finish, readable, render, words
from ..files import write_whole
from . import amplitude_equation, averaging, car, resonance, response, section2, section3, section4, senses
from .differences import CONVENTION, differences
from .response import Deviation
from .rows import Evidence, Row

COMMAND = "python -m analysis audit -o docs"
SENSES = {"A": "ψ2 positive like ψ", "B": "ψ2 opposite to ψ"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Audit:
    """rows: by the paper's order, §3.1 in convention B.  in_a: the changes of §3.1 in convention A."""

    rows: tuple[Row, ...]
    in_a: tuple[Row, ...]
    deviations: tuple[Deviation, ...]

    @property
    def holds(self) -> bool:
        """Whether every number decides as its row says."""
        return all(row.holds for row in (*self.rows, *self.in_a))

    @property
    def counts(self) -> dict[str, int]:
        """Changes of (3.1)–(3.7) that each convention needs."""
        return {"A": len(self.in_a), "B": len(differences("B"))}


def audit(progress: bool = False) -> Audit:
    """Everything computed anew; takes most of a minute."""
    sections: list[Callable[[], list[Row]]] = [
        section2.rows, car.rows, section3.rows, averaging.rows, amplitude_equation.rows, resonance.rows,
        section3.road_rows, response.rows, section4.rows, senses.rows,
    ]  # fmt: skip
    runs = [partial(response.remainder, *run) for run in response.runs()]  # kept by their cache
    todo: list[Callable[[], Any]] = [*runs, car.in_convention_a, *sections]
    results = [task() for task in tqdm(todo, desc="audit", unit="task", disable=None if progress else True)]
    in_a, *by_section = results[len(runs) :]
    return Audit(
        rows=tuple(row for rows in by_section for row in rows),
        in_a=tuple(in_a),
        deviations=tuple(response.deviations()),
    )


def write(result: Audit, folder: Path) -> list[Path]:
    """audit.md, audit.json and the figures, each whole; returns their paths."""
    contents = {
        "audit.md": markdown(result).encode(),
        "audit.json": (json.dumps(as_json(result), indent=1, ensure_ascii=False) + "\n").encode(),
        **{subject.file: render(subject) for subject in subjects()},
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in contents.items():
        write_whole(folder / name, content)
    return [folder / name for name in contents]


def as_json(result: Audit) -> dict[str, Any]:
    """All numbers, unrounded."""
    return {
        "rows": [row.as_json() for row in result.rows],
        "convention A": [row.as_json() for row in result.in_a],
        "changes": result.counts,
        "response": [{**asdict(d), "quantity": d.quantity.name} for d in result.deviations],
    }


# ------------------------------------------------------------------ words
NOISE = 1e-5  # numbers that are only known to be below a tolerance as small as this are written so
ROUND_OFF = 1e-12


def shown(e: Evidence, value: float) -> str:
    """A number to three digits, a count in full; round-off, as below its tolerance, or below ROUND_OFF."""
    if e.expected == 0.0 and abs(value) <= e.tolerance and 0.0 < e.tolerance < NOISE:
        return f"< {e.tolerance:g}".replace("-", "−")
    if 0.0 < abs(value) < ROUND_OFF:
        return f"< {ROUND_OFF:g}".replace("-", "−")
    return readable(value, 6 if value.is_integer() else 3)


def conventions(result: Audit) -> str:
    """How many changes each sense of ψ2 needs, and which is reported."""
    each = " and ".join(f"{n} in convention {name} ({SENSES[name]})" for name, n in sorted(result.counts.items()))
    return (
        f"The print mixes two senses of ψ2. Changes that (3.1)–(3.7) need: {each}; the rows are those of convention "
        f"{CONVENTION}. The car of this project is convention A: the same model with ψ2 → −ψ2."
    )


def text(result: Audit) -> str:
    """The audit for a terminal."""
    parts = [_row_text(row) for row in result.rows]
    parts += [conventions(result), "Changes in convention A:"]
    parts += [_row_text(row) for row in result.in_a]
    parts.append("Response to the default bump, derived and as printed:")
    table = _response_table(result)
    widths = [max(len(line[k]) for line in table) for k in range(len(table[0]))]
    parts.append("\n".join("  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)) for line in table))
    undecided = [row.equation for row in (*result.rows, *result.in_a) if not row.holds]
    kinds = {row.verdict for row in result.rows}
    counted = ", ".join(f"{sum(row.verdict == kind for row in result.rows)} {kind}" for kind in sorted(kinds))
    parts.append(
        f"{len(result.rows)} rows: {counted}." + (f" Not decided: {', '.join(undecided)}." if undecided else "")
    )
    return "\n\n".join(parts)


def _row_text(row: Row) -> str:
    lines = [f"{row.equation}: {row.verdict}", f"  printed  {row.printed}", f"  derived  {row.derived}"]
    for e in row.evidence:
        pair = f"{shown(e, e.printed)} | {shown(e, e.derived)}{_unit(e)}"
        lines.append(f"    {pair:<24} {e.measure}")
    return "\n".join(lines + ([f"  {row.note}"] if row.note else []))


def _unit(e: Evidence) -> str:
    return "" if e.unit == "1" else f" {e.unit}"


def _response_table(result: Audit) -> list[tuple[str, ...]]:
    lines: list[tuple[str, ...]] = [("coordinate", "derived peak", "printed peak", "largest difference / derived peak")]
    for d in result.deviations:
        unit, factor = READING[d.quantity.unit]
        peaks = (f"{readable(factor * value, 3)} {unit}" for value in (d.derived, d.printed))
        lines.append((words(d.quantity), *peaks, f"{readable(100.0 * d.difference, 3)} %"))
    return lines


# ------------------------------------------------------------------ Markdown
HEAD = f"""# The paper audited

Written by `{COMMAND}`; a test compares every row with what the command gives. The changes to the
seven equations were found by symbolic difference from the Lagrangian of the car. Under “evidence” stand the numbers
that decide, each for the printed and for the derived form; of a claim that is refuted, for the printed and for the
derived system; of what is right if read so, for the nearest reading and for that one. A condition or sentence “does not
hold” where a formula would be a misprint. What is decided “by inspection” contradicts itself or what stands beside it,
and has no number. Without rows: (2.1)–(2.4), (3.9)–(3.12), (4.2), which define, and (2.8), (2.9), (2.11), (3.19), which
assume. Lengths in m, angles in rad, SI units throughout; the car is the default one, which is representative of its
class and not the paper's.
"""


def markdown(result: Audit) -> str:
    """The audit as the page of the docs."""
    columns = ("equation", "printed", "derived", "evidence: printed → derived", "verdict")
    short = ("equation", "printed", "derived", "evidence: printed → derived")
    figures = "\n".join(f"- `{s.file}`: {s.caption()}" for s in subjects())
    notes = [f"- {row.equation}: {row.note}" for row in result.rows if row.note]
    parts = [
        HEAD + "\n" + conventions(result),
        _table(columns, [(*_cells(row), row.verdict) for row in result.rows]),
        "## Notes\n\n" + "\n".join(notes),
        "## Changes in convention A",
        _table(short, [_cells(row) for row in result.in_a]),
        "## What the misprints do to the response",
        "Default car and bump (10 mm); the undefined m_z of (3.4) taken as m2; ψ2 of the print in the sense in which "
        "its road term drives it.",
        _table(*_split(_response_table(result))),
        "The command also draws these, into the folder that it is given; the repository holds this page alone:\n\n"
        + figures,
    ]
    return "\n\n".join(parts) + "\n"


def _split(table: list[tuple[str, ...]]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    return table[0], table[1:]


def _cells(row: Row) -> tuple[str, str, str, str]:
    evidence = [f"{e.measure}: **{shown(e, e.printed)} → {shown(e, e.derived)}**{_unit(e)}" for e in row.evidence]
    return row.equation, row.printed, row.derived, "<br>".join(evidence)


def _table(columns: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    cells = [columns, ["---"] * len(columns), *([cell.replace("|", r"\|") for cell in line] for line in lines)]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


# ------------------------------------------------------------------ figures
def subjects() -> list[Subject]:
    """Both responses to the bump, and how both die away."""
    z, psi, phi, *_, psi2 = range(7)
    return [
        Subject(
            file="audit-response.svg",
            title="The bump, as derived and as printed",
            caption=lambda: (
                "Roll of the body, its pitch, roll of the rear axle and heave over the default bump; blue: the "
                "equations from the energies; red, dashed: (3.1)–(3.7) as printed."
            ),
            panels=[partial(_both, k) for k in (psi, phi, psi2, z)],
            sources=(),
            needs=(),
            window=lambda: (0.0, 2.0),
        ),
        Subject(
            file="audit-decay.svg",
            title="Nothing stays behind the bump",
            caption=lambda: (
                "Largest |q| over its peak among the seven coordinates, as derived (blue) and as printed (red, "
                "dashed): no shift remains."
            ),
            panels=[_decay],
            sources=(),
            needs=(),
            window=lambda: (0.0, float(response.TIMES[-1])),
        ),
    ]


DRAWN = 8  # of the response's rows each eighth, 2 ms apart
LINES = (("derived", BLUE, "-", "from the energies"), ("printed", RED, DASHED, "as printed"))


def _both(k: int, ax: Axes) -> Axes:
    q = response.POSITIONS[k]
    unit, factor = READING[q.unit]
    for name, color, dashes, how in LINES:
        values = factor * response.responses()[name][::DRAWN, k]
        ax.plot(response.TIMES[::DRAWN], values, color=color, linestyle=dashes, label=f"{words(q)}, {how}")
    ax.set_ylabel(axis_label((q,), unit))
    return finish(ax)


def _decay(ax: Axes) -> Axes:
    for name, color, dashes, how in LINES:
        size = np.abs(response.responses()[name])
        largest = (size / size.max(axis=0)).max(axis=1)
        ax.semilogy(response.TIMES[DRAWN::DRAWN], largest[DRAWN::DRAWN], color=color, linestyle=dashes, label=how)
    ax.set_ylabel("largest $|q_i|$ over its peak")
    return finish(ax)
