"""Beside each δ(ε) that is proved, how far starts within δ were found to get."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..bertolino_baksa import rows_adversary
from ..bertolino_baksa.adversary import long_enough, reached, reference_floor, slowest
from ..bertolino_baksa.certificate import Certificate, Claim
from ..bertolino_baksa.rows_certificate import RowsCertificate
from ..bertolino_baksa.switched_certificate import SwitchedCertificate
from ..car import car_form, road_signal
from ..methods.polynomials import Array
from ..methods.standard_form import StandardForm
from ..reference import car_of, road_parameters
from .horizon_words import motions_of, reference_floors

FEW_BY_TIME = 8  # starts for each δ, under a gain by time, where motions take longer
COUNT = 5  # of an adversary, spread over the table of δ(ε)


@dataclass(frozen=True, slots=True)
class Points:
    """Rows of a table of δ(ε), and the largest N(x − x_lin) that was found for starts within each δ."""

    claim: Claim
    rows: Array  # (K, 2) of (ε, δ)
    found: Array  # (K,)
    floor: float  # of motions from x_lin(0) itself

    @property
    def ratio(self) -> Array:
        """Certified over found ε (K,)."""
        return np.asarray(self.rows[:, 0] / self.found)

    @property
    def near(self) -> float:
        """The largest ratio for δ up to a third of δ_max."""
        return float(self.ratio[self.rows[:, 1] <= self.claim.largest_delta / 3.0].max(initial=1.0))

    @property
    def words(self) -> str:
        """The ratios in a line."""
        return (
            f"  {self.claim.norm.name} norm: eps is at most {self.near:.4g} times what an adversary reaches from "
            f"starts within delta up to delta_max/3, {self.ratio[-1]:.4g} times at delta_max"
        )


def adversary_points(certificate: Certificate) -> list[Points]:
    """An adversary's answer to each claim; some seconds."""
    form, parameters = _form(certificate), certificate.model["parameters"]
    signal, end = road_signal(road_parameters(parameters)), float(certificate.pieces[-1].end)
    norms = [claim.norm for claim in certificate.claims]
    floors = reference_floor(form, signal, norms, certificate.x0, min(end, long_enough(form, signal)))
    chosen = [_spread(claim) for claim in certificate.claims]
    found = reached(
        form, signal, norms, certificate.x0, [rows[:, 1] for rows in chosen], min(end, signal.edges[-1] + slowest(form))
    )
    return _points(certificate.claims, chosen, found, floors)


def row_points(certificate: RowsCertificate) -> list[Points]:
    """The same on roads of the class, starts along the chords of the rows."""
    form, norms = _form(certificate), [claim.norm for claim in certificate.claims]
    floors = rows_adversary.reached(form, norms, certificate.rows, certificate.x0)
    chosen = [_spread(claim) for claim in certificate.claims]
    deltas = [rows[:, 1] for rows in chosen]
    found = rows_adversary.reached_from(form, norms, certificate.rows, certificate.x0, deltas)
    return _points(certificate.claims, chosen, found, floors)


def horizon_points(certificate: SwitchedCertificate) -> list[Points]:
    """The same under the gain by time."""
    norms = [claim.norm for claim in certificate.claims]
    road = road_signal(road_parameters(certificate.model["parameters"])).edges[-1]
    stop = road + slowest(car_form(car_of(certificate.model["parameters"])))
    floors = reference_floors(certificate.model, norms, float(certificate.pieces[-1].end))
    chosen = [_spread(claim) for claim in certificate.claims]
    found = motions_of(certificate.model, stop).worst(norms, [rows[:, 1] for rows in chosen], FEW_BY_TIME)
    return _points(certificate.claims, chosen, found, floors)


def _form(certificate: Certificate | RowsCertificate) -> StandardForm:
    gain = certificate.model.get("gain")
    return car_form(car_of(certificate.model["parameters"]), gain=None if gain is None else np.array(gain))


def _points(claims: Sequence[Claim], chosen: Sequence[Array], found: Sequence[Array], floors: Array) -> list[Points]:
    return [
        Points(claim, rows, np.maximum(far, floor), floor)
        for claim, rows, far, floor in zip(claims, chosen, found, floors.tolist(), strict=True)
    ]


def _spread(claim: Claim) -> Array:
    """Rows of the table, spread over it, with that of the largest δ up to a third of δ_max among them."""
    third = int(np.searchsorted(claim.table[:, 1], claim.largest_delta / 3.0, side="right")) - 1
    spread = np.linspace(0, len(claim.table) - 1, COUNT).round().astype(int)
    return claim.table[np.unique([*spread, max(third, 0)])]
