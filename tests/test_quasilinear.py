"""Quasi-linearization: tensors against the full equations, their symmetries, symbols against numbers, and the page."""

from __future__ import annotations

import time
from dataclasses import asdict
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from orders import observed_order

from analysis.car import car_form, road_signal
from analysis.car_modes import car_modes
from analysis.methods.linear_response import linear_response
from analysis.mode_report import write
from analysis.quasilinear import FACTORS, TERMS, Quasilinear, Tensor, quasilinear, quasilinear_form, symbolic
from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.equations import equations_of_motion
from fmu_src.vehicle.parameters import Car

ROOT = Path(__file__).resolve().parents[1]
CAR = Car(bp1=150.0, bp2=170.0, Jz=700.0, m11=31.0)
SIZES = {"q": 7, "v": 7, "u": 4, "h": 4, "dh": 4}


@pytest.fixture(scope="module")
def formulas() -> Quasilinear:
    return symbolic()


def random_factors(seed: int) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    return {kind: rng.uniform(-1.0, 1.0, size) for kind, size in SIZES.items()}


def contracted(tensors: Quasilinear, names: list[str], factors: dict[str, Any]) -> Any:
    """Σ sign · t_ij… · factors, from the listed entries: as a reader of the page would."""
    total = np.zeros(7)
    for name in names:
        kinds, sign = TERMS[name]
        for index, value in tensors[name].entries.items():
            product = np.prod([factors[kind][j] for kind, j in zip(kinds, index[1:], strict=True)])
            total[index[0]] += sign * len(tensors[name].arrangements(index)) * value * product
    return total


# ---------------------------------------------------------------------------------------------------- the numbers
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("left_out", "order"), [((), 5), (("c_ijkl",), 3)], ids=["complete", "as in the paper"])
def test_all_terms_meet_the_full_equations_to_order_5_and_the_papers_choice_to_order_3(
    seed: int, left_out: tuple[str, ...], order: int
) -> None:
    """Actuators and road rates included. Without the cubic stiffness nothing is gained over the linear equations."""
    tensors, motion, direction = quasilinear(CAR), equations_of_motion(CAR), random_factors(seed)
    names = [name for name in TERMS if name not in left_out]

    def error(size: float) -> float:
        x = {kind: size * values for kind, values in direction.items()}
        exact, _, _ = motion(*(x[kind].tolist() for kind in ("q", "v", "u", "h", "dh")))
        return float(np.abs(np.array(exact) - contracted(tensors, names, x)).max())

    slope, bend = observed_order(error, [0.2, 0.1, 0.05])
    assert slope == pytest.approx(order, abs=0.1)
    assert bend < 0.05


def test_3_10_is_the_standard_form() -> None:
    tensors, form = quasilinear(CAR), quasilinear_form(CAR)
    paper = quasilinear_form(CAR, complete=False)
    rng = np.random.default_rng(5)
    x, h, dh = (rng.uniform(-1.0, 1.0, (n, 6)) for n in (14, 4, 4))
    w = np.concatenate([h, dh])
    np.testing.assert_allclose(tensors.A, form.A, rtol=1e-13)
    np.testing.assert_allclose(tensors.Q(h, dh), form.B @ w, rtol=1e-13)
    P = tensors.P(h, dh, x)
    scale = np.abs(form.Phi(x, w)).max()
    np.testing.assert_allclose(tensors.R(x) + P, form.Phi(x, w), atol=1e-13 * scale)
    np.testing.assert_allclose(tensors.R(x, complete=False) + P, paper.Phi(x, w), atol=1e-13 * scale)
    assert np.abs(tensors.R(x) - tensors.R(x, complete=False)).max() > 0.1 * scale


def test_the_cubic_stiffness_is_the_largest_term_on_the_papers_bump() -> None:
    """In the rear axle's roll, the row with the largest terms; in the other rows the cubic damping is the larger."""
    form, tensors, times = car_form(Car(), order=1), quasilinear(Car()), np.linspace(0.0, 1.0, 501)
    road = road_signal(RoadParameters())
    x, w = linear_response(form.A, form.B, np.zeros(14), road, times), road(times)
    kept, parametric = tensors.R(x, complete=False), tensors.P(w[:4], w[4:], x)
    dropped = tensors.R(x) - kept
    kept, parametric, dropped = (np.abs(part[7:]).max(axis=1) for part in (kept, parametric, dropped))
    assert np.argmax(dropped) == np.argmax(kept) == 6
    assert dropped[6] > 4.0 * max(kept[6], parametric[6])  # measured: 4.3 and 8.3 times
    assert np.all(dropped[:6] < kept[:6])


def test_only_the_axles_roll_is_excited_parametrically() -> None:
    tensors = quasilinear(Car())
    value = -PARAMETERS["cp2"].start * 0.685 / (2.0 * (44.0 * 0.685**2 + 3.0))
    assert tensors["d_ijkl"].entries == {(6, 2, 6, 6): pytest.approx(value), (6, 3, 6, 6): pytest.approx(-value)}
    assert tensors["e_ijkl"].entries == tensors["e_ij"].entries == {}  # the default tyres have no dampers
    assert set(quasilinear(CAR)["e_ijkl"].entries) == set(tensors["d_ijkl"].entries)


@pytest.mark.parametrize("name", TERMS)
def test_a_tensor_is_symmetric_in_the_indices_of_one_kind_of_factor(name: str) -> None:
    tensor = quasilinear(CAR)[name]
    dense = tensor.dense()
    assert np.count_nonzero(dense) == sum(len(tensor.arrangements(index)) for index in tensor.entries)
    for order in permutations(range(len(tensor.kinds))):
        if all(tensor.kinds[i] == tensor.kinds[j] for i, j in enumerate(order)):
            np.testing.assert_array_equal(dense, dense.transpose(0, *(i + 1 for i in order)))


def test_arrangements_stay_within_their_kind() -> None:
    assert Tensor(("v", "q", "q"), {}).arrangements((0, 5, 1, 2)) == [(0, 5, 1, 2), (0, 5, 2, 1)]
    assert len(Tensor(("q", "q", "q"), {}).arrangements((0, 1, 2, 3))) == 6
    assert Tensor(("q", "q", "q"), {}).arrangements((0, 1, 1, 1)) == [(0, 1, 1, 1)]


def test_numbers_take_well_under_a_second() -> None:
    begin = time.perf_counter()
    quasilinear(CAR)
    assert time.perf_counter() - begin < 0.5  # measured: 6 ms


# ---------------------------------------------------------------------------------------------------- the symbols
@pytest.mark.parametrize("name", TERMS)
def test_the_formulas_give_the_numbers(formulas: Quasilinear, name: str) -> None:
    import sympy as sp

    values = {sp.Symbol(PARAMETERS[key].symbol, positive=True): value for key, value in asdict(CAR).items()}
    numbers = quasilinear(CAR)[name].entries
    found = {index: float(value.subs(values)) for index, value in formulas[name].entries.items()}
    assert found.keys() == numbers.keys()
    for index, value in found.items():
        assert value == pytest.approx(numbers[index], rel=1e-11), index


def test_formulas_that_can_be_read_off_the_equations(formulas: Quasilinear) -> None:
    """(3.5): the gyroscopic term, and the roll stiffness (c1 s1² + c2 s0²) 2 sin ψ cos ψ cos²φ."""
    import sympy as sp

    Jx, Jy, Jz, c1, c2, s1, s0 = (
        sp.Symbol(PARAMETERS[name].symbol, positive=True) for name in ("Jx", "Jy", "Jz", "c1", "c2", "s1", "s0")
    )
    roll = 2 * (c1 * s1**2 + c2 * s0**2) / Jx
    assert sp.simplify(formulas["m_ijkl"].entries[1, 2, 2, 1] + (Jy - Jz) / Jx) == 0
    assert sp.simplify(formulas["c_ij"].entries[1, 1] - roll) == 0
    assert sp.simplify(formulas["c_ijkl"].entries[1, 1, 1, 1] + roll * sp.Rational(2, 3)) == 0  # sin 2ψ/2 = ψ − 2ψ³/3
    assert sp.simplify(3 * formulas["c_ijkl"].entries[1, 1, 2, 2] + roll) == 0  # cos²φ = 1 − φ²


# ---------------------------------------------------------------------------------------------------- the page
def test_the_page_in_the_docs_is_what_the_command_writes(formulas: Quasilinear, tmp_path: Path) -> None:
    car = Car()
    write(car, car_modes(car), "the default car", "python -m analysis modes -o DIR", tmp_path)
    written = (tmp_path / "quasilinear.md").read_text(encoding="utf-8")
    assert written == (ROOT / "docs" / "default-car" / "quasilinear.md").read_text(encoding="utf-8")
    entries = sum(len(formulas[name].entries) for name in TERMS)
    assert sum(line.startswith(("| $\\bar", "| $d_", "| $e_", "| $g_")) for line in written.splitlines()) == entries
    for line in written.splitlines():
        assert line.count("{") == line.count("}") and line.count("$") % 2 == 0, line
    for kind in FACTORS:
        assert all(f"${q.symbol}$" in written or q.symbol in written for q in FACTORS[kind])
