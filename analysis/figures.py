"""How figures are drawn: axes, labels, windows of time, and rendering to SVG. The only user of matplotlib.

A plotting function takes data and an `ax`, draws, and returns `ax`. Trajectories are in SI units; millimetres,
milliradians and kilonewtons are made here, for reading, and nowhere else.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from lxml import etree
from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.rcsetup import cycler

from fmu_src.quantities import CORNER_WORDS, ROAD_HEIGHTS, Quantity

from .errors import InputError
from .trajectory import Array, Trajectory

Axes = Any  # of matplotlib, whose types are not looked at here
Panel = Callable[[Axes], Axes]
Window = tuple[float, float]
READING = {
    "m": ("mm", 1e3),
    "rad": ("mrad", 1e3),
    "m/s": ("mm/s", 1e3),
    "rad/s": ("mrad/s", 1e3),
    "N": ("N", 1.0),
}
"""SI unit -> unit in which a value is read, and the factor to it."""

BLUE, ORANGE, TEAL, PURPLE, RED = "#0077bb", "#ee7733", "#009988", "#aa3377", "#cc3311"  # Paul Tol, colour-blind-safe
DASHED, DOTTED = (0, (5, 1.5)), (0, (1.5, 1.0))
STYLE = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same glyphs on every machine
    "font.size": 9.0,
    "mathtext.fontset": "dejavuserif",
    "axes.grid": True,
    "axes.edgecolor": "#666666",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.xmargin": 0.0,
    "axes.prop_cycle": cycler(color=[BLUE, ORANGE, TEAL, PURPLE], linestyle=["-", DASHED] * 2),  # right dashed
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "svg.fonttype": "path",
    "svg.hashsalt": "bertolino-baksa",  # else the ids in the file are new each time
}
WIDTH, PANEL_HEIGHT, PICTURE_HEIGHT = 7.2, 2.5, 2.0  # inches
DUBLIN_CORE = "http://purl.org/dc/elements/1.1/"  # namespace of an SVG's own title and description
COLUMNS = 2000  # of a panel, finer than the eye or a printer


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """What a figure is made of; it can be drawn if its trajectories hold the columns that it needs."""

    file: str
    title: str
    caption: Callable[[], str]
    panels: Sequence[Panel]
    sources: Sequence[Trajectory]
    needs: Sequence[Quantity]
    window: Callable[[], Window] | None = None  # of time [s]; by default the eventful one
    shared: bool = True  # one axis of time for all panels; else each panel has an axis of its own

    @property
    def missing(self) -> list[str]:
        """Names of the needed columns that were not recorded."""
        return [q.name for q in self.needs if any(q.name not in source.names for source in self.sources)]


def readable(value: float, digits: int = 4) -> str:
    """A measured value to so many digits, with a true minus sign."""
    return f"{value:.{digits}g}".replace("-", "−")


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


def plot_heaves(trajectory: Trajectory, quantities: Sequence[Quantity], ax: Axes) -> Axes:
    """Heaves of body and rear axle over the lightly drawn ones of the front wheels, left and right; in that order."""
    body, axle, left, right = quantities
    unit, factor = READING[body.unit]
    for q, color, width in ((left, "#88bbdd", 0.8), (right, "#f7b98c", 0.8), (axle, TEAL, 1.3), (body, "#222222", 1.6)):
        label = f"${q.symbol}$ {words(q).removesuffix(' heave')}"
        ax.plot(trajectory.time, factor * trajectory[q.name], color=color, linestyle="-", linewidth=width, label=label)
    ax.set_ylabel(axis_label(quantities, unit))
    return finish(ax)


def plot_comparison(curves: Sequence[tuple[Trajectory, str, Any, str]], q: Quantity, ax: Axes) -> Axes:
    """One quantity of several runs, each with its colour, its dashes and how it is controlled."""
    unit, factor = READING[q.unit]
    for trajectory, color, dashes, how in curves:
        values = factor * trajectory[q.name]
        ax.plot(trajectory.time, values, color=color, linestyle=dashes, label=how)
    ax.set_ylabel(f"{words(q)} {axis_label((q,), unit)}")
    return finish(ax)


def plot_discrepancy(time: Array, x: Array, x_lin: Array, q: Quantity, ax: Axes) -> Axes:
    """A quantity, its linear approximation, and what is between them, magnified by a power of ten to be seen."""
    unit, factor = READING[q.unit]
    away, largest = np.abs(x - x_lin).max(), np.abs(x).max()
    power = int(np.floor(np.log10(largest / away))) if 0.0 < away < largest else 0
    ax.plot(time, factor * x, label=f"${q.symbol}$ {words(q)}")
    ax.plot(time, factor * x_lin, label="linear approximation")
    ax.plot(time, factor * 10.0**power * (x - x_lin), color=RED, linestyle="-", label=f"difference × $10^{{{power}}}$")
    ax.set_ylabel(axis_label((q,), unit))
    return finish(ax)


def plot_tyre_loads(time: Array, loads: Array, quantities: Sequence[Quantity], ax: Axes) -> Axes:
    """Total loads (n, k) [N] of k tyres, and the line below which they would have left the ground."""
    for q, load in zip(quantities, loads.T, strict=True):
        ax.plot(time, 1e-3 * load, label=words(q))
    ax.axhline(0.0, color=RED, linestyle="-", linewidth=1.0, label="no load, contact is lost below")
    ax.set_ylabel("static + " + axis_label(quantities, "kN"))
    return finish(ax)


# ------------------------------------------------------------------ to SVG
def render(subject: Subject, caption: str | None = None) -> bytes:
    """The figure as SVG; the same data give the same bytes, whatever style the user has set.

    caption : is kept in the file as its description (Dublin Core), for `described`.
    """
    with style.context(STYLE, after_reset=True):
        n = len(subject.panels)
        figure = Figure(figsize=(WIDTH, PANEL_HEIGHT * n + 0.4), layout="constrained")
        axes = figure.subplots(n, 1, sharex=subject.shared, squeeze=False).ravel()
        for panel, ax in zip(subject.panels, axes, strict=True):
            panel(ax)
        if subject.shared:
            _share_time(subject, list(axes))
        return _svg(figure, subject.title, caption)


def _share_time(subject: Subject, axes: Sequence[Axes]) -> None:
    """The subject's window of time, labelled below the last panel only."""
    start, end = subject.window() if subject.window else eventful(subject.sources, subject.needs)
    if start < end:
        axes[0].set_xlim(start, end)
    for ax in axes:
        ax.label_outer()
        for line in ax.get_lines():
            thin(line, (start, end))


def described(image: bytes, where: str) -> tuple[str, str]:
    """Title and caption that `render` kept in an SVG. Raises InputError if there are none."""
    try:
        root = etree.fromstring(image, etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError as error:
        raise InputError(f"{where}: cannot be read as SVG: {error}") from error
    title, caption = (root.findtext(f".//{{{DUBLIN_CORE}}}{name}") for name in ("title", "description"))
    if not (title and caption):
        raise InputError(f"{where}: wanted a figure with title and description, as `certify RUN` draws it")
    return title, caption


def render_pictures(pictures: Sequence[Panel], columns: int, title: str) -> bytes:
    """Pictures to one scale, without axes, in rows of so many, as SVG."""
    rows = -(-len(pictures) // columns)
    with style.context(STYLE, after_reset=True):
        figure = Figure(figsize=(WIDTH, PICTURE_HEIGHT * rows), layout="constrained")
        axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
        for ax in axes:
            ax.set_axis_off()
            ax.set_aspect("equal")
            ax.margins(0.02)
        for picture, ax in zip(pictures, axes, strict=False):
            picture(ax)
        return _svg(figure, title)


def _svg(figure: Figure, title: str, caption: str | None = None) -> bytes:
    image = io.BytesIO()
    about = {"Title": title, "Description": caption, "Date": None, "Creator": None}
    figure.savefig(image, format="svg", metadata=about)
    return image.getvalue()


def thin(line: Any, window: Window) -> None:
    """Leave of a line that has far more samples than the page has columns the lowest and the highest in each column."""
    x, y = line.get_data()
    first, last = np.searchsorted(x, window)
    if last - first > 4 * COLUMNS:  # a long run would give hundreds of megabytes
        edges = np.linspace(first, last, COLUMNS, endpoint=False).astype(int)
        extremes = [extreme.reduceat(y[:last], edges) for extreme in (np.minimum, np.maximum)]
        line.set_data(np.repeat(x[edges], 2), np.column_stack(extremes).ravel())
