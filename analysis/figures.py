"""Figures of a run, as SVG: the paper's figures 2 to 6, 9 and 10, and the tyre loads. The only user of matplotlib.

A plotting function takes data and an `ax`, draws, and returns `ax`. Trajectories are in SI units; millimetres,
milliradians and kilonewtons are made here, for reading, and nowhere else.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from cycler import cycler
from matplotlib import style
from matplotlib.figure import Figure

from fmu_src.quantities import CORNER_WORDS, FORCES, POSITIONS, ROAD_HEIGHTS, TYRE_FORCES, Quantity

from .errors import InputError
from .trajectory import Array, Run, Trajectory

Axes = Any  # of matplotlib, whose types are not looked at here
Panel = Callable[[Axes], Axes]
Window = tuple[float, float]
FOLDER = "figures"
READING = {
    "m": ("mm", 1e3),
    "rad": ("mrad", 1e3),
    "m/s": ("mm/s", 1e3),
    "rad/s": ("mrad/s", 1e3),
    "N": ("N", 1.0),
}
"""SI unit -> unit in which a value is read, and the factor to it."""

BLUE, ORANGE, TEAL, PURPLE, RED = "#0077bb", "#ee7733", "#009988", "#aa3377", "#cc3311"  # Paul Tol, colour-blind-safe
DASHED = (0, (5, 1.5))
STYLE = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same glyphs on every machine
    "font.size": 9.0,
    "mathtext.fontset": "dejavuserif",
    "axes.grid": True,
    "axes.edgecolor": "#666666",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.xmargin": 0.0,
    "axes.prop_cycle": cycler(color=[BLUE, ORANGE, TEAL, PURPLE]) + cycler(linestyle=["-", DASHED] * 2),  # right dashed
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "svg.fonttype": "path",
    "svg.hashsalt": "bertolino-baksa",  # else the ids in the file are new each time
}
WIDTH, PANEL_HEIGHT = 7.2, 2.5  # inches
COLUMNS = 2000  # of a panel, finer than the eye or a printer
G = 9.81  # m/s2

Z, PSI, PHI, Z11, Z12, Z2, PSI2 = POSITIONS


@dataclass(frozen=True, slots=True)
class FigureEntry:
    """A figure that was drawn: its file in the figures' folder, its title, its caption (plain text)."""

    file: str
    title: str
    caption: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """A figure that a run can give, if its trajectories hold the columns that it needs."""

    file: str
    title: str
    caption: Callable[[], str]
    panels: Sequence[Panel]
    sources: Sequence[Trajectory]
    needs: Sequence[Quantity]
    window: Callable[[], Window] | None = None  # of time [s]; by default the eventful one

    @property
    def missing(self) -> list[str]:
        """Names of the needed columns that were not recorded."""
        return [q.name for q in self.needs if any(q.name not in source.names for source in self.sources)]


# ------------------------------------------------------------------ numbers that figures and report share
def real_parameters(run: Run, *names: str) -> list[float]:
    """Real parameters of the run, SI units. Raises InputError naming those that its record lacks."""
    known = run.parameters
    lacking = [name for name in names if not isinstance(known.get(name), (int, float))]
    if lacking:
        raise InputError(f"run.json: parameters: wanted a number for {', '.join(lacking)}, got none")
    return [float(known[name]) for name in names]


def readable(value: float, digits: int = 4) -> str:
    """A measured value to so many digits, with a true minus sign."""
    return f"{value:.{digits}g}".replace("-", "−")


def is_controlled(run: Run) -> bool:
    """Whether the controller of this run is switched on."""
    return bool(run.record["parameters"].get("controller", {}).get("enabled", False))


def static_loads(run: Run) -> Array:
    """Loads (4) [N] of the tyres fl, fr, rl, rr of the car at rest: its share of the body, its wheel, half the beam."""
    m, m11, m12, m21, m22, m2, a, b = real_parameters(run, "m", "m11", "m12", "m21", "m22", "m2", "a", "b")
    front, rear = m * b / (2 * (a + b)), m * a / (2 * (a + b)) + m2 / 2
    return G * np.array([front + m11, front + m12, rear + m21, rear + m22])


def tyre_loads(run: Run) -> Array:
    """Total vertical loads (n, 4) [N] of the tyres: static load and exported tyre force."""
    return static_loads(run) + run.trajectory.columns([q.name for q in TYRE_FORCES])


# ------------------------------------------------------------------ what part of the time axis is worth its width
def uneven(trajectory: Trajectory, wave: float) -> Window:
    """Times [s] between which the road changes, a quarter added; of an endless road four waves of `wave` [s] each."""
    time = trajectory.time
    changes = np.diff(trajectory.columns([q.name for q in ROAD_HEIGHTS]), axis=0) != 0.0
    rows = np.flatnonzero(changes.any(axis=1))
    if not rows.size:
        return float(time[0]), float(time[-1])
    first, last = time[rows[0]], time[rows[-1] + 1]
    if last == time[-1]:
        met_last = max(time[np.argmax(wheel)] for wheel in changes.T if wheel.any())
        last = min(last, met_last + 4.0 * wave)
    margin = 0.25 * (last - first)
    return float(max(time[0], first - margin)), float(min(time[-1], last + margin))


def eventful(sources: Sequence[Trajectory], quantities: Sequence[Quantity]) -> Window:
    """Times [s] from the start until all is within 1 % of where it ends, a quarter added."""
    names = [q.name for q in quantities]
    return min(t.time[0] for t in sources), max(_settled(t.time, t.columns(names)) for t in sources)


def _settled(time: Array, values: Array) -> float:
    away = np.abs(values - values[-1])
    rows = np.flatnonzero((away > 0.01 * away.max(axis=0)).any(axis=1))
    end = time[0] + 1.25 * (time[rows[-1] + 1] - time[0]) if rows.size else time[-1]
    return float(min(end, time[-1]))


# ------------------------------------------------------------------ plotting functions
def words(q: Quantity) -> str:
    """Short words for a legend: the corner of a quantity that each corner has, else what it is without its sense."""
    what, _, last = q.text.rpartition(", ")
    return last if last in CORNER_WORDS else what


def axis_label(quantities: Sequence[Quantity], unit: str) -> str:
    return ", ".join(f"${q.symbol}$" for q in quantities) + f" [{unit}]"


def plot_quantities(trajectory: Trajectory, quantities: Sequence[Quantity], ax: Axes) -> Axes:
    """Quantities of one unit against time, with a legend above the panel."""
    unit, factor = READING[quantities[0].unit]
    for q in quantities:
        ax.plot(trajectory.time, factor * trajectory[q.name], label=f"${q.symbol}$ {words(q)}")
    ax.set_ylabel(axis_label(quantities, unit))
    return finish(ax)


def finish(ax: Axes) -> Axes:
    """Time axis, and the legend above the panel, where no data can be."""
    ax.set_xlabel("$t$ [s]")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.2)
    return ax


def plot_heaves(trajectory: Trajectory, ax: Axes) -> Axes:
    """Body and rear axle heave over the lightly drawn front wheels."""
    unit, factor = READING[Z.unit]
    for q, color, width in ((Z11, "#88bbdd", 0.8), (Z12, "#f7b98c", 0.8), (Z2, TEAL, 1.3), (Z, "#222222", 1.6)):
        label = f"${q.symbol}$ {words(q).removesuffix(' heave')}"
        ax.plot(trajectory.time, factor * trajectory[q.name], color=color, linestyle="-", linewidth=width, label=label)
    ax.set_ylabel(axis_label((Z, Z2, Z11, Z12), unit))
    return finish(ax)


def plot_comparison(controlled: Trajectory, uncontrolled: Trajectory, q: Quantity, ax: Axes) -> Axes:
    """One quantity with (red) and without (blue, dashed) control forces."""
    unit, factor = READING[q.unit]
    for trajectory, color, dashes, how in (
        (controlled, RED, "-", "optimal stabilization"),
        (uncontrolled, BLUE, DASHED, "without control forces"),
    ):
        values = factor * trajectory[q.name]
        ax.plot(trajectory.time, values, color=color, linestyle=dashes, label=f"{words(q)}, {how}")
    ax.set_ylabel(axis_label((q,), unit))
    return finish(ax)


def plot_tyre_loads(time: Array, loads: Array, quantities: Sequence[Quantity], ax: Axes) -> Axes:
    """Total loads (n, k) [N] of k tyres, and the line below which they would have left the ground."""
    for q, load in zip(quantities, loads.T, strict=True):
        ax.plot(time, 1e-3 * load, label=words(q))
    ax.axhline(0.0, color=RED, linestyle="-", linewidth=1.0, label="no load, contact is lost below")
    ax.set_ylabel("static + " + axis_label(quantities, "kN"))
    return finish(ax)


# ------------------------------------------------------------------ the figures of a run
def subjects(run: Run, counterpart: Run | None) -> list[Subject]:
    """All figures that this run can give; the controller's, if it or its counterpart has one at work."""
    pair = {is_controlled(each): each.trajectory for each in (run, counterpart) if each}
    made = _paper_figures(run)
    if len(pair) == 2:
        made.append(_comparison(pair[True], pair[False]))
    if True in pair and _acts(pair[True]):
        made.append(_strut_forces(pair[True], "" if is_controlled(run) else " They are those of the counterpart run."))
    return [*made, _tyre_loads(run)]


def _paper_figures(run: Run) -> list[Subject]:
    trajectory = run.trajectory

    def subject(number: int, name: str, title: str, text: str, needs: Sequence[Quantity]) -> Subject:
        return Subject(
            file=f"figure-{number:02d}-{name}.svg",
            title=title,
            caption=lambda: (
                f"As figure {number} of the paper. {text}" + (_shift(run, needs) if number in (3, 4) else "")
            ),
            panels=(partial(plot_quantities, trajectory, needs),),
            sources=(trajectory,),
            needs=needs,
        )

    def road_window() -> Window:
        Lambda, v0 = real_parameters(run, "Lambda", "v0")
        return uneven(trajectory, Lambda / v0)

    road = (
        "Height of the road under each wheel, where it is not flat (of an endless road the first waves). "
        "A wheel meets the profile after its own delay, if the profile lies in its track."
    )
    wheels = "Up, from static equilibrium."
    heaves = "Body and rear axle, up, from static equilibrium; the front wheels of figure 3 lightly."
    angles = "Roll ψ, positive where the left side goes up, and pitch φ, positive nose down."
    return [
        replace(subject(2, "excitations", "Excitations on all wheels", road, ROAD_HEIGHTS), window=road_window),
        subject(3, "front-wheels", "Vertical displacements of the front wheels", wheels, (Z11, Z12)),
        replace(
            subject(4, "heaves", "Vertical displacements", heaves, (Z, Z2, Z11, Z12)),
            panels=(partial(plot_heaves, trajectory),),
        ),
        subject(5, "car-rotation", "Car rotation angles", angles, (PSI, PHI)),
        subject(6, "axle-rotation", "Rotation angle of the rear axle", "Roll ψ₂, positive like ψ.", (PSI2,)),
    ]


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


def _comparison(controlled: Trajectory, uncontrolled: Trajectory) -> Subject:
    return Subject(
        file="figure-09-stabilization.svg",
        title="Controlled against uncontrolled car",
        caption=lambda: (
            "As figure 9 of the paper. Red: optimal stabilization; blue: without control forces. Heave z, up; pitch φ, "
            "positive nose down (the paper's section 4 has it front up); below them roll ψ, which the controller does "
            "not see. Here the car is the full one, with seven degrees of freedom; the paper's is the half car."
        ),
        panels=[partial(plot_comparison, controlled, uncontrolled, q) for q in (Z, PHI, PSI)],
        sources=(controlled, uncontrolled),
        needs=(Z, PHI, PSI),
    )


def _strut_forces(trajectory: Trajectory, whose: str) -> Subject:
    return Subject(
        file="figure-10-control-forces.svg",
        title="Control forces of the struts",
        caption=lambda: (
            "As figure 10 of the paper, by strut: positive pushes the body up and the wheel down. The paper's forces, "
            f"per axle and positive down on the body, are u₁ = −(u₁₁ + u₁₂) and u₂ = −(u₂₁ + u₂₂).{whose}"
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


# ------------------------------------------------------------------ to files
def draw_all(run: Run, counterpart: Run | None, folder: Path) -> list[FigureEntry]:
    """Write `figures/*.svg` into the run's folder: all figures whose columns were recorded."""
    target = folder / FOLDER
    target.mkdir(exist_ok=True)
    drawn = [subject for subject in subjects(run, counterpart) if not subject.missing]
    for subject in drawn:
        write_whole(target / subject.file, render(subject))
    return [FigureEntry(subject.file, subject.title, subject.caption()) for subject in drawn]


def left_out(run: Run, counterpart: Run | None) -> list[tuple[str, list[str]]]:
    """Titles of the figures that cannot be drawn, each with the columns that were not recorded."""
    return [(subject.title, subject.missing) for subject in subjects(run, counterpart) if subject.missing]


def render(subject: Subject) -> bytes:
    """The figure as SVG; the same data give the same bytes, whatever style the user has set."""
    with style.context(STYLE, after_reset=True):
        n = len(subject.panels)
        figure = Figure(figsize=(WIDTH, PANEL_HEIGHT * n + 0.4), layout="constrained")
        axes = figure.subplots(n, 1, sharex=True, squeeze=False).ravel()
        for panel, ax in zip(subject.panels, axes, strict=True):
            panel(ax).label_outer()
        start, end = subject.window() if subject.window else eventful(subject.sources, subject.needs)
        if start < end:
            axes[0].set_xlim(start, end)
        for line in (line for ax in axes for line in ax.get_lines()):
            thin(line, (start, end))
        image = io.BytesIO()
        figure.savefig(image, format="svg", metadata={"Title": subject.title, "Date": None, "Creator": None})
    return image.getvalue()


def thin(line: Any, window: Window) -> None:
    """Leave of a line that has far more samples than the page has columns the lowest and the highest in each column."""
    x, y = line.get_data()
    first, last = np.searchsorted(x, window)
    if last - first > 4 * COLUMNS:  # a long run would give hundreds of megabytes
        edges = np.linspace(first, last, COLUMNS, endpoint=False).astype(int)
        extremes = [extreme.reduceat(y[:last], edges) for extreme in (np.minimum, np.maximum)]
        line.set_data(np.repeat(x[edges], 2), np.column_stack(extremes).ravel())


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that is either complete or not there."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
