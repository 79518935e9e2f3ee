"""`python -m analysis certify SCENARIO --closed-loop`: the certificate under constant feedback, beside the passive one.

The controller with the gain of its infinite horizon acts for all t ≥ 0 and at every instant, so that the car is
x' = F(x, w) with u = K x: A − B_u K in the standard form. Beside it the gain by time on its horizon, in a file of its
own. All certificates use the passive car's norms.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fmu_src.controller.design import design
from fmu_src.controller.law import control_parameters

from ..bertolino_baksa.balls import NotProvedError
from ..bertolino_baksa.certificate import Certificate, to_json
from ..bertolino_baksa.proof import Proof
from ..bertolino_baksa.switched_certificate import SwitchedCertificate
from ..bertolino_baksa.switched_certificate import to_json as horizon_json
from ..files import write_whole
from ..methods.polynomials import Array
from ..reference import Parameters
from ..stabilization.full_car import strut_gain
from .adversary_points import Points, adversary_points, horizon_points
from .car_certificates import certify_car
from .certificate_command import statement
from .certificate_figures import draw_delta
from .finite_horizon import certify_horizon, refuse_hardware
from .horizon_words import statement as statement_by_time

HORIZON = ".horizon.json"  # in place of .json: the certificate with the gain by time, beside that with the constant one
SHARES = (0.01, 0.1, 0.5)  # of the smaller largest ε, at which δ is compared


def infinite_gain(parameters: Parameters) -> Array:
    """Gain (4, 14) of u = −gain x at the struts, by the controller of these parameters on its infinite horizon.

    Raises InputError where hardware stands between the law and the struts.
    """
    refuse_hardware(parameters)
    K = np.array(design(control_parameters(parameters).model, infinite=True, span=None).infinite)
    return -strut_gain(K.reshape(2, 4)) if K.size == 8 else -K.reshape(4, 14)  # of the half car, of the full car


def both(parameters: Parameters) -> tuple[tuple[Certificate, Proof], tuple[Certificate, Proof]]:
    """The passive certificate and the one under control, in the same norms. Raises NotProvedError if one is none."""
    passive = certify_car(parameters)
    return passive, certify_car(parameters, infinite_gain(parameters))


def command(parameters: Parameters, where: Path | None) -> int:
    """Print both and what control changes, write the certificate under control; 0, or 1 if one is not proved."""
    print("Finding and proving a reference motion without and with control ...", file=sys.stderr, flush=True)
    try:
        passive, closed = both(parameters)
        said = [statement(*made) for made in (passive, closed)]
    except NotProvedError as error:
        print(f"no certificate: {error}")
        return 1
    points = [adversary_points(made) for made, _ in (passive, closed)]
    for title, lines, found in zip(("without control", "with control for all t >= 0"), said, points, strict=True):
        print("\n".join([f"{title}:", *lines, *(each.words for each in found)]), flush=True)
    print("\n".join(["what control changes, each norm the same for both:", *comparison(passive[0], closed[0])]))
    lines, by_time, beside = on_horizon(parameters, passive[0])
    print("\n".join(lines))
    if where is not None:
        _write(where, to_json(closed[0]), points[1])
    if where is not None and by_time is not None:
        _write(where.with_suffix(HORIZON), horizon_json(by_time), beside)
    return 0


def _write(where: Path, content: bytes, points: Sequence[Points]) -> None:
    """The certificate and the figure of its δ(ε)."""
    write_whole(where, content)
    write_whole(where.with_suffix(".svg"), draw_delta(points))
    print(f"{where}, {where.with_suffix('.svg')}: written")


def on_horizon(
    parameters: Parameters, passive: Certificate
) -> tuple[list[str], SwitchedCertificate | None, list[Points]]:
    """The certificate with the controller's gain by time on its horizon, in words, against no control, and what an
    adversary reaches; None and none if there is none."""
    control = control_parameters(parameters)
    if control.horizon != "finite":
        return ["the controller has no finite horizon: nothing is said of a gain that changes in time"], None, []
    try:
        made, proof = certify_horizon(parameters, [claim.norm for claim in passive.claims])
        said = statement_by_time(made, proof)
    except NotProvedError as error:
        return [f"no certificate with the gain by time on its horizon: {error}"], None, []
    title = f"with the gain by time from {control.begin:g} to {control.end:g} s and no control before and after:"
    changed = "what the gain by time changes, each norm the same for both:"
    points = horizon_points(made)
    return [title, *said, *(each.words for each in points), changed, *comparison(passive, made)], made, points


def comparison(passive: Certificate, closed: Certificate | SwitchedCertificate) -> list[str]:
    """The proved l, the largest δ, and δ at the same ε of both, norm by norm; ε where both claim something."""
    lines = []
    for before, after in zip(passive.claims, closed.claims, strict=True):
        least, top = max(before.floor, after.floor), min(before.table[-1, 0], after.table[-1, 0])
        wider = ", ".join(
            f"{after.delta(e) / before.delta(e):.3g} at eps = {e:.3g}"
            for e in (float(share * top) for share in SHARES)
            if e >= least
        )
        lines.append(
            f"  {before.norm.name} norm: l times {after.floor / before.floor:.4g}; largest delta times "
            f"{after.largest_delta / before.largest_delta:.3g}; delta times {wider}"
        )
    return lines
