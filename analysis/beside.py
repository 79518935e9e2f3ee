"""The runs beside a run: the same scenario without control and with either design of it, as far as it is not that."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from fmu_src.controller.law import DESIGN

from .cosimulation import simulate
from .errors import CosimError
from .scenario import Scenario
from .trajectory import COUNTERPART, OTHER_DESIGN, Run, write_run


def scenarios_beside(scenario: Scenario, run: Run) -> dict[str, Scenario]:
    """By folder: the controller switched the other way; the controller on, with the other design."""
    on, design = not run.parameters["enabled"], run.parameters["design"]
    (other,) = (each for each in DESIGN.values if each != design)

    def changed(words: str, **parameters: str | bool) -> Scenario:
        return replace(scenario, name=f"{scenario.name}, {words}", parameters={**scenario.parameters, **parameters})

    return {
        COUNTERPART: changed(f"control {'on' if on else 'off'}", enabled=on),
        OTHER_DESIGN: changed(f"{other} design", enabled=True, design=other),
    }


def simulate_beside(scenario: Scenario, run: Run, folder: Path) -> None:
    """Simulate them into folders within that of the run; where one cannot be simulated, say so and go on."""
    for name, other in scenarios_beside(scenario, run).items():
        try:
            made = simulate(other, progress=True)
        except CosimError as error:
            print(f"no run beside this one for comparison ({other.name}): {error}", file=sys.stderr)
            continue
        (folder / name).mkdir()
        write_run(made, folder / name)
