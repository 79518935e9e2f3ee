"""Optimal stabilization: Riccati equations, the stored design, signs, and the controller as a slave."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from conftest import ROOT
from fmpy import extract
from host import DISCARD, OK, Host
from numpy.testing import assert_allclose
from scipy.linalg import expm, solve_continuous_are

from build import DESIGNS, PACKAGE
from fmu_src.controller.design import FILE_NAMES, Design, design, problem, store, stored
from fmu_src.controller.fullcar import FullCar
from fmu_src.controller.halfcar import HalfCar, half_car_state, strut_forces
from fmu_src.controller.law import ControlParameters, control_law, control_parameters
from fmu_src.controller.lqr_controller import LqrController
from fmu_src.controller.riccati import exponentials, finite_horizon, infinite_horizon, riccati_rate
from fmu_src.quantities import ParameterError
from fmu_src.vehicle.linear import linearized
from fmu_src.vehicle.parameters import Car

Array = np.ndarray[Any, Any]


@pytest.fixture(scope="module")
def matrices() -> tuple[Array, Array, Array, Array]:
    h = HalfCar()
    return np.array(h.A), np.array(h.B), np.array(h.Q), np.array(h.R)


@pytest.fixture(scope="module")
def default_design() -> Design:
    return design(HalfCar(), infinite=True, span=float("inf"))


def test_scalar_lqr_has_its_closed_form() -> None:
    """x' = a x + u, q = r = 1: L = a + w, and L(s) = sinh ws / (w cosh ws − a sinh ws), with w = √(a² + 1)."""
    a, s = 0.7, np.linspace(0, 3, 61)
    A, B, Q, R = (np.array([[x]]) for x in (a, 1.0, 1.0, 1.0))
    w = np.sqrt(a**2 + 1)
    assert_allclose(infinite_horizon(A, B, Q, R)[0], [[a + w]], rtol=1e-12)
    expected = np.sinh(w * s) / (w * np.cosh(w * s) - a * np.sinh(w * s))
    assert_allclose(finite_horizon(A, B, Q, R, s)[:, 0, 0], expected, rtol=1e-10, atol=1e-12)


def test_exponentials_are_those_of_scipy_and_have_their_closed_forms() -> None:
    """exp of a turn by w with decay, of a nilpotent, of 0, and of a full car's flow over [0, 2 s]; scaled or not."""
    for w in (0.0, 1e-3, 1.0, 40.0):
        J, t = np.array([[-0.3, w], [-w, -0.3]]), np.linspace(0.0, 3.0, 7)
        c, s = np.exp(-0.3 * t) * np.cos(w * t), np.exp(-0.3 * t) * np.sin(w * t)
        expected = np.moveaxis(np.array([[c, s], [-s, c]]), 2, 0)
        assert_allclose(exponentials(J * t[:, None, None]), expected, rtol=0, atol=1e-13)
    N = np.diag([2.0, 3.0], k=1)
    assert_allclose(exponentials(N[None])[0], np.eye(3) + N + N @ N / 2, rtol=0, atol=1e-15)
    assert_allclose(exponentials(np.zeros((2, 3, 3))), np.broadcast_to(np.eye(3), (2, 3, 3)), rtol=0, atol=1e-15)
    A, B, Q, R, _ = problem(FullCar())
    closed = A + B @ infinite_horizon(A, B, Q, R)[1]
    for reach in (1e-3, 0.1, 2.0):
        X = closed * np.linspace(0.0, reach, 18)[:, None, None]
        assert np.abs(exponentials(X) - expm(X)).max() < 1e-11 * np.abs(expm(X)).max()


def test_algebraic_riccati_residual_vanishes_and_scipy_agrees(matrices: tuple[Array, Array, Array, Array]) -> None:
    L, K = infinite_horizon(*matrices)
    A, B, Q, R = matrices
    assert np.abs(riccati_rate(L, *matrices)).max() < 1e-9 * np.abs(Q).max()
    assert_allclose(L, solve_continuous_are(A, B, Q, R), rtol=1e-7, atol=1e-7 * np.abs(L).max())
    assert_allclose(K, -np.linalg.solve(R, B.T @ L), rtol=1e-9)
    assert np.linalg.eigvals(A + B @ K).real.max() < np.linalg.eigvals(A).real.max() < 0


def test_finite_horizon_agrees_with_the_hamiltonian_exponential(matrices: tuple[Array, Array, Array, Array]) -> None:
    """L(s) = P X⁻¹ from [X; P]' along the Hamiltonian flow: a second way to (4.7), by doubling exact steps."""
    A, B, Q, R = matrices
    S = B @ np.linalg.solve(R, B.T)
    to_go = np.linspace(0, 2.5, 101)
    L = finite_horizon(*matrices, to_go)
    flow = expm(np.block([[-A, S], [Q, A.T]]) * to_go[1])
    expected = np.zeros((4, 4))
    for k, each in enumerate(L):
        if k:
            X, P = np.split(flow @ np.vstack([np.eye(4), expected]), 2)
            expected = P @ np.linalg.inv(X)
        assert_allclose(each, expected, rtol=1e-8, atol=1e-9 * np.abs(L[-1]).max())
        assert_allclose(each, each.T)
        assert np.linalg.eigvalsh(each).min() > -1e-9 * np.abs(each).max() - 1e-12


def test_finite_horizon_tends_to_the_infinite_one(matrices: tuple[Array, Array, Array, Array]) -> None:
    L, _ = infinite_horizon(*matrices)
    assert_allclose(finite_horizon(*matrices, np.array([0.0, 8.0]))[-1], L, rtol=1e-6, atol=1e-6 * np.abs(L).max())


def test_the_half_car_is_the_car_without_wheels(matrices: tuple[Array, Array, Array, Array]) -> None:
    """With stiff, light wheels the car's slow heave and pitch poles are those of (4.1) as corrected."""
    light = Car(m11=1e-3, m12=1e-3, m21=1e-3, m22=1e-3, m2=0.0, J2=1e-3, cp1=1e9, cp2=1e9)
    poles = np.linalg.eigvals(linearized(light).A)
    for pole in np.linalg.eigvals(matrices[0]):
        assert np.abs(poles - pole).min() < 1e-3 * abs(pole)


def test_control_signs_agree_with_the_car(matrices: tuple[Array, Array, Array, Array]) -> None:
    """B u of (4.1), turned into strut forces, accelerates the body of the car as it does the half car."""
    B, Bu = matrices[1], np.array(linearized(Car()).Bu)
    for u in ([1.0, 0.0], [0.0, 1.0], [2.0, -3.0]):
        force = Bu[7:] @ strut_forces(u)
        assert_allclose(half_car_state(0, 0, force[0], force[2])[2:], (B @ u)[2:], rtol=1e-12)
        assert_allclose(force[1], 0, atol=1e-15)


def test_gains_between_table_entries_are_right(
    default_design: Design, matrices: tuple[Array, Array, Array, Array]
) -> None:
    assert default_design.finite is not None
    s = np.random.default_rng(3).uniform(0, 4.0, 200)
    s.sort()
    L = finite_horizon(*matrices, np.array([0.0, *s]))[1:]
    expected = np.array([(-matrices[1].T @ each).ravel() for each in L])
    got = np.array([default_design.finite.gain(x) for x in s])
    assert np.abs(got - expected).max() < 3e-8 * np.abs(expected).max()


def test_a_stored_design_is_read_back_bit_for_bit(default_design: Design, tmp_path: Path) -> None:
    assert stored(store(default_design, tmp_path)) == default_design
    assert default_design.serves(HalfCar(), "finite", 1e6)
    assert not design(HalfCar(), infinite=False, span=1.0).serves(HalfCar(), "finite", 1.1)
    assert not default_design.serves(HalfCar(lam=1e9), "infinite", 1.0)


def test_control_acts_from_the_come_down_of_the_last_wheel_to_T(default_design: Design) -> None:
    x = [0.01] * 14
    whole = FullCar()
    full = control_law(ControlParameters(model=whole, tau0=0.02), design(whole, infinite=False, span=2.0))
    assert full(0.319, x) == full(2.3, x) == (0.0, 0.0, 0.0, 0.0) != full(2.29, x)
    law = control_law(ControlParameters(tau0=0.02), default_design)
    assert law(0.319, x) == law(2.3, x) == (0.0, 0.0, 0.0, 0.0)
    assert law(0.32 - 1e-12, x) != (0.0, 0.0, 0.0, 0.0) != law(2.299, x)
    assert ControlParameters(tau0=-0.02).begin == pytest.approx(0.30)
    assert ControlParameters(activation="at t_on", t_on=1.0).begin == 1.0
    assert control_law(ControlParameters(enabled=False), None)(1.0, x) == (0.0, 0.0, 0.0, 0.0)


def test_finite_and_infinite_laws_differ_only_near_the_end(default_design: Design) -> None:
    x = np.random.default_rng(5).normal(size=14).tolist()
    finite, infinite = (control_law(ControlParameters(horizon=h), default_design) for h in ("finite", "infinite"))
    assert_allclose(finite(0.4, x), infinite(0.4, x), rtol=1e-3)
    assert np.abs(np.array(finite(2.29, x))).max() < 0.1 * np.abs(np.array(infinite(2.29, x))).max()


def test_the_gain_at_a_time_is_that_of_the_time_to_go(
    default_design: Design, matrices: tuple[Array, Array, Array, Array]
) -> None:
    """u(t) = −R⁻¹ Bᵀ L(T − t) x shortly before T, where the gain changes the most."""
    x, T = np.random.default_rng(6).normal(size=14).tolist(), 1.7
    law = control_law(ControlParameters(T=T), default_design)
    seen = half_car_state(x[0], x[2], x[7], x[9])
    for left in (0.02, 0.07, 0.15):
        L = finite_horizon(*matrices, np.array([0.0, left]))[-1]
        assert_allclose(law(T - left, x), strut_forces((-matrices[1].T @ L @ seen).tolist()), rtol=1e-5)


def test_the_weights_of_the_half_car_are_those_of_its_cost() -> None:
    car = HalfCar(lam=3e9, H1=1.7)
    assert_allclose(car.Q, 3e9 * np.diag([1.0, 1.7**2, 0.0, 0.0]))
    assert_allclose(car.R, np.eye(2))


@pytest.mark.parametrize(
    ("parameters", "said"),
    [({"T": 0.1}, "end of control after its start"), ({"lambda": -1.0}, "lambda = -1.0"), ({"v0": 0.0}, "v0 = 0.0")],
)
def test_the_slave_refuses_bad_parameters_by_name(parameters: dict[str, float], said: str) -> None:
    slave = LqrController(instance_name="controller", resources="")
    for name, value in parameters.items():
        slave.p[slave.reals.index(name)] = value
    with pytest.raises(RuntimeError, match=said):
        slave.exit_initialization_mode()


@pytest.fixture(scope="module")
def folder(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return Path(extract(dist / "LqrController.fmu", tmp_path_factory.mktemp("controller")))


@pytest.mark.parametrize(
    ("T", "horizon", "t", "status"),
    [
        (0.302, "finite", 0.295, DISCARD),  # over all of the control, from 0.3 s on
        (0.302, "finite", 0.3, DISCARD),
        (0.302, "finite", 0.28, OK),  # does not meet it
        (0.302, "finite", 0.31, OK),
        (0.31, "finite", 0.3, OK),  # just one step
        (0.302, "infinite", 0.295, OK),
    ],
)
def test_a_step_longer_than_the_whole_control_is_refused_and_a_shorter_one_is_not(
    folder: Path, T: float, horizon: str, t: float, status: int
) -> None:
    control = ControlParameters(tau0=0.0, T=T, horizon=horizon)
    assert bool(control.fault_of_step(t, 0.01)) is (status == DISCARD)
    assert not replace(control, enabled=False).fault_of_step(t, 0.01)
    host = Host(folder)
    assert host.set({"tau0": 0.0, "T": T}) == host.set_string(host.reference["horizon"], horizon) == OK
    assert host.start(0.28) == OK
    for k in range(round((t - 0.28) / 0.001)):
        assert host.step(0.28 + 0.001 * k, 0.001) == OK
    assert host.step(t, 0.01) == status
    if status == DISCARD:
        assert "T = 0.302 s: wanted at least a step of 0.01 s of control, got 0.002 s from 0.3 s on" in str(host.log)
        assert host.step(t, 0.002) == OK
    host.free()


@pytest.mark.parametrize(
    ("step", "status"),
    [
        (0.15, DISCARD),  # samples at 0, 0.3 and 0.6 s, of 0, 0.24 and 0.48 s; control from 0.32 to 0.49 s
        (0.12, OK),  # a sample at 0.48 s
    ],
)
def test_a_step_that_ends_control_before_a_sample_of_it_was_taken_is_refused_and_a_shorter_one_is_not(
    folder: Path, step: float, status: int
) -> None:
    parameters = {"tau0": 0.02, "T": 0.49, "sample_time": 0.24}
    host = Host(folder)
    assert host.set(parameters) == OK
    assert host.start() == OK
    assert host.set(dict.fromkeys(host.inputs, 0.01)) == OK
    t = 0.0
    while t + step < 0.49:
        assert host.step(t, step) == OK
        t += step
    acted = any(host.get())
    assert host.step(t, step) == status
    assert acted is (status == OK)
    if status == DISCARD:
        said = "T = 0.49 s, sample_time = 0.24 s: wanted a sample within the control from 0.32 s on, got one at 0.3 s"
        assert f"{said} and the next at 0.6 s" in str(host.log)
        assert host.step(t, 0.03) == OK
        assert any(host.get())
        assert host.step(t + 0.03, step) == OK
    assert not any(host.get())
    host.free()


@pytest.mark.parametrize(
    ("changes", "t", "step", "last", "refused"),
    [
        ({}, 0.45, 0.15, 0.3, True),
        ({}, 0.45, 0.15, 0.32 - 1e-12, False),  # one at the begin is one of control
        ({}, 0.45, 0.04, 0.3, True),  # to T itself, where control is over
        ({}, 0.45, 0.03, 0.3, False),  # not to its end
        ({}, 0.49, 0.15, 0.3, False),  # control is over
        ({"enabled": False}, 0.45, 0.15, 0.3, False),
        ({"sample_time": 0.0}, 0.45, 0.15, 0.0, False),
        ({"horizon": "infinite"}, 0.45, 0.15, 0.3, False),
    ],
)
def test_which_steps_end_a_control_without_a_sample(
    changes: dict[str, Any], t: float, step: float, last: float, refused: bool
) -> None:
    control = control_parameters({"tau0": 0.02, "T": 0.49, "sample_time": 0.24, **changes})
    assert bool(control.fault_of_samples(t, step, last)) is refused


@pytest.mark.parametrize(
    ("parameters", "start", "said"),
    [
        (
            {"T": 0.39, "sample_time": 0.1},
            0.0,
            r"T = 0\.39 s, sample_time = 0\.1 s: .* sample .* from 0\.32 s on, .* at 0\.4 s",
        ),
        ({"T": 0.4, "sample_time": 0.1}, 0.0, "the first at 0.4 s"),
        ({"T": 0.41, "sample_time": 0.1}, 0.0, None),
        ({"T": 0.39, "sample_time": 0.1}, 0.35, None),  # the run's first sample is one of control
        ({"T": 0.9}, 0.9, r"T = 0\.9 s: wanted an end of control after the start of the run at 0\.9 s"),
        ({"T": 0.9}, 1.0, "after the start of the run at 1 s"),
        ({"T": 0.9}, 0.8, None),
        ({"T": 0.9, "enabled": False}, 1.0, None),
        ({"T": 0.9, "horizon": "infinite", "sample_time": 0.7}, 1.0, None),
    ],
)
def test_a_run_in_which_control_would_never_act_is_refused(
    folder: Path, parameters: dict[str, Any], start: float, said: str | None
) -> None:
    host = Host(folder)
    for name, value in {"tau0": 0.02, **parameters}.items():
        if isinstance(value, str):
            assert host.set_string(host.reference[name], value) == OK
        elif isinstance(value, bool):
            assert host.set_boolean(host.reference[name], value) == OK
        else:
            assert host.set({name: value}) == OK
    fault = control_parameters({"tau0": 0.02, **parameters}).fault_of_start(start)
    assert (host.start(start) == OK) is (said is None) is (fault is None)
    if said:
        assert re.search(said, str(fault))
        assert str(fault) in str(host.log)
    host.free()


def test_a_design_that_needs_missing_packages_says_what_to_install() -> None:
    """In a Python that cannot import numpy, the stored design works and another one is refused with the remedy."""
    code = (
        "import sys; sys.modules['numpy'] = None\n"
        "from fmu_src.controller.lqr_controller import LqrController\n"
        "c = LqrController(instance_name='c', resources='')\n"
        "try: c.exit_initialization_mode()\n"
        "except RuntimeError as refusal: print(refusal)\n"
    )
    said = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "not installed: numpy" in said
    assert "Install numpy and scipy" in said


@pytest.mark.parametrize("car", [HalfCar(lam=3e10), FullCar(lam=3e10, lambda_tyre=1e9)])
def test_the_gain_of_the_infinite_horizon_is_that_of_python_control(car: HalfCar | FullCar) -> None:
    A, B, Q, R, _ = problem(car)
    L, K = infinite_horizon(A, B, Q, R)
    gain, solution, poles = control.lqr(A, B, Q, R)
    assert_allclose(K, -gain, rtol=0, atol=1e-9 * np.abs(gain).max())
    assert_allclose(L, solution, rtol=0, atol=1e-9 * np.abs(L).max())
    assert_allclose(np.sort_complex(np.linalg.eigvals(A + B @ K)), np.sort_complex(poles), rtol=1e-6)


def test_a_design_of_14_states_takes_well_under_a_second_with_as_many_threads_as_a_host_lets_blas_have() -> None:
    """Measured, two cores, mostly busy: 0.3 s of CPU time in a fresh process, of which 0.25 s imports, then 0.04 to
    0.05 s each; exponentials in BLAS calls of their own made that 0.10 to 0.20 s. python-control would bring 0.9 s."""
    code = (
        "import sys, time\nfrom fmu_src.controller.design import design\n"
        "from fmu_src.controller.fullcar import FullCar\n"
        "def made(k): design(FullCar(lam=2e10 + k), infinite=True, span=2.0)\n"
        "made(0)\nfirst = time.process_time()\n"
        "for k in range(1, 21): made(k)\n"
        "print([m for m in ('control', 'scipy.signal', 'scipy.integrate') if m in sys.modules])\n"
        "print(first, (time.process_time() - first) / 20)\n"
    )
    host = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    command = [sys.executable, "-c", code]
    imported, seconds = subprocess.run(
        command, cwd=ROOT, env=host, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert imported == "[]"
    first, each = map(float, seconds.split())
    assert first < 1.0
    assert each < 0.075


@pytest.mark.parametrize("car", [HalfCar(), FullCar()])
def test_a_fresh_design_of_a_default_car_is_the_one_among_the_sources(car: HalfCar | FullCar) -> None:
    kept, fresh = stored(PACKAGE / DESIGNS / FILE_NAMES[type(car)]), design(car, infinite=True, span=float("inf"))
    renew = "renew it: python -c 'import build; build.renew_designs()'"
    assert kept is not None and kept.car == fresh.car, renew
    assert kept.finite is not None and fresh.finite is not None
    assert kept.finite.settled == fresh.finite.settled and len(kept.finite.edges) == len(fresh.finite.edges), renew
    pairs = [(kept.infinite, fresh.infinite), (kept.finite.edges, fresh.finite.edges)]
    for old, new in [*pairs, (kept.finite.coefficients, fresh.finite.coefficients)]:
        a, b = np.array(old), np.array(new)
        assert np.abs(a - b).max() < 1e-10 * np.abs(b).max(), renew


@pytest.mark.parametrize("car", [HalfCar(), FullCar()])
def test_the_shipped_designs_are_those_of_the_default_parameters(dist: Path, car: HalfCar | FullCar) -> None:
    with zipfile.ZipFile(dist / "LqrController.fmu") as archive:
        shipped = Design.of(json.loads(archive.read(f"resources/{FILE_NAMES[type(car)]}")))
    assert shipped.car == car
    assert shipped.finite is not None
    assert shipped.serves(car, "finite", 1e6)
    A, B, Q, R, K0 = problem(car)
    forever = (K0 + infinite_horizon(A, B, Q, R)[1]).ravel()
    assert shipped.infinite is not None
    assert_allclose(shipped.infinite, forever, rtol=1e-9, atol=1e-9 * np.abs(forever).max())
    s = np.linspace(0.0, 1.5, 16)
    expected = [(K0 - np.linalg.solve(R, B.T @ L)).ravel() for L in finite_horizon(A, B, Q, R, s)]
    got = [shipped.finite.gain(x) for x in s]
    assert np.abs(np.array(got) - expected).max() < 3e-8 * np.abs(forever).max()
    assert_allclose(shipped.finite.gain(1e6), forever, atol=3e-8 * np.abs(forever).max())


@pytest.mark.parametrize("lam", [0.0, 1e6, 1e12, 1e14])
def test_the_gain_table_is_as_fine_as_the_control_is_fast(lam: float) -> None:
    car = HalfCar(lam=lam)
    A, B, Q, R = (np.array(M) for M in (car.A, car.B, car.Q, car.R))
    table = design(car, infinite=False, span=1.0).finite
    assert table is not None
    s = np.sort(np.random.default_rng(4).uniform(0, 1.0, 50))
    expected = [(-B.T @ each).ravel() for each in finite_horizon(A, B, Q, R, np.array([0.0, *s]))[1:]]
    got = [table.gain(x) for x in s]
    assert np.abs(np.array(got) - expected).max() <= 1e-7 * np.abs(expected).max()


def test_a_control_too_fast_for_any_table_is_refused_with_the_reason() -> None:
    with pytest.raises(ParameterError, match=r"^lambda = 1e\+300 N2/m2: .* leaves the finite numbers"):
        design(HalfCar(lam=1e300), infinite=False, span=10.0)
    with pytest.raises(ParameterError, match=r"^c1 = 1e\+16 N/m: .* no stabilizing solution in double precision"):
        design(HalfCar(c1=1e16), infinite=False, span=2.0)
    with pytest.raises(
        ParameterError, match=r"^b1 = 0\.01 .*lambda = 1\.0 .*: the gain changes .*: wanted a shorter control, or"
    ):
        design(HalfCar(lam=1.0, b1=0.01, b2=0.01), infinite=False, span=1e9)
    undamped = HalfCar(lam=0.0, b1=0.0, b2=0.0)  # L = 0 for ever, but nothing says so
    with pytest.raises(ParameterError, match=r"b1 = 0\.0 N\.s/m.*lambda = 0\.0 .* no stabilizing solution"):
        design(undamped, infinite=False, span=1e5)
    with pytest.raises(ParameterError, match=r"^b1 = 0\.0 .*lambda = 0\.0 .* no stabilizing solution"):
        design(undamped, infinite=True, span=None)
    with pytest.raises(ParameterError, match=r"^b1 = 0\.0 .*lambda = 1e-20 .* no stabilizing solution"):
        design(HalfCar(lam=1e-20, b1=0.0, b2=0.0), infinite=True, span=None)
    with pytest.raises(ParameterError, match=r"^c1 = 1e\+16 N/m: .* no stabilizing solution in double precision"):
        design(HalfCar(c1=1e16), infinite=True, span=None)


@pytest.mark.parametrize(
    "car",
    [
        FullCar(car=Car(b1=0.0, b2=0.0), H2=0.0),  # roll
        HalfCar(a=1.25, b=1.25, c1=15e3, c2=15e3, b1=0.0, b2=0.0, H1=0.0),  # pitch
    ],
)
@pytest.mark.parametrize("infinite", [True, False])
def test_an_undamped_mode_that_costs_nothing_is_on_the_axis_and_so_refused(
    car: HalfCar | FullCar, infinite: bool
) -> None:
    """In doubles its poles lie some 1e-10 to the left; in truth nothing moves them."""
    with pytest.raises(ParameterError, match=r"b1 = 0\.0 .* no stabilizing solution"):
        design(car, infinite=infinite, span=None if infinite else 1.0)


def test_a_little_damping_of_such_a_mode_is_enough() -> None:
    made = design(FullCar(car=Car(b1=0.1, b2=0.1), H2=0.0), infinite=True, span=None)
    assert made.infinite is not None


def test_without_weights_a_damped_car_is_left_alone() -> None:
    for car in (HalfCar(lam=0.0), FullCar(lam=0.0)):
        made = design(car, infinite=True, span=1.0)
        assert made.infinite is not None and made.finite is not None
        assert not any(made.infinite)
        assert not any(made.finite.gain(0.5))
