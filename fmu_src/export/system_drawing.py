"""The closed loop, what is in it and what goes from one to the other: model.png of the container."""

from __future__ import annotations

from .drawing import BLUE, INK, ORANGE, SOFT, TEAL, Axes, Point, arrow, box, line, words

SIZE = (150.0, 76.0)
ROAD, VEHICLE, CONTROLLER = (30.0, 232.0), (330.0, 232.0), (330.0, 64.0)  # lower left corners
BOXES = (
    (ROAD, "RoadExcitation", "road under four wheels", "#e3f0f9", BLUE),
    (VEHICLE, "Vehicle7DOF", "Eqs. (3.1)–(3.7)", "#e2f2f0", TEAL),
    (CONTROLLER, "LqrController", "§4: u = K x", "#fdebdc", ORANGE),
)


def draw(ax: Axes) -> None:
    for corner, name, what, fill, edge in BOXES:
        box(ax, corner, SIZE, fill, edge)
        words(ax, _middle(corner, 9.0), name, size=11.0, weight="bold")
        words(ax, _middle(corner, -12.0), what, SOFT, 8.0)
    arrow(ax, (ROAD[0] + SIZE[0], 270.0), (VEHICLE[0], 270.0), BLUE, 1.6)
    words(ax, (255.0, 283.0), "heights, rates, bows", BLUE, 8.5)
    down, up = VEHICLE[0] + SIZE[0] + 40.0, VEHICLE[0] - 40.0
    low, high = CONTROLLER[1] + 38.0, VEHICLE[1] + 22.0
    line(ax, [(VEHICLE[0] + SIZE[0], 270.0), (down, 270.0), (down, low)], TEAL, 1.6)
    arrow(ax, (down, low), (CONTROLLER[0] + SIZE[0], low), TEAL, 1.6)
    words(ax, (down + 32.0, 186.0), "14 states", TEAL)
    line(ax, [(CONTROLLER[0], low), (up, low), (up, high)], ORANGE, 1.6)
    arrow(ax, (up, high), (VEHICLE[0], high), ORANGE, 1.6)
    words(ax, (up - 34.0, 186.0), "4 forces", ORANGE)
    words(ax, (300.0, 360.0), "VehicleOnRoad: the closed loop as one FMU", INK, 12.0, weight="bold")


def _middle(corner: Point, up: float) -> Point:
    return corner[0] + 0.5 * SIZE[0], corner[1] + 0.5 * SIZE[1] + up
