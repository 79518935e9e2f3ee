"""The car's equations: against the second derivation from the energies, and against the laws they must obey."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, fields, replace
from typing import Any

import lagrangian
import numpy as np
import pytest
import sympy
from numpy.testing import assert_allclose

from fmu_src.quantities import PARAMETERS, ParameterError
from fmu_src.vehicle.equations import equations_of_motion
from fmu_src.vehicle.linear import linearized, masses
from fmu_src.vehicle.parameters import Car

Array = np.ndarray[Any, Any]
FLAT = [0.0] * 4
# left <-> right: z ψ φ z11 z12 z2 ψ2, and the corners fl fr rl rr
MIRROR_Q, MIRROR_CORNERS = [0, 1, 2, 4, 3, 5, 6], [1, 0, 3, 2]
MIRROR_SIGNS = np.array([1, -1, 1, 1, 1, 1, -1])


def random_state(rng: np.random.Generator) -> tuple[Array, Array, Array, Array, Array]:
    """q, q̇, u, h, ḣ far beyond small: angles up to a radian."""
    q = rng.uniform(-1, 1, 7) * [0.3, 1, 1, 0.2, 0.2, 0.2, 1]
    return q, rng.normal(size=7), 500 * rng.normal(size=4), 0.1 * rng.normal(size=4), rng.normal(size=4)


def accelerations(car: Car, q: Array, v: Array, u: Array, h: Array, dh: Array) -> Array:
    return np.array(equations_of_motion(car)(q.tolist(), v.tolist(), u, h, dh)[0])


def test_hand_written_accelerations_are_those_of_the_lagrangian(
    car: Car, lagrange: Callable[..., Any], rng: np.random.Generator
) -> None:
    for _ in range(200):
        q, v, u, h, dh = random_state(rng)
        expected = lagrange(np.concatenate([q, v]), h, dh, u)
        assert_allclose(accelerations(car, q, v, u, h, dh), expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())


def test_power_balance_closes_to_round_off(car: Car, rng: np.random.Generator) -> None:
    """d(T + V)/dt along the hand-written accelerations = road power + actuator power − dissipation."""
    d, power = lagrangian.derive(), lagrangian.power(asdict(car))
    (energy,) = d.energy
    rate = sum(sympy.diff(energy, q) * v for q, v in zip(d.q, d.v, strict=True))
    rate += sum(sympy.diff(energy, v) * a for v, a in zip(d.v, sympy.symbols("a1:8"), strict=True))
    rate += sum(sympy.diff(energy, h) * dh for h, dh in zip(d.h, d.dh, strict=True))
    numbers = {p: asdict(car)[p.name] for p in d.parameters}
    function = sympy.lambdify([*d.q, *d.v, *sympy.symbols("a1:8"), *d.h, *d.dh], rate.subs(numbers))
    for _ in range(50):
        q, v, u, h, dh = random_state(rng)
        road, actuators, lost = power(np.concatenate([q, v]), h, dh, u)
        gained = function(*q, *v, *accelerations(car, q, v, u, h, dh), *h, *dh)
        assert abs(gained - road - actuators + lost) < 1e-12 * (abs(road) + abs(actuators) + abs(lost))


def test_exchanging_left_and_right_mirrors_the_motion(rng: np.random.Generator) -> None:
    car = Car(bp1=90.0, bp2=70.0)
    for _ in range(50):
        q, v, u, h, dh = random_state(rng)
        mirrored = [x[MIRROR_Q] * MIRROR_SIGNS for x in (q, v)] + [x[MIRROR_CORNERS] for x in (u, h, dh)]
        expected = accelerations(car, q, v, u, h, dh)[MIRROR_Q] * MIRROR_SIGNS
        assert_allclose(accelerations(car, *mirrored), expected, rtol=1e-12, atol=1e-9)


def test_the_motion_is_odd(car: Car, rng: np.random.Generator) -> None:
    for _ in range(50):
        state = random_state(rng)
        assert_allclose(accelerations(car, *(-x for x in state)), -accelerations(car, *state), rtol=0, atol=0)


def test_rest_on_a_flat_road_is_exactly_rest(car: Car) -> None:
    accelerations, travels, tyres = equations_of_motion(car)([0.0] * 7, [0.0] * 7, FLAT, FLAT, FLAT)
    assert {*accelerations, *travels, *tyres} == {0.0}


def test_linear_part_is_the_complex_step_derivative(car: Car) -> None:
    motion, L = equations_of_motion(car, np.sin, np.cos), linearized(car)
    step = 1e-30

    def column(index: int) -> Array:
        w = np.zeros(14 + 12, complex)
        w[index] = 1j * step
        return np.imag(motion(w[:7], w[7:14], w[14:18], w[18:22], w[22:])[0]) / step

    whole = np.column_stack([column(i) for i in range(26)])
    assert_allclose(np.hstack([L.A, L.Bu, L.Bh, L.Bdh])[7:], whole, rtol=1e-12, atol=1e-12)
    assert_allclose(np.array(L.A)[:7], np.eye(7, 14, 7))


def test_linear_part_is_that_of_the_lagrangian(car: Car) -> None:
    for ours, theirs in zip(asdict(linearized(car)).values(), lagrangian.linear(asdict(car)), strict=True):
        assert_allclose(ours, theirs, rtol=1e-12, atol=1e-10)


def test_stiffness_and_damping_are_symmetric(car: Car) -> None:
    M, A = np.diag(masses(car)), np.array(linearized(car).A)[7:]
    for block in (M @ A[:, :7], M @ A[:, 7:]):
        assert_allclose(block, block.T, rtol=1e-13, atol=1e-9)
        assert np.linalg.eigvalsh(-block).min() > -1e-9


def test_the_default_car_has_the_modes_of_its_class() -> None:
    """Heave about 1.2 Hz, roll 1.4, pitch 1.5; hop 11 to 12; axle tramp 13 Hz, all well damped."""
    eigenvalues = np.linalg.eigvals(linearized(Car()).A)
    upper = sorted(eigenvalues[eigenvalues.imag > 0], key=abs)
    frequency, damping = np.abs(upper) / (2 * np.pi), [-x.real / abs(x) for x in upper]
    assert_allclose(frequency, [1.20, 1.41, 1.51, 11.15, 11.98, 12.00, 13.03], atol=0.01)
    assert min(damping) > 0.2


def test_strut_and_tyre_outputs_are_the_springs_own(rng: np.random.Generator) -> None:
    """Without dampers and actuators, M q̈ is minus the gradient of ½ Σ c Δ² + ½ Σ N²/cp: a check of Δ and N."""
    car = replace(Car(), b1=0.0, b2=0.0)
    c, cp = np.array([car.c1, car.c1, car.c2, car.c2]), np.array([car.cp1, car.cp1, car.cp2, car.cp2])
    motion = equations_of_motion(car, np.sin, np.cos)
    q, h = 0.3 * rng.normal(size=7), 0.1 * rng.normal(size=4)
    gradient = []
    for i in range(7):
        q_step = q + 1e-30j * np.eye(7)[i]
        _, travel, N = map(np.array, motion(q_step, np.zeros(7), FLAT, h, FLAT))
        gradient.append(np.imag(np.sum(c * travel**2 / 2) + np.sum(N**2 / (2 * cp))) / 1e-30)
    M = np.array(masses(car))
    M[2] += (car.Jz - car.Jy) * np.sin(q[1]) ** 2
    assert_allclose(
        accelerations(car, q, np.zeros(7), np.zeros(4), h, np.zeros(4)) * M, -np.array(gradient), rtol=1e-11
    )


BAD = {"m": 0.0, "m11": -1.0, "Jx": float("nan"), "c1": -5.0, "b2": float("inf"), "s0": -0.1}


@pytest.mark.parametrize("name", [f.name for f in fields(Car)])
def test_every_parameter_refuses_nan_and_minus_infinity(name: str) -> None:
    for bad in (float("nan"), float("-inf"), -1.0):
        with pytest.raises(ParameterError, match=rf"\b{name} = {bad}"):
            Car(**{name: bad})
    assert PARAMETERS[name].fault(PARAMETERS[name].start) is None


def test_all_faults_are_named_at_once() -> None:
    with pytest.raises(ParameterError) as refusal:
        Car(**BAD)
    assert all(f"{name} = {value!r}" in str(refusal.value) for name, value in BAD.items())


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"a": 0.0, "b": 0.0}, "wheelbase"),
        ({"m21": 20.0, "m22": 22.0}, "equal masses"),
        ({"s2": 0.0, "J2": 0.0}, "roll inertia"),
    ],
)
def test_parameters_that_make_no_car_together_are_refused(parameters: dict[str, float], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        Car(**parameters)
