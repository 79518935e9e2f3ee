"""Which figures a run has: the paper's figures 2 to 6, 9 and 10, and the tyre loads, with their captions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from fmu_src.quantities import CORNER_WORDS, FORCES, POSITIONS, ROAD_HEIGHTS, STATES, TYRE_FORCES, Quantity

from .discrepancy import linear_states
from .figures import (
    BLUE,
    DASHED,
    DOTTED,
    PURPLE,
    READING,
    RED,
    Axes,
    Subject,
    Window,
    described,
    plot_comparison,
    plot_discrepancy,
    plot_heaves,
    plot_quantities,
    plot_tyre_loads,
    readable,
    render,
    uneven,
    words,
)
from .files import write_whole
from .trajectory import FIGURES, Run, Trajectory
from .tyres import static_loads, tyre_loads

TUBE, DELTA = "certified-tube.svg", "certified-delta.svg"  # drawn by `certify RUN`, with their captions in them
ENERGIES = "modal-energies.svg"  # by `spatial RUN`, likewise
Z, PSI, PHI, Z11, Z12, Z2, PSI2 = POSITIONS


@dataclass(frozen=True, slots=True)
class FigureEntry:
    """A figure that was drawn: its file in the figures' folder, its title, its caption (plain text)."""

    file: str
    title: str
    caption: str


def draw_all(run: Run, counterpart: Run | None, folder: Path, other_design: Run | None = None) -> list[FigureEntry]:
    """Write `figures/*.svg` into the run's folder: all figures whose columns were recorded."""
    target = folder / FIGURES
    target.mkdir(exist_ok=True)
    drawn = [subject for subject in subjects(run, counterpart, other_design) if not subject.missing]
    for subject in drawn:
        write_whole(target / subject.file, render(subject))
    return [FigureEntry(subject.file, subject.title, subject.caption()) for subject in drawn]


def certified(folder: Path) -> list[FigureEntry]:
    """The figures that `certify RUN` drew into a run's folder, if any. Raises InputError for what it did not draw."""
    return _kept(folder, TUBE, DELTA)


def energies(folder: Path) -> list[FigureEntry]:
    """The figure that `spatial RUN` drew into a run's folder, if it did. Raises InputError as `certified` does."""
    return _kept(folder, ENERGIES)


def _kept(folder: Path, *names: str) -> list[FigureEntry]:
    found = [folder / FIGURES / name for name in names]
    return [FigureEntry(path.name, *described(path.read_bytes(), str(path))) for path in found if path.is_file()]


def left_out(run: Run, counterpart: Run | None) -> list[tuple[str, list[str]]]:
    """Titles of the figures that cannot be drawn, each with the columns that were not recorded."""
    return [(subject.title, subject.missing) for subject in subjects(run, counterpart) if subject.missing]


# ------------------------------------------------------------------ the choice
def is_controlled(run: Run) -> bool:
    """Whether the controller of this run is switched on."""
    return bool(run.record["parameters"].get("controller", {}).get("enabled", False))


def subjects(run: Run, counterpart: Run | None, other_design: Run | None = None) -> list[Subject]:
    """All figures that this run can give; the controller's, if it or its counterpart has one at work."""
    pair = {is_controlled(each): each for each in (run, counterpart) if each}
    made = _paper_figures(run)
    if len(pair) == 2:
        made.append(_comparison(pair[True], pair[False], other_design))
    if True in pair and _acts(pair[True].trajectory):
        made.append(_strut_forces(pair[True], "" if is_controlled(run) else " They are those of the counterpart run."))
    return [*made, _tyre_loads(run), _linear_approximation(run)]


def _paper_figures(run: Run) -> list[Subject]:
    def subject(
        number: int,
        name: str,
        title: str,
        text: str,
        needs: Sequence[Quantity],
        plot: Callable[[Trajectory, Sequence[Quantity], Axes], Axes] = plot_quantities,
    ) -> Subject:
        return Subject(
            file=f"figure-{number:02d}-{name}.svg",
            title=title,
            caption=lambda: (
                f"As figure {number} of the paper. {text}" + (_shift(run, needs) if number in (3, 4) else "")
            ),
            panels=(partial(plot, run.trajectory, needs),),
            sources=(run.trajectory,),
            needs=needs,
        )

    road = (
        "Height of the road under each wheel, where it is not flat (of an endless road the first waves). "
        "A wheel meets the profile after its own delay, if the profile lies in its track."
    )
    wheels = "Up, from static equilibrium."
    heaves = "Body and rear axle, up, from static equilibrium; the front wheels of figure 3 lightly."
    angles = "Roll ψ, positive where the left side goes up, and pitch φ, positive nose down."
    excitations = subject(2, "excitations", "Excitations on all wheels", road, ROAD_HEIGHTS)
    return [
        replace(excitations, window=partial(_road_window, run)),
        subject(3, "front-wheels", "Vertical displacements of the front wheels", wheels, (Z11, Z12)),
        subject(4, "heaves", "Vertical displacements", heaves, (Z, Z2, Z11, Z12), plot_heaves),
        subject(5, "car-rotation", "Car rotation angles", angles, (PSI, PHI)),
        subject(6, "axle-rotation", "Rotation angle of the rear axle", "Roll ψ₂, positive like ψ.", (PSI2,)),
    ]


def _road_window(run: Run) -> Window:
    Lambda, v0 = run.reals("Lambda", "v0")
    return uneven(run.trajectory, Lambda / v0)


def _shift(run: Run, quantities: Sequence[Quantity]) -> str:
    """Where the displacements end, beside what the paper says of it; only for a road that ends as level as it began."""
    trajectory = run.trajectory
    if not {q.name for q in ROAD_HEIGHTS} <= set(trajectory.names):
        return ""
    heights = trajectory.columns([q.name for q in ROAD_HEIGHTS])
    if heights[-2:].any() or not heights.any():
        return ""
    unit, factor = READING["m"]
    ends = ", ".join(f"{words(q)} {readable(factor * trajectory[q.name][-1], 2)} {unit}" for q in quantities)
    return (
        " The paper reads from its figures 3 and 4 that the displacements remain constant behind the unevenness "
        f"(“vibrational shift”). Here, at t = {trajectory.time[-1]:g}\N{NO-BREAK SPACE}s: {ends}."
    )


def _acts(trajectory: Trajectory) -> bool:
    """Whether any recorded control force is ever other than zero; True if one was not recorded."""
    names = [q.name for q in FORCES]
    return not set(names) <= set(trajectory.names) or bool(trajectory.columns(names).any())


def _comparison(controlled: Run, uncontrolled: Run, other_design: Run | None) -> Subject:
    curves: list[tuple[Trajectory, str, Any, str]] = [
        (controlled.trajectory, RED, "-", "optimal stabilization"),
        (uncontrolled.trajectory, BLUE, DASHED, "without control forces"),
    ]
    another = ""
    if other_design:
        name = f"{other_design.parameters.get('design', 'other')} design"
        curves.append((other_design.trajectory, PURPLE, DOTTED, name))
        another = f" Purple: {name}."
    return Subject(
        file="figure-09-stabilization.svg",
        title="Controlled against uncontrolled car",
        caption=lambda: (
            f"As figure 9 of the paper. Red: optimal stabilization; blue: without control forces.{another} Heave z, "
            "up; pitch φ, positive nose down (the paper's section 4 has it front up); below them roll ψ, which the "
            "half-car design does not see. Here the car is the full one, with seven degrees of freedom; the paper's is "
            f"the half car: python -m analysis stabilize draws that, and figure 8. {_choice(controlled)}"
        ),
        panels=[partial(plot_comparison, curves, q) for q in (Z, PHI, PSI)],
        sources=[trajectory for trajectory, *_ in curves],
        needs=(Z, PHI, PSI),
    )


def _choice(run: Run) -> str:
    """What of the control's weights and of the car is a choice, with the values of the run."""
    lam, H1 = run.reals("lambda", "H1")
    end = f"T = {run.reals('T')[0]:g} s" if run.parameters["horizon"] == "finite" else "infinite horizon"
    return (
        f"λ = {lam:g} N²/m², H1 = {H1:g} m, {end} and the car's data are this project's choice or the scenario's: the "
        "paper gives none."
    )


def _strut_forces(run: Run, whose: str) -> Subject:
    trajectory = run.trajectory
    return Subject(
        file="figure-10-control-forces.svg",
        title="Control forces of the struts",
        caption=lambda: (
            "As figure 10 of the paper, by strut: positive pushes the body up and the wheel down. The paper's forces, "
            f"per axle and positive down on the body, are u₁ = −(u₁₁ + u₁₂) and u₂ = −(u₂₁ + u₂₂).{whose} "
            + _choice(run)
        ),
        panels=(partial(plot_quantities, trajectory, FORCES),),
        sources=(trajectory,),
        needs=FORCES,
    )


def _tyre_loads(run: Run) -> Subject:
    def caption() -> str:
        loads = ", ".join(f"{w} {1e-3 * load:.3g} kN" for w, load in zip(CORNER_WORDS, static_loads(run), strict=True))
        return (
            f"Not in the paper. Vertical load of each tyre: its static load ({loads}) and the tyre force over it. "
            "Below zero a real tyre has left the ground, while the model's tyre spring goes on pulling."
        )

    def axle(pair: slice, ax: Axes) -> Axes:
        return plot_tyre_loads(run.trajectory.time, tyre_loads(run)[:, pair], TYRE_FORCES[pair], ax)

    return Subject(
        file="tyre-loads.svg",
        title="Tyre loads",
        caption=caption,
        panels=(partial(axle, slice(0, 2)), partial(axle, slice(2, 4))),
        sources=(run.trajectory,),
        needs=TYRE_FORCES,
    )


def _linear_approximation(run: Run) -> Subject:
    linear = cache(lambda: linear_states(run))

    def caption() -> str:
        x, t = run.trajectory.columns([q.name for q in POSITIONS]), run.trajectory.time
        away = np.abs(x - linear()[:, : len(POSITIONS)])
        readings = [
            f"{words(q)} {readable(READING[q.unit][1] * column.max(), 2)} {READING[q.unit][0]}"
            f" at {t[column.argmax()]:.3g} s"
            for q, column in zip(POSITIONS, away.T, strict=True)
        ]
        return (
            "Not in the paper. The run beside the solution (2.3) of the linear equations with the same start, on the "
            f"same road, under the same forces. Largest differences: {', '.join(readings)}."
        )

    def panel(q: Quantity, ax: Axes) -> Axes:
        return plot_discrepancy(run.trajectory.time, run.trajectory[q.name], linear()[:, STATES.index(q)], q, ax)

    return Subject(
        file="linear-approximation.svg",
        title="The linear approximation",
        caption=caption,
        panels=[partial(panel, q) for q in (Z, PHI, PSI, PSI2)],
        sources=(run.trajectory,),
        needs=(*STATES, *FORCES),
    )
