"""The car on its road with nothing rounded: what proofs speak of. Its numbers are the decimals that floats print."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from types import SimpleNamespace
from typing import Any

import numpy as np
from flint import arb, fmpq

from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.linear import linearized, masses
from fmu_src.vehicle.parameters import Car

from ..bertolino_baksa.balls import ExactSystem, decimal
from ..bertolino_baksa.norms import Norm, euclid, weighted_sup
from ..car import car_equations
from ..methods.polynomials import Array

LEAST = 1e-3


def exact_car(car: Car) -> Any:
    """The car's parameters as balls around the decimals that they print."""
    return SimpleNamespace(**{f.name: arb(decimal(getattr(car, f.name))) for f in fields(Car)})


def exact_system(car: Car, road: RoadParameters, gain: Array | None = None) -> ExactSystem:
    """x' = F(x, w): the car of `car.car_form` with its four wheels on the road from t = 0 on."""
    delays = _delays(road)
    half = decimal(road.Lambda) / (2 * decimal(road.v0))  # half a wave; π/Ω
    length = {"bump": half, "flat": fmpq(0)}.get(road.profile)  # [s]; None: without end
    met = [None if d is None else (d, None if length is None else d + length) for d in delays]
    corners = sorted({fmpq(0), *(t for span in met for t in span or () if t is not None and t > 0)})
    shape = _shape(road, half)
    pieces = tuple((begin, _under_wheels(shape, [_since(span, begin) for span in met])) for begin in corners)
    period = 2 * half if road.profile in ("sine", "fourier", "step") else fmpq(0)
    return ExactSystem(14, 8, car_equations(exact_car(car), gain), pieces, period)


def _delays(road: RoadParameters) -> list[fmpq | None]:
    """Exact times at which the wheels fl, fr, rl, rr meet the profile; None for a wheel that meets none."""
    start, tau0 = decimal(road.t_start), decimal(road.tau0)
    rear = start + (decimal(road.a) + decimal(road.b)) / decimal(road.v0)
    met = (start, start + tau0, rear, rear + tau0)
    return [d if on else None for d, on in zip(met, road.excited, strict=True)]


def _shape(road: RoadParameters, half: fmpq) -> Callable[[Any], tuple[Any, Any]]:
    """Height and rate of the profile at the time since a wheel met it."""
    if road.profile == "step":
        return lambda s: (arb(decimal(road.A)), arb(0))
    amplitudes = road.amplitudes if road.profile == "fourier" else (road.A,)
    waves = [(arb(decimal(A)), nu * arb.pi() / half) for nu, A in enumerate(amplitudes, start=1) if A]

    def shape(s: Any) -> tuple[Any, Any]:
        height, rate = arb(0), arb(0)
        for A, omega in waves:
            sin, cos = (s * omega).sin_cos()
            height, rate = height + sin * A, rate + cos * (A * omega)
        return height, rate

    return shape


def _since(span: tuple[fmpq, fmpq | None] | None, t: fmpq) -> fmpq | None:
    """When a wheel met the profile that is under it just after t, between these times; None where there is none."""
    if span is None:
        return None
    begin, end = span
    return begin if begin <= t and (end is None or t < end) else None


def _under_wheels(shape: Callable[[Any], tuple[Any, Any]], since: list[fmpq | None]) -> Callable[[Any], Any]:
    def w(t: Any) -> list[Any]:
        pairs = [(arb(0), arb(0)) if d is None else shape(t - arb(d)) for d in since]
        return [h for h, _ in pairs] + [dh for _, dh in pairs]

    return w


def energy_norm(car: Car) -> Norm:
    """√(½ q̇ᵀ M q̇ + ½ qᵀ K q) [√J], the linear car's energy; its factors rounded to doubles, which then define it."""
    M, linear = np.array(masses(car)), linearized(car)
    K = -np.array(linear.A)[7:, :7] * M[:, None]
    T = np.zeros((14, 14))
    T[:7, :7] = np.linalg.cholesky((K + K.T) / 4.0).T
    T[7:, 7:] = np.diag(np.sqrt(M / 2.0))
    return Norm("energy", T)


def norms(car: Car, x_lin: Array) -> tuple[Norm, ...]:
    """The norms of a statement: energy [√J]; each state over its largest value in x_lin (14, …) [1]; Euclid [SI].

    States that (nearly) rest in x_lin are taken over LEAST of what its energy could make of them; where all of it
    rests, an energy of 1 J.
    """
    energy = energy_norm(car)
    could = np.linalg.norm(np.linalg.inv(energy.T), axis=1) * (energy(x_lin).max() or 1.0)
    weights = np.maximum(np.abs(x_lin).max(axis=1), LEAST * could)
    return energy, weighted_sup(weights), euclid(14)
