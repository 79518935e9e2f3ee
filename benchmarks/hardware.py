"""What a real car's hardware leaves of the control: `bump-lqr` under each design with each part of it, as Markdown.

Heave, roll, pitch settled [s], heave acceleration weighted by Wk, largest over a running second [m/s²], energy given
and taken by the actuators [J]; with the estimate for two noises.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from analysis.cosimulation import simulate
from analysis.ride import ride
from analysis.scenario import read_scenario
from fmu_src.controller.law import DESIGN

SAMPLED = {"sample_time": 0.01}
VARIANTS: dict[str, dict[str, float | str | bool]] = {
    "ideal": {},
    "`force_limit` 20 N": {"force_limit": 20.0},
    "`actuator_lag` 20 ms": {"actuator_lag": 0.02},
    "`sample_time` 10 ms": {**SAMPLED},
    "the same, `estimate`": {**SAMPLED, "feedback": "estimate"},
    "the same, `seed` 5": {**SAMPLED, "feedback": "estimate", "seed": 5.0},
    "`semi-active`": {"actuators": "semi-active"},
}


def row(words: str, parameters: dict[str, float | str | bool]) -> str:
    """One run's line of the table."""
    scenario = read_scenario("bump-lqr")
    found = ride(simulate(replace(scenario, parameters={**scenario.parameters, **parameters})))
    settled = ", ".join(f"{t:.2f}" for t in found.settled)
    return f"| {words} | {settled} | {found.transient:.3f} | {found.energy_spent:.2f} / {found.energy_taken:.2f} |"


if __name__ == "__main__":
    print("| hardware | settled [s] | Wk [m/s²] | energy [J] |\n|---|---:|---:|---:|")
    print(row("none: passive", {"enabled": False}))
    for design in DESIGN.values:
        for words, parameters in VARIANTS.items():
            print(row(f"{design}, {words}", {"design": design, **parameters}), flush=True)
