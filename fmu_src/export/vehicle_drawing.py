"""The car with seven degrees of freedom, seen from its right rear and from above: model.png of Vehicle7DOF."""

from __future__ import annotations

from .drawing import (
    BLUE,
    INK,
    LINE,
    ORANGE,
    PURPLE,
    RED,
    SOFT,
    TEAL,
    Axes,
    Point,
    area,
    arrow,
    dimension,
    disc,
    line,
    spring,
    strut,
    turn,
    words,
)

FRONT, REAR = 1.0, -1.5  # as far as the default car's axles, from its centre of gravity
TRACK, STRUTS, SIDE = 1.0, 0.6, 1.14  # half widths of wheels, rear struts and body; not to scale, so that nothing hides
WHEEL, HUB, BODY, ROOF = 50.0, 69.0, 176.0, 202.0  # heights in pixels over the road
PLATE, TOP = "#cfd8e0", "#dbeaf5"
PLACES = ((FRONT, 1.0, "1", "11"), (FRONT, -1.0, "1", "12"), (REAR, 1.0, "2", "21"), (REAR, -1.0, "2", "22"))


def at(x: float, y: float, z: float) -> Point:
    """Pixels of a point x forward, y left, z pixels over the road: depth goes to the upper right."""
    return 318.0 + 112.0 * x + 68.0 * y, 94.0 + z + 31.0 * y


def beside(x: float, y: float, z: float, right: float, up: float) -> Point:
    across, height = at(x, y, z)
    return across + right, height + up


def draw(ax: Axes) -> None:
    _axle(ax)
    _side(ax, 1.0)
    _body(ax)
    _side(ax, -1.0)
    _body_motions(ax)
    _wheel_motions(ax)
    _names(ax)
    _lengths(ax)


def _side(ax: Axes, y: float) -> None:
    for x, place in ((FRONT, TRACK), (REAR, STRUTS)):
        road = [at(x + dx, y + dy, 0.0) for dx, dy in ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2))]
        area(ax, road, "#e6e9eb", LINE, linewidth=0.8)
        spring(ax, at(x, y, 0.0), at(x, y, WHEEL), SOFT, half=6.0, coils=4)
        left, right = at(x - 0.17, y, WHEEL), at(x + 0.17, y, HUB)
        area(ax, [left, (right[0], left[1]), right, (left[0], right[1])], PLATE)
        strut(ax, at(x, y * place, HUB), at(x, y * place, BODY))


def _axle(ax: Axes) -> None:
    ends = [at(REAR, TRACK, WHEEL + 9), at(REAR, -TRACK, WHEEL + 9)]
    line(ax, ends, INK, 6.4, solid_capstyle="butt")
    line(ax, ends, PLATE, 4.4, solid_capstyle="butt")


def _body(ax: Axes) -> None:
    front, rear = FRONT + 0.34, REAR - 0.34
    side = [(rear, -SIDE), (front, -SIDE)]
    end = [(front, -SIDE), (front, SIDE)]
    for edge, fill in ((side, "#a9cbe6"), (end, "#8fb8d8")):
        area(ax, [at(*p, BODY) for p in edge] + [at(*p, ROOF) for p in reversed(edge)], fill, alpha=0.7)
    top = [(rear, -SIDE), (front, -SIDE), (front, SIDE), (rear, SIDE)]
    area(ax, [at(*p, ROOF) for p in top], TOP, alpha=0.8)


def _body_motions(ax: Axes) -> None:
    centre = at(0, 0, ROOF)
    for end, letter in ((at(0.8, 0, ROOF), "$x$"), (at(0, 1.0, ROOF), "$y$"), (at(0, 0, ROOF + 74), "$z$")):
        arrow(ax, centre, end, INK, 1.1, mutation_scale=8.0)
        color = RED if letter == "$z$" else SOFT
        words(
            ax, (end[0] + (9 if letter != "$z$" else -10), end[1] + (1 if letter != "$z$" else -4)), letter, color, 10
        )
    disc(ax, centre, 3.6, INK)
    turn(ax, at(0.5, 0, ROOF), (6.0, 14.0), (-150, 130), RED)
    words(ax, beside(0.5, 0, ROOF, 12, 16), r"$\psi$", RED, 11)
    turn(ax, at(0, 0.6, ROOF), (14.0, 6.0), (215, -65), RED, 25)
    words(ax, beside(0, 0.6, ROOF, -19, 6), r"$\varphi$", RED, 11)


def _wheel_motions(ax: Axes) -> None:
    for x, y, axle, wheel in PLACES:
        foot = beside(x, y, 0, 30, -5)
        arrow(ax, foot, (foot[0], foot[1] + 21), PURPLE, 1.2, mutation_scale=7.5)
        words(ax, (foot[0] + 14, foot[1] + 12), f"$h_{{{wheel}}}$", PURPLE)
        if axle == "1":
            foot = beside(x, y, WHEEL, 28, -3)
            arrow(ax, foot, (foot[0], foot[1] + 25), RED)
            words(ax, (foot[0] + 15, foot[1] + 13), f"$z_{{{wheel}}}$", RED, 10)
    foot = beside(REAR, 0.0, WHEEL + 9, 0, 0)
    arrow(ax, foot, (foot[0], foot[1] + 34), RED)
    words(ax, (foot[0] + 11, foot[1] + 21), "$z_2$", RED, 10)
    turn(ax, foot, (6.0, 14.0), (-150, 130), RED)
    words(ax, (foot[0] + 16, foot[1] - 9), r"$\psi_2$", RED, 10)


def _names(ax: Axes) -> None:
    words(ax, beside(0.1, -0.55, ROOF, 0, 0), "$m,\\; J_x,\\; J_y,\\; J_z$", INK, 10)
    words(ax, beside(REAR, 0.0, 0, 5, 10), r"$m_2,\, J_{z\psi_2}$", INK, 9.5)
    for x, y, axle, wheel in PLACES:
        words(ax, beside(x, y, 0.5 * (WHEEL + HUB), 0, 0), f"$m_{{{wheel}}}$", INK, 8.5)
        words(ax, beside(x, y, 0.5 * WHEEL, -17, 0), f"$c_{{p{axle}}}$", SOFT)
        middle = beside(x, y if axle == "1" else y * STRUTS, 0.5 * (HUB + BODY), 0, 0)
        words(ax, (middle[0] - 10, middle[1] - 17), f"$u_{{{wheel}}}$", ORANGE, 8.5)
        if wheel != "21":  # which stands behind glass
            words(ax, (middle[0] - 37, middle[1]), f"$c_{axle}$", BLUE)
            words(ax, (middle[0] + 36, middle[1]), f"$b_{axle}$", TEAL)


def _lengths(ax: Axes) -> None:
    rear, middle, front = (beside(x, -TRACK, 0, 0, -32) for x in (REAR, 0.0, FRONT))
    dimension(ax, rear, middle, "$b$")
    dimension(ax, middle, front, "$a$")
    dimension(ax, at(FRONT, -TRACK, ROOF), at(FRONT, 0, ROOF), "$s_1$", TOP)
    dimension(ax, at(REAR, -STRUTS, ROOF), at(REAR, 0, ROOF), "$s_0$", TOP)
    dimension(ax, beside(REAR, -TRACK, WHEEL - 8, 12, 0), beside(REAR, 0, WHEEL - 8, 0, 0), "$s_2$")
