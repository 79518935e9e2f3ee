"""Certificates of x_lin whose linear part changes in time: definition 2.1 where a feedback acts for a while."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import strict
from .balls import precision
from .certificate import (
    FORMAT,
    Claim,
    claim_of,
    claims_json,
    claims_of,
    model_in,
    motion,
    pieces_json,
    pieces_of,
    refuse_unproved,
    sealed,
    square,
)
from .norms import Norm
from .switched import Phase, Switched, SwitchedProof, prove
from .tube import Piece

KIND = "changing linear part"
THEOREM = (
    "Let x' = F(x, w(t)), where some of the inputs w change the linear part A(w) x + B w of F at x = 0, as a gain that "
    "changes in time does, and let psi = x_lin be the solution of x' = A(w(t)) x + B w(t) with psi(0) = 0. For every "
    "eps >= l let delta(eps) be the largest delta of the table whose eps is not above it. Then every solution x with "
    "N(x(0)) < delta(eps) satisfies N(x(t) - psi(t)) < eps for all t >= 0: psi is an almost stable approximate "
    "solution (definition 2.1, Bertolino and Baksa). N(x) = |T x|_2, or max |(T x)_i| where the norm says so; all "
    "numbers are SI and exact as printed."
)
Build = Callable[[dict[str, Any]], Switched]


@dataclass(frozen=True, slots=True)
class SwitchedCertificate:
    """What the file holds; `model` says which system and which inputs, in the words of whoever builds it."""

    model: dict[str, Any]
    phases: tuple[Phase, ...]
    pieces: tuple[Piece, ...]
    claims: tuple[Claim, ...]


def certify(
    model: dict[str, Any], switched: Switched, phases: Sequence[Phase], pieces: Sequence[Piece], norms: Sequence[Norm]
) -> tuple[SwitchedCertificate, SwitchedProof]:
    """The largest table of δ(ε) in each norm from these pieces. Raises NotProvedError if there is no certificate."""
    with precision(2):
        proof = prove(switched, phases, pieces)
        x_lin = motion(pieces)
        claims = []
        for norm in norms:
            floor = float(proof.epsilon(norm, np.zeros(1))[0])
            claims.append(claim_of(proof, norm, floor, float(norm(x_lin).max())))
    return SwitchedCertificate(model, tuple(phases), tuple(pieces), tuple(claims)), proof


def verify(certificate: SwitchedCertificate, build: Build) -> SwitchedProof:
    """Prove every claim anew. Raises NotProvedError with the first that cannot be proved."""
    with precision(2):
        proof = prove(build(certificate.model), certificate.phases, certificate.pieces)
        for claim in certificate.claims:
            refuse_unproved(claim, proof.epsilon(claim.norm, claim.table[:, 1]).tolist())
    return proof


def to_json(certificate: SwitchedCertificate) -> bytes:
    """The certificate as a file's bytes, with the hash of its content."""
    return sealed(
        {
            "format": FORMAT,
            "kind": KIND,
            "theorem": THEOREM,
            "model": certificate.model,
            "phases": [{"begin": str(p.begin), "metric": p.S.tolist()} for p in certificate.phases],
            "claims": claims_json(certificate.claims),
            "pieces": pieces_json(certificate.pieces),
        }
    )


def certificate_of(content: dict[str, Any]) -> SwitchedCertificate:
    """The certificate from its plain data; raises what reading wrong data raises."""
    strict.of_keys(content, ("format", "kind", "theorem", "model", "phases", "claims", "pieces"))
    strict.theorem(content["theorem"], THEOREM)
    phases = [strict.of_keys(p, ("begin", "metric")) for p in content["phases"]]
    n = len(phases[0]["metric"])
    found = tuple(Phase(strict.fraction(p["begin"]), square(p["metric"], n)) for p in phases)
    return SwitchedCertificate(
        model_in(content), found, pieces_of(content["pieces"], n), claims_of(content["claims"], n)
    )
