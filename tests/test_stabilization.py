"""The half car stabilized, §4: Riccati against Pontryagin, the optimum, the print, the figures, the FMU in the loop."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from half_car_run import cost, half_car_run
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from orders import observed_order
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are

from analysis.errors import InputError
from analysis.methods.linear_response import linear_response
from analysis.methods.signals import Piece, Signal
from analysis.stabilization import document, study
from analysis.stabilization.certified import growth
from analysis.stabilization.drawings import subjects
from analysis.stabilization.full_car import car_plant, full_gain, varied_values
from analysis.stabilization.half_car import (
    axle_road,
    come_down,
    corrected,
    excitation,
    over_the_bump,
    printed,
    printed_control,
)
from analysis.stabilization.limit import approach
from analysis.stabilization.margins import LoopMargins, Margins
from analysis.stabilization.pontryagin import by_collocation, by_exponentials, hamiltonian
from analysis.stabilization.regulator import (
    Arc,
    Regulator,
    by_riccati,
    energy_to_rest,
    instants,
    modal_reach,
    quadrature,
    riccati_solution,
    stationary,
)
from analysis.stabilization.study import difference
from analysis.trajectory import read_run, write_run
from fmu_src.controller.fullcar import FullCar
from fmu_src.controller.halfcar import HalfCar
from fmu_src.controller.riccati import riccati_rate
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car

Array = np.ndarray[Any, Any]
Way = Callable[[Regulator, Array, Array], Arc]
WAYS: tuple[Way, ...] = (by_riccati, by_exponentials, by_collocation)
CAR, ROAD = HalfCar(), RoadParameters()
WEIGHTS = (1e8, 1e10, 1e12)


def regulator(lam: float = CAR.lam) -> Regulator:
    return corrected(CAR).regulator(replace(CAR, lam=lam))


@pytest.fixture(scope="module")
def x0() -> Array:
    """x(t_B2)."""
    return over_the_bump(corrected(CAR), ROAD, np.array([come_down(ROAD)]))[:, 0]


@pytest.fixture(scope="module")
def times() -> Array:
    return instants(come_down(ROAD), 2.3, 1e-3)


@pytest.fixture(scope="module")
def optimal(x0: Array, times: Array) -> Arc:
    return by_riccati(regulator(), x0, times)


# ------------------------------------------------------------------ the half car
def test_the_motion_over_the_bump_is_that_of_an_integrator(x0: Array) -> None:
    """Front axle on the half sine, neither, rear axle on it: each arc by DOP853, from the formulas of the bump."""
    model, E, omega = corrected(CAR), excitation(CAR), 2 * np.pi * ROAD.v0 / ROAD.Lambda
    x, edges = np.zeros(4), axle_road(ROAD).edges
    assert_allclose(edges, [0.0, 0.05, 0.25, 0.3], atol=1e-12)  # t_A1, t_A2, t_B1, t_B2
    for (begin, end), met in zip(pairwise(edges), ([1.0, 0.0], [0.0, 0.0], [0.0, 1.0]), strict=True):

        def rate(t: float, x: Array, begin: float = begin, met: list[float] = met) -> Array:
            s = omega * (t - begin)
            heights, rates = np.multiply(met, ROAD.A * np.sin(s)), np.multiply(met, ROAD.A * omega * np.cos(s))
            return model.A @ x + E @ [*heights, *rates]

        x = solve_ivp(rate, (begin, end), x, method="DOP853", rtol=1e-12, atol=1e-16).y[:, -1]
    assert_allclose(x0, x, atol=1e-11 * np.abs(x).max())


def test_a_road_that_moves_as_a_rigid_plane_acts_as_the_body_moving_the_other_way(rng: np.random.Generator) -> None:
    """C(t) of (4.1) from A: a road that rises by z and tilts by φ, z_A = z + aφ and z_B = z − bφ, pulls as −(z, φ)."""
    car = HalfCar(a=1.3, b=0.8, c1=11e3, c2=17e3, b1=900.0, b2=1500.0)
    z, phi, dz, dphi = rng.normal(size=4)
    w = [z + car.a * phi, z - car.b * phi, dz + car.a * dphi, dz - car.b * dphi]
    against = np.array(car.A) @ [z, phi, dz, dphi]
    assert_allclose((excitation(car) @ w)[2:], -against[2:], rtol=1e-12)
    assert not excitation(car)[:2].any()


@pytest.mark.parametrize("lam", WEIGHTS)
def test_riccati_and_pontryagin_agree(lam: float, x0: Array, times: Array) -> None:
    arcs = [way(regulator(lam), x0, times) for way in WAYS]
    assert difference(arcs[0], arcs[1]) < 1e-9
    assert difference(arcs[2], arcs[1]) < 1e-9
    assert np.abs(arcs[1].p[:, -1]).max() <= 1e-12 * np.abs(arcs[1].p).max()  # (4.5)


@pytest.mark.parametrize("model", [printed_control, printed])
def test_they_agree_on_what_is_printed(model: Any, times: Array) -> None:
    made = model(CAR)
    start = over_the_bump(made, ROAD, times[:1])[:, 0]
    arcs = [way(made.regulator(CAR), start, times) for way in (by_riccati, by_exponentials)]
    assert difference(*arcs) < 1e-9


@pytest.mark.parametrize("lam", WEIGHTS)
def test_L_solves_its_equation_and_is_symmetric_and_semidefinite_at_every_time(lam: float) -> None:
    r, s = regulator(lam), np.linspace(0.0, 2.0, 401)
    solution = riccati_solution(r, 2.0)
    L, slope = solution(s), solution.derivative()(s)
    rates = np.array([riccati_rate(each, r.A, r.B, r.Q, r.R) for each in L])
    assert np.abs(slope - rates).max() < 1e-8 * np.abs(r.Q).max()
    assert np.abs(L - L.transpose(0, 2, 1)).max() <= 1e-14 * np.abs(L).max()
    assert np.linalg.eigvalsh(L).min() >= -1e-12 * np.abs(L).max()
    assert np.linalg.eigvalsh(np.diff(L, axis=0)).min() >= -1e-11 * np.abs(L).max()  # and grows, as right as L is


def test_control_scipy_and_an_own_backward_integration_agree() -> None:
    """The classical Runge–Kutta method has the equation's rest point as its own."""
    r = regulator()
    own, h = np.zeros((4, 4)), 5e-3
    for _ in range(800):
        k1 = riccati_rate(own, r.A, r.B, r.Q, r.R)
        k2 = riccati_rate(own + h / 2 * k1, r.A, r.B, r.Q, r.R)
        k3 = riccati_rate(own + h / 2 * k2, r.A, r.B, r.Q, r.R)
        k4 = riccati_rate(own + h * k3, r.A, r.B, r.Q, r.R)
        own = own + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    by_control, K = stationary(r)
    scale = np.abs(own).max()
    assert_allclose(by_control, own, atol=1e-10 * scale)
    assert_allclose(solve_continuous_are(r.A, r.B, r.Q, r.R), own, atol=1e-10 * scale)
    assert_allclose(riccati_solution(r, 4.0)(4.0), own, atol=1e-10 * scale)
    assert_allclose(K, -r.B.T @ own, atol=1e-10 * np.abs(K).max())


@pytest.mark.parametrize("lam", WEIGHTS)
def test_the_finite_horizon_tends_to_the_infinite_one_at_twice_the_slowest_decay(lam: float) -> None:
    found = approach(regulator(lam))
    r = regulator(lam)
    assert found.rate == pytest.approx(-2 * np.linalg.eigvals(r.A + r.B @ stationary(r)[1]).real.max())
    assert found.fitted == pytest.approx(found.rate, rel=1e-3)
    assert found.bend < 0.01
    assert found.gap[0] / found.gap[-1] > 1e3


# ------------------------------------------------------------------ the optimum
@pytest.mark.parametrize("lam", WEIGHTS)
def test_the_cost_is_half_x_L_x(lam: float, x0: Array, times: Array) -> None:
    arc = by_exponentials(regulator(lam), x0, times)
    L = riccati_solution(regulator(lam), times[-1] - times[0])(times[-1] - times[0])
    assert_allclose(
        quadrature(regulator(lam), arc.t, arc.x, arc.u), 0.5 * x0 @ L @ x0, rtol=1e-7 if lam > 1e11 else 1e-9
    )


@pytest.mark.parametrize(("end", "tolerance"), [(0.5, 1e-10), (2.3, 1e-12)])
def test_the_hamiltonian_is_constant_along_an_optimal_arc_and_no_other(end: float, tolerance: float, x0: Array) -> None:
    """Over a short horizon H is of the size of its parts; over a long one it is nearly 0, and so they measure it."""
    r, t = regulator(), instants(0.3, end, 1e-3)
    arc = by_exponentials(r, x0, t)
    running = r.running_cost(arc.x, arc.u).max()
    H = hamiltonian(r, arc)
    assert np.ptp(H) < tolerance * running
    assert_allclose(H[-1], r.running_cost(arc.x, arc.u)[-1], atol=tolerance * running)  # p(T) = 0
    other = Arc(t, arc.x, arc.p, 1.01 * arc.u)
    assert np.ptp(hamiltonian(r, other)) > 1e-6 * running


def perturbed_costs(around: Arc, rng: np.random.Generator) -> tuple[Array, Array]:
    """Costs under the control of this arc with each of 1,000 perturbations added, and the second variation of each.

    A perturbation is a sum of harmonics of random size; motions are linear in it, and known exactly for each harmonic.
    """
    r, begin, span = regulator(), around.t[0], around.t[-1] - around.t[0]
    controls, motions = [], []
    for axle in np.eye(2):
        for frequency in 2j * np.pi / span * np.arange(0, 8):
            for phase in (1.0, 1j) if frequency else (1.0,):
                signal = Signal(
                    (Piece(begin, np.array([frequency, -frequency]), np.outer(axle, [phase / 2, np.conj(phase) / 2])),)
                )
                controls.append(signal(around.t))
                motions.append(linear_response(r.A, r.B, np.zeros(4), signal, around.t))
    sizes = rng.normal(size=(1000, len(controls))) * 10.0 ** rng.uniform(-2, 2, size=(1000, 1))
    costs, second = [], []
    for size in sizes:
        dx, du = np.tensordot(size, motions, axes=1), np.tensordot(size, controls, axes=1)
        costs.append(quadrature(r, around.t, around.x + dx, around.u + du))
        second.append(quadrature(r, around.t, dx, du))
    return np.array(costs), np.array(second)


def test_no_other_control_costs_less(optimal: Arc, rng: np.random.Generator) -> None:
    best = quadrature(regulator(), optimal.t, optimal.x, optimal.u)
    costs, second = perturbed_costs(optimal, rng)
    assert len(costs) == 1000
    assert costs.min() > best
    assert_allclose(costs - best, second, rtol=1e-6, atol=1e-9 * best)  # no first variation


def test_the_same_search_finds_what_is_not_optimal(x0: Array, times: Array, rng: np.random.Generator) -> None:
    other = by_riccati(regulator(2.0 * CAR.lam), x0, times)
    costs, _ = perturbed_costs(other, rng)
    assert costs.min() < quadrature(regulator(), times, other.x, other.u)


# ------------------------------------------------------------------ as printed
def test_one_control_instead_of_two_costs_more_and_reaches_less(x0: Array) -> None:
    models = [model(CAR) for model in (corrected, printed_control, printed)]
    assert [np.linalg.matrix_rank(m.B) for m in models] == [2, 1, 1]
    costs = [0.5 * x0 @ riccati_solution(m.regulator(CAR), 2.0)(2.0) @ x0 for m in models]
    efforts = [energy_to_rest(m.A, m.B, x0, 2.0) for m in models]
    assert 1.1 < costs[1] / costs[0] < costs[2] / costs[0]
    assert 3.0 < efforts[1] / efforts[0] < efforts[2] / efforts[0]
    reaches = [modal_reach(m.A, m.B) for m in models]  # measured: 0.10, 0.030, 0.00058: the saddle all but out of reach
    assert reaches[0] > 3.0 * reaches[1] > 100.0 * reaches[2] > 0.0


def test_the_printed_half_car_diverges_without_control(times: Array) -> None:
    growth = np.linalg.eigvals(printed(CAR).A).real.max()
    assert growth > 1.0
    x = over_the_bump(printed(CAR), ROAD, np.array([4.0, 5.0]))
    assert_allclose(x[:, 1] / x[:, 0], np.exp(growth), rtol=1e-2)
    assert np.abs(over_the_bump(corrected(CAR), ROAD, np.array([5.0]))).max() < 1e-6


@pytest.fixture(scope="module")
def result() -> study.Study:
    """The study at the chosen weight and at one that the car with its wheels does not stand."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "WEIGHTS", (CAR.lam, 1e13))
        return study.study()


def test_the_figures_show_what_their_axes_say(result: study.Study) -> None:
    """Figure 8: L14; 9: z [mm] and φ [mrad], without control first; 10: u1, u2 [N]; in the default weight's red."""
    arc, L = result.default.arc, result.default.L
    free = 1e3 * result.free["corrected"]
    shown = {"08-L14": [[L[:, 0, 3]], [L[:, 0, 3] / np.abs(L[:, 0, 3]).max()]],
             "09-motion": [[free[k], 1e3 * arc.x[k]] for k in (0, 1)],
             "10-forces": [[arc.u[0]], [arc.u[1]]]}  # fmt: skip
    labels = ("L_{14}", "L_{14}"), ("z$ [mm]", "varphi$ [mrad]"), ("u_1$ [N], front", "u_2$ [N], rear")
    for (name, panels), words in zip(shown.items(), labels, strict=True):
        (subject,) = (s for s in subjects(result) if name in s.file)
        for panel, lines, label in zip(subject.panels, panels, words, strict=True):
            ax = panel(Figure().subplots())
            assert label in ax.get_ylabel()
            for line, expected in zip(ax.get_lines(), lines, strict=True):
                assert_allclose(line.get_ydata(), expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())


def test_the_command_writes_table_json_and_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, result: study.Study
) -> None:
    monkeypatch.setattr(document, "study", lambda progress: result)
    assert document.run(tmp_path) == 0
    said = capsys.readouterr().out
    assert "FAILS" not in said
    data = json.loads((tmp_path / document.FILE).read_text(encoding="utf-8"))
    assert [model["rank of B"] for model in data["models"]] == [2, 1, 1]
    assert all(f["holds"] for f in data["findings"])
    proved = [[w[f"{d}-car design, car"]["certified"]["proved"] for w in data["weights"]] for d in ("half", "full")]
    assert proved == [[1.0, 0.0], [1.0, 0.0]]
    assert 1e12 < data["car unstable somewhere in the box from lambda"] < 0.3 * data["car unstable from lambda"]
    own = [growth(car_plant(Car()), full_gain(FullCar(lam=w["lambda"])), varied_values(Car())) for w in data["weights"]]
    assert [w["full-car design, car"]["growth"] for w in data["weights"]] == pytest.approx(own)
    broken = [data["weights"][0][f"{d}-car design, car"]["margins"]["loops"] for d in ("half", "full")]
    assert [len(loops) for loops in broken] == [2, 4]  # what one signal commands: axles, struts
    figures = sorted(path.name for path in tmp_path.glob("*.svg"))
    assert figures == [f"stabilization-{n}.svg" for n in ("08-L14", "09-motion", "10-forces", "limit", "printed")]
    page = (tmp_path / document.PAGE).read_text(encoding="utf-8")
    assert document.text(result) in page and "holds: " in page
    for subject in subjects(result):
        assert f"({subject.file})" in page and subject.caption() in page
    assert "λ = 1e+10 N²/m², H1 = 1 m, T = 2.3 s are this project's choice" in page
    with pytest.raises(InputError, match="wanted a folder, got a file"):
        document.run(tmp_path / document.FILE)


def test_the_cells_of_a_weight_are_L14_cost_forces_and_rates(result: study.Study) -> None:
    w = result.weighted[0]
    numbers = [
        w.solution.L[0, 0, 3],
        w.solution.cost,
        *np.abs(w.solution.arc.u).max(axis=1),
        w.approach.fitted,
        w.approach.rate,
    ]
    cells = document._weight_row(w)
    assert cells[0] == "1e+10"
    for cell, number, unit in zip(cells[1:], numbers, ("N²s²/m", "N²s", "N", "N", "1/s", "1/s"), strict=True):
        value, _, written = cell.partition(" ")
        assert float(value.replace("−", "-")) == pytest.approx(number, rel=5e-3)
        assert written == unit
    row = document._model_row(result.default)
    assert row[:3] == ("corrected", "2", "−2.43 1/s")
    assert row[4:] == ("1152 N²s", "20.1 N", "106 N", "0.01364 N²s")


def test_the_page_names_the_car_and_says_that_it_is_not_the_papers(result: study.Study) -> None:
    said = document.text(result)
    assert "m = 870 kg, J = 1060 kg m², a = 1 m, b = 1.5 m, per axle c1 = 30000 N/m" in said
    assert "not the paper's" in said and "the default car" in said


def test_margins_are_printed_as_the_worst_of_one_signal_and_as_those_of_all() -> None:
    loops = (LoopMargins(down=0.1, up=5.0, phase=40.0), LoopMargins(down=0.2, up=3.0, phase=np.inf))
    made = Margins(loops=loops, common=LoopMargins(0.25, 2.5, 30.0), return_difference=0.61, disk=0.72, delay=0.0115)
    assert document._margin_cells(made) == ("0.2 to 3", "40°", "0.25 to 2.5", "30°", "0.61", "0.72", "11.5 ms")
    never = replace(made, loops=loops[1:], delay=np.inf)
    assert document._margin_cells(never)[1] == document._margin_cells(never)[-1] == "any"


# ------------------------------------------------------------------ the FMU in the loop
def test_the_cost_measured_on_an_exported_run_is_half_x_L_x(dist: Path, tmp_path: Path, x0: Array) -> None:
    """Forces held over a step of h cost more by a multiple of h²; at 0.1 ms it is below 1e-6."""
    begin, end = come_down(ROAD), 2.3
    L = riccati_solution(regulator(), end - begin)(end - begin)
    least = 0.5 * x0 @ L @ x0

    def measured(step: float) -> float:
        folder = tmp_path / f"{step:g}"
        folder.mkdir()
        write_run(half_car_run(dist / "LqrController.fmu", folder / "fmu", x0, begin, end, step), folder)
        return cost(read_run(folder))

    costs = {step: measured(step) for step in (4e-3, 2e-3, 1e-3)}
    slope, bend = observed_order(lambda step: costs[step] - least, list(costs))
    assert slope == pytest.approx(2.0, abs=0.05)
    assert bend < 0.02
    assert measured(1e-4) == pytest.approx(least, rel=1e-6)
