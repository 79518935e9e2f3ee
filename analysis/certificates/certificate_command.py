"""`python -m analysis certify` and `verify`: certificates made, judged, and put into words."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fmu_src.quantities import CORNER_WORDS, PARAMETERS, STATES

from ..bertolino_baksa import bounded_certificate, rows_certificate
from ..bertolino_baksa.adversary import long_enough, reference_floor
from ..bertolino_baksa.balls import NotProvedError, precision
from ..bertolino_baksa.bounded_certificate import BoundedCertificate
from ..bertolino_baksa.cells import errors_of_states, outputs
from ..bertolino_baksa.certificate import Certificate, certificate_of, opened, to_json, verify
from ..bertolino_baksa.proof import Proof
from ..bertolino_baksa.rows_certificate import RowsCertificate
from ..bertolino_baksa.search import largest
from ..bertolino_baksa.tube import Tube
from ..car import car_form, road_signal
from ..errors import InputError
from ..files import write_whole
from ..methods.polynomials import Array
from ..reference import Parameters, car_of, road_parameters
from ..trajectory import CERTIFICATE
from ..tyres import static_loads_of, tyre_heights
from .car_certificates import build, car_norms, certify_car, prove_reference
from .certificate_words import model_words, named_by_content, refuse_exceeded, start_words
from .directed import at_least, at_most
from .exact_car import exact_car

CLOSE = 1.02  # ratio at which the bisection for the largest amplitude stops


def make_certificate(parameters: Parameters, where: Path | None, *, search: bool = False) -> int:
    """Certify x_lin from rest, print what is proved, write the file; 0, or 1 if there is no certificate.

    It is of the car without control: a controller of these parameters is left out, and that is said.
    """
    if parameters.get("enabled", True):
        print("The car is certified without its controller; with it: --closed-loop.", file=sys.stderr)
    print("Finding and proving a reference motion ...", file=sys.stderr, flush=True)
    try:
        certificate, proof = certify_car(parameters)
        lines = statement(certificate, proof)
    except NotProvedError as error:
        print(f"no certificate: {error}")
        return 1
    for line in lines:
        print(line)
    if search:
        A = at_least(largest_amplitude(parameters))
        print(f"  the largest A with a proved tube: {A} m (by bisection, to {CLOSE:g})")
    if where is not None:
        write_whole(where, to_json(certificate))
        print(f"{where}: written")
        from .certificate_figures import adversary_points, draw_delta

        picture = where.with_suffix(".svg")
        write_whole(picture, draw_delta(adversary_points(certificate)))
        print(f"{picture}: written")
    return 0


def judge_certificate(path: Path) -> int:
    """Prove a certificate's claims anew; 0 if all are proved, 1 if not."""
    if path.is_dir():
        inside = f"; {path / CERTIFICATE} is one" if (path / CERTIFICATE).is_file() else ""
        raise InputError(f"{path}: wanted a certificate, got a folder{inside}")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    certificate = opened(data, str(path), _any_kind)
    try:
        lines = _proved_anew(certificate)
    except NotProvedError as error:
        print(f"{path}: NOT proved: {error}")
        return 1
    for line in lines:
        print(line)
    print(f"{path}: every claim is proved")
    return 0


def _any_kind(content: dict[str, Any]) -> Certificate | BoundedCertificate | RowsCertificate:
    match content.get("kind"):
        case bounded_certificate.KIND:
            return bounded_certificate.certificate_of(content)
        case rows_certificate.KIND:
            return rows_certificate.certificate_of(content)
        case _:
            return certificate_of(content)


def _proved_anew(certificate: Certificate | BoundedCertificate | RowsCertificate) -> list[str]:
    if isinstance(certificate, BoundedCertificate):
        from .car_bounded_roads import statement as every_road

        return every_road(certificate, bounded_certificate.verify(certificate, build))
    if isinstance(certificate, RowsCertificate):
        from .car_sampled_roads import statement as sampled_roads

        return sampled_roads(certificate, rows_certificate.verify(certificate, build))
    return statement(certificate, verify(certificate, build))


def statement(certificate: Certificate, proof: Proof) -> list[str]:
    """What is proved, line by line, each certified number beside an empirical one.

    Raises NotProvedError if that exceeds it: no proof says so, but a fault in one would.
    """
    model = certificate.model
    claims = named_by_content(certificate.claims, car_norms(model["parameters"]))
    form = car_form(car_of(model["parameters"]), gain=np.array(model["gain"]) if "gain" in model else None)
    signal = road_signal(road_parameters(model["parameters"]))
    stop = min(float(certificate.pieces[-1].end), long_enough(form, signal))
    true = reference_floor(form, signal, [c.norm for c in claims], certificate.x0, stop)
    start = start_words(certificate.x0)
    lines = [f"x_lin {start} is almost stable (definition 2.1): for all t >= 0 and every eps >= l,"]
    for claim, floor in zip(claims, true.tolist(), strict=True):
        epsilon, delta = claim.table[-1].tolist()
        refuse_exceeded(claim, floor)
        beside = f"a reference motion reaches {floor:.6g}" + (f": ratio {claim.floor / floor:.4f}" if floor else "")
        lines.append(
            f"  {claim.norm.name} norm: l <= {at_most(claim.floor, 6)} ({beside}); "
            f"delta up to {at_least(delta)}, at eps = {at_most(epsilon)}"
        )
    ends = "x -> 0 after the road's end" if proof.repetition is None else "every period's tube returns into itself"
    return [*lines, *model_words(model), f"  {ends}", *_along(model["parameters"], proof, start)]


def _along(parameters: Parameters, proof: Proof, start: str) -> list[str]:
    """Of the motion from x0 alone, for how long: |x − x_lin|, and whether the springs of its tyres only push.

    With its later periods where the road repeats itself; the tail of a road that ends is left out.
    """
    tubes = [proof.tube, *([proof.repetition.window] if proof.repetition else [])]
    until = "for all t >= 0" if proof.repetition else f"until t = {float(proof.tube.pieces[-1].end):g} s"
    bounds = np.max([errors_of_states(tube, proof.metric) for tube in tubes], axis=0)
    named = ", ".join(f"{q.name} {at_most(b, 3)} {q.unit}" for q, b in zip(STATES[:7], bounds.tolist(), strict=False))
    low = np.min([_loads(parameters, proof, tube) for tube in tubes], axis=0)
    worst = int(np.argmin(low))
    load = f"each tyre's load is at least {at_least(low[worst])} N ({CORNER_WORDS[worst]})"
    contact = (
        "so that it stays on the ground; of other starts within delta this is not said"
        if low[worst] > 0.0
        else "so that contact is not proved: where a load is negative the certificate speaks of springs that pull"
    )
    return [
        f"  of the motion {start} itself, {until}:",
        f"    |x - x_lin| at most {named}",
        f"    {load}, {contact}",
    ]


def _loads(parameters: Parameters, proof: Proof, tube: Tube) -> Array:
    """Smallest loads (4,) [N] of the tyres in a tube."""
    car = exact_car(car_of(parameters))
    cp, bp = (car.cp1, car.cp1, car.cp2, car.cp2), (car.bp1, car.bp1, car.bp2, car.bp2)

    def forces(x: Sequence[Any], w: Sequence[Any], sin: Any, cos: Any) -> list[Any]:
        heights, rates = tyre_heights(car, x[:7], x[7:], sin, cos)
        return [
            c * (h - height) + b * (dh - rate)
            for c, b, h, dh, height, rate in zip(cp, bp, w[:4], w[4:], heights, rates, strict=True)
        ]

    with precision(2):
        return outputs(proof.system, tube, proof.metric, forces)[0] + static_loads_of(car_of(parameters))


def largest_amplitude(parameters: Parameters) -> float:
    """Largest height A [m] of the road for which a tube is proved; 0.0 if none is found."""
    first = float(parameters.get("A", PARAMETERS["A"].start))
    return largest(lambda A: prove_reference({**parameters, "A": A}), first, CLOSE)
