"""Between the rows of an export: what holds on every road of a class, against adversaries; the equations' defect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from exported_runs import NAMES, halved, run_of, shifted, tampered
from flint import arb
from numpy.typing import NDArray
from orders import observed_order

from analysis.bertolino_baksa.balls import jacobian, precision
from analysis.bertolino_baksa.hermite import quintics
from analysis.bertolino_baksa.input_rows import RowClass
from analysis.bertolino_baksa.sampled import Samples
from analysis.bertolino_baksa.tube import input_matrix
from analysis.car import car_form, road_signal
from analysis.certificates.exact_car import energy_norm, exact_system
from analysis.certificates.run_certificates import _everywhere, _motions, certified_findings
from analysis.certificates.unknown_roads import TILTED, AllRoads, road_class, samples
from analysis.errors import InputError
from analysis.reference import road_parameters
from analysis.scenario import read_scenario
from analysis.trajectory import Run
from fmu_src.quantities import ROAD_HEIGHTS
from fmu_src.vehicle.parameters import Car

Array = NDArray[np.float64]
HEIGHTS = [q.name for q in ROAD_HEIGHTS]
PARTS = 8  # of a cell, of the fine grid
DAMPED = {"bp1": 200.0, "bp2": 150.0}


@pytest.fixture(scope="module")
def bump() -> Run:
    return run_of("bump")


def everywhere(run: Run, x: Array, t: Array, heights: Array, form: str, own: float) -> tuple[AllRoads, Samples]:
    allowed = own * np.abs(x).max(axis=0) + np.spacing(np.abs(x))
    rows = samples(t, x, allowed, heights, np.spacing(np.abs(heights)), road_class(form))
    return _everywhere(run, rows), rows


# ---------------------------------------------------------------------------------------------- every road of a class
def bow(roads: RowClass, step: float, s: Array, slope: Array) -> tuple[Array, Array]:
    """Largest height that the class leaves beside the chord for all s in a cell, nearly, and its rate."""
    if roads.kind == "curv":
        return roads.bound * s * (step - s) / 2.0 + 0.0 * slope, roads.bound * (step / 2.0 - s) + 0.0 * slope
    rate = roads.bound - np.abs(slope)
    return rate * np.minimum(s, step - s), rate * np.where(s < step / 2.0, 1.0, -1.0)


def adversaries(cells: int, step: float) -> Array:
    """Signs (wheels, cells, 3) of the bows: by chance; near the axle's own roll; near the wheels' own heave."""
    t = step * np.arange(cells)
    roll, heave = (np.sign(np.sin(w * t)) for w in (80.0, 70.0))
    chance = np.random.default_rng(4).choice([-1.0, 1.0], (4, cells))
    return np.stack([chance, np.outer([1, -1, 1, -1], roll), np.tile(heave, (4, 1))], axis=2)


def motions_on(car: Car, roads: RowClass, heights: Array, step: float) -> tuple[Array, Array]:
    """x and x_lin (points, 14, 3) from rest on the fine grid, on roads of the class through the heights (N, 4)."""
    form, signs, slopes = car_form(car, order=1), adversaries(len(heights) - 1, step), np.diff(heights, axis=0) / step
    x = lin = np.zeros((14, 3))
    found = [(x, lin)]
    h = 2.0 * step / PARTS
    for cell, slope in enumerate(slopes):

        def w(s: float, cell: int = cell, slope: Array = slope, right: bool = False) -> Array:
            at = s - 1e-9 * step if right else s + 1e-9 * step
            (height, _), (_, rate) = bow(roads, step, np.array(s), slope), bow(roads, step, np.array(at), slope)
            up = signs[:, cell]
            chord = np.concatenate([heights[cell] + s * slope, slope])[:, None]
            return np.asarray(chord + np.concatenate([up * height[:, None], up * rate[:, None]]))

        for part in range(0, PARTS, 2):
            ends = [w(h * (part / 2 + c), right=c == 1.0) for c in (0.0, 0.5, 0.5, 1.0)]
            slopes_x = [(0.0 * x, 0.0 * lin)]
            for c, u in zip((0.0, 0.5, 0.5, 1.0), ends, strict=True):
                y, z = x + c * h * slopes_x[-1][0], lin + c * h * slopes_x[-1][1]
                slopes_x.append((form.rate(y, u), form.A @ z + form.B @ u))
            x, lin = (
                v + h / 6.0 * (slopes_x[1][n] + 2.0 * (slopes_x[2][n] + slopes_x[3][n]) + slopes_x[4][n])
                for n, v in enumerate((x, lin))
            )
            found.append((x, lin))
    return np.array([a for a, _ in found]), np.array([b for _, b in found])


@pytest.mark.parametrize(
    ("form", "step", "parameters", "sharp"),
    [
        ("curv:45", 1e-3, {}, 1.01),
        ("lip:0.72", 1e-3, {}, 1.03),
        ("curv:45", 5e-3, {}, 1.1),
        ("lip:0.72", 2e-3, {}, 1.1),
        ("lip:0.72", 1e-3, DAMPED, 1.1),
    ],
)
def test_what_holds_on_every_road_of_a_class_is_sharp(
    bump: Run, form: str, step: float, parameters: dict[str, float], sharp: float
) -> None:
    """Roads that leave the chords as far as the class lets them: from the rows of their motions alone, e is bounded
    from above and by no more than `sharp` times what it reaches; and x stays within what is allowed at every row.
    """
    run = replace(bump, record={**bump.record, "parameters": {"scenario": {**bump.parameters, **parameters}}})
    car, roads, norm = Car(**parameters), road_class(form), energy_norm(Car(**parameters))
    t: Array = np.linspace(0.0, 0.36, round(0.36 / step) + 1)
    heights = road_signal(road_parameters(bump.parameters))(t)[:4].T
    x, lin = motions_on(car, roads, heights, step)
    worst = []
    for k in range(3):
        rows = x[:: PARTS // 2, :, k]
        found, known = everywhere(run, rows, t, heights, form, 1e-7)
        reached = norm((x - lin)[:, :, k].T).max()
        worst.append(found.found.largest_error(norm) / reached)
        assert found.rows(rows, known.open).ratio < 1.0
        _, e, off = found.found.rows()
        assert (np.abs(e - (x - lin)[:: PARTS // 2, :, k]) <= off + 1e-11).all()
    assert all(1.0 <= ratio < sharp for ratio in worst)
    assert np.abs(x[:, :, 1] - x[:, :, 2]).max() > 3e-5  # the roads are not all the same


def of_run(run: Run, form: str, every: int = 1, own: float = 1e-6) -> AllRoads:
    t, x, heights = run.trajectory.time, run.trajectory.columns(NAMES), run.trajectory.columns(HEIGHTS)
    return everywhere(run, x[::every], t[::every], heights[::every], form, own)[0]


@pytest.mark.parametrize(("form", "every"), [("curv:45", 1), ("curv:45", 5), ("lip:0.72", 1)])
def test_e_of_the_rows_is_that_of_the_known_road(bump: Run, form: str, every: int) -> None:
    """The second way: the tube on the exact road, from the first row alone, is within what the rows leave open."""
    found, t = of_run(bump, form, every).found, bump.trajectory.time
    _, e, off = found.rows()
    _, expected, proved = _motions(bump, t, np.zeros(14), np.zeros(14)).at(t[::every])
    assert (np.abs(e - expected) <= off + 2.0 * proved).all()
    assert np.abs(e - expected).max() < 1e-3 * np.abs(expected).max()


def test_a_class_that_leaves_more_open_proves_less(bump: Run) -> None:
    norm = energy_norm(Car())
    bounds = [of_run(bump, form).found.largest_error(norm) for form in ("curv:40", "curv:400", "curv:4000")]
    assert bounds[0] < bounds[1] < bounds[2]
    by_digits = [of_run(bump, "curv:40", own=own).found.largest_error(norm) for own in (1e-6, 1e-4, 1e-3)]
    assert by_digits[0] < by_digits[1] < by_digits[2]
    with pytest.raises(InputError, match=r"rise faster than 0\.5 m/s: by 0\.\d+ m/s from row \d+ on, column h_fl"):
        of_run(bump, "lip:0.5")


def test_what_a_class_leaves_open_is_what_its_steepest_roads_reach() -> None:
    """Class `lip` between heights of slope g: straight up at H1, then down; the mean over half a cell of what
    they have reached from the nearer row on, by quadrature."""
    step, slope, bound = 1e-3, 0.3, 0.7
    peak, mean, _ = RowClass("lip", bound).between(np.array([step]), np.array([[slope]]), np.zeros((1, 1)))
    s = np.linspace(0.0, step, 100_001)
    up = np.minimum(bound * s, slope * step + bound * (step - s)) - slope * s
    most = np.maximum(up, up[::-1])  # the road that falls first is this one backwards
    assert peak[0, 0] == pytest.approx(most.max(), rel=1e-4)
    assert mean[0, 0] == pytest.approx(np.maximum.accumulate(most)[:50_001].mean(), rel=1e-4)


@pytest.mark.parametrize("parameters", [{}, DAMPED])
def test_the_input_enters_linearly_but_for_a_cosine(parameters: dict[str, float], rng: np.random.Generator) -> None:
    """∂F/∂w = diag(1, …, cos ψ2) B at any state: what the proof between rows takes for granted."""
    with precision(2):
        system = exact_system(Car(**parameters), road_parameters(read_scenario("bump").parameters))
        B = input_matrix(system)
        for state in rng.uniform(-0.5, 0.5, (5, 14)).tolist():
            found = jacobian(system, [arb(v) for v in state], [arb(0.1)] * 8, inputs=True)
            for i in range(14):
                share = arb(state[TILTED]).cos() if i == 7 + TILTED else arb(1)
                assert all(found[i, j].overlaps(share * B[i, j]) for j in range(8))


# ---------------------------------------------------------------------------------------------------- authenticity
def test_quintics_have_what_the_rows_have_and_miss_order_4() -> None:
    """Exact for polynomials of degree 5; the second derivative of others is off by the fourth power of the step."""
    t = np.array([0.1, 0.3, 0.7])
    q = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0, -1.0, 2.0])
    p = quintics(t, np.stack([q(t), q.deriv()(t)], axis=1), q.deriv(2)(np.stack([t[:-1], t[1:]], axis=1))[:, :, None])
    nodes = t[:-1, None] + p.half[:, None] * (1.0 + np.cos(np.pi * (np.arange(7) + 0.5) / 7.0))
    np.testing.assert_allclose(p.values[:, 0], q(nodes), rtol=1e-12)
    np.testing.assert_allclose(p.slopes[:, 1], q.deriv(2)(nodes), rtol=1e-10)

    def missed(step: float) -> float:
        t = np.linspace(0.0, 2.0, round(2.0 / step) + 1)
        ends = -np.sin(np.stack([t[:-1], t[1:]], axis=1))[:, :, None]
        p = quintics(t, np.stack([np.sin(t), np.cos(t)], axis=1), ends)
        return float(np.abs(p.slopes[:, 1] + p.values[:, 0]).max())

    slope, straightness = observed_order(missed, [0.2, 0.1, 0.05, 0.025])
    assert slope == pytest.approx(4.0, abs=0.1) and straightness < 0.1


def one_step(states: Array) -> None:
    """As if the step from one row to the next were left out."""
    states[200:-1] = states[201:].copy()


def faster(states: Array) -> None:
    states[250, NAMES.index("der(body.heave)")] += 1e-6


@pytest.mark.parametrize("roads", [None, "curv:45", "lip:0.72"])
@pytest.mark.parametrize("change", [shifted, halved, one_step, faster])
def test_a_tampered_export_is_not_authentic(bump: Run, change: Callable[[Array], None], roads: str | None) -> None:
    findings, _ = certified_findings(tampered(bump, change), roads=road_class(roads) if roads else None)
    assert "obeys the equations" in findings[0].claim and not findings[0].holds
    if change is faster:
        assert (
            "rows 252 and 253, body.heave" in findings[0].source or "rows 251 and 252, body.heave" in findings[0].source
        )
        assert "; 2 cells out" in findings[0].source


@pytest.mark.parametrize("roads", [None, "curv:45", "lip:0.72"])
def test_the_defect_is_within_what_is_allowed_by_little_more_than_it_must(bump: Run, roads: str | None) -> None:
    """An honest run holds, by less than a factor 10; so does one whose states jump by 1e-10, and not by 1e-7."""
    named = road_class(roads) if roads else None
    measured = [
        certified_findings(tampered(bump, scaled(size)), roads=named)[0][0].measured for size in (0.0, 1e-10, 1e-7)
    ]
    assert 0.1 < measured[0] < 1.0 and measured[1] < 1.0 < measured[2]


def test_neither_is_one_with_another_acceleration(bump: Run) -> None:
    """Where accelerations are exported, they are those of the rows."""
    values = bump.trajectory.values.copy()
    values[250, bump.trajectory.names.index("axle_r.roll_acceleration")] += 0.01
    other = replace(bump, trajectory=replace(bump.trajectory, values=values))
    (authentic, rows, _), _ = certified_findings(other)
    assert rows.holds and not authentic.holds
    assert "rows 251 and 252, axle_r.roll, largest: 0.01 rad/s/s; 1 cell out" in authentic.source


def scaled(size: float) -> Callable[[Array], None]:
    def change(states: Array) -> None:
        states[300:] *= 1.0 + size

    return change
