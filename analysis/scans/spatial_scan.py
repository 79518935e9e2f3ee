"""`python -m analysis spatial`: energy that the car's nonlinear terms move between its modes, and where most.

Road and car are the scenario's; speed and one of c2/c1, Jy, b/a are varied from half to twice their value.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fmu_src.quantities import STATES
from fmu_src.vehicle.parameters import Car

from ..car import car_form
from ..energy import kinetic_energy
from ..errors import InputError
from ..files import write_whole
from ..methods.linear_response import linear_response
from ..methods.nonlinear_response import nonlinear_response
from ..methods.polynomials import Array
from ..methods.spatial import Transfer, UndampedModes, transfer, undamped_modes
from ..parallel import mapped
from ..reference import Parameters, car_of
from ..scenario import read_scenario
from .car_scans import VARIATIONS, higher_road, system_of, variation
from .tables import as_csv, output_folder

SPAN, SAMPLES = 5.0, 501  # s from rest, and times in it
RTOL = 1e-9  # of the full equations; Φ's share is seen down to about this
STEPS = (9, 3)  # speeds, and values of the other parameter
HEIGHTS = (4.0, 16.0)  # times the road's own, at the worst point


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One car on one road: the varied parameters by name, and what Φ moves."""

    values: dict[str, float]
    transfer: Transfer


def car_modes(car: Car) -> UndampedModes:
    """Modes of the car at rest without damping; the tyres' springs stand on level ground."""
    masses = 2.0 * kinetic_energy(car, np.hstack([np.zeros((7, 7)), np.eye(7)]))
    return undamped_modes(np.diag(masses), -np.diag(masses) @ car_form(car, order=1).A[7:, :7])


def motions(parameters: Parameters, *, rtol: float = RTOL) -> tuple[Array, Array, Array]:
    """Times (T,), and the passive car's linear and full motion (14, T) from rest on the road.

    Raises InputError if the road does not move the car within SPAN.
    """
    form, signal = system_of(parameters, order=1)
    t = signal.begin + np.linspace(0.0, SPAN, SAMPLES)
    start = np.zeros(len(form.A))
    linear = linear_response(form.A, form.B, start, signal, t)
    if not linear.any():
        raise InputError(f"spatial: wanted a road that moves the car within {SPAN:g} s, got one that leaves it at rest")
    return t, linear, nonlinear_response(form, start, signal, t, rtol=rtol)


def transfer_of(parameters: Parameters) -> Transfer:
    """What Φ moves between the modes on this road."""
    return transfer(car_modes(car_of(parameters)), *motions(parameters))


def grid(parameters: Parameters, steps: tuple[int, int]) -> list[Point]:
    """Speeds times values of each other parameter; the scenario's own among them."""
    speed = variation("speed")
    cases, names = [], []
    for name in (name for name in VARIATIONS if name != "speed"):
        varied = variation(name)
        for v in speed.value(parameters) * _factors(steps[0]):
            for value in varied.value(parameters) * _factors(steps[1]):
                cases.append(speed.changed(varied.changed(parameters, float(value)), float(v)))
                names.append({"speed": float(v), name: float(value)})
    found = mapped(transfer_of, cases, "energy between modes")
    return [Point(values=values, transfer=moved) for values, moved in zip(names, found, strict=True)]


def _factors(count: int) -> Array:
    """From a half to twice, in even ratios; 1 is among them for odd counts, and alone for one."""
    return np.geomspace(0.5, 2.0, count) if count > 1 else np.ones(1)


def changed(parameters: Parameters, values: dict[str, float]) -> Parameters:
    """The parameters with those values of VARIATIONS."""
    for name, value in values.items():
        parameters = variation(name).changed(parameters, value)
    return parameters


def worst_of(points: list[Point]) -> Point:
    """Where Φ adds most to one mode."""
    return max(points, key=lambda point: point.transfer.largest_gain)


def edges(worst: Point, points: list[Point]) -> list[str]:
    """Parameters of the worst point that have the smallest or the largest value of the grid."""
    found = []
    for name, value in worst.values.items():
        others = [point.values[name] for point in points if name in point.values]
        if value in (min(others), max(others)) and min(others) < max(others):
            found.append(name)
    return found


# ------------------------------------------------------------------ on the terminal
def command(scenario: str, out: Path | None) -> int:
    """The verb `spatial` on a scenario; returns the exit status."""
    parameters = read_scenario(scenario).parameters
    print("\n".join(lines(parameters, f"{scenario}, passive")))
    points = grid(parameters, STEPS)
    worst = worst_of(points)
    there = changed(parameters, worst.values)
    edge = edges(worst, points)
    where = f"; on the edge of the grid in {' and '.join(edge)}: it may be worse beyond" if edge else ""
    print("\n".join(lines(there, f"worst of {len(points)}, by the largest gain of one mode: {in_words(worst)}{where}")))
    print("\n".join(most_lines(points)))
    print("\n".join(heights(there)))
    if out:
        output_folder(out)
        write_whole(out / "spatial.csv", as_csv(_rows(points)))
        print(f"{out / 'spatial.csv'}: written")
    return 0


def most_lines(points: list[Point]) -> list[str]:
    """Where the other two measures are largest."""
    text = []
    for quality, words in (("moved", "moves most between modes"), ("undriven_gain", "adds most to an undriven mode")):
        most = max(points, key=lambda point: getattr(point.transfer, quality))
        value = getattr(most.transfer, quality)
        where = f"{in_words(most)}: {value:.3g}" if value > 0.0 else "nowhere on the grid"
        text.append(f"where Φ {words}: {where}")
    return text


def in_words(point: Point) -> str:
    return ", ".join(f"{name} = {value:.4g}" for name, value in point.values.items())


def heights(parameters: Parameters) -> list[str]:
    """What Φ does there on higher roads."""
    return [
        f"there, on the road {factor:g} times as high: {said(transfer_of(higher_road(parameters, factor)))}"
        for factor in HEIGHTS
    ]


def said(found: Transfer) -> str:
    """The three measures of a transfer."""
    return (
        f"largest gain of one mode {found.largest_gain:.3g} of the linear energy, moved between modes "
        f"{found.moved:.3g}, largest gain of an undriven mode {found.undriven_gain:.3g}"
    )


def lines(parameters: Parameters, what: str) -> list[str]:
    """Energies of modes and coordinates in the linear motion, and what Φ changes."""
    modes, (t, linear, full) = car_modes(car_of(parameters)), motions(parameters)
    found = transfer(modes, t, linear, full)
    kinetic = np.asarray(np.trapezoid(modes.kinetic_energies(np.stack([linear, full], axis=2)), t, axis=1)) / SPAN
    largest: Array = np.abs(linear[:7]).max(axis=1)
    deviation: Array = np.abs(full - linear)[:7].max(axis=1)
    text = [
        f"{what}: mean energy {found.linear.sum():.4g} J over {SPAN:g} s; by Φ: {said(found)}",
        f"{'mode':>6}{'ω [rad/s]':>12}{'linear share':>14}{'change by Φ':>14}"
        f"   {'coordinate':<17}{'linear share':>12}{'change by Φ':>14}{'|x − x_lin| / |x_lin|':>24}",
    ]
    shares, change = kinetic[:, 0] / kinetic[:, 0].sum(), (kinetic[:, 1] - kinetic[:, 0]) / kinetic[:, 0].sum()
    for k in range(7):
        text.append(
            f"{k + 1:>6}{modes.frequencies[k]:>12.3f}{found.linear[k] / found.linear.sum():>14.4f}"
            f"{found.change[k]:>14.2e}   {STATES[k].name:<17}{shares[k]:>12.4f}{change[k]:>14.2e}"
            f"{deviation[k] / largest[k] if largest[k] else np.nan:>24.2e}"
        )
    return text


def _rows(points: list[Point]) -> list[list[object]]:
    heads = [
        *VARIATIONS,
        "largest gain of one mode [1]",
        "moved between modes [1]",
        "largest gain of an undriven mode [1]",
        *(f"linear share {k}" for k in range(1, 8)),
        *(f"change {k}" for k in range(1, 8)),
    ]
    rows: list[list[object]] = [list(heads)]
    for p in points:
        shares = p.transfer.linear / p.transfer.linear.sum()
        rows.append(
            [
                *(p.values.get(name, "") for name in VARIATIONS),
                p.transfer.largest_gain,
                p.transfer.moved,
                p.transfer.undriven_gain,
                *shares.tolist(),
                *p.transfer.change.tolist(),
            ]
        )
    return rows
