"""§3.1: evidence on the seven equations, on each misprint by itself and on the whole print."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from fmu_src.quantities import PARAMETERS

from ..derivation import derive
from . import assumptions, printed_car
from .differences import CONVENTION, Difference, differences, plain
from .rows import RIGHT, Evidence, Row
from .system import SAMPLING, Array, System, derived, energy, planted, power_residual, printed

SAMPLE, SEED = 4000, 2026  # so many that the seed does not count
ROUND_OFF = 1e-12
BUMPS = PARAMETERS["A"].start * np.array([1.0, 2.0, 4.0])  # m
CROSSING = np.linspace(0.0, 0.6, round(0.6 / SAMPLING) + 1)  # s, holds the peaks of all states


def rows() -> list[Row]:
    """§3.1 in the order of the paper."""
    return [assumptions.rotation(), *map(_misprint, differences(CONVENTION)), _whole(), _statics(), *assumptions.rows()]


def in_convention_a() -> list[Row]:
    """The changes that convention A needs, each with its power balance; the rows are those of convention B."""
    return [
        Row(equation=d.equation, printed=plain(d.printed), derived=plain(d.derived), evidence=_battery(d, "A"))
        for d in differences("A")
    ]


def _misprint(difference: Difference) -> Row:
    evidence = _battery(difference, CONVENTION)
    if any(e.measure == EVENNESS for e in evidence):
        evidence.append(_order_of_discrepancy(difference))
    return Row(
        equation=difference.equation,
        printed=plain(difference.printed),
        derived=plain(difference.derived),
        evidence=evidence,
    )


# ------------------------------------------------------------------ one misprint, all laws
@cache
def sample(seed: int = SEED) -> tuple[Array, Array, Array, Array]:
    """q (7), q̇ (7), h (4), ḣ (4) in SAMPLE columns; angles of about 0.3 rad, heights of 0.1 m."""
    rng = np.random.default_rng(seed)
    q, v = (
        rng.normal(size=(7, SAMPLE)) * np.array([[0.1, 0.3, 0.3, 0.1, 0.1, 0.1, 0.3]]).T,
        rng.normal(size=(7, SAMPLE)),
    )
    return q, v, 0.1 * rng.normal(size=(4, SAMPLE)), rng.normal(size=(4, SAMPLE))


def power_from_nowhere(system: System, seed: int = SEED) -> float:
    """Sum of all powers that come from nowhere, over that of road and dampers: one motion of the sample is no more."""
    residual, turnover = power_residual(system, *sample(seed))
    return float(np.abs(residual).sum() / turnover.sum())


def damping_asymmetry(system: System) -> float:
    D = system.linear.D
    return float(np.abs(D - D.T).max() / np.abs(D).max())


def creating_rate(system: System) -> float:
    """Least eigenvalue of the damping matrix's symmetric part, weighted by the masses: below 0, it gives energy."""
    linear = system.linear
    weight = 1.0 / np.sqrt(linear.M)
    return float(np.linalg.eigvalsh(weight[:, None] * (linear.D + linear.D.T) / 2.0 * weight).min())


def stiffness_asymmetry(system: System) -> float:
    K = system.linear.K
    return float(np.abs(K - K.T).max() / np.abs(K).max())


def evenness(system: System, seed: int = SEED) -> float:
    """Even part of the accelerations over the odd one, each summed over the sample, largest over coordinates."""
    q, v, h, _ = sample(seed)
    there, back = system.accelerations(q, v, h), system.accelerations(-q, -v, -h)
    return float((np.abs(there + back).sum(axis=1) / np.abs(there - back).sum(axis=1)).max())


def force_on_tilted_road(system: System) -> float:
    """Car and road rolled together by a small angle: the generalized forces left over, over those of the road alone."""
    car, linear = system.car, system.linear
    height = np.array([car.s1, -car.s1, car.s2, -car.s2])
    q = system.sign * np.array([0.0, 1.0, 0.0, car.s1, -car.s1, 0.0, 1.0])
    road = linear.P @ height
    return float(np.abs(linear.K @ q - road).max() / np.abs(linear.K @ q).max())


def undefined_symbols(system: System) -> float:
    d = derive()
    known = printed_car.NOMENCLATURE | {*d.q, *d.v, *d.a, *d.h}
    return float(len(system.equations.free_symbols - known))


EVENNESS = "even part of the accelerations, summed over motions drawn at random, over the odd one, of an odd system"
LAWS: dict[str, tuple[Callable[[System], float], str, float, float]] = {
    "symbols that the nomenclature does not have": (undefined_symbols, "1", 0.0, 1.0),
    "power from nowhere, summed over motions drawn at random, over that of road and dampers": (
        power_from_nowhere,
        "1",
        ROUND_OFF,
        1e-4,
    ),
    "damping matrix, largest |D − Dᵀ| over largest |D|": (damping_asymmetry, "1", ROUND_OFF, 1e-2),
    "least eigenvalue of the damping's symmetric part by mass": (creating_rate, "1/s", ROUND_OFF, 1e-2),
    "stiffness matrix, largest |K − Kᵀ| over largest |K|": (stiffness_asymmetry, "1", ROUND_OFF, 1e-2),
    EVENNESS: (evenness, "1", ROUND_OFF, 1e-3),
    "force left when car and road are rolled together, over the springs'": (force_on_tilted_road, "1", ROUND_OFF, 1e-2),
}
"""What any car obeys: measure -> (function, 0 for a right system; unit; tolerance; least value that refutes)."""


def _battery(difference: Difference, convention: str) -> list[Evidence]:
    """All laws on the derived equations with this one misprint in them; those that it breaks are evidence."""
    wrong, right = planted(difference, convention), derived(convention)
    measured = [
        Evidence(measure=measure, printed=law(wrong), derived=law(right), unit=unit, tolerance=tolerance, apart=apart)
        for measure, (law, unit, tolerance, apart) in LAWS.items()
    ]
    return [e for e in measured if abs(e.printed) >= e.apart]


def _order_of_discrepancy(difference: Difference) -> Evidence:
    row = difference.row
    name = plain(derive().q[row])
    return Evidence(
        measure=f"order in the bump's height A of the discrepancy x − x_lin, coordinate {name} (A = 10, 20, 40 mm)",
        printed=discrepancy_order(planted(difference, CONVENTION), row),
        derived=discrepancy_order(derived(CONVENTION), row),
        unit="1",
        expected=3.0,
        tolerance=0.05,
        apart=0.5,
    )


def discrepancy_order(system: System, row: int) -> float:
    """Slope of log max |q − q_lin| over log A."""
    off = [
        np.abs(system.over_the_bump(CROSSING, A)[:, row] - system.linear_over_the_bump(CROSSING, A)[:, row]).max()
        for A in BUMPS
    ]
    return float(np.polyfit(np.log(BUMPS), np.log(off), 1)[0])


# ------------------------------------------------------------------ the whole print
def _whole() -> Row:
    return Row(
        equation="(3.1)–(3.7)",
        printed="the damping of all seven equations together",
        derived="that of Rayleigh's function, ½ Σ b Δ̇²",
        evidence=[
            _law(LAWS_OF_DAMPING[0]),
            _law(LAWS_OF_DAMPING[1]),
            Evidence(
                measure="largest gain of energy from a free start, over the energy at the start",
                printed=energy_gained(printed(CONVENTION)),
                derived=energy_gained(derived(CONVENTION)),
                unit="1",
                tolerance=1e-9,
                apart=1e-4,
            ),
        ],
    )


def _statics() -> Row:
    wrong, right = printed(CONVENTION), derived(CONVENTION)
    return Row(
        equation="(3.1)–(3.7)",
        printed="the stiffness of all seven equations together, and the stability of rest",
        derived="the same",
        evidence=[
            _law("stiffness matrix, largest |K − Kᵀ| over largest |K|"),
            Evidence(
                measure="eigenvalues of the default car with a real part ≥ 0",
                printed=float(np.sum(np.linalg.eigvals(wrong.linear.A).real >= 0.0)),
                derived=float(np.sum(np.linalg.eigvals(right.linear.A).real >= 0.0)),
                unit="1",
                tolerance=0.0,
                apart=1.0,
            ),
        ],
        kind=RIGHT,
    )


LAWS_OF_DAMPING = (
    "damping matrix, largest |D − Dᵀ| over largest |D|",
    "least eigenvalue of the damping's symmetric part by mass",
)


def _law(measure: str) -> Evidence:
    law, unit, tolerance, apart = LAWS[measure]
    wrong, right = printed(CONVENTION), derived(CONVENTION)
    return Evidence(
        measure=measure, printed=law(wrong), derived=law(right), unit=unit, tolerance=tolerance, apart=apart
    )


def energy_gained(system: System) -> float:
    """(largest E − E(0))/E(0) [1] of a free motion of 1 J that starts where the print's damping gives most power."""
    linear = printed(system.convention, system.car).linear
    weight = 1.0 / np.sqrt(linear.M)
    _, modes = np.linalg.eigh(weight[:, None] * (linear.D + linear.D.T) / 2.0 * weight)
    start = np.concatenate([np.zeros(7), np.sqrt(2.0) * weight * modes[:, 0]])
    E = energy(system, system.over_the_bump(np.linspace(0.0, 0.5, 2001), 0.0, start))
    return float(E.max() / E[0] - 1.0)
