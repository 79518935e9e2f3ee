"""The study written down: tables for the terminal, JSON, findings, figures, and a page that shows them all."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fmu_src.controller.halfcar import HalfCar

from ..errors import InputError
from ..figures import Subject, readable, render
from ..files import write_whole
from ..findings import Finding
from .certified import Certified
from .drawings import CHOICE, subjects
from .margins import LoopMargins, Margins
from .study import SPREAD, Robustness, Solution, Study, Weighted, study

FILE, PAGE = "stabilization.json", "stabilization.md"
ROBUST = (
    "λ", "design", "plant", "growth", "worst", "one: gain ×", "one: phase", "all: gain ×", "all: phase", "σ(I + L)",
    "disk", "all: delay", "proved stable",
)  # fmt: skip
WEAKEST = (
    "weakest mode: least |wᴴB| / |w||B| over the left eigenvectors w of A, in SI units; 0 would be: not controllable. "
    "J and forces are from x(t_B2) of each one's own motion over the bump."
)
VARIED = "the body's mass with its inertias, c1, c2, of the car also cp1, cp2 and the wheels' masses, front and rear,"
PROVED_TO = 1e12  # λ [N²/m²] up to which the control on the car is claimed to be proved stable over the box
BROKEN = (
    "one: what the weakest signal stands while the others are as they are, an axle's (both its struts together) in the "
    "half-car design, a strut's in the full-car design; all: what all stand together if they are wrong by the same."
)
DEFAULT = f"{CHOICE} are this project's choice: the paper gives none."
HALF_CAR = HalfCar()
CAR = (
    f"Of the default car: m = {HALF_CAR.m:g} kg, J = {HALF_CAR.Jy:g} kg m², a = {HALF_CAR.a:g} m, "
    f"b = {HALF_CAR.b:g} m, per axle c1 = {2 * HALF_CAR.c1:g} N/m, c2 = {2 * HALF_CAR.c2:g} N/m, "
    f"b1 = {2 * HALF_CAR.b1:g} N s/m, b2 = {2 * HALF_CAR.b2:g} N s/m; "
    "representative of a small car, not the paper's, whose data are not public."
)


def run(folder: Path | None) -> int:
    """Print the study and its findings, and write it into the folder, if one is given; 0 if all findings hold, else 1.

    Raises InputError if the folder is a file.
    """
    if folder and folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: wanted a folder, got a file; name another with -o")
    result = study(progress=True)
    print(text(result))
    if folder:
        for path in write(result, folder):
            print(f"{path}: written")
    made = findings(result)
    print("\n".join(f.line for f in made))
    return 0 if all(f.holds for f in made) else 1


def write(result: Study, folder: Path) -> list[Path]:
    """stabilization.json, the figures, and stabilization.md, which shows them with the tables; returns their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = subjects(result)
    contents = {
        FILE: (json.dumps(as_json(result), indent=1, ensure_ascii=False) + "\n").encode(),
        **{subject.file: render(subject) for subject in drawn},
        PAGE: page(result, drawn).encode(),
    }
    for name, content in contents.items():
        write_whole(folder / name, content)
    return [folder / name for name in contents]


# ------------------------------------------------------------------ claims
def findings(result: Study) -> list[Finding]:
    """What the study must find, each with the number that decides."""
    d, agreement = result.default, result.agreement

    def finding(claim: str, equation: str, measured: float, expected: float, tolerance: float) -> Finding:
        return Finding(
            claim=claim,
            equation=equation,
            measured=measured,
            expected=expected,
            tolerance=tolerance,
            unit="1",
            source="python -m analysis stabilize",
        )

    L, largest = d.L, np.abs(d.L).max()
    two_point = "difference over the largest value, against the two-point problem by exponentials"
    made = [
        finding(f"the arc by Riccati's equation: {two_point}", "(4.3)–(4.7)", agreement.riccati, 0.0, 1e-9),
        finding(f"the arc by collocation: {two_point}", "(4.3)–(4.5)", agreement.collocation, 0.0, 1e-9),
        finding("H is constant: its change over the running cost", "above (4.3)", agreement.hamiltonian, 0.0, 1e-9),
        finding("½ x0ᵀ L(t_B2) x0 over the cost by quadrature", "(4.6)", d.cost / d.measured, 1.0, 1e-8),
        finding("L(t) is positive semidefinite: least eigenvalue over largest entry, if < 0", "(4.7)",
                float(min(np.linalg.eigvalsh(L).min() / largest, 0.0)), 0.0, 1e-12),
    ]  # fmt: skip
    for w in result.weighted:
        at = f"λ = {w.lam:.0e}"
        a = w.approach
        made.append(
            finding(f"{at}: rate of L(t) → L∞ over twice the slowest decay", "remark 4.1", a.fitted / a.rate, 1.0, 1e-3)
        )
        for name, margins in (("half car", w.half.margins), ("car under its own design", w.full_on_car.margins)):
            short = min(margins.return_difference - 1.0, 0.0) if margins else -1.0
            claim = f"{at}: {name}: least singular value of I + L, below 1"
            made.append(finding(claim, "remark 4.1", short, 0.0, 1e-9))
        made.append(finding(f"{at}: half car proved stable within ± 30 %", "(4.1)", w.half.certified.proved, 1.0, 0.0))
        if w.lam > PROVED_TO:
            continue
        for name, robust in (("half-car", w.half_on_car), ("full-car", w.full_on_car)):
            claim = f"{at}: car under its {name} design proved stable within ± 30 %"
            made.append(finding(claim, "(3.10)", robust.certified.proved, 1.0, 0.0))
    return made


# ------------------------------------------------------------------ JSON
def as_json(result: Study) -> dict[str, Any]:
    """All numbers, unrounded; what is infinite as null."""
    return {
        "note": f"{DEFAULT} {CAR}",
        "t_B2": result.begin,
        "models": [_solution_json(s) for s in (result.default, *result.printed)],
        "agreement": asdict(result.agreement),
        "weights": [_weighted_json(w) for w in result.weighted],
        "car unstable from lambda": _finite(result.lost),
        "car unstable somewhere in the box from lambda": _finite(result.lost_in_box),
        "findings": [f.as_json() for f in findings(result)],
    }


def _solution_json(s: Solution) -> dict[str, Any]:
    return {
        "model": s.model.name,
        "x0": s.arc.x[:, 0].tolist(),
        "cost": s.cost,
        "cost by quadrature": s.measured,
        "largest control": s.peaks.tolist(),
        "rank of B": int(np.linalg.matrix_rank(s.model.B)),
        "reach of the weakest mode": s.weakest,
        "growth of A": s.growth,
        "energy to rest": _finite(s.energy_to_rest),
    }


def _weighted_json(w: Weighted) -> dict[str, Any]:
    return {
        "lambda": w.lam,
        "cost": w.solution.cost,
        "largest control": w.solution.peaks.tolist(),
        "rate to the infinite horizon": {"expected": w.approach.rate, "fitted": w.approach.fitted},
        **{f"{design} design, {plant}": _robustness_json(r) for design, plant, r in _robustness(w)},
    }


def _robustness_json(r: Robustness) -> dict[str, Any]:
    certified = asdict(r.certified)
    return {"growth": r.growth, "worst growth": r.worst, "margins": _margins_json(r.margins), "certified": certified}


def _margins_json(m: Margins | None) -> dict[str, Any] | None:
    if m is None:
        return None

    def loop_json(loop: LoopMargins) -> dict[str, Any]:
        return {key: _finite(value) for key, value in asdict(loop).items()}

    return {
        "loops": [loop_json(loop) for loop in m.loops],
        "common": loop_json(m.common),
        "return difference": m.return_difference,
        "disk": m.disk,
        "delay": _finite(m.delay),
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


# ------------------------------------------------------------------ text
def page(result: Study, drawn: Sequence[Subject]) -> str:
    """The study as Markdown: what is printed, and each figure with its caption."""
    figures = [f"![{each.title}]({each.file})\n\n**{each.title}.** {each.caption()}\n" for each in drawn]
    claims = [f"- {finding.line}" for finding in findings(result)]
    parts = ["# Optimal stabilization (§4)", f"```\n{text(result)}\n```", *figures, "## Findings", "\n".join(claims)]
    return "\n\n".join(parts) + "\n"


def text(result: Study) -> str:
    """The study for a terminal."""
    models = (result.default, *result.printed)
    return "\n\n".join(
        [
            f"{DEFAULT}\n{CAR}",
            "Half car behind the bump, by the equations used:\n" + _table(
                ("(4.1)", "rank B", "growth of A", "weakest mode", "J", "max |u1|", "max |u2|", "effort to rest"),
                [_model_row(s) for s in models],
            ) + "\n" + WEAKEST,
            "By λ, finite horizon:\n" + _table(
                ("λ", "L14(t_B2)", "J", "max |u1|", "max |u2|", "L → L∞ by", "expected"),
                [_weight_row(w) for w in result.weighted],
            ),
            f"u = K x broken at the actuators; {VARIED} ± {SPREAD:.0%}:\n" + _table(
                ROBUST,
                [row for w in result.weighted for row in _robust_rows(w)],
            ) + "\n" + BROKEN,
            _lost(result.lost, result.lost_in_box),
        ]
    )  # fmt: skip


def _lost(lam: float, in_box: float) -> str:
    box = f"within ± {SPREAD:.0%}"
    if not np.isfinite(in_box):
        return (
            f"At all these weights the half-car design also holds the car with its wheels stable at all corners {box}."
        )
    somewhere = f"at some corner {box} from λ = {readable(in_box, 3)} N²/m²"
    if not np.isfinite(lam):
        return f"On the car with its wheels the half-car design is unstable {somewhere}."
    return f"On the car with its wheels the half-car design is unstable from λ = {readable(lam, 3)} N²/m², {somewhere}."


def _model_row(s: Solution) -> tuple[str, ...]:
    peaks = (f"{readable(u, 3)} N" for u in s.peaks)
    rank = str(np.linalg.matrix_rank(s.model.B))
    cost, effort = (f"{readable(value, 4)} N²s" for value in (s.cost, s.energy_to_rest))
    return s.model.name, rank, f"{readable(s.growth, 3)} 1/s", readable(s.weakest, 2), cost, *peaks, effort


def _weight_row(w: Weighted) -> tuple[str, ...]:
    peaks = (f"{readable(u, 3)} N" for u in w.solution.peaks)
    rates = (f"{readable(rate, 6)} 1/s" for rate in (w.approach.fitted, w.approach.rate))
    L14 = f"{readable(w.solution.L[0, 0, 3])} N²s²/m"
    return f"{w.lam:.0e}", L14, f"{readable(w.solution.cost)} N²s", *peaks, *rates


def _robustness(w: Weighted) -> list[tuple[str, str, Robustness]]:
    """Each with the car that the gain is made for and the one that it acts on."""
    return [
        ("half-car", "half car", w.half),
        ("half-car", "car", w.half_on_car),
        ("full-car", "car", w.full_on_car),
    ]


def _robust_rows(w: Weighted) -> list[tuple[str, ...]]:
    return [(f"{w.lam:.0e}", design, plant, *_robust_cells(r)) for design, plant, r in _robustness(w)]


def _robust_cells(r: Robustness) -> tuple[str, ...]:
    growths = (f"{readable(value, 3)} 1/s" for value in (r.growth, r.worst))
    return *growths, *_margin_cells(r.margins), _proved(r.certified)


def _margin_cells(m: Margins | None) -> tuple[str, ...]:
    if m is None:
        return ("—",) * 7
    one = LoopMargins(
        down=max(loop.down for loop in m.loops),
        up=min(loop.up for loop in m.loops),
        phase=min(loop.phase for loop in m.loops),
    )
    several = (readable(m.return_difference, 3), readable(m.disk, 3))
    return *_loop_cells(one), *_loop_cells(m.common), *several, _any(m.delay, 1e3, " ms")


def _loop_cells(m: LoopMargins) -> tuple[str, str]:
    return f"{readable(m.down, 3)} to {readable(m.up, 3)}", _any(m.phase, 1.0, "°")


def _any(value: float, factor: float, unit: str) -> str:
    return f"{readable(factor * value, 3)}{unit}" if np.isfinite(value) else "any"


def _proved(c: Certified) -> str:
    share = f"{100 * c.proved:.3g} % in {c.boxes}"
    if c.witness is None:
        return share
    return f"{share}; not at " + ", ".join(f"{name} = {readable(value)}" for name, value in c.witness.items())


def _table(columns: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [columns, *rows]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip() for line in lines)
