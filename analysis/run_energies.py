"""`python -m analysis spatial RUN`: the energy of each mode along a run and its series, and what Φ moved in it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from fmu_src.quantities import FORCES, STATES

from .check import lacking
from .errors import InputError
from .figures import BLUE, DASHED, DOTTED, ORANGE, RED, Axes, Subject, finish, render
from .files import write_whole
from .methods.polynomials import Array
from .methods.series import partial_sums
from .methods.spatial import Transfer, UndampedModes, transfer
from .reference import car_of
from .run_figures import ENERGIES
from .run_series import MOST_ROWS, series_terms
from .scans.spatial_scan import car_modes, said
from .scans.tables import as_csv
from .trajectory import FIGURES, MODAL_ENERGIES, Run, read_run

SERIES = ("order 0", "order 1")
LOOKS = (("run", BLUE, "-"), (SERIES[0], ORANGE, DASHED), (SERIES[1], RED, DOTTED))


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEnergies:
    """Times (T,) and states (14, T) of the run and of the partial sums of its series, by name."""

    modes: UndampedModes
    t: Array
    motions: dict[str, Array]

    def energies(self, name: str) -> Array:
        """Of each mode (7, T) [J]."""
        return self.modes.energies(self.motions[name])

    def transfer(self, name: str) -> Transfer:
        """Mean energies of a motion against those of order 0, the linear one."""
        return transfer(self.modes, self.t, self.motions[SERIES[0]], self.motions[name])


def energies_of(run: Run) -> RunEnergies:
    """Of the first MOST_ROWS rows. Raises InputError for a run that lacks columns or stands still."""
    if missing := lacking(run):
        raise InputError(f"the run's energies cannot be told: it lacks the columns {', '.join(missing)}")
    t = run.trajectory.time[:MOST_ROWS]
    x = run.trajectory.columns([q.name for q in STATES])[:MOST_ROWS].T
    if len(t) < 2 or not x.any():
        raise InputError("the run's energies cannot be told: wanted a car that moves, got one that stands still")
    terms, _ = series_terms(run, t, x[:, 0], len(SERIES) - 1)
    sums = dict(zip(SERIES, partial_sums(terms), strict=True))
    return RunEnergies(modes=car_modes(car_of(run.parameters)), t=t, motions={"run": x, **sums})


def command(folder: Path, out: Path | None) -> int:
    """The verb `spatial` on a run folder; writes table and figure into it, or into `out`; returns the exit status."""
    run = read_run(folder)
    found = energies_of(run)
    controlled = bool(np.any(run.trajectory.columns([q.name for q in FORCES])))
    print("\n".join(lines(found, f"{folder}{', under its actuators' if controlled else ''}")))
    figures = out or folder / FIGURES
    try:
        figures.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{figures}: nothing can be written there: {error}") from error
    picture = subject(found, run)
    for path, content in (
        ((out or folder) / MODAL_ENERGIES, as_csv(rows(found))),
        (figures / ENERGIES, render(picture, picture.caption())),
    ):
        write_whole(path, content)
        print(f"{path}: written")
    return 0


def lines(found: RunEnergies, what: str) -> list[str]:
    """Mean energies in words: shares of the linear motion, what the run has more, and what order 1 leaves of that."""
    run, first = found.transfer("run"), found.transfer(SERIES[1])
    whole = run.linear.sum()
    text = [
        f"{what}: mean energy {run.nonlinear.sum():.6g} J over {found.t[-1] - found.t[0]:g} s, of the linear motion "
        f"{whole:.6g} J; by Φ: {said(run)}",
        f"{'mode':>6}{'ω [rad/s]':>12}{'linear share':>14}{'change in the run':>19}{'in order 1':>12}",
    ]
    for k, frequency in enumerate(found.modes.frequencies):
        text.append(
            f"{k + 1:>6}{frequency:>12.3f}{run.linear[k] / whole:>14.4f}{run.change[k]:>19.2e}{first.change[k]:>12.2e}"
        )
    return text


def rows(found: RunEnergies) -> list[list[object]]:
    """The table: time and E_k of the run and of both orders."""
    modes = range(1, len(found.modes.frequencies) + 1)
    heads: list[object] = ["time", *(f"E_{k} {name} [J]" for name in found.motions for k in modes)]
    values = np.vstack([found.t, *(found.energies(name) for name in found.motions)])
    return [heads, *values.T.tolist()]


def subject(found: RunEnergies, run: Run) -> Subject:
    """The figure: a panel for each mode."""
    shares = found.transfer("run").linear / found.transfer("run").linear.sum()
    words = ", ".join(f"{k}: {share:.2g}" for k, share in enumerate(shares, start=1))

    def panel(k: int, ax: Axes) -> Axes:
        for name, color, dashes in LOOKS:
            ax.plot(found.t, found.energies(name)[k], color=color, linestyle=dashes, label=name)
        ax.set_ylabel(f"$E_{k + 1}$ [J]")
        return finish(ax)

    return Subject(
        file=ENERGIES,
        title="Energy of the modes",
        caption=lambda: (
            "Not in the paper. Energy of each mode of the undamped linear car, all of which add up, in the run and in "
            f"the series of order 0 (linear) and 1. Shares of the modes in the linear motion: {words}. "
            f"By the nonlinear terms: {said(found.transfer('run'))}."
        ),
        panels=[partial(panel, k) for k in range(len(found.modes.frequencies))],
        sources=(run.trajectory,),
        needs=STATES,
    )
