"""Findings: claims with the number that decides them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .files import write_whole


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A claim, what was measured, what was expected and within which tolerance; nan never holds."""

    claim: str
    equation: str
    measured: float
    expected: float
    tolerance: float
    unit: str
    source: str

    @property
    def holds(self) -> bool:
        return abs(self.measured - self.expected) <= self.tolerance

    @property
    def line(self) -> str:
        """The verdict in one line of a terminal."""
        verdict = "holds" if self.holds else "FAILS"
        wanted = f"wanted {self.expected:g} ± {self.tolerance:.2g}"
        return f"{verdict}: {self.claim}: {self.measured:.3g} ({wanted}; {self.source})"

    def as_json(self) -> dict[str, Any]:
        """All fields and the verdict."""
        return {**asdict(self), "holds": self.holds}


def write_findings(findings: Sequence[Finding], path: Path) -> None:
    """Write a findings.json: a list of all findings with their verdicts."""
    text = json.dumps([f.as_json() for f in findings], indent=1, ensure_ascii=False) + "\n"
    write_whole(path, text.encode())
