"""The car and its road in the form that the methods work on: the one door through which they enter the analysis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from fractions import Fraction
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_src.quantities import STATES
from fmu_src.road.profiles import SNAP, RoadParameters
from fmu_src.vehicle.equations import equations_of_motion
from fmu_src.vehicle.linear import linearized
from fmu_src.vehicle.parameters import Car

from .methods.polynomials import Array
from .methods.power_series import cos, sin, variables
from .methods.signals import Piece, Signal
from .methods.standard_form import Equations, Function, StandardForm, only, standard_form


def car_form(car: Car, *, gain: Array | None = None, forces: bool = False, order: int = 5) -> StandardForm:
    """The car: states x = (q, q̇) (14), inputs w = (h, ḣ) (8); with a gain (4, 14), under forces u = −gain x.

    forces : whether forces u at the struts are four inputs more, w = (h, ḣ, u) (12); they add to those of a gain.
    """
    return standard_form(car_equations(car, gain), [q.name for q in STATES], 12 if forces else 8, order=order)


def actuators(car: Car) -> Array:
    """B_u (14, 4) of x' = A x + B w + B_u u: what forces u [N] of the actuators do."""
    return np.array(linearized(car).Bu)


def exact_A(car: Car) -> list[list[Fraction]]:
    """A of (3.10), (14, 14), with nothing rounded: the car's numbers are the decimals that floats print."""
    exact = SimpleNamespace(**{name: Fraction(repr(value)) for name, value in asdict(car).items()})
    rates = car_equations(exact, None)(variables(14, 1, Fraction(1)), [0] * 8, sin, cos)
    return [[Fraction(rate.terms.get((j,), 0)) for j in range(14)] for rate in rates]


def without_cubic_stiffness(form: StandardForm) -> StandardForm:
    """The car's form with R̄ and P̄ as §3.2 prints them: cubic only, and no monomials in the coordinates q alone."""
    return only(form, lambda monomial: len(monomial) == 3 and max(monomial) >= 7)


def car_equations(car: Any, gain: Array | None) -> Equations:
    """F(x, w) of a car whose parameters may be any kind of number."""
    rows = [] if gain is None else gain.tolist()

    def equations(x: Sequence[Any], w: Sequence[Any], sine: Function, cosine: Function) -> Sequence[Any]:
        u = list(w[8:]) or [0.0] * 4
        for i, row in enumerate(rows):
            u[i] = sum((xi * -k for k, xi in zip(row, x, strict=True) if k), u[i])
        accelerations, _, _ = equations_of_motion(car, sine, cosine)(x[:7], x[7:], u, w[:4], w[4:8])
        return [*x[7:], *accelerations]

    return equations


def road_signal(road: RoadParameters, begin: float = 0.0) -> Signal:
    """w = (h, ḣ) (8) under the wheels fl, fr, rl, rr from `begin` [s] on, for ever."""
    shape = road.shape()
    delays = [d if on else np.inf for d, on in zip(road.delays, road.excited, strict=True)]
    corners = sorted({d + c for d in delays for c in shape.corners if begin < d + c < np.inf})
    starts = [begin, *(later for earlier, later in pairwise([begin, *corners]) if later - earlier > SNAP)]
    exponents, waves = _harmonics(road)
    pieces = []
    for start in starts:
        phases = np.zeros((4, len(exponents)), complex)
        for wheel, delay in enumerate(delays):
            if delay - SNAP <= start < delay + shape.end - SNAP or (road.profile == "step" and start >= delay - SNAP):
                phases[wheel] = waves * np.exp(exponents * (start - delay))
        pieces.append(Piece(start, exponents, np.concatenate([phases, phases * exponents])))
    return Signal(tuple(pieces))


def _harmonics(road: RoadParameters) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Exponents [1/s] and complex amplitudes [m] of the profile's height over the time since a wheel met it."""
    match road.profile:
        case "step":
            return np.zeros(1, complex), np.array([road.A], complex)
        case "fourier":
            amplitudes = road.amplitudes
        case "bump" | "sine":
            amplitudes = (road.A,)
        case _:
            amplitudes = ()
    nu = np.array([k for k, A in enumerate(amplitudes, start=1) if A])
    half = np.array([A for A in amplitudes if A]) / 2j  # sin = (exp(i·) − exp(−i·))/2i
    omega = 1j * road.omega * nu
    return np.concatenate([omega, -omega]), np.concatenate([half, -half])
