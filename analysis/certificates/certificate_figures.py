"""What a certificate looks like: δ(ε) beside what an adversary reaches, and a run in the tube around x_lin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from fmu_src.quantities import POSITIONS, STATES, Quantity

from ..bertolino_baksa.certificate import Certificate, Claim
from ..bertolino_baksa.funnel import ends, funnel
from ..bertolino_baksa.proof import Proof
from ..figures import BLUE, DASHED, ORANGE, READING, RED, Axes, Subject, axis_label, finish, readable, render, words
from ..methods.polynomials import Array
from ..run_figures import DELTA, TUBE
from ..trajectory import Run
from .adversary_points import Points
from .car_certificates import linear_motion
from .directed import at_least, at_most

UNITS = {"energy": "√J", "weighted sup": "–", "Euclid": "SI"}
SHOWN = 0.1  # of the largest N(x_lin): a start as far off is shown with its tube
LOWEST = 1e-3  # of the floor: what the logarithmic axis of N(x − x_lin) begins with
PALE = "#dfe9f2"


# ---------------------------------------------------------------------------------------------------- δ(ε)
def draw_delta(points: Sequence[Points]) -> bytes:
    """The curves δ(ε) as SVG, with their caption in it."""
    subject = Subject(
        file=DELTA,
        title="How far off x_lin a motion may start, and how far it then gets",
        caption=partial(_delta_caption, points),
        panels=[partial(_delta_panel, each) for each in points],
        sources=(),
        needs=(),
        shared=False,
    )
    return render(subject, subject.caption())


def _delta_caption(points: Sequence[Points]) -> str:
    said = []
    for each in points:
        floor = f" = {readable(each.claim.floor / each.floor, 5)} times what is reached" if each.floor > 0.0 else ""
        said.append(
            f"{each.claim.norm.name}: l = {_typeset(at_most(each.claim.floor))}{floor}, "
            f"δ_max = {_typeset(at_least(each.claim.largest_delta))}, "
            f"certified over found ε up to {readable(each.near, 3)} for "
            f"δ ≤ δ_max/3 and {readable(each.ratio[-1], 3)} at δ_max"
        )
    return (
        "Definition 2.1. Line: proved; all motions that start within δ(ε) of x_lin stay within ε of it for all t ≥ 0. "
        "Nothing is claimed below the floor l; beyond its last corner the line stays at δ_max. Dots: starts at that δ "
        "that were found to get as far as that ε, so that no δ(ε) can be higher there: the largest that is true lies "
        f"between line and dots. {'; '.join(said)}."
    )


def _typeset(number: str) -> str:
    return number.replace("-", "−")


def _delta_panel(points: Points, ax: Axes) -> Axes:
    claim, unit = points.claim, UNITS.get(points.claim.norm.name, "")
    epsilon, delta = claim.table.T
    left, right = 0.4 * claim.floor, 4.0 * max(epsilon[-1], points.found[-1])
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.axvspan(left, claim.floor, color="#eeeeee", linewidth=0.0)
    label = "certified $\\delta(\\varepsilon)$"
    ax.step(np.append(epsilon, right), np.append(delta, delta[-1]), where="post", color=BLUE, label=label)
    ax.plot(points.found, points.rows[:, 1], "o", color=RED, markersize=3.5, label="reached by an adversary")
    ax.axvline(claim.floor, color=ORANGE, linestyle=DASHED, linewidth=1.0, label="floor $l$")
    ax.axhline(delta[-1], color="#777777", linestyle=":", linewidth=1.0, label="$\\delta_{max}$")
    ax.set_xlim(left, right)
    ax.set_xlabel(f"$\\varepsilon$ [{unit}], {claim.norm.name} norm")
    ax.set_ylabel(f"$\\delta$ [{unit}]")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.2)
    return ax


# ---------------------------------------------------------------------------------------------------- the tube
@dataclass(frozen=True, slots=True)
class InTube:
    """A run beside x_lin (n, 14) from rest, and what is proved at its times (n, …); nan after the last piece."""

    run: Run
    linear: Array
    claim: Claim
    row: tuple[float, float]  # (ε, δ) of the tube that is shown
    tube: Array  # (n, 14): for all starts within that δ
    size: Array  # (n,): of N(x − x_lin), for a start as far off as the run's
    bound: Array  # (n, 14): the same of each state

    @property
    def off(self) -> Array:
        """x − x_lin (n, 14)."""
        return np.asarray(self.run.trajectory.columns([q.name for q in STATES]) - self.linear)


def in_tube(run: Run, certificate: Certificate, proof: Proof) -> InTube:
    """The run in the tube of the first norm, for a δ that holds its start and is large enough to be seen.

    The run's start must be within the largest δ.
    """
    claim, t = certificate.claims[0], run.trajectory.time
    linear = linear_motion(run.parameters, t)
    start = float(claim.norm(run.trajectory.columns([q.name for q in STATES])[0]))
    shown = max(start, SHOWN * float(claim.norm(linear.T).max()))
    row = min(int(np.searchsorted(claim.table[:, 1], shown, side="right")), len(claim.table) - 1)
    epsilon, delta = claim.table[row].tolist()
    cell = np.searchsorted(ends(proof), t, side="right") - 1

    def at(bounds: Array) -> Array:
        return np.concatenate([bounds, np.full((1, *bounds.shape[1:]), np.nan)])[np.minimum(cell, len(bounds))]

    _, tube = funnel(proof, claim.norm, delta)
    size, bound = funnel(proof, claim.norm, start)
    return InTube(run, linear, claim, (epsilon, delta), at(tube), at(size), at(bound))


def draw_tube(found: InTube) -> bytes:
    """The run in the tube as SVG, with its caption in it."""
    largest = np.maximum(np.abs(found.linear).max(axis=0), 1e-12)
    worst = POSITIONS[int(np.argmax((np.nanmax(found.bound, axis=0) / largest)[:7]))]
    subject = Subject(
        file=TUBE,
        title="The tube around the linear approximation",
        caption=partial(_tube_caption, found, worst),
        panels=[
            partial(_tube_panel, found, POSITIONS[0]),
            partial(_magnified_panel, found, worst),
            partial(_size_panel, found),
        ],
        sources=(found.run.trajectory,),
        needs=STATES,
    )
    return render(subject, subject.caption())


def _tube_caption(found: InTube, worst: Quantity) -> str:
    (epsilon, delta), norm, unit = found.row, found.claim.norm, UNITS[found.claim.norm.name]
    seen, (body, factor) = float(norm(found.off.T).max()), READING["m"]
    widest = _typeset(at_most(factor * float(np.nanmax(found.tube[:, 0])), 3))
    return (
        f"Definition 2.1 on this run. Above: body heave in the certified tube of all motions that start within "
        f"δ = {_typeset(at_least(delta, 3))} {unit} of x_lin in the {norm.name} norm; they stay within "
        f"ε = {_typeset(at_most(epsilon, 3))} {unit} of it for all t ≥ 0, and within {widest} {body} in heave. "
        f"Middle: {words(worst)}, which leaves x_lin by most for its size, with its certified bound for a start like "
        f"the run's, magnified. Below: the {norm.name} norm of x − x_lin with its bound; the floor is "
        f"l = {_typeset(at_most(found.claim.floor, 5))} {unit}, the run reaches {readable(seen, 5)} {unit}. "
        "Bounds are of the exact motion: where the run lies above one, its integrator's error is seen."
    )


def _tube_panel(found: InTube, q: Quantity, ax: Axes) -> Axes:
    (unit, factor), t, k = READING[q.unit], found.run.trajectory.time, STATES.index(q)
    x_lin, width = factor * found.linear[:, k], factor * found.tube[:, k]
    ax.fill_between(t, x_lin - width, x_lin + width, color=PALE, linewidth=0.0, label="certified tube")
    ax.plot(t, x_lin, color=ORANGE, linestyle="-", linewidth=2.4, label="$x_{lin}$")
    ax.plot(t, factor * found.run.trajectory[q.name], color=BLUE, linestyle=DASHED, label=f"${q.symbol}$ {words(q)}")
    ax.set_ylabel(axis_label((q,), unit))
    return finish(ax)


def _magnified_panel(found: InTube, q: Quantity, ax: Axes) -> Axes:
    t, k = found.run.trajectory.time, STATES.index(q)
    power = 3 * int(np.floor(np.log10(max(np.nanmax(found.bound[:, k]), 1e-30)) / 3.0))
    band, off = 10.0**-power * found.bound[:, k], 10.0**-power * found.off[:, k]
    ax.fill_between(t, -band, band, color=PALE, linewidth=0.0, label="certified bound")
    ax.plot(t, off, color=RED, linestyle="-", label=f"${q.symbol}$ of the run less that of $x_{{lin}}$")
    ax.set_ylabel(f"difference [$10^{{{power}}}$ {q.unit}]")
    return finish(ax)


def _size_panel(found: InTube, ax: Axes) -> Axes:
    t, norm, floor = found.run.trajectory.time, found.claim.norm, found.claim.floor
    lowest, size = LOWEST * floor, norm(found.off.T)
    ax.semilogy(t, found.size, color=PALE, linestyle="-", linewidth=5.0, label="certified bound")
    ax.semilogy(t, np.maximum(size, 0.1 * lowest), color=RED, linestyle="-", linewidth=1.0, label="run")
    ax.axhline(floor, color=ORANGE, linestyle=DASHED, linewidth=1.0, label="floor $l$")
    ax.set_ylim(lowest, 3.0 * max(floor, float(size.max())))
    ax.set_ylabel(f"$N(x - x_{{lin}})$ [{UNITS[norm.name]}]")
    return finish(ax)
