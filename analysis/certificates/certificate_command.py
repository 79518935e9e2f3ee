"""`python -m analysis certify` and `verify`: certificates made, judged, and put into words."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

from fmu_src.quantities import PARAMETERS

from ..bertolino_baksa import bounded_certificate, rows_certificate, switched_certificate
from ..bertolino_baksa.adversary import long_enough, reference_floor
from ..bertolino_baksa.balls import NotProvedError
from ..bertolino_baksa.bounded_certificate import BoundedCertificate
from ..bertolino_baksa.certificate import Certificate, certificate_of, opened, to_json, verify
from ..bertolino_baksa.proof import Proof
from ..bertolino_baksa.rows_certificate import RowsCertificate
from ..bertolino_baksa.search import largest
from ..bertolino_baksa.switched_certificate import SwitchedCertificate
from ..car import car_form, road_signal
from ..errors import InputError
from ..files import write_whole
from ..reference import Parameters, car_of, road_parameters
from ..scenario import Scenario
from ..trajectory import CERTIFICATE
from .car_certificates import build, car_norms, certify_car, prove_reference
from .certificate_words import model_words, named_by_content, start_words
from .directed import at_least
from .motion_words import along, claim_words

AnyCertificate = Certificate | BoundedCertificate | RowsCertificate | SwitchedCertificate
CLOSE = 1.02  # ratio at which the bisection for the largest amplitude stops


def make_certificate(scenario: Scenario, where: Path | None, *, search: bool = False, starts: int = 0) -> int:
    """Certify x_lin from rest, print what is proved, write the file; 0, or 1 if there is no certificate.

    It is of the car without control: a controller of these parameters is left out, and that is said.

    search : whether the largest amplitude is sought.  starts : number of starts that are tried on the FMUs; 1 is
             returned if one of them gets beyond ε.
    """
    parameters = scenario.parameters
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
        print(line, flush=True)
    from .adversary_points import adversary_points

    points = adversary_points(certificate)
    for line in (each.words for each in points):
        print(line, flush=True)
    if search:
        A = at_least(largest_amplitude(parameters))
        print(f"  the largest A with a proved tube: {A} m (by bisection, to {CLOSE:g})")
    if where is not None:
        write_whole(where, to_json(certificate))
        print(f"{where}: written")
        from .certificate_figures import draw_delta

        picture = where.with_suffix(".svg")
        write_whole(picture, draw_delta(points))
        print(f"{picture}: written")
    if not starts:
        return 0
    from .fmu_starts import on_the_fmus

    found, within = on_the_fmus(certificate, scenario, starts)
    print("\n".join(found))
    return 0 if within else 1


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


def _any_kind(content: dict[str, Any]) -> AnyCertificate:
    match content.get("kind"):
        case bounded_certificate.KIND:
            return bounded_certificate.certificate_of(content)
        case rows_certificate.KIND:
            return rows_certificate.certificate_of(content)
        case switched_certificate.KIND:
            return switched_certificate.certificate_of(content)
        case _:
            return certificate_of(content)


def _proved_anew(certificate: AnyCertificate) -> list[str]:
    if isinstance(certificate, BoundedCertificate):
        from .car_bounded_roads import statement as every_road

        return every_road(certificate, bounded_certificate.verify(certificate, build))
    if isinstance(certificate, RowsCertificate):
        from .car_sampled_roads import statement as sampled_roads

        return sampled_roads(certificate, rows_certificate.verify(certificate, build))
    if isinstance(certificate, SwitchedCertificate):
        from .finite_horizon import build as build_by_time
        from .horizon_words import statement as by_time

        return by_time(certificate, switched_certificate.verify(certificate, build_by_time))
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
    try:
        true = reference_floor(form, signal, [c.norm for c in claims], certificate.x0, stop)
    except InputError as error:  # the proof needs none
        print(f"nothing is integrated beside the proof: {error}", file=sys.stderr)
        true = np.full(len(claims), np.nan)
    start = start_words(certificate.x0)
    again = proof.repetition
    tubes = [(tube, proof.metric) for tube in (proof.tube, *([again.window] if again else []))]
    until = "for all t >= 0" if again else f"until t = {float(proof.tube.pieces[-1].end):g} s"
    return [
        *claim_words(claims, true, f"{start} is almost stable (definition 2.1): for all t >= 0"),
        *model_words(model),
        "  every period's tube returns into itself" if again else "  x -> 0 after the road's end",
        *along(model["parameters"], proof.system, tubes, f"{start} itself, {until}"),
    ]


def largest_amplitude(parameters: Parameters) -> float:
    """Largest height A [m] of the road for which a tube is proved; 0.0 if none is found."""
    first = float(parameters.get("A", PARAMETERS["A"].start))
    return largest(lambda A: prove_reference({**parameters, "A": A}), first, CLOSE)
