"""`python -m analysis certify SCENARIO --sampled ROAD.csv --road-class CLASS`: all roads of a class through rows."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from fmu_src.quantities import STATES

from ..bertolino_baksa.balls import Array, NotProvedError
from ..bertolino_baksa.certificate import motion
from ..bertolino_baksa.input_rows import InputRows
from ..bertolino_baksa.norms import Norm
from ..bertolino_baksa.proof import Proof
from ..bertolino_baksa.rows_adversary import reached
from ..bertolino_baksa.rows_certificate import RowsCertificate, certify, to_json
from ..car import car_form
from ..errors import InputError
from ..files import write_whole
from ..reference import Parameters, car_of
from .adversary_points import row_points
from .car_bounded_roads import flat
from .car_certificates import build, metric_of
from .certificate_figures import draw_delta
from .certificate_words import model_words, named_by_content, start_words
from .closed_loop_certificate import infinite_gain
from .directed import at_most
from .exact_car import norms
from .exported import read_heights
from .motion_words import along, claim_words
from .unknown_roads import road_class


def command(parameters: Parameters, road: Path, roads: str, where: Path | None, closed: bool) -> int:
    """Certify x_lin from rest on every road of the class through the file's heights; 0, or 1 if nothing is proved.

    closed : whether the controller's constant gain acts at every instant.

    Raises InputError for a file that holds no road, and for an unknown class.
    """
    if roads == "exact":
        raise InputError(f"--road-class {roads}: wanted curv:H2 [m/s^2] or lip:H1 [m/s]")
    rows = InputRows(*read_heights(road), road_class(roads))
    gain = infinite_gain(parameters) if closed else None
    print(f"Finding and proving a motion to t = {rows.times[-1]:g} s ...", file=sys.stderr, flush=True)
    try:
        certificate, proof = certify_rows(parameters, rows, gain)
        lines = statement(certificate, proof)
    except NotProvedError as error:
        print(f"no certificate of all these roads: {error}")
        return 1
    points = row_points(certificate)
    for line in (*lines, *(each.words for each in points), *_bent(rows)):
        print(line)
    if where is not None:
        write_whole(where, to_json(certificate))
        write_whole(where.with_suffix(".svg"), draw_delta(points))
        print(f"{where}, {where.with_suffix('.svg')}: written")
    return 0


def _bent(rows: InputRows) -> list[str]:
    """Where the rows themselves bend more than their class does between them, which its corners at rows allow."""
    curves = np.abs(np.diff(rows.slopes, axis=0)).max(axis=1) / (rows.steps[1:] + rows.steps[:-1]) * 2.0
    if rows.between.kind != "curv" or not (most := float(curves.max(initial=0.0))) > rows.between.bound:
        return []
    return [f"  the rows themselves bend by up to {most:.3g} m/s^2: there the roads of this class have corners"]


def certify_rows(parameters: Parameters, rows: InputRows, gain: Array | None = None) -> tuple[RowsCertificate, Proof]:
    """The certificate of x_lin from rest for this car. Raises NotProvedError, with the reason, if there is none."""
    car = car_of(parameters)

    def named(x_lin: Array) -> tuple[Norm, ...]:
        return norms(car, x_lin)

    return certify(flat(parameters, gain), build, metric_of(car, gain), named, rows, np.zeros(14))


def statement(certificate: RowsCertificate, proof: Proof) -> list[str]:
    """What is proved, each number beside what roads of the class reach.

    Raises NotProvedError if that exceeds it, or where the inputs are not the car's road.
    """
    model, rows = certificate.model, certificate.rows
    car, gain = car_of(model["parameters"]), model.get("gain")
    form = car_form(car, gain=None if gain is None else np.array(gain))
    claims = named_by_content(certificate.claims, norms(car, motion(certificate.pieces)))
    most = reached(form, [claim.norm for claim in claims], rows, certificate.x0)
    start, last = start_words(certificate.x0), float(rows.times[-1])
    assert proof.open is not None
    which = (
        f"{start} is almost stable (definition 2.1) on every road of class {rows.between} through "
        f"{len(rows.times)} rows of heights: for all t until {last!r} s"
    )
    words = ", ".join(
        f"{q.name} {at_most(v, 3)} {q.unit}"
        for q, v in zip(STATES[:7], proof.open.linear.max(axis=0).tolist(), strict=False)
    )
    return [
        *claim_words(claims, most, which, "roads of the class reach"),
        *model_words(model, road=False),
        *along(
            model["parameters"],
            proof.system,
            [(proof.tube, proof.metric)],
            f"{start} itself, on every such road, until t = {last!r} s",
            proof.open,
        ),
        f"    x_lin is off that of the file's polynomials by at most {words}",
    ]
