"""The bump in both tracks and the wheels that meet it, on the road and against time: model.png of RoadExcitation."""

from __future__ import annotations

from math import pi, sin

from .drawing import (
    BLUE,
    INK,
    LINE,
    ORANGE,
    PURPLE,
    SOFT,
    TEAL,
    Axes,
    Point,
    area,
    arrow,
    dimension,
    disc,
    line,
    words,
)

FRONT, REAR, TRACK = 1.25, -1.25, 1.0  # where the wheels are; not to scale
LENGTH, HEIGHT = 1.15, 17.0  # of the bump, and in pixels
BEGINS = {TRACK: 0.72, -TRACK: 1.62}  # the bump in the left and in the right track: what lies between takes tau_0
BACK, AHEAD = -1.95, 2.9  # ends of the road
RADIUS = 17.0
COLORS = {"11": BLUE, "12": ORANGE, "21": TEAL, "22": PURPLE}
OUTLINE = (
    (-1.8, 24.0),
    (-1.85, 46.0),
    (-1.6, 58.0),
    (-1.1, 62.0),
    (-0.65, 86.0),
    (0.4, 86.0),
    (0.95, 62.0),
    (1.75, 52.0),
    (1.85, 24.0),
)
WINDOWS = (
    ((-0.98, 63.0), (-0.6, 82.0), (-0.15, 82.0), (-0.15, 63.0)),
    ((-0.08, 63.0), (-0.08, 82.0), (0.36, 82.0), (0.8, 63.0)),
)


def at(x: float, y: float, z: float = 0.0) -> Point:
    """Pixels of a point x forward, y left, z pixels over the road: depth goes to the upper right."""
    return 258.0 + 88.0 * x + 54.0 * y, 240.0 + z + 30.0 * y


def height(x: float, y: float) -> float:
    """Pixels of road under a wheel at x in the track y."""
    s = x - BEGINS[y]
    return HEIGHT * sin(pi * s / LENGTH) if 0.0 < s < LENGTH else 0.0


def draw(ax: Axes) -> None:
    area(ax, [at(BACK, -1.45), at(AHEAD, -1.45), at(AHEAD, 1.45), at(BACK, 1.45)], "#eceff1", LINE, linewidth=0.8)
    for y in (TRACK, -TRACK):
        _track(ax, y)
        for x in (REAR, FRONT):
            _wheel(ax, x, y)
        if y == TRACK:
            _car(ax)
    _names(ax)
    _signals(ax)


def _track(ax: Axes, y: float) -> None:
    xs = [BACK + (AHEAD - BACK) * i / 240 for i in range(241)]
    far = [at(x, y + 0.26, height(x, y)) for x in xs]
    near = [at(x, y - 0.26, height(x, y)) for x in xs]
    area(ax, far + near[::-1], "#cbd3d9", "none")
    begin = BEGINS[y]
    bump = [begin + LENGTH * i / 60 for i in range(61)]
    side = [at(x, y - 0.26, height(x, y)) for x in bump]
    area(ax, [at(x, y + 0.26, height(x, y)) for x in bump] + side[::-1], "#b3bfc8", "none")
    area(ax, side, "#93a3af", "none")
    line(ax, near, SOFT, 0.9)
    line(ax, far, SOFT, 0.6)


def _wheel(ax: Axes, x: float, y: float) -> None:
    centre = at(x, y, height(x, y) + RADIUS)
    disc(ax, centre, RADIUS, "#3c4650", INK)
    disc(ax, centre, 0.58 * RADIUS, "#d4dbe1", INK, linewidth=0.8)
    disc(ax, centre, 2.0, INK)


def _car(ax: Axes) -> None:
    """A pale car over the wheels: its outline, drawn through from the left to the right side."""
    left, right = [[at(x, y, z) for x, z in OUTLINE] for y in (0.8, -0.8)]
    n = len(OUTLINE)
    for i in (0, 8, 7, 6, 5, 4, 3, 2, 1):  # sides that the eye meets come last
        j = (i + 1) % n
        area(ax, [left[i], left[j], right[j], right[i]], "#c3daec", SOFT, alpha=0.3, linewidth=0.7)
    area(ax, right, "#c3daec", SOFT, alpha=0.45, linewidth=0.9)
    for pane in WINDOWS:
        area(ax, [at(x, -0.8, z) for x, z in pane], "#f4f9fd", SOFT, alpha=0.6, linewidth=0.6)


def _names(ax: Axes) -> None:
    arrow(ax, at(1.95, -0.6, 34), at(2.75, -0.6, 34), INK, 2.0, mutation_scale=13)
    words(ax, at(2.3, -0.6, 46), "$v_0$", INK, 11)
    for x, y, index in ((FRONT, TRACK, "11"), (FRONT, -TRACK, "12"), (REAR, TRACK, "21"), (REAR, -TRACK, "22")):
        foot = at(x, y, height(x, y))
        words(ax, (foot[0] - 27, foot[1] + 5), f"$h_{{{index}}}$", COLORS[index], 11)
    across, top = at(BEGINS[-TRACK] + 0.5 * LENGTH, -TRACK - 0.26)
    dimension(ax, (across, top), (across, top + HEIGHT), "")
    words(ax, (across + 9, top + 8), "$A$", INK)
    for begin, end, text in ((BEGINS[-TRACK], BEGINS[-TRACK] + LENGTH, r"$\Lambda/2$"), (REAR, FRONT, "$a+b$")):
        (x0, y0), (x1, _) = at(begin, -TRACK), at(end, -TRACK)
        x0, x1 = (x0 - 14, x1 - 14) if text != "$a+b$" else (x0, x1)  # along the bump's near edge
        dimension(ax, (x0, y0 - 24), (x1, y0 - 24), text)


def _signals(ax: Axes) -> None:
    """Heights against time, with the delays of the default car and speed."""
    left, base, scale, top = 60.0, 48.0, 1220.0, 46.0  # pixels; pixels a second
    arrow(ax, (left - 18, base), (545, base), INK, 1.0, mutation_scale=8)
    arrow(ax, (left, base - 8), (left, base + 78), INK, 1.0, mutation_scale=8)
    words(ax, (552, base - 1), "$t$", INK, 10)
    words(ax, (left - 12, base + 72), "$h$", INK, 10)
    starts = {"11": 0.02, "12": 0.04, "21": 0.27, "22": 0.29}
    for index, start in starts.items():
        wave = [(left + scale * (start + 0.05 * i / 40), base + top * sin(pi * i / 40)) for i in range(41)]
        line(ax, wave, COLORS[index], 1.7)
    for index, shift in (("11", -25), ("12", 25), ("21", -25), ("22", 25)):
        across = left + scale * (starts[index] + 0.025)
        words(ax, (across + shift, base + top - 4), f"$h_{{{index}}}$", COLORS[index], 11)
    for first, last, down, text in (
        ("11", "12", 11, r"$\tau_0$"),
        ("21", "22", 11, r"$\tau_0$"),
        ("11", "21", 28, "$(a+b)/v_0$"),
    ):
        start, end = left + scale * starts[first], left + scale * starts[last]
        for x in (start, end):
            line(ax, [(x, base - 2), (x, base - down - 3)], SOFT, 0.6)
        dimension(ax, (start, base - down), (end, base - down), text if down > 20 else "")
        if down < 20:
            words(ax, (end + 9, base - down), text, SOFT)
    across = left + scale * starts["11"]
    dimension(ax, (across, base + 60), (across + 0.05 * scale, base + 60), "")
    words(ax, (across + 0.025 * scale, base + 70), r"$\Lambda/(2v_0)$", SOFT)
