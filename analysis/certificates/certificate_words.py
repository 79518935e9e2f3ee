"""What a certificate speaks of, in words: its car, road, gain and start, and which norms are those of the house."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fmu_src.quantities import CORNERS, PARAMETERS, STATES
from fmu_src.road.profiles import PROFILE
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.vehicle.vehicle7dof import CAR

from ..bertolino_baksa.balls import NotProvedError
from ..bertolino_baksa.certificate import Claim
from ..bertolino_baksa.norms import Norm
from ..methods.polynomials import Array

SAME = 1e-9  # relative: more than a library of linear algebra changes, less than is seen in print
DEFAULTS = {
    **{name: q.start for name, q in PARAMETERS.items()},
    PROFILE.name: PROFILE.start,
    **dict.fromkeys(RoadExcitation.switches, True),
}


def named_by_content(claims: Sequence[Claim], ours: Sequence[Norm]) -> tuple[Claim, ...]:
    """The claims with a norm's name left to it only if it is our norm of that name."""
    return tuple(
        claim
        if any(_same(claim.norm, norm) for norm in ours)
        else replace(claim, norm=replace(claim.norm, name=f"#{number} (the file's own)"))
        for number, claim in enumerate(claims, start=1)
    )


def _same(one: Norm, other: Norm) -> bool:
    off = np.abs(one.T - other.T).max(axis=1) / np.abs(other.T).max(axis=1)
    return (one.name, one.largest) == (other.name, other.largest) and bool(off.max() <= SAME)


def refuse_exceeded(claim: Claim, reached: float) -> None:
    """Raise NotProvedError where a motion that was integrated goes beyond the floor that is claimed of all."""
    if reached > claim.floor:
        raise NotProvedError(
            f"{claim.norm.name} norm: l = {claim.floor!r}, but a motion that was integrated, apart from the proof, "
            f"reaches {reached!r}: there is a fault in the one or the other"
        )


def model_words(model: Mapping[str, Any], *, road: bool = True) -> list[str]:
    """The profile, unless claims are of many roads, what differs from the default, and what controls the car."""
    given = model["parameters"]
    said = {PROFILE.name: given.get(PROFILE.name, PROFILE.start)}
    if said[PROFILE.name] in ("bump", "sine", "step"):
        said["A"] = given.get("A", DEFAULTS["A"])
    said |= {name: value for name, value in given.items() if value != DEFAULTS[name]}
    if not road:
        said = {name: value for name, value in said.items() if name in CAR}
    off = ", ".join(f"{name} = {number(value)}{_unit(name)}" for name, value in said.items())
    lines = [f"  {'car and road' if road else 'car'}: {f'{off}; the rest is the default' if off else 'the default'}"]
    if "gain" not in model:
        return [*lines, "  without control"]
    rows = zip(CORNERS, model["gain"], strict=True)
    gains = [f"    u_{corner} = {_force(row)}" for corner, row in rows]
    return [*lines, "  controlled at every instant t >= 0 by the forces [N] at the struts, x in SI units:", *gains]


def _force(row: Sequence[float]) -> str:
    """−row · x, by the names of the states."""
    terms = " ".join(
        f"{'-' if k > 0.0 else '+'} {number(abs(k))} {q.name}" for k, q in zip(row, STATES, strict=True) if k
    )
    return terms or "0"


def start_words(x0: Array) -> str:
    """x(0) = x0."""
    off = [f"{q.name} = {number(v)} {q.unit}" for q, v in zip(STATES, x0.tolist(), strict=True) if v]
    return f"from {', '.join(off)}" if off else "from rest"


def number(value: float | str | bool) -> str:
    """The value, short where that is exact."""
    return f"{value:g}" if isinstance(value, float) and float(f"{value:g}") == value else str(value)


def _unit(name: str) -> str:
    return f" {PARAMETERS[name].unit}" if name in PARAMETERS else ""
