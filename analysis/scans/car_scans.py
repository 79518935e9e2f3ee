"""One design parameter of car or drive varied, all else kept: what scans over resonances and energies go through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import HARMONICS

from ..car import car_form, road_signal
from ..errors import InputError
from ..methods.signals import Piece, Signal
from ..methods.standard_form import StandardForm
from ..reference import Parameters, car_of, road_parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """A parameter by its value [unit] in a set of parameters, and the set with another value."""

    text: str
    unit: str
    value: Callable[[Parameters], float]
    changed: Callable[[Parameters, float], Parameters]


def _real(p: Parameters, name: str) -> float:
    return float(p.get(name, PARAMETERS[name].start))


def _other_balance(p: Parameters, ratio: float) -> Parameters:
    """Another b/a on the same wheelbase."""
    wheelbase = _real(p, "a") + _real(p, "b")
    a = wheelbase / (1.0 + ratio)
    return {**p, "a": a, "b": wheelbase - a}


VARIATIONS = {
    "speed": Variation(text="speed", unit="m/s", value=lambda p: _real(p, "v0"), changed=lambda p, v: {**p, "v0": v}),
    "c2/c1": Variation(
        text="rear over front strut stiffness, c1 kept",
        unit="1",
        value=lambda p: _real(p, "c2") / _real(p, "c1"),
        changed=lambda p, v: {**p, "c2": v * _real(p, "c1")},
    ),
    "Jy": Variation(
        text="pitch inertia", unit="kg m²", value=lambda p: _real(p, "Jy"), changed=lambda p, v: {**p, "Jy": v}
    ),
    "b/a": Variation(
        text="centre of gravity to rear over front axle, wheelbase kept",
        unit="1",
        value=lambda p: _real(p, "b") / _real(p, "a"),
        changed=_other_balance,
    ),
}


def variation(name: str) -> Variation:
    """One of VARIATIONS. Raises InputError for a name that is none."""
    if name not in VARIATIONS:
        raise InputError(f"--scan {name}: wanted one of {', '.join(VARIATIONS)}")
    return VARIATIONS[name]


def higher_road(parameters: Parameters, factor: float) -> Parameters:
    """All heights of the road times a factor."""
    heights = {name: factor * _real(parameters, name) for name in ("A", *HARMONICS)}
    return {**parameters, **heights}


def lasting_road(parameters: Parameters) -> Piece | None:
    """The road's waves once all wheels are on it; None if it is flat in the end (bump, step, waves of no height)."""
    road = road_parameters(parameters)
    last = road_signal(road).pieces[-1]
    return last if road.profile in ("sine", "fourier") and np.any(last.amplitudes) else None


def system_of(parameters: Parameters, *, order: int = 3) -> tuple[StandardForm, Signal]:
    """The passive car and its road from t = 0 on."""
    return car_form(car_of(parameters), order=order), road_signal(road_parameters(parameters))
