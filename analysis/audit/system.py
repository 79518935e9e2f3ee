"""A set of seven equations of motion in numbers: accelerations, matrices at rest, energy, runs over the bump."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from fmu_src.road.profiles import RoadParameters, road
from fmu_src.vehicle.parameters import Car

from ..car import road_signal
from ..derivation import PARAMETERS, derive
from ..methods.linear_response import linear_response
from ..reference import in_stretches
from . import printed_car
from .differences import SIGNS, Difference, derived_equations

Array = NDArray[np.float64]
SAMPLING = 2.5e-4  # s between the times at which maxima are looked for; the fastest mode takes 75 ms, so 1e-4 is missed
SMALL = dict.fromkeys([*derive().q, *derive().v, *derive().a, *derive().h], sp.S.Zero)


@dataclass(frozen=True, slots=True)
class Linear:
    """M q̈ + D q̇ + K q = P h at rest; M (7) is the diagonal, D, K (7, 7), P (7, 4), SI units."""

    M: Array
    D: Array
    K: Array
    P: Array

    @property
    def A(self) -> Array:
        """Of x' = A x, (14, 14)."""
        return np.block([[np.zeros((7, 7)), np.eye(7)], [-self.K / self.M[:, None], -self.D / self.M[:, None]]])

    @property
    def B(self) -> Array:
        """Of x' = A x + B (h, ḣ), (14, 8)."""
        return np.block([[np.zeros((7, 8))], [self.P / self.M[:, None], np.zeros((7, 4))]])


@dataclass(frozen=True)  # no slots: `linear` is kept
class System:
    """Left sides of seven equations of motion, in the coordinates of a convention, for one car; m_z is taken as m2."""

    equations: sp.ImmutableMatrix
    convention: str
    car: Car

    @property
    def sign(self) -> Array:
        """Diagonal (7) that takes the convention's coordinates to those of the derivation."""
        return np.array(SIGNS[self.convention].diagonal().tolist()[0], dtype=float)

    @cached_property
    def linear(self) -> Linear:
        """By complex steps, which are exact."""
        M = np.array(compiled_masses(self.equations)(*_numbers(self.car), self.car.m2), dtype=float)
        q, v, h = np.split(1e-30j * np.eye(18), [7, 14])
        slopes = M[:, None] * np.imag(self.accelerations(q, v, h)) / 1e-30
        K, D, P = np.split(slopes, [7, 14], axis=1)
        return Linear(M, -D, -K, P)

    def accelerations(self, q: Any, v: Any, h: Any) -> Array:
        """q̈ (7, …) at q, v (7, …) and h (4, …)."""
        rows = compiled(self.equations, "numpy")(*_numbers(self.car), self.car.m2, *q, *v, *h)
        return np.stack(np.broadcast_arrays(*rows))

    def over_the_bump(
        self, times: Array, A: float, x0: Array | None = None, *, rtol: float = 1e-11, method: str = "DOP853"
    ) -> Array:
        """States (n, 14) at `times` [s] over the default bump, A [m] high; from rest if x0 is not given."""
        values = [*_numbers(self.car), self.car.m2]
        ground, motion = road(bump(self.car, A)), compiled(self.equations, "math")

        def rate(t: float, x: Array) -> list[float]:
            state = x.tolist()
            return [*state[7:], *motion(*values, *state, *ground.heights(t))]

        start = np.zeros(14) if x0 is None else x0
        atol = 1e-3 * rtol * max(A, 1e-6)
        return in_stretches(rate, ground.corners(times[-1]), start, times, rtol=rtol, atol=atol, method=method)

    def linear_over_the_bump(self, times: Array, A: float) -> Array:
        """x_lin (n, 14) of (2.3), in closed form, from rest."""
        signal = road_signal(bump(self.car, A))
        return linear_response(self.linear.A, self.linear.B, np.zeros(14), signal, times).T


def bump(car: Car, A: float) -> RoadParameters:
    """The default bump, A [m] high, under this car."""
    return RoadParameters(profile="bump", A=A, a=car.a, b=car.b)


def printed(convention: str, car: Car | None = None) -> System:
    """(3.1)–(3.7) as printed."""
    return System(sp.ImmutableMatrix(printed_car.EQUATIONS), convention, car or Car())


def derived(convention: str, car: Car | None = None) -> System:
    """The equations from the energies."""
    return System(sp.ImmutableMatrix(derived_equations(convention)), convention, car or Car())


def planted(difference: Difference, convention: str, car: Car | None = None) -> System:
    """The derived equations with one misprint of the paper put in."""
    equations = sp.Matrix(derived_equations(convention))
    equations[difference.row] += difference.printed - difference.derived
    return System(sp.ImmutableMatrix(equations), convention, car or Car())


def _numbers(car: Car) -> list[float]:
    """In the order of the derivation's parameters."""
    known = asdict(car)
    return [known[name] for name in PARAMETERS]


@cache
def compiled_masses(equations: sp.ImmutableMatrix) -> Any:
    """Function (parameters, m_z) -> coefficients (7) of each equation's own acceleration at rest."""
    masses = [equation.diff(a).xreplace(SMALL) for equation, a in zip(equations, derive().a, strict=True)]
    return sp.lambdify([*derive().parameters, printed_car.m_z], masses)


@cache
def compiled(equations: sp.ImmutableMatrix, numbers: str) -> Any:
    """Function (parameters, m_z, q, v, h) -> q̈ (7) for these left sides; `numbers`: the library, math or numpy."""
    d = derive()
    rest = equations.xreplace(dict.fromkeys(d.a, sp.S.Zero))
    masses = [equation.diff(a) for equation, a in zip(equations, d.a, strict=True)]  # each is linear in its own alone
    accelerations = [-force / mass for force, mass in zip(rest, masses, strict=True)]
    return sp.lambdify([*d.parameters, printed_car.m_z, *d.q, *d.v, *d.h], accelerations, modules=numbers, cse=True)


# ------------------------------------------------------------------ energy
@cache
def _power_balance() -> Any:
    """Function (parameters, q, v, a, h, ḣ) -> (dE/dt, power of the road, dissipation) [W] of the derived car."""
    d = derive()
    (E,) = d.energy
    pairs = [*zip(d.q, d.v, strict=True), *zip(d.v, d.a, strict=True), *zip(d.h, d.dh, strict=True)]
    rate = sum((E.diff(x) * dx for x, dx in pairs), sp.S.Zero)
    road_power, _, dissipation = d.power
    return sp.lambdify([*d.parameters, *d.q, *d.v, *d.a, *d.h, *d.dh], [rate, road_power, dissipation], cse=True)


def power_residual(system: System, q: Array, v: Array, h: Array, dh: Array) -> tuple[Array, Array]:
    """Power that comes from nowhere, dE/dt − road + dissipation, and |road| + dissipation [W], in each column."""
    s = system.sign[:, None]
    a = system.accelerations(q, v, h)
    rate, road_power, lost = _power_balance()(*_numbers(system.car), *(s * q), *(s * v), *(s * a), *h, *dh)
    return rate - road_power + lost, np.abs(road_power) + lost


@cache
def _energy() -> Any:
    d = derive()
    return sp.lambdify([*d.parameters, *d.q, *d.v, *d.h], d.energy[0], cse=True)


def energy(system: System, x: Array) -> Array:
    """T + V [J] (n,) of the states x (n, 14) on the flat road."""
    s = system.sign[:, None]
    return _energy()(*_numbers(system.car), *(s * x.T[:7]), *(s * x.T[7:]), 0.0, 0.0, 0.0, 0.0)
