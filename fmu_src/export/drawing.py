"""Sheets to draw on, in pixels, and the parts that mechanical drawings are made of; a sheet becomes a PNG.

The same drawing gives the same bytes whatever style the user has set: fonts come with matplotlib, nothing is dated.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from math import cos, hypot, radians, sin
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Polygon

Axes = Any  # of matplotlib, whose types are not looked at here
Point = tuple[float, float]

WIDTH, HEIGHT, DPI = 600, 400, 100
INK, SOFT, LINE = "#1d2329", "#5a6570", "#aab4bd"
BLUE, ORANGE, TEAL, PURPLE, RED = "#0077bb", "#d9640f", "#008272", "#aa3377", "#c0300f"  # Paul Tol's, darker on white
STYLE = {
    "font.family": "DejaVu Sans",  # comes with matplotlib: the same glyphs on every machine
    "font.size": 8.5,
    "mathtext.fontset": "dejavuserif",
    "lines.solid_capstyle": "round",
    "lines.solid_joinstyle": "round",
    "patch.linewidth": 1.1,
}


def png(draw: Callable[[Axes], None]) -> bytes:
    """What `draw` puts on a sheet of WIDTH × HEIGHT pixels (origin bottom left) as a PNG."""
    with style.context(STYLE, after_reset=True):
        figure = Figure(figsize=(WIDTH / DPI, HEIGHT / DPI), dpi=DPI)
        ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        ax.set_axis_off()
        ax.set(xlim=(0, WIDTH), ylim=(0, HEIGHT), aspect="equal")
        draw(ax)
        image = io.BytesIO()
        figure.savefig(image, format="png", metadata={"Software": None})
    return image.getvalue()


# ------------------------------------------------------------------ lines, areas, words
def _over(ax: Axes) -> int:
    """The next level: what is drawn later lies over what was drawn before."""
    return len(ax.get_children())


def line(ax: Axes, points: Sequence[Point], color: str = INK, width: float = 1.2, **options: Any) -> None:
    xs, ys = [x for x, _ in points], [y for _, y in points]
    ax.plot(xs, ys, color=color, linewidth=width, zorder=_over(ax), **options)


def area(ax: Axes, points: Sequence[Point], fill: str, edge: str = INK, **options: Any) -> None:
    ax.add_patch(Polygon(points, closed=True, facecolor=fill, edgecolor=edge, zorder=_over(ax), **options))


def disc(ax: Axes, centre: Point, radius: float, fill: str, edge: str = INK, **options: Any) -> None:
    ax.add_patch(Circle(centre, radius, facecolor=fill, edgecolor=edge, zorder=_over(ax), **options))


def box(ax: Axes, corner: Point, size: Point, fill: str, edge: str = INK) -> None:
    """A box with round corners, from its lower left corner."""
    shape: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=5", "facecolor": fill, "edgecolor": edge}
    ax.add_patch(FancyBboxPatch(corner, size[0], size[1], zorder=_over(ax), **shape))


def words(ax: Axes, at: Point, text: str, color: str = INK, size: float = 9.0, **options: Any) -> None:
    settings = {"color": color, "fontsize": size, "ha": "center", "va": "center", "zorder": _over(ax), **options}
    ax.text(*at, text, **settings)


def arrow(ax: Axes, start: Point, end: Point, color: str = INK, width: float = 1.3, **options: Any) -> None:
    settings = {"arrowstyle": "-|>", "mutation_scale": 9.0, "shrinkA": 0.0, "shrinkB": 0.0, **options}
    ax.add_patch(FancyArrowPatch(start, end, color=color, linewidth=width, zorder=_over(ax), **settings))


def dimension(ax: Axes, start: Point, end: Point, text: str, back: str = "white") -> None:
    """A line with an arrow at each end and its length's name in its middle, on the colour of what is behind it."""
    arrow(ax, start, end, SOFT, 0.8, arrowstyle="<|-|>", mutation_scale=6.0)
    middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    words(ax, middle, text, SOFT, bbox={"facecolor": back, "edgecolor": "none", "pad": 0.8})


def turn(ax: Axes, centre: Point, radii: Point, angles: Point, color: str, tilt: float = 0.0) -> None:
    """An arrow along an ellipse from one angle to the other [degrees], for a rotation; `tilt` turns the ellipse."""
    start, end = angles
    c, s = cos(radians(tilt)), sin(radians(tilt))
    points = []
    for i in range(41):
        angle = radians(start + (end - start) * i / 40)
        x, y = radii[0] * cos(angle), radii[1] * sin(angle)
        points.append((centre[0] + c * x - s * y, centre[1] + s * x + c * y))
    line(ax, points[:-2], color, 1.3)
    arrow(ax, points[-4], points[-1], color)


# ------------------------------------------------------------------ springs, dampers, actuators
def _along(start: Point, end: Point) -> tuple[Callable[[float, float], Point], float]:
    """Point at (distance along, distance to the left) of the line from start to end, and the line's length."""
    length = hypot(end[0] - start[0], end[1] - start[1])
    ux, uy = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    return lambda t, n: (start[0] + t * ux - n * uy, start[1] + t * uy + n * ux), length


def spring(ax: Axes, start: Point, end: Point, color: str = BLUE, half: float = 5.0, coils: int = 5) -> None:
    at, length = _along(start, end)
    lead = 0.16 * length
    pitch = (length - 2 * lead) / coils
    zigzag = [at(lead + (i + 0.25 + 0.5 * k) * pitch, half * (1 - 2 * k)) for i in range(coils) for k in (0, 1)]
    line(ax, [start, at(lead, 0), *zigzag, at(length - lead, 0), end], color, 1.3)


def damper(ax: Axes, start: Point, end: Point, color: str = TEAL, half: float = 4.0) -> None:
    at, length = _along(start, end)
    low, high, piston = 0.3 * length, 0.68 * length, 0.52 * length
    line(ax, [start, at(low, 0)], color, 1.3)
    line(ax, [at(high, half), at(low, half), at(low, -half), at(high, -half)], color, 1.3)
    line(ax, [at(piston, half - 1), at(piston, 1 - half)], color, 2.0)
    line(ax, [at(piston, 0), end], color, 1.3)


def actuator(ax: Axes, start: Point, end: Point, color: str = ORANGE, radius: float = 6.5) -> None:
    at, length = _along(start, end)
    line(ax, [start, end], color, 1.3)
    disc(ax, at(0.5 * length, 0), radius, "#fdebdc", color)
    arrow(ax, at(0.5 * length - radius + 1, 0), at(0.5 * length + radius, 0), color, 1.2, mutation_scale=6.5)


def strut(ax: Axes, bottom: Point, top: Point, gap: float = 23.0, *, pulling: bool = False) -> None:
    """Spring, actuator and damper side by side between two plates; the actuator's arrow up, or down if `pulling`."""
    for (x, y), inner in ((bottom, 6.0), (top, -6.0)):
        line(ax, [(x, y), (x, y + inner)], INK, 1.3)
        line(ax, [(x - gap - 4, y + inner), (x + gap + 4, y + inner)], INK, 1.5)
    low, high = bottom[1] + 6.0, top[1] - 6.0
    spring(ax, (bottom[0] - gap, low), (top[0] - gap, high))
    damper(ax, (bottom[0] + gap, low), (top[0] + gap, high))
    ends = (bottom[0], low), (top[0], high)
    actuator(ax, *(reversed(ends) if pulling else ends))
