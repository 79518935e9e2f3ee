"""VehicleOnRoad.ssp in masters that we did not write, against our own master; docs/interop.md has the table.

Each tool runs in a process of its own, so that a crash, also one at its exit, is seen as one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_runs import (
    COUNT,
    LATE,
    LATE_ITEMS,
    SAME,
    STATE_NAMES,
    STEP,
    STOP,
    Runner,
    Value,
    error,
    ours,
    small,
)
from foreign_systems import parameter_set, with_own_output, with_parameters
from small_master import Array, Recording, Ways, deviation


def near(number: float) -> Any:
    """The number of docs/interop.md, to a tenth of it."""
    return pytest.approx(number, rel=0.1)


def over_largest(found: Recording, expected: Recording, name: str) -> Array:
    """How far a variable is off, over its largest value, in each row."""
    a, b = found.columns([name])[:, 0], expected.columns([name])[:, 0]
    return np.abs(a - b) / np.abs(b).max()


def test_the_small_master_is_our_master_to_the_bit(system: Path) -> None:
    """A comparison of a foreign master with the small one is one with ours, but for the way that is named."""
    expected = ours(system)
    np.testing.assert_array_equal(small(system, Ways()).columns(expected.names), expected.rows)


# ---------------------------------------------------------------------------------------------------- fmpy
def test_fmpy_runs_the_ssp_and_starts_all_inputs_at_zero(system: Path, foreign: Runner) -> None:
    """Its rows carry the time of the step's start. The road's rate is not 0 at the start; nothing else differs."""
    found = foreign("run_fmpy_ssp.py", system, STOP, STEP, "RESULT")
    assert found.time[0] == 0.0
    found = found.later(STEP)
    assert deviation(found, small(system, Ways(initial="zero")).between(1)) < 1e-12  # measured: 1.9e-14
    expected = ours(system).between(1)
    assert deviation(found, expected, STATE_NAMES) == near(2.9e-3)
    assert deviation(found, expected) == near(6.7e-2)
    off = over_largest(found, expected, "vehicle.wheel_fl.heave_acceleration")
    assert off[0] == near(6.7e-2) and off[1000:].max() < 1e-8  # rows at 1 ms, and after 1 s; measured: 6.0e-9
    unshifted = Recording(ours(system).time[:-1], found.names, found.rows)
    assert deviation(unshifted, ours(system).between(0, -1), STATE_NAMES) == near(9.1e-2)


def test_fmpy_agrees_with_our_jacobi_where_all_starts_at_zero(system: Path, foreign: Runner, tmp_path: Path) -> None:
    late = tmp_path / "late.ssv"
    late.write_text(parameter_set("late", {"road.t_start": 0.1, "controller.t_start": 0.1}))
    found = foreign("run_fmpy_ssp.py", system, 0.7, STEP, "RESULT", late).later(STEP)
    expected = ours(system, stop=0.7, parameters=(("t_start", 0.1),))
    assert deviation(found, expected.between(1)) < 1e-12  # measured: 2.8e-14


def test_fmpys_first_step_keeps_the_coupling_order(system: Path, foreign: Runner) -> None:
    """Control forces are held over a step: order 1."""
    errors = [error(foreign("run_fmpy_ssp.py", system, 0.7, h, "RESULT").later(h)) for h in (2e-3, 1e-3, 5e-4)]
    assert errors == [near(0.0315), near(0.0157), near(0.0078)]
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.02)


# ---------------------------------------------------------------------------------------------------- libcosim
def test_libcosim_runs_the_ssp_as_our_jacobi(system: Path, foreign: Runner) -> None:
    found = foreign("run_libcosimpy.py", system, COUNT, "RESULT")
    assert deviation(found, ours(system).between(1)) < 1e-13  # measured: 7.1e-15


def test_libcosim_takes_the_first_parameter_set_of_each_component(
    system: Path, foreign: Runner, tmp_path: Path
) -> None:
    late = with_parameters(system, tmp_path / "late.ssp", "late", LATE)
    expected = ours(system, stop=0.6, parameters=LATE_ITEMS)
    assert deviation(foreign("run_libcosimpy.py", late, 600, "RESULT"), expected.between(1)) < SAME


def test_ecco_with_steps_of_one_length_is_jacobi(system: Path, foreign: Runner) -> None:
    found = foreign("run_ecco.py", system, STOP, "RESULT", STEP, STEP, STEP, 1e-4)
    assert deviation(found, ours(system).between(1)) < 1e-13  # measured: 7.1e-15


@pytest.mark.parametrize(
    ("tolerance", "steps", "off"),
    [(1e-2, 1260, 6.5e-2), (1e-3, 1266, 3.1e-2), (1e-4, 1303, 1.6e-2), (1e-5, 1461, 7.6e-3), (1e-6, 2005, 2.9e-3)],
)
def test_ecco_spends_its_steps_where_power_is_exchanged(
    system: Path, foreign: Runner, tolerance: float, steps: int, off: float
) -> None:
    """Errors fall with the tolerance; a third of the steps halves the error of the fixed step, 1.56e-2."""
    found = foreign("run_ecco.py", system, STOP, "RESULT", STEP, 1e-4, 5e-3, tolerance)
    assert (len(found.time), error(found)) == (near(steps), near(off))
    assert np.diff(found.time).max() > 4.9e-3
    assert tolerance > 1e-5 or np.diff(found.time).min() < 5e-4


def test_which_order_is_best(system: Path) -> None:
    end = (("road_sampling", "end"),)
    assert error(ours(system)) == near(1.56e-2)
    assert error(ours(system, "gauss-seidel", parameters=end)) == near(5.2e-3)
    assert error(ours(system, "gauss-seidel")) == near(9.1e-2)


# ---------------------------------------------------------------------------------------------------- Ecos
def test_ecos_runs_the_ssp_as_our_jacobi_and_renews_outputs_for_new_inputs(system: Path, foreign: Runner) -> None:
    found = foreign("run_ecospy.py", system, COUNT, "RESULT")
    expected = ours(system)
    assert deviation(found, expected, STATE_NAMES) < 1e-12  # measured: 1.8e-14
    assert deviation(found, small(system, Ways(after="refresh"))) < 1e-12  # measured: 1.9e-14
    assert deviation(found, expected) == near(2.3e-1)
    for motion, most in (("body.heave", 0.23), ("body.pitch", 0.22), ("axle_r.heave", 0.14)):
        off = over_largest(found, expected, f"vehicle.{motion}_acceleration")
        assert off[320] == near(most)  # where the controller switches on
        assert np.delete(off, 320).max() < 0.01
    assert over_largest(found, expected, "controller.force_fl").max() == near(0.039)


def test_ecos_takes_parameters_and_start_values_of_a_named_set(system: Path, foreign: Runner, tmp_path: Path) -> None:
    sets = {**LATE, "vehicle": {**LATE["vehicle"], "body.heave": 0.01}}
    late = with_parameters(system, tmp_path / "late.ssp", "late", sets)
    expected = ours(system, stop=0.6, parameters=LATE_ITEMS, start=(("body.heave", 0.01),))
    assert deviation(foreign("run_ecospy.py", late, 600, "RESULT", "late"), expected, STATE_NAMES) < SAME


def test_ecos_leaves_a_copy_of_the_system_behind_and_the_others_nothing(
    system: Path, foreign: Runner, tmp_path: Path
) -> None:
    foreign("run_libcosimpy.py", system, 1, "RESULT")
    foreign("run_fmpy_ssp.py", system, 2 * STEP, STEP, "RESULT")
    assert [path.name for path in tmp_path.iterdir()] == ["result"]
    foreign("run_ecospy.py", system, 1, "RESULT")
    assert [path.name[:8] for path in sorted(tmp_path.iterdir())] == ["ecos_ssp", "result"]


# ---------------------------------------------------------------------------------------------------- refusals
RUNAWAY: dict[str, dict[str, Value]] = {"vehicle": {"b1": 1e9}, "controller": {"enabled": False}}


def test_libcosim_stops_at_a_refused_step_and_quotes_the_fmu(system: Path, foreign: Runner, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"(?s)ended with 1:.*vehicle: step .*finite numbers"):
        foreign("run_libcosimpy.py", with_parameters(system, tmp_path / "x.ssp", "x", RUNAWAY), 5, "RESULT")


def test_libcosim_quotes_a_refusal_with_its_percent_signs(system: Path, foreign: Runner, tmp_path: Path) -> None:
    refused = with_parameters(system, tmp_path / "x.ssp", "x", {"road": {"profile": "100%s%n"}})
    with pytest.raises(AssertionError, match=r"initialization: profile = '100%s%n': wanted one of bump"):
        foreign("run_libcosimpy.py", refused, 1, "RESULT")


def test_ecos_goes_on_after_a_refused_step_and_finds_the_last_good_state(
    system: Path, foreign: Runner, tmp_path: Path
) -> None:
    runaway = with_parameters(system, tmp_path / "x.ssp", "x", RUNAWAY)
    states = foreign("run_ecospy.py", runaway, 5, "RESULT", "x").columns(STATE_NAMES)
    assert np.isfinite(states).all()
    assert (states[2:] == states[2]).all() and (states[1] != states[0]).any()


def test_ecos_goes_on_after_a_refused_start_and_nothing_crashes(system: Path, foreign: Runner, tmp_path: Path) -> None:
    """It ignores fmi2Fatal; the FMU, having raised once, must stay quiet and safe."""
    refused = with_parameters(system, tmp_path / "x.ssp", "x", {"vehicle": {"m21": 20.0}})
    assert not foreign("run_ecospy.py", refused, 5, "RESULT", "x").columns(STATE_NAMES).any()


# ---------------------------------------------------------------------------------------------------- why it is so
@pytest.mark.parametrize(
    ("connected", "script", "words"),
    [
        (True, "run_libcosimpy.py", "No such node (<xmlattr>.endElement)"),
        (True, "run_ecospy.py", "No element named: vehicle"),
        (False, "run_fmpy_ssp.py", "start_p"),
    ],
)
def test_the_system_has_no_connectors_of_its_own_because_no_way_suits_all_tools(
    system: Path, tmp_path: Path, foreign: Runner, connected: bool, script: str, words: str
) -> None:
    """Should this fail after an upgrade of the tool, the .ssp can do better."""
    other = with_own_output(system, tmp_path / "other.ssp", connected=connected)
    step = (STEP,) if script == "run_fmpy_ssp.py" else ()
    with pytest.raises(AssertionError) as refusal:
        foreign(script, other, 1, *step, "RESULT")
    assert words in str(refusal.value)
