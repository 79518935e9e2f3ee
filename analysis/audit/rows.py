"""A row of the audit: what is printed, what it should be, and numbers that decide between the two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

MISPRINT, FAILS, READING = "misprint", "does not hold", "right, if read so"
RIGHT, REFUTED, INSPECTION = "right as printed", "claim refuted", "by inspection"
"""Kinds of rows. A misprint is a formula that fails where the derived form passes; so does a sentence or condition that
does not hold; and so does the nearest reading of what is right if read otherwise, which is no misprint. What is right
passes as the derived form does; a claim is refuted by a test that both the printed and the derived system pass. By
inspection: the words contradict themselves or what stands beside them; such a row has no number and claims none."""

FAILING = (MISPRINT, FAILS, READING)
UNDECIDED = "NOT DECIDED"


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """One measure of the printed and of the derived form.

    expected  : what a right form gives, within ± tolerance.
    apart     : least distance from `expected` at which a form is refuted (≥ tolerance).
    """

    measure: str
    printed: float
    derived: float
    unit: str
    expected: float = 0.0
    tolerance: float
    apart: float

    def decides(self, kind: str) -> bool:
        """Whether the derived form passes, and the printed one fails or passes as the kind has it; nan never does."""
        off = abs(self.printed - self.expected)
        as_claimed = off >= self.apart if kind in FAILING else off <= self.tolerance
        return self.apart >= self.tolerance and abs(self.derived - self.expected) <= self.tolerance and as_claimed


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """An equation or sentence of the paper that was audited."""

    equation: str
    printed: str
    derived: str
    evidence: Sequence[Evidence] = ()
    kind: str = MISPRINT
    note: str = ""

    @property
    def holds(self) -> bool:
        """Whether there is evidence and every number of it decides as the row claims; by inspection there is none."""
        if self.kind == INSPECTION:
            return not self.evidence
        return bool(self.evidence) and all(e.decides(self.kind) for e in self.evidence)

    @property
    def verdict(self) -> str:
        """The kind, if the numbers bear it out."""
        return self.kind if self.holds else UNDECIDED

    def as_json(self) -> dict[str, Any]:
        """All fields and the verdict."""
        evidence = [{**asdict(e), "decides": e.decides(self.kind)} for e in self.evidence]
        return {**asdict(self), "evidence": evidence, "verdict": self.verdict}
