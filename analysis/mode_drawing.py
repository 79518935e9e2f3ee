"""The car as a frame of lines in each of its modes, seen from its right: at rest, and at both ends of the swing."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from fmu_src.vehicle.parameters import Car

from .car_modes import CarModes
from .figures import BLUE, ORANGE, Axes, render_pictures
from .methods.polynomials import Array

HUB, PLATE, RADIUS = 0.30, 0.80, 0.27  # heights over the road at rest, and radius of the wheels [m]; for the eye only
SWING = 0.22  # largest displacement drawn [m]
REST = "#b8c0c8"
Lines = list[Array]  # each (points, 3): x forward, y left, z up [m]


def draw_modes(car: Car, found: CarModes) -> bytes:
    """SVG of the seven modes. Of a decaying motion the shape is drawn, not the decay."""
    pictures = [partial(_picture, car, found, k) for k in range(7)]
    return render_pictures([*pictures, _legend], 2, "Modes of the car")


def _legend(ax: Axes) -> Axes:
    for height, color, text in ((0.65, BLUE, "one end of the swing"), (0.5, ORANGE, "the other"), (0.35, REST, "rest")):
        ax.text(0.3, height, text, color=color, transform=ax.transAxes)
    return ax


def _picture(car: Car, found: CarModes, k: int, ax: Axes) -> Axes:
    shape = found.modes.K[:7, k].real  # the largest coordinate is at its end: its entry in K is 1
    rest = frame(car, np.zeros(7))
    moved = max(float(np.abs(a - b).max()) for a, b in zip(frame(car, shape), rest, strict=True))
    _draw(ax, rest, REST, 0.8)
    _draw(ax, frame(car, -SWING / moved * shape), ORANGE, 0.9)
    _draw(ax, frame(car, SWING / moved * shape), BLUE, 1.5)
    ax.set_title(f"{k + 1}. {found.names[k]}\n{found.words(k)}", fontsize=9)
    return ax


def frame(car: Car, q: Array) -> Lines:
    """Body, struts, rear axle, wheels and tyres as lines at small q = (z, ψ, φ, z11, z12, z2, ψ2) [m, rad]."""
    z, psi, phi, z11, z12, z2, psi2 = q

    def body(x: float, y: float) -> tuple[float, float, float]:
        return x, y, PLATE + z + psi * y - phi * x

    def axle(y: float) -> tuple[float, float, float]:
        return -car.b, y, HUB + z2 + psi2 * y

    wheels = [(car.a, car.s1, HUB + z11), (car.a, -car.s1, HUB + z12), axle(car.s2), axle(-car.s2)]
    feet = [*wheels[:2], axle(car.s0), axle(-car.s0)]
    tops = [body(car.a, car.s1), body(car.a, -car.s1), body(-car.b, car.s0), body(-car.b, -car.s0)]
    plate = [body(x, y) for x, y in ((car.a, car.s1), (car.a, -car.s1), (-car.b, -car.s2), (-car.b, car.s2))]
    struts = [[foot, top] for foot, top in zip(feet, tops, strict=True)]
    tyres = [[(x, y, 0.0), (x, y, height)] for x, y, height in wheels]
    lines: list[Sequence[tuple[float, float, float]]] = [[*plate, plate[0]], wheels[2:], *struts, *tyres]
    turn = np.linspace(0.0, 2.0 * np.pi, 41)
    rim = RADIUS * np.stack([np.cos(turn), 0.0 * turn, np.sin(turn)], axis=1)
    return [*map(np.array, lines), *(np.array(wheel) + rim for wheel in wheels)]


def _draw(ax: Axes, lines: Lines, color: str, width: float) -> None:
    """Oblique projection: what lies on the left is drawn further up and to the right."""
    for x, y, z in (line.T for line in lines):
        ax.plot(x + 0.6 * y, z + 0.35 * y, color=color, linestyle="-", linewidth=width)
