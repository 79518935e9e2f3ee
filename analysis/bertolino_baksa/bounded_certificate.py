"""Certificates of ψ = 0 under every input within given bounds: definition 2.1 with one δ(ε) for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import strict
from .balls import Array, NotProvedError, precision
from .bounded_inputs import Bounds, Driven, gains
from .certificate import (
    FIRST,
    FORMAT,
    MARGIN,
    Build,
    Claim,
    claims_json,
    refuse_unproved,
    sealed,
    system_of,
)
from .norms import Norm, proved_metric
from .search import CLOSE, largest

KIND = "bounded inputs"
SHARES = (0.1, 0.25, 0.5, 0.75, 1.0)  # of the largest δ, in the table of δ(ε)
THEOREM = (
    "Let w be any inputs of x' = F(x, w(t)) with |w_i(t)| <= bounds_i for all t >= 0; where `tied`, the first half of "
    "them are 0 at t = 0 and Lipschitz with the bounds of the second half, |w_i(s) - w_i(t)| <= bounds_(i + m/2) "
    "|s - t|, and the second half are their rates. F(0, 0) = 0, and psi = 0. For every eps >= l let delta(eps) be the "
    "largest delta of the table whose eps is not above it. Then, whatever w, every solution x with N(x(0)) < "
    "delta(eps) satisfies N(x(t)) < eps for all t >= 0: psi is an almost stable approximate solution (definition 2.1, "
    "Bertolino and Baksa). N(x) = |T x|_2, or max |(T x)_i| where the norm says so; all numbers are SI and exact as "
    "printed."
)


@dataclass(frozen=True, slots=True)
class BoundedCertificate:
    """What the file holds; `model` says which system, in the words of whoever builds it."""

    model: dict[str, Any]
    bounds: Bounds
    S: Array
    claims: tuple[Claim, ...]


def smallest(driven: Driven, norm: Norm) -> tuple[float, float]:
    """l, and the smallest δ of the table, which adds but FIRST to it. Raises NotProvedError if that δ is not proved."""
    floor = driven.epsilon(norm, [0.0])[0]
    first = FIRST * floor / driven.gains.kappa(norm)
    try:
        driven.motion(driven.gains.spread(norm) * (CLOSE * first))  # so that `largest` finds more than `first`
    except NotProvedError as error:
        raise NotProvedError(f"no delta of {first:.3g} or more in the {norm.name} norm: {error}") from error
    return floor, first


def claim(driven: Driven, norm: Norm) -> Claim:
    """δ(ε) up to the largest δ that is found; raises as `smallest`."""
    floor, first = smallest(driven, norm)
    spread = driven.gains.spread(norm)
    top = largest(lambda delta: driven.motion(spread * delta), floor)
    if not top > first:
        raise NotProvedError(f"no delta of {first:.3g} or more in the {norm.name} norm")
    delta = np.array([first, *(share * top for share in SHARES if share * top > first)])
    epsilon = np.array(driven.epsilon(norm, delta.tolist()))
    return Claim(norm, np.stack([np.maximum.accumulate(epsilon) * (1.0 + MARGIN), delta * (1.0 - MARGIN)], axis=1))


def certify(model: dict[str, Any], driven: Driven, norms: Sequence[Norm]) -> BoundedCertificate:
    """The certificate of what is proved of the model's system in these norms; raises as `claim`."""
    claims = tuple(claim(driven, norm) for norm in norms)
    return BoundedCertificate(model, driven.bounds, driven.gains.metric.S, claims)


def verify(certificate: BoundedCertificate, build: Build) -> Driven:
    """Prove every claim anew. Raises NotProvedError with the first that cannot be proved."""
    with precision(2):
        system = build(certificate.model)
        if len(certificate.bounds.sizes) != system.m:
            raise NotProvedError(f"wanted bounds of {system.m} inputs, got {len(certificate.bounds.sizes)}")
        driven = gains(system, proved_metric(system, certificate.S)).under(certificate.bounds)
        for each in certificate.claims:
            refuse_unproved(each, driven.epsilon(each.norm, each.table[:, 1].tolist()))
    return driven


def to_json(certificate: BoundedCertificate) -> bytes:
    """The certificate as a file's bytes, with the hash of its content."""
    return sealed(
        {
            "format": FORMAT,
            "kind": KIND,
            "theorem": THEOREM,
            "model": certificate.model,
            "bounds": certificate.bounds.sizes.tolist(),
            "tied": certificate.bounds.tied,
            "metric": certificate.S.tolist(),
            "claims": claims_json(certificate.claims),
        }
    )


def certificate_of(content: dict[str, Any]) -> BoundedCertificate:
    """The certificate from its plain data; raises what reading wrong data raises."""
    strict.of_keys(content, ("format", "kind", "theorem", "model", "bounds", "tied", "metric", "claims"))
    strict.theorem(content["theorem"], THEOREM)
    sizes, tied = strict.numbers(content["bounds"], 1), strict.truth(content["tied"])
    if not np.all(sizes >= 0.0) or (tied and len(sizes) % 2):
        raise ValueError(f"bounds of inputs: wanted numbers >= 0, got {sizes.tolist()}")
    S, model, claims = system_of(content, len(content["metric"]))
    return BoundedCertificate(model, Bounds(sizes, tied), S, claims)
