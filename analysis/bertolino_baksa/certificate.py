"""Certificates: the statement of definition 2.1 in words and numbers, with all that is needed to prove it anew.

`certify` finds pieces and a table of δ(ε); `verify` proves a certificate's claims from its own numbers, by defect and
logarithmic norm, however they were found. The proof itself (`proof.prove`, `Proof.epsilon`) and the exact
equations serve both: a fault in them would be made twice. What is independent of them is `adversary`.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from flint import fmpq

from ..errors import InputError
from . import strict
from .balls import Array, ExactSystem, NotProvedError, precision
from .norms import Norm, proved_metric
from .pieces import Piece
from .proof import Proof, prove
from .taylor import find_pieces

FORMAT = 1
ROWS = 24  # of a table δ(ε)
FIRST = 1e-3  # of the floor: what the smallest δ may add to it
FLOOR = 1e-6  # of the motion: a smaller floor is not told from none
CLOSE = 0.95  # of a δ that failed: near enough for a largest δ
HUGE = 1e30  # beyond every δ, but those of a system that is linear
MARGIN = 1e-6  # relative, by which claims stand off what was proved
MAX_BYTES = 200_000_000
THEOREM = (
    "Let psi = x_lin be the solution of the linear part x' = A x + B w(t) of x' = F(x, w(t)) with psi(0) = x0. For "
    "every eps >= l let delta(eps) be the largest delta of the table whose eps is not above it. Then every solution x "
    "with N(x(0) - psi(0)) < delta(eps) satisfies N(x(t) - psi(t)) < eps for all t >= 0: psi is an almost stable "
    "approximate solution (definition 2.1, Bertolino and Baksa). N(x) = |T x|_2, or max |(T x)_i| where the norm says "
    "so; all numbers are SI and exact as printed."
)
Build = Callable[[dict[str, Any]], ExactSystem]
Norms = Callable[[Array], tuple[Norm, ...]]
Read = TypeVar("Read")


@dataclass(frozen=True, slots=True)
class Claim:
    """The floor l in a norm, and the table of δ(ε): rows (ε, δ), both rising; l is the first ε."""

    norm: Norm
    table: Array  # (rows, 2)

    @property
    def floor(self) -> float:
        """l."""
        return float(self.table[0, 0])

    @property
    def largest_delta(self) -> float:
        """δ_max: beyond its ε, δ stays there."""
        return float(self.table[-1, 1])

    def delta(self, epsilon: float) -> float:
        """δ(ε). Raises InputError for ε < l, about which nothing is claimed."""
        if not epsilon >= self.floor:
            raise InputError(f"epsilon = {epsilon!r}: wanted at least l = {self.floor:.6g} ({self.norm.name} norm)")
        return float(self.table[np.searchsorted(self.table[:, 0], epsilon, side="right") - 1, 1])


@dataclass(frozen=True, slots=True)
class Certificate:
    """What a certificate file holds; `model` says which system, in the words of whoever builds it."""

    model: dict[str, Any]
    x0: Array
    S: Array
    pieces: tuple[Piece, ...]
    claims: tuple[Claim, ...]


def certify(
    model: dict[str, Any], build: Build, S: Array, norms: Norms, stops: Sequence[fmpq], x0: Array
) -> tuple[Certificate, Proof]:
    """Find pieces and the largest table of δ(ε) in each norm; norms are made from x_lin's values (n, …).

    stops : ends of the pieces [s], rising: the first from which on the tail has no part in the floors is taken.

    Raises NotProvedError, with what failed, if there is no certificate.
    """
    with precision(2):
        system = build(model)
        for stop in stops:
            pieces = tuple(find_pieces(system, x0.tolist(), stop))
            proof = prove(system, proved_metric(system, S), pieces, x0.tolist())
            x_lin = motion(pieces)
            floors = [(norm, float(proof.epsilon(norm, np.zeros(1))[0])) for norm in norms(x_lin)]
            if all(proof.settled(norm, floor) for norm, floor in floors):
                break
        claims = tuple(claim_of(proof, norm, floor, float(norm(x_lin).max())) for norm, floor in floors)
    return Certificate(model, x0, S, pieces, claims), proof


def motion(pieces: Sequence[Piece], points: int = 9) -> Array:
    """x_lin's polynomials (n, pieces · points) at even times over each piece, its ends among them."""
    tau = np.linspace(0.0, 1.0, points)
    return np.concatenate([p.linear @ tau ** np.arange(p.linear.shape[1])[:, None] for p in pieces], axis=1)


class Proved(Protocol):
    """What a table of δ(ε) is made from; see `Proof`."""

    def epsilon(self, norm: Norm, delta: Array) -> Array: ...

    def bounded(self, norm: Norm, delta: float) -> bool: ...

    def carried(self, norm: Norm) -> float: ...


def claim_of(proof: Proved, norm: Norm, floor: float, scale: float) -> Claim:
    """The table with the largest δ that is found; its smallest δ raises the floor by but FIRST of it.

    floor : what is proved of δ = 0.
    scale : N of the largest motion of x_lin, or 1 where that rests; a floor of 0 becomes FLOOR of it, as l > 0.
    """
    scale = scale or 1.0
    floor = max(floor, FLOOR * scale)
    if not floor < np.inf:
        raise NotProvedError(f"no bound for all t in the {norm.name} norm")
    first = FIRST * floor / proof.carried(norm)
    top = _largest(proof, norm, first)
    while True:  # once more: all together
        delta = np.geomspace(first, top, ROWS) * (1.0 - MARGIN)
        epsilon = proof.epsilon(norm, delta)
        if np.all(np.isfinite(epsilon)):
            break
        if not top > first:
            raise NotProvedError(f"no delta > 0 in the {norm.name} norm")
        top = max(CLOSE * top, first)
    return Claim(norm, np.stack([np.maximum.accumulate(epsilon) * (1.0 + MARGIN), delta], axis=1))


def _largest(proof: Proved, norm: Norm, first: float) -> float:
    """A δ ≥ first that is proved, while one at most 1/CLOSE times as large is not (or is above HUGE): by halving."""
    if not proof.bounded(norm, first):
        raise NotProvedError(f"no delta > 0 in the {norm.name} norm")
    proved, failed = first, max(HUGE, 2.0 * first)
    while not proved > CLOSE * failed:
        delta = math.sqrt(proved) * math.sqrt(failed)
        if proof.bounded(norm, delta):
            proved = delta
        else:
            failed = delta
    return proved


def verify(certificate: Certificate, build: Build) -> Proof:
    """Prove every claim of the certificate anew. Raises NotProvedError with the first that cannot be proved."""
    with precision(2):
        system = build(certificate.model)
        proof = prove(system, proved_metric(system, certificate.S), certificate.pieces, certificate.x0.tolist())
        for claim in certificate.claims:
            refuse_unproved(claim, proof.epsilon(claim.norm, claim.table[:, 1]).tolist())
    return proof


def refuse_unproved(claim: Claim, epsilon: Sequence[float]) -> None:
    """Raise NotProvedError with the first row of the claim's table whose ε is below what is proved of its δ."""
    for (claimed, delta), proved in zip(claim.table.tolist(), epsilon, strict=True):
        if not proved <= claimed:
            raise NotProvedError(
                f"{claim.norm.name} norm, delta = {delta!r}: claimed eps = {claimed!r}, proved {proved!r}"
            )


def to_json(certificate: Certificate) -> bytes:
    """The certificate as a file's bytes, with the hash of its content."""
    return sealed(
        {
            "format": FORMAT,
            "theorem": THEOREM,
            "model": certificate.model,
            "x0": certificate.x0.tolist(),
            "metric": certificate.S.tolist(),
            "claims": claims_json(certificate.claims),
            "pieces": pieces_json(certificate.pieces),
        }
    )


def sealed(content: dict[str, Any]) -> bytes:
    """A file's bytes: the content after its hash."""
    return json.dumps({"sha256": _hash(content), **content}, indent=1, allow_nan=False).encode() + b"\n"


def claims_json(claims: Sequence[Claim]) -> list[dict[str, Any]]:
    """Claims as plain data."""
    return [
        {
            "norm": {"name": c.norm.name, "largest": c.norm.largest, "T": c.norm.T.tolist()},
            "l": c.floor,
            "delta of eps": [{"eps": e, "delta": d} for e, d in c.table.tolist()],
        }
        for c in claims
    ]


def pieces_json(pieces: Sequence[Piece]) -> list[dict[str, Any]]:
    """Pieces as plain data."""
    return [
        {"begin": str(p.begin), "end": str(p.end), "x_lin": p.linear.tolist(), "e": p.error.tolist()} for p in pieces
    ]


def _hash(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def from_json(data: bytes, where: str) -> Certificate:
    """Read a certificate. Raises InputError if it is not one, or if it was altered."""
    return opened(data, where, certificate_of)


def opened(data: bytes, where: str, read: Callable[[dict[str, Any]], Read]) -> Read:
    """What `read` makes of a file's content. Raises InputError if it cannot be read, or if it was altered."""
    if len(data) > MAX_BYTES:
        raise InputError(f"{where}: wanted at most {MAX_BYTES} bytes, got {len(data)}")
    try:
        content = strict.loads(data)
        stated = content.pop("sha256")
        if type(content["format"]) is not int or content["format"] != FORMAT:
            raise InputError(f"{where}: wanted a certificate of format {FORMAT}, got {content['format']!r}")
        if stated != _hash(content):
            raise InputError(f"{where}: the content does not have the hash that it states: it was altered")
        return read(content)
    except InputError:  # a ValueError too, which has said all
        raise
    except (LookupError, TypeError, ValueError, AttributeError, RecursionError, ArithmeticError) as error:
        raise InputError(f"{where}: cannot be read as a certificate: {type(error).__name__}: {error}") from error


def certificate_of(content: dict[str, Any]) -> Certificate:
    """The certificate from its plain data; raises what reading wrong data raises."""
    strict.of_keys(content, ("format", "theorem", "model", "x0", "metric", "claims", "pieces"))
    strict.theorem(content["theorem"], THEOREM)
    x0 = strict.numbers(content["x0"], 1)
    S, model, claims = system_of(content, len(x0))
    return Certificate(model, x0, S, pieces_of(content["pieces"], len(x0)), claims)


def pieces_of(content: Any, n: int) -> tuple[Piece, ...]:
    """Pieces of n states from plain data; raises ValueError where they cannot be."""
    pieces = []
    for p in content:
        strict.of_keys(p, ("begin", "end", "x_lin", "e"))
        linear, error = strict.numbers(p["x_lin"], 2), strict.numbers(p["e"], 2)
        if not (linear.shape == error.shape and len(linear) == n and 2 <= linear.shape[1] <= 100):
            raise ValueError(f"a piece has coefficients of the shapes {linear.shape} and {error.shape}")
        begin, end = strict.fraction(p["begin"]), strict.fraction(p["end"])
        if not end > begin:
            raise ValueError(f"a piece runs from {begin} to {end}")
        pieces.append(Piece(begin, end, linear, error))
    if not pieces:
        raise ValueError("wanted pieces")
    return tuple(pieces)


def system_of(content: dict[str, Any], n: int) -> tuple[Array, dict[str, Any], tuple[Claim, ...]]:
    """Metric, model and claims of n states from plain data; raises ValueError where they cannot be."""
    return square(content["metric"], n), model_in(content), claims_of(content["claims"], n)


def square(content: Any, n: int) -> Array:
    """A matrix of n states from plain data; raises ValueError for any other."""
    found = strict.numbers(content, 2)
    if found.shape != (n, n):
        raise ValueError(f"wanted a matrix of {n} states, got the shape {found.shape}")
    return found


def model_in(content: dict[str, Any]) -> dict[str, Any]:
    """The model; raises ValueError if it is no object."""
    model = content["model"]
    if not isinstance(model, dict):
        raise ValueError("wanted a model")
    return model


def claims_of(content: Any, n: int) -> tuple[Claim, ...]:
    """Claims of n states from plain data, one at least; raises ValueError where they cannot be."""
    claims = []
    for c in content:
        norm = strict.of_keys(strict.of_keys(c, ("norm", "l", "delta of eps"))["norm"], ("name", "largest", "T"))
        rows = [strict.of_keys(row, ("eps", "delta")) for row in c["delta of eps"]]
        table, floor = strict.numbers([[row["eps"], row["delta"]] for row in rows], 2), strict.numbers(c["l"], 0)
        if not (np.all(np.diff(table, axis=0) >= 0.0) and table[0, 1] > 0.0 and table[0, 0] == floor):
            raise ValueError("delta(eps) must rise, from l and a delta > 0 on")
        claims.append(
            Claim(Norm(strict.text(norm["name"]), square(norm["T"], n), strict.truth(norm["largest"])), table)
        )
    if not claims:
        raise ValueError("wanted claims")
    return tuple(claims)
