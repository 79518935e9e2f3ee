"""The series (3.15)–(3.16) against a run: what each order leaves of the exported motion is the next order's term."""

from __future__ import annotations

import numpy as np

from fmu_src.quantities import FORCES, STATES

from .car import car_form
from .check import own_error
from .discrepancy import scales
from .errors import InputError
from .findings import Finding
from .methods.modes import modes
from .methods.polynomials import Array
from .methods.sampled_series import sampled_series
from .methods.series import partial_sums, successive_ratios
from .recorded_road import recorded_road
from .reference import car_of
from .trajectory import Run

ORDERS = 3  # that are compared with the run; one more term is formed, to know what the last one leaves
MOST_ROWS = 20_000  # of the run that are compared, from its first
HIGH_AS_A = ("bump", "sine", "step")  # profiles of which A is the height
USEFUL = 0.5  # ratio of successive terms from which on a few of them say nothing about the motion


def series_findings(run: Run) -> tuple[list[Finding], str]:
    """A finding for each order of the series under the exported road and forces; if there is none, why.

    For runs that `check` takes: all columns, at least two rows.
    """
    t = run.trajectory.time[:MOST_ROWS]
    x = run.trajectory.columns([q.name for q in STATES])[:MOST_ROWS].T
    try:
        terms, ratio = series_terms(run, t, x[:, 0], ORDERS)
    except InputError as error:  # no modes
        return [], str(error)
    if not np.abs(terms[0]).any():
        return [], "the car stands still"
    if not ratio < USEFUL:
        return [], f"the motion is too large: each term is up to {ratio:.2g} times the one before, wanted < {USEFUL:g}"
    scale = scales(x.T)[:, None]
    errors = [_sup((x - approximation) / scale) for approximation in partial_sums(terms)[:ORDERS]]
    sizes = [_sup(term / scale) for term in terms]
    tails = [sum(sizes[k + 2 :]) + sizes[-1] * ratio / (1.0 - ratio) for k in range(ORDERS)]
    accuracy = own_error(run)
    table = f"errors of order 0, 1, …: {', '.join(f'{e:.2g}' for e in errors)}; {_radius(ratio, run)}"
    return [
        Finding(
            claim=f"the series to order {k} leaves of the run what its next term says: largest difference, over each "
            "state's maximum",
            equation="(3.15)–(3.16)",
            measured=errors[k],
            expected=sizes[k + 1],
            tolerance=tails[k] + accuracy,
            unit="1",
            source=f"trajectory.csv, all states, to {t[-1]:g} s; {table}"
            + ("; less than the run's own error may be" if sizes[k + 1] < accuracy else ""),
        )
        for k in range(ORDERS)
    ], ""


@np.errstate(over="ignore", invalid="ignore")  # of motions that are far too large
def series_terms(run: Run, t: Array, x0: Array, order: int) -> tuple[Array, float]:
    """x⁽ᵏ⁾ (order + 1, 14, len(t)) at the rows' times t from x0, and the largest ratio of successive terms.

    Under the exported road and forces. Raises InputError for a car without modes.
    """
    form = car_form(car_of(run.parameters), forces=True, order=2 * order + 1)
    road, forces = recorded_road(run.trajectory), run.trajectory.columns([q.name for q in FORCES])

    def w(times: Array) -> Array:
        row = np.searchsorted(t, times, side="right") - 1
        return np.concatenate([road(times).T, road(times, 1).T, forces[row].T])

    found = sampled_series(form, modes(form.A), w, t, x0, order)
    xi = found.modal(t)
    return (found.modes.K @ xi).real, float(successive_ratios(xi).max()) if xi[0].any() else 0.0


def _radius(ratio: float, run: Run) -> str:
    """Within which ε, and within which motions, terms get smaller: ε stands for the square of a motion's size.

    With the road's height where that alone makes the motion: from rest, under no forces.
    """
    if ratio == 0.0:
        return "no terms but the linear one"
    times = ratio**-0.5
    states, forces = (run.trajectory.columns([q.name for q in table]) for table in (STATES, FORCES))
    alone = run.parameters.get("profile") in HIGH_AS_A and not states[0].any() and not forces.any()
    road = f", A = {times * run.reals('A')[0]:.3g} m" if alone else ""
    return (
        f"factor between the terms {ratio:.2g}, so practical radius ε < {1.0 / ratio:.3g}: motions up to {times:.3g} "
        f"times this one{road}"
    )


def _sup(values: Array) -> float:
    return float(np.abs(values).max())
