"""The half car of (4.1) as a regulator, corrected and as printed, and its motion over the bump, (4.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fmu_src.controller.halfcar import HalfCar
from fmu_src.road.profiles import RoadParameters

from ..car import road_signal
from ..methods.linear_response import linear_response
from ..methods.polynomials import Array
from ..methods.signals import Piece, Signal
from .regulator import Regulator

FRONT, REAR = 0, 2  # wheels of the left side, under which the half car runs


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """x' = A x + B u + E w, w = (z_A, z_B, ż_A, ż_B) the road under front and rear; E w is C(t) of (4.1)."""

    name: str
    A: Array
    B: Array
    E: Array

    def regulator(self, car: HalfCar) -> Regulator:
        """With the weights of this half car."""
        return Regulator(self.A, self.B, np.array(car.Q), np.array(car.R))


def corrected(car: HalfCar) -> Model:
    """(4.1) as energy has it."""
    return Model("corrected", np.array(car.A), np.array(car.B), excitation(car))


def printed(car: HalfCar) -> Model:
    """(4.1) as printed; a saddle, whose two controls push the same way."""
    from ..audit.section4 import A_PRINTED, B_PRINTED, SYMBOLS

    values = (car.m, car.Jy, car.a, car.b, 2 * car.c1, 2 * car.c2, 2 * car.b1, 2 * car.b2)
    put = dict(zip(SYMBOLS, values, strict=True))
    A, B = (np.array(matrix.subs(put).tolist(), dtype=float) for matrix in (A_PRINTED, B_PRINTED))
    return Model("as printed", A, B, excitation(car))


def printed_control(car: HalfCar) -> Model:
    """A of (4.1) corrected, B as printed: what the misprint in B alone costs."""
    return Model("A corrected, B as printed", np.array(car.A), printed(car).B, excitation(car))


def excitation(car: HalfCar) -> Array:
    """E (4, 4); C(t) of (4.1) is right as printed."""
    m, J, a, b = car.m, car.Jy, car.a, car.b
    c1, c2, b1, b2 = 2 * car.c1, 2 * car.c2, 2 * car.b1, 2 * car.b2
    heave, pitch = (c1, c2, b1, b2), (a * c1, -b * c2, a * b1, -b * b2)
    return np.array([np.zeros(4), np.zeros(4), np.divide(heave, m), np.divide(pitch, J)])


def axle_road(road: RoadParameters) -> Signal:
    """w under the left wheels; its pieces begin at t_A1, t_A2, t_B1, t_B2."""
    rows = [FRONT, REAR, 4 + FRONT, 4 + REAR]
    both_sides = road_signal(replace(road, tau0=0.0))  # at the same time: the half car knows no other
    return Signal(tuple(Piece(p.begin, p.exponents, p.amplitudes[rows]) for p in both_sides.pieces))


def come_down(road: RoadParameters) -> float:
    """t_B2 [s], when the rear wheels have come down."""
    return road.delays[REAR] + road.shape().end


def over_the_bump(model: Model, road: RoadParameters, t: Array) -> Array:
    """x (4, k) at the times t (k,) without control, from rest before the bump: exact."""
    return linear_response(model.A, model.E, np.zeros(4), axle_road(road), t)
