"""The quick floor: never below what a motion reaches, coarse by no more than is said, and quick."""

from __future__ import annotations

import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest
from test_certificates import certified

from analysis.__main__ import main
from analysis.bertolino_baksa import quick
from analysis.bertolino_baksa.adversary import reference_floor
from analysis.bertolino_baksa.balls import precision
from analysis.bertolino_baksa.convolution import largest_over
from analysis.bertolino_baksa.norms import proved_metric
from analysis.bertolino_baksa.quick import quick_floors
from analysis.bertolino_baksa.taylor import find_pieces
from analysis.bertolino_baksa.tube import prove_linear
from analysis.car import car_form, road_signal
from analysis.certificates.car_certificates import build, car_norms, metric_of, model_of, stops
from analysis.certificates.quick_command import quick_answer
from analysis.methods.linear_response import linear_response
from analysis.reference import car_of, road_parameters

REST = [0.0] * 14


def floors(parameters: dict[str, Any]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """What is proved in each norm, and what a reference motion reaches."""
    form, named = car_form(car_of(parameters)), car_norms(parameters)
    with precision(2):
        system = build(model_of(parameters))
        end = stops(system, form.A)[0]
        found = quick_floors(system, proved_metric(system, metric_of(car_of(parameters))), named, REST, end)
    signal = road_signal(road_parameters(parameters))
    return np.array(found), reference_floor(form, signal, named, np.zeros(14), float(end))


@pytest.mark.parametrize(
    ("parameters", "most"),
    [({}, [4.0, 8.0, 4.0]), ({"A": 0.1}, [4.0, 10.0, 4.0]), ({"tau0": 0.0}, [3.0, 15.0, 3.0])],
)
def test_it_is_above_what_a_motion_reaches_by_a_few_times(parameters: dict[str, Any], most: list[float]) -> None:
    """In the energy norm, in the weighted sup, which weighs what moves least by most, and in Euclid's."""
    proved, reached = floors(parameters)
    assert (proved > reached).all() and (proved < most * reached).all()


def test_it_is_above_what_the_certificate_proves() -> None:
    proved, _ = floors({})
    assert (proved > [claim.floor for claim in certified(0.01)[0].claims]).all()


def test_r_along_x_lin_is_bounded_over_every_cell() -> None:
    """At a hundred times in each cell, by the equations themselves; and without waste."""
    parameters: dict[str, Any] = {"A": 0.05}
    form, signal = car_form(car_of(parameters)), road_signal(road_parameters(parameters))
    with precision(2):
        system = build(model_of(parameters))
        metric = proved_metric(system, metric_of(car_of(parameters)))
        pieces = tuple(find_pieces(system, REST, stops(system, form.A)[0], linear_only=True))
        off = prove_linear(system, metric, pieces)
        X = np.hstack([quick.ranges(pieces, off, metric), quick.inputs(system, metric, pieces)])
        bound = quick.majorant(system, 2.0 * X.max(axis=0) + 1e-9)
        found = quick._along(system, metric, pieces, off, bound)
    ends, largest = np.concatenate([[0.0], np.cumsum(quick.widths(pieces, metric))]), np.zeros(14)
    for cell in range(0, 300, 7):
        times = np.linspace(ends[cell], ends[cell + 1], 100)[1:-1]
        x, w = (
            linear_response(form.A, form.B, np.zeros(14), signal, times),
            np.array([signal(t) for t in times]).T.reshape(8, -1),
        )
        rest = np.abs(form.rate(x, w) - form.A @ x - form.B @ w).max(axis=1)
        assert (rest <= found[cell] + 1e-12).all()
        largest = np.maximum(largest, rest)
    assert (found[::7][: len(range(0, 300, 7))].max(axis=0) <= 1.5 * largest + 1e-9).all()


def test_the_largest_over_spans_of_cells() -> None:
    ends = np.array([0.0, 1.0, 1.5, 4.0])
    values = np.array([[1.0], [3.0], [2.0]])
    found = largest_over(ends, values, np.array([-1.0, 0.2, 1.2, 1.6]), np.array([0.5, 1.2, 1.4, 9.0]))
    assert found[:, 0].tolist() == [1.0, 3.0, 3.0, 2.0]


def test_an_endless_road_or_too_large_a_motion_has_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert quick_answer({"profile": "sine"}) == 1
    assert "needs a road that ends flat" in capsys.readouterr().out
    assert quick_answer({"A": 0.5}) == 1
    assert "no quick answer" in capsys.readouterr().out


def test_it_says_how_coarse_it_is_in_about_a_second_and_loads_nothing_that_it_has_no_use_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Time of the processor, so that what else runs there hardly counts."""
    quick_answer({})  # loads what is loaded where it is used
    begin = time.process_time()
    assert main(["certify", "bump", "--quick"]) == 0
    assert time.process_time() - begin < 2.0
    lines = capsys.readouterr().out.splitlines()
    assert all("times what a reference motion reaches" in line for line in lines[1:4])
    code = (
        "import sys; from analysis.__main__ import main; main(['certify', 'bump', '--quick']); "
        "unused = ('matplotlib', 'pandas', 'pint', 'scipy.integrate', 'scipy.interpolate', 'scipy.optimize', 'sympy'); "
        "sys.exit(any(name in sys.modules for name in unused))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
