"""The control loop round the half car: model.png of LqrController."""

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
    box,
    dimension,
    disc,
    line,
    strut,
    turn,
    words,
)

LEFT, RIGHT, LOOP, MIDDLE = 60.0, 540.0, 78.0, 292.0  # the loop's verticals, its lower line, where it meets the car
FRONT, REAR, CENTRE = 412.0, 192.0, 324.0
GROUND, BEAM = 234.0, 312.0
BACK = "#f6f8fa"


def draw(ax: Axes) -> None:
    _half_car(ax)
    _loop(ax)
    _blocks(ax)


def _half_car(ax: Axes) -> None:
    box(ax, (118, 202), (366, 184), BACK, LINE)
    line(ax, [(140, GROUND), (462, GROUND)], SOFT, 1.2)
    for i in range(33):
        line(ax, [(142 + 10 * i, GROUND), (136 + 10 * i, GROUND - 7)], LINE, 0.7)
    for across, index in ((FRONT, "1"), (REAR, "2")):
        strut(ax, (across, GROUND), (across, BEAM), gap=20.0, pulling=True)
        words(ax, (across - 33, 273), f"$c_{index}$", BLUE)
        words(ax, (across + 33, 273), f"$b_{index}$", TEAL)
        words(ax, (across - 9, 254), f"$u_{index}$", ORANGE)
    area(ax, [(158, BEAM), (446, BEAM), (446, BEAM + 16), (158, BEAM + 16)], "#c3daec")
    _motions(ax, (CENTRE, BEAM + 8))
    words(ax, (238, BEAM + 8), "$m,\\; J_y$", INK, 10)
    dimension(ax, (CENTRE, 217), (FRONT, 217), "$a$", BACK)
    dimension(ax, (CENTRE, 217), (REAR, 217), "$b$", BACK)
    line(ax, [(CENTRE, GROUND - 10), (CENTRE, BEAM)], SOFT, 0.6, linestyle=(0, (6, 2, 1, 2)))


def _motions(ax: Axes, centre: Point) -> None:
    arrow(ax, centre, (centre[0], centre[1] + 54), RED)
    words(ax, (centre[0] - 9, centre[1] + 48), "$z$", RED, 11)
    disc(ax, centre, 3.6, INK)
    turn(ax, centre, (34.0, 34.0), (-2, 52), RED)
    words(ax, (centre[0] + 42, centre[1] + 24), r"$\varphi$", RED, 11)


def _loop(ax: Axes) -> None:
    line(ax, [(484, MIDDLE), (RIGHT, MIDDLE)], INK, 1.4)
    arrow(ax, (RIGHT, MIDDLE), (RIGHT, 194), INK, 1.4)
    line(ax, [(RIGHT, 150), (RIGHT, LOOP)], INK, 1.4)
    arrow(ax, (RIGHT, LOOP), (484, LOOP), INK, 1.4)
    arrow(ax, (230, LOOP), (186, LOOP), INK, 1.4)
    line(ax, [(112, LOOP), (LEFT, LOOP)], INK, 1.4)
    arrow(ax, (LEFT, LOOP), (LEFT, 150), INK, 1.4)
    line(ax, [(LEFT, 194), (LEFT, MIDDLE)], INK, 1.4)
    arrow(ax, (LEFT, MIDDLE), (118, MIDDLE), INK, 1.4)
    words(ax, (540, MIDDLE + 32), "body.heave\nbody.pitch\nand their rates", SOFT, 7.5)
    words(ax, (60, MIDDLE + 24), "force_fl, _fr,\n_rl, _rr", SOFT, 7.5)
    words(ax, (512, LOOP + 11), "$x$", INK, 11)
    words(ax, (208, LOOP + 11), "$u$", INK, 11)


def _blocks(ax: Axes) -> None:
    box(ax, (486, 150), (108, 44), "#fdf1ee", RED)
    words(ax, (540, 179), r"$x=(z,\varphi,\dot z,\dot\varphi)$", INK, 10)
    words(ax, (540, 161), "pitch turned front up", SOFT, 7.5)
    box(ax, (230, 30), (254, 96), "#eef5fb", BLUE)
    words(ax, (357, 107), r"$u=K(t)\,x,\quad K=-R^{-1}B^{\mathsf{T}}L$", INK, 11)
    words(ax, (357, 78), r"$-\dot L=LA+A^{\mathsf{T}}L-LBR^{-1}B^{\mathsf{T}}L+Q$", INK, 9.5)
    words(ax, (357, 49), r"$L(T)=0$   or   $\dot L=0,\; T=\infty$", INK, 9.5)
    box(ax, (112, 48), (74, 60), "#f6eef4", PURPLE)
    line(ax, [(186, LOOP), (167, LOOP)], INK, 1.4)
    line(ax, [(167, LOOP), (136, LOOP + 15)], INK, 1.6)
    line(ax, [(131, LOOP), (112, LOOP)], INK, 1.4)
    for x in (167, 131):
        disc(ax, (x, LOOP), 2.6, "white")
    words(ax, (149, 58), r"$t_{on}\leq t<T$", INK, 8.5)
    box(ax, (4, 150), (112, 44), "#fef4ec", ORANGE)
    words(ax, (60, 181), r"$u_{11}=u_{12}=-u_1/2$", INK, 9)
    words(ax, (60, 163), r"$u_{21}=u_{22}=-u_2/2$", INK, 9)
