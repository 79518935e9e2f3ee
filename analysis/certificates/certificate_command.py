"""`python -m analysis certify` and `verify`: certificates made, judged, and put into words."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fmu_src.quantities import CORNER_WORDS, PARAMETERS, STATES
from fmu_src.vehicle.equations import equations_of_motion

from ..bertolino_baksa.adversary import reference_floor
from ..bertolino_baksa.balls import NotProvedError, precision
from ..bertolino_baksa.bounded_certificate import KIND, BoundedCertificate
from ..bertolino_baksa.bounded_certificate import certificate_of as bounded_of
from ..bertolino_baksa.bounded_certificate import verify as verify_bounded
from ..bertolino_baksa.cells import errors_of_states, outputs
from ..bertolino_baksa.certificate import Certificate, certificate_of, opened, to_json, verify
from ..bertolino_baksa.norms import proved_metric
from ..bertolino_baksa.proof import Proof
from ..bertolino_baksa.quick import quick_floors
from ..car import car_form, road_signal
from ..files import write_whole
from ..methods.linear_response import linear_response
from ..reference import Parameters, car_of, road_parameters
from ..tyres import static_loads_of
from .car_bounded_roads import statement as every_road
from .car_certificates import build, certify_car, metric_of, model_of, prove_reference, stops
from .certificate_figures import adversary_points, draw_delta
from .exact_car import exact_car, norms

CLOSE = 1.02  # ratio at which the bisection for the largest amplitude stops
TINY = 1e-6  # m; below it the search for an amplitude is given up


def make_certificate(parameters: Parameters, where: Path | None, *, largest: bool = False) -> int:
    """Certify x_lin from rest, print what is proved, write the file; 0, or 1 if there is no certificate."""
    print("Finding and proving a reference motion ...", file=sys.stderr, flush=True)
    try:
        certificate, proof = certify_car(parameters)
    except NotProvedError as error:
        print(f"no certificate: {error}")
        return 1
    for line in statement(certificate, proof):
        print(line)
    if largest:
        print(f"  the largest A with a proved tube: {largest_amplitude(parameters):.4g} m (by bisection, to {CLOSE:g})")
    if where is not None:
        write_whole(where, to_json(certificate))
        print(f"{where}: written")
        picture = where.with_suffix(".svg")
        write_whole(picture, draw_delta(adversary_points(certificate)))
        print(f"{picture}: written")
    return 0


def judge_certificate(path: Path) -> int:
    """Prove a certificate's claims anew; 0 if all are proved, 1 if not."""
    certificate = opened(path.read_bytes(), str(path), _any_kind)
    try:
        if isinstance(certificate, BoundedCertificate):
            lines = every_road(certificate, verify_bounded(certificate, build))
        else:
            lines = statement(certificate, verify(certificate, build))
    except NotProvedError as error:
        print(f"{path}: NOT proved: {error}")
        return 1
    for line in lines:
        print(line)
    print(f"{path}: every claim is proved")
    return 0


def _any_kind(content: dict[str, Any]) -> Certificate | BoundedCertificate:
    return bounded_of(content) if content.get("kind") == KIND else certificate_of(content)


def quick_answer(parameters: Parameters) -> int:
    """Print floors from the scalar comparison, and how coarse they are; 0, or 1 if it proves none."""
    car, road = car_of(parameters), road_parameters(parameters)
    form, signal = car_form(car), road_signal(road)
    try:
        with precision(2):
            system = build(model_of(parameters))
            end = stops(system, form.A)[0]
            x_lin = linear_response(form.A, form.B, np.zeros(14), signal, np.linspace(0.0, float(end), 2000))
            named = norms(car, x_lin)
            floors = quick_floors(system, proved_metric(system, metric_of(car)), named, [0.0] * 14, end)
    except NotProvedError as error:
        print(f"no quick answer: {error}")
        return 1
    true = reference_floor(form, signal, named, np.zeros(14), float(end))
    for norm, floor, least in zip(named, floors, true, strict=True):
        print(f"l <= {floor:.4g} in the {norm.name} norm ({floor / least:.2g} times what a reference motion reaches)")
    return 0


def statement(certificate: Certificate, proof: Proof) -> list[str]:
    """What is proved, line by line, each certified number beside an empirical one."""
    parameters = certificate.model["parameters"]
    gain = certificate.model.get("gain")
    form = car_form(car_of(parameters), gain=None if gain is None else np.array(gain))
    signal, end = road_signal(road_parameters(parameters)), float(certificate.pieces[-1].end)
    true = reference_floor(form, signal, [c.norm for c in certificate.claims], certificate.x0, end)
    lines = ["x_lin is almost stable (definition 2.1): for all t >= 0 and every eps >= l,"]
    for claim, floor in zip(certificate.claims, true.tolist(), strict=True):
        epsilon, delta = claim.table[-1].tolist()
        ratio = f": ratio {claim.floor / floor:.4f}" if floor > 0.0 else ""
        lines.append(
            f"  {claim.norm.name} norm: l = {claim.floor:.6g} (a reference motion reaches {floor:.6g}{ratio}); "
            f"delta up to {delta:.4g}, at eps = {epsilon:.4g}"
        )
    ends = "x -> 0 after the road's end" if proof.repetition is None else "every period's tube returns into itself"
    return [*lines, f"  {ends}", *_tubes(proof), *_tyres(parameters, proof)]


def _tubes(proof: Proof) -> list[str]:
    bounds = errors_of_states(proof.tube, proof.metric)
    named = ", ".join(f"{q.name} {b:.3g} {q.unit}" for q, b in zip(STATES[:7], bounds[:7].tolist(), strict=True))
    return [f"  |x - x_lin| of the motion from rest: {named}"]


def _tyres(parameters: Parameters, proof: Proof) -> list[str]:
    """Smallest load of each tyre along the motion from x0, and whether the springs only push."""
    motion = equations_of_motion(exact_car(car_of(parameters)), lambda x: x.sin(), lambda x: x.cos())

    def forces(x: Sequence[object], w: Sequence[object], sin: object, cos: object) -> Sequence[object]:
        return motion(x[:7], x[7:], [0.0] * 4, w[:4], w[4:])[2]

    with precision(2):
        low = outputs(proof.system, proof.tube, proof.metric, forces)[0] + static_loads_of(car_of(parameters))
    worst = int(np.argmin(low))
    said = f"  smallest tyre load on the pieces: {low[worst]:.4g} N ({CORNER_WORDS[worst]})"
    if low[worst] > 0.0:
        return [f"{said}; every tyre stays on the ground"]
    return [f"{said}; contact is not proved: where a load is negative the certificate speaks of springs that pull"]


def largest_amplitude(parameters: Parameters) -> float:
    """Largest height A [m] of the road for which a tube is proved, by bisection; 0.0 if none is found."""
    good, bad = 0.0, np.inf
    middle = float(parameters.get("A", PARAMETERS["A"].start))
    while not bad <= good * CLOSE and (middle > TINY or good):
        try:
            prove_reference({**parameters, "A": middle})
            good = middle
        except NotProvedError:
            bad = middle
        middle = 2.0 * good if bad == np.inf else float(np.sqrt(max(good, bad / 4.0) * bad))
    return good
