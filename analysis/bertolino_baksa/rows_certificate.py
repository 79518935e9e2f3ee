"""Certificates for all inputs of a class through given rows: what `open_inputs` proves, in a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import strict
from .balls import Array, ExactSystem, NotProvedError, decimal, precision
from .certificate import (
    FORMAT,
    Build,
    Claim,
    Norms,
    claim_of,
    claims_json,
    motion,
    pieces_json,
    pieces_of,
    refuse_unproved,
    sealed,
    system_of,
)
from .input_rows import InputRows, RowClass, Window, looseness, on_windows, windows
from .norms import proved_metric
from .proof import Proof, prove_open
from .taylor import find_pieces
from .tube import Piece

KIND = "inputs known at rows"
THEOREM = (
    "Let T be the last of the times, and w = (u, u') any inputs of x' = F(x, w(t)) on 0 <= t <= T of which the first "
    "half, u, takes the heights of the rows at the times and is, from each time to the next, Lipschitz with the bound, "
    "|u(s) - u(t)| <= bound |s - t|, where the class is 'lip', and differentiable with a derivative that is Lipschitz "
    "with the bound where it is 'curv'. Let psi = x_lin be the solution of the linear part x' = A x + B w(t) under "
    "this w, with psi(0) = x0. For every eps >= l let delta(eps) be the largest delta of the table whose eps is not "
    "above it. Then, whatever w, every solution x with N(x(0) - psi(0)) < delta(eps) satisfies N(x(t) - psi(t)) < eps "
    "for all 0 <= t <= T (definition 2.1, Bertolino and Baksa, as far as w is known). N(x) = |T x|_2, or "
    "max |(T x)_i| where the norm says so; all numbers are SI and exact as printed."
)


@dataclass(frozen=True, slots=True)
class RowsCertificate:
    """What the file holds; `model` says which system, in the words of whoever builds it."""

    model: dict[str, Any]
    rows: InputRows
    windows: tuple[Window, ...]
    x0: Array
    S: Array
    pieces: tuple[Piece, ...]
    claims: tuple[Claim, ...]


def certify(
    model: dict[str, Any], build: Build, S: Array, norms: Norms, rows: InputRows, x0: Array
) -> tuple[RowsCertificate, Proof]:
    """Find windows, pieces and the largest table of δ(ε) in each norm, made from values (n, …) of x_lin under the
    windows' inputs. Raises NotProvedError, with what failed, if there is no certificate.
    """
    found = windows(rows)
    with precision(2):
        system = on_windows(build(model), rows, found)
        pieces = tuple(find_pieces(system, x0.tolist(), decimal(float(rows.times[-1]))))
        proof = _prove(system, S, rows, found, pieces, x0)
        x_lin = motion(pieces)
        claims = tuple(
            claim_of(proof, norm, float(proof.epsilon(norm, np.zeros(1))[0]), float(norm(x_lin).max()))
            for norm in norms(x_lin)
        )
    return RowsCertificate(model, rows, tuple(found), x0, S, pieces, claims), proof


def verify(certificate: RowsCertificate, build: Build) -> Proof:
    """Prove every claim anew. Raises NotProvedError with the first that cannot be proved."""
    rows, found = certificate.rows, certificate.windows
    with precision(2):
        system = on_windows(build(certificate.model), rows, found)
        proof = _prove(system, certificate.S, rows, found, certificate.pieces, certificate.x0)
        for claim in certificate.claims:
            refuse_unproved(claim, proof.epsilon(claim.norm, claim.table[:, 1]).tolist())
    return proof


def _prove(
    system: ExactSystem, S: Array, rows: InputRows, found: Sequence[Window], pieces: Sequence[Piece], x0: Array
) -> Proof:
    if system.m != 2 * rows.heights.shape[1]:
        raise NotProvedError(f"wanted heights of {system.m // 2} inputs, got {rows.heights.shape[1]}")
    if pieces[-1].end < decimal(float(rows.times[-1])):
        raise NotProvedError("the pieces end before the rows")
    rows.refuse_steep()
    begins = [begin for begin, _ in system.pieces]
    of = [sum(begin <= piece.begin for begin in begins) - 1 for piece in pieces]
    loose = looseness(rows, found)
    by_pieces = replace(loose, peak=loose.peak[of], mean=loose.mean[of])
    return prove_open(system, proved_metric(system, S), pieces, x0.tolist(), by_pieces)


def to_json(certificate: RowsCertificate) -> bytes:
    """The certificate as a file's bytes, with the hash of its content."""
    rows = certificate.rows
    return sealed(
        {
            "format": FORMAT,
            "kind": KIND,
            "theorem": THEOREM,
            "model": certificate.model,
            "times": rows.times.tolist(),
            "heights": rows.heights.tolist(),
            "class": rows.between.kind,
            "bound": rows.between.bound,
            "windows": [{"rows": [w.first, w.last], "u": w.coefficients.tolist()} for w in certificate.windows],
            "x0": certificate.x0.tolist(),
            "metric": certificate.S.tolist(),
            "claims": claims_json(certificate.claims),
            "pieces": pieces_json(certificate.pieces),
        }
    )


def certificate_of(content: dict[str, Any]) -> RowsCertificate:
    """The certificate from its plain data; raises what reading wrong data raises."""
    keys = "format kind theorem model times heights class bound windows x0 metric claims pieces"
    strict.of_keys(content, keys.split())
    strict.theorem(content["theorem"], THEOREM)
    between = RowClass(strict.text(content["class"]), float(strict.numbers(content["bound"], 0)))
    if between.kind not in ("curv", "lip") or not between.bound >= 0.0:
        raise ValueError(f"wanted the class curv or lip with a bound >= 0, got {between}")
    rows = InputRows(strict.numbers(content["times"], 1), strict.numbers(content["heights"], 2), between)
    found = tuple(_window(each, rows) for each in content["windows"])
    x0 = strict.numbers(content["x0"], 1)
    S, model, claims = system_of(content, len(x0))
    return RowsCertificate(model, rows, found, x0, S, pieces_of(content["pieces"], len(x0)), claims)


def _window(value: Any, rows: InputRows) -> Window:
    strict.of_keys(value, ("rows", "u"))
    first, last = value["rows"]
    coefficients = strict.numbers(value["u"], 2)
    if not (type(first) is type(last) is int and 0 <= first < last < len(rows.times)):
        raise ValueError(f"a window has the rows {first!r} to {last!r}, of {len(rows.times)}")
    if len(coefficients) != rows.heights.shape[1] or not 2 <= coefficients.shape[1] <= 100:
        raise ValueError(f"a window has coefficients of the shape {coefficients.shape}")
    return Window(first, last, coefficients)
