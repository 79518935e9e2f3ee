"""`python -m analysis certify SCENARIO --closed-loop`: the certificate under constant feedback, beside the passive one.

The controller of the half car with the gain of its infinite horizon acts for all t ≥ 0 and at every instant, so that
the car is x' = F(x, w) with u = K x: A − B_u K in the standard form. Both certificates use the passive car's norms.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fmu_src.controller.design import design
from fmu_src.controller.hardware import Hardware
from fmu_src.controller.law import control_parameters

from ..bertolino_baksa.balls import NotProvedError, precision
from ..bertolino_baksa.certificate import Certificate, to_json
from ..bertolino_baksa.norms import Norm
from ..bertolino_baksa.proof import Proof
from ..errors import InputError
from ..files import write_whole
from ..methods.polynomials import Array
from ..reference import Parameters
from ..stabilization.full_car import strut_gain
from .car_certificates import certify_car
from .certificate_command import statement
from .directed import at_least, at_most
from .finite_horizon import finite_horizon, largest_delta

SHARES = (0.01, 0.1, 0.5)  # of the smaller largest ε, at which δ is compared


def infinite_gain(parameters: Parameters) -> Array:
    """Gain (4, 14) of u = −gain x at the struts, by the controller of these parameters on its infinite horizon.

    Raises InputError where hardware stands between the law and the struts.
    """
    refuse_hardware(parameters)
    K = np.array(design(control_parameters(parameters).model, infinite=True, span=None).infinite)
    return -strut_gain(K.reshape(2, 4)) if K.size == 8 else -K.reshape(4, 14)  # of the half car, of the full car


def refuse_hardware(parameters: Parameters) -> None:
    """Raise InputError, which names it, where the struts do not do at once what the law asks for."""
    hardware = control_parameters(parameters).hardware
    if not hardware.ideal:
        names = ("actuators", "feedback", "force_limit", "actuator_lag", "sample_time")
        found = [name for name in names if getattr(hardware, name) != getattr(Hardware(), name)]
        got = ", ".join(f"{name} = {getattr(hardware, name)!r}" for name in found)
        raise InputError(f"--closed-loop: the proof is of the law itself; wanted no hardware, got {got}")


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
    for title, lines in zip(("without control", "with control for all t >= 0"), said, strict=True):
        print("\n".join([f"{title}:", *lines]))
    print("\n".join(["what control changes, each norm the same for both:", *comparison(passive[0], closed[0])]))
    for line in on_horizon(parameters, [claim.norm for claim in passive[0].claims]):
        print(line)
    if where is not None:
        write_whole(where, to_json(closed[0]))
        print(f"{where}: written")
    return 0


def on_horizon(parameters: Parameters, norms: Sequence[Norm]) -> list[str]:
    """l and the largest δ with the controller's gain by time on its horizon, against no control by the same method."""
    control = control_parameters(parameters)
    if control.horizon != "finite":
        return ["the controller has no finite horizon: nothing is said of a gain that changes in time"]
    try:
        passive, controlled = finite_horizon(parameters)
    except NotProvedError as error:
        return [f"no certificate with the gain by time on its horizon: {error}"]
    lines = [
        f"with the gain by time from {control.begin:g} to {control.end:g} s and no control after, for all t >= 0 "
        "(x_lin under it; delta by tubes alone, with control and without: less than is proved above):"
    ]
    for norm in norms:
        with precision(2):
            before, after = (found.epsilon(norm, 0.0) for found in (passive, controlled))
            least, most = (largest_delta(found, norm) for found in (passive, controlled))
        lines.append(
            f"  {norm.name} norm: l <= {at_most(after, 6)}, times {after / before:.6g}; delta up to {at_least(most)}, "
            f"without control {at_least(least)}"
        )
    return lines


def comparison(passive: Certificate, closed: Certificate) -> list[str]:
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
