"""`python -m analysis certify RUN`: the certificate of a run's car and road, and the run judged and drawn by it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from fmu_src.quantities import STATES

from ..bertolino_baksa.balls import NotProvedError
from ..bertolino_baksa.certificate import Certificate, Claim, from_json, to_json
from ..check import own_error
from ..discrepancy import scales
from ..errors import InputError
from ..files import write_whole
from ..findings import Finding
from ..methods.polynomials import Array
from ..reference import car_of, road_parameters
from ..run_figures import DELTA, TUBE
from ..trajectory import CERTIFICATE, FIGURES, Run
from .adversary_points import adversary_points
from .car_certificates import car_norms, certify_car, linear_motion
from .certificate_command import statement
from .certificate_figures import draw_delta, draw_tube, in_tube
from .certificate_words import named_by_content
from .directed import at_least, at_most
from .run_certificates import acting


def silent(run: Run) -> str:
    """Why the certificate of x_lin from rest at t = 0 says nothing of a run; "" if it does."""
    if missing := [q.name for q in STATES if q.name not in run.trajectory.names]:
        return f"{', '.join(missing)} are not recorded"
    if run.trajectory.time[0] != 0.0:
        return f"the run begins at t = {run.trajectory.time[0]:g} s, and the certificate speaks of x_lin from t = 0 on"
    return acting(run)


def road_ends(run: Run) -> bool:
    """Whether the road comes to an end: its certificate then takes some eight seconds, and else twenty."""
    return bool(road_parameters(run.parameters).profile in ("bump", "flat"))


def certify_run(run: Run, folder: Path) -> str:
    """Write certificate.json and two figures into a run's folder, and print what is proved; why not, if it is not."""
    if reason := silent(run):
        return reason
    print("Finding and proving a reference motion ...", file=sys.stderr, flush=True)
    try:
        certificate, proof = certify_car(run.parameters)
    except NotProvedError as error:
        return str(error)
    for line in statement(certificate, proof):
        print(line)
    figures = {DELTA: draw_delta(adversary_points(certificate))}
    if off := _too_far(run, certificate.claims[0]):
        print(f"  no figure of the tube: {off}")
    else:
        figures[TUBE] = draw_tube(in_tube(run, certificate, proof))
    (folder / FIGURES).mkdir(exist_ok=True)
    (folder / FIGURES / TUBE).unlink(missing_ok=True)  # of an earlier run in this folder
    for name, image in figures.items():
        write_whole(folder / FIGURES / name, image)
    write_whole(folder / CERTIFICATE, to_json(certificate))
    return ""


def definition_findings(run: Run, path: Path) -> tuple[list[Finding], str]:
    """Definition 2.1 on a run: a finding for each norm of the certificate in this file; if there is none, why.

    The certificate is taken at its word here; `verify` proves it. Raises InputError if it is of another car or road.
    """
    certificate = from_json(path.read_bytes(), str(path))
    _refuse_another(run, certificate, path)
    certificate = replace(certificate, claims=named_by_content(certificate.claims, car_norms(run.parameters)))
    if reason := silent(run):
        return [], reason
    why_not = [_too_far(run, claim) for claim in certificate.claims]
    x = run.trajectory.columns([q.name for q in STATES])
    off = x - linear_motion(run.parameters, run.trajectory.time)
    within = [claim for claim, reason in zip(certificate.claims, why_not, strict=True) if not reason]
    return [_stays(claim, x, off, own_error(run)) for claim in within], "; ".join(filter(None, why_not))


def _refuse_another(run: Run, certificate: Certificate, path: Path) -> None:
    stated = certificate.model.get("parameters", {})
    if certificate.model.get("gain") is not None or certificate.x0.any():
        raise InputError(f"{path}: wanted a certificate of the passive car from rest")
    for mine, its in (
        (car_of(run.parameters), car_of(stated)),
        (road_parameters(run.parameters), road_parameters(stated)),
    ):
        if mine != its:
            raise InputError(f"{path}: is of another car or road than run.json: wanted {mine}, got {its}")


def _too_far(run: Run, claim: Claim) -> str:
    """Why the claim does not reach a run's start; "" if it does."""
    size = float(claim.norm(run.trajectory.columns([q.name for q in STATES])[0]))
    if size < claim.largest_delta:
        return ""
    wanted = f"wanted less than {at_least(claim.largest_delta)}"
    return f"the run starts {size:.4g} off x_lin in the {claim.norm.name} norm; {wanted}"


def _stays(claim: Claim, x: Array, off: Array, own: float) -> Finding:
    """N(x − x_lin) < ε for the smallest ε of the table whose δ the start is within; the run's own error on top."""
    start, reached = float(claim.norm(x[0])), float(claim.norm(off.T).max())
    epsilon, delta = claim.table[int(np.searchsorted(claim.table[:, 1], start, side="right"))].tolist()
    weighed = np.abs(claim.norm.T) @ (own * scales(x))
    error = float(weighed.max() if claim.norm.largest else np.linalg.norm(weighed))
    return Finding(
        claim=f"the run is as near x_lin as the certificate says of every motion that starts within "
        f"{at_least(delta)} of it: largest N(x - x_lin), N the {claim.norm.name} norm",
        equation="definition 2.1",
        measured=reached,
        expected=0.0,
        tolerance=epsilon + error,
        unit={"energy": "√J", "weighted sup": "1"}.get(claim.norm.name, "SI"),
        source=f"{CERTIFICATE}; start {start:.4g} off; certified of the exact motion {at_most(epsilon, 6)}, to which "
        f"the run's own error adds up to {error:.2g}",
    )
