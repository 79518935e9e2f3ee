"""Averaging and resonances on an exported run: its modal amplitudes against the averaged ones, once its road lasts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fmu_src.quantities import FORCES, STATES

from .car import car_form, road_signal
from .check import own_error
from .errors import InputError
from .findings import Finding
from .methods.amplitudes import stability
from .methods.averaging import AmplitudeEquations, average
from .methods.modes import Complex
from .methods.polynomials import Array
from .methods.resonance import resonances
from .methods.signals import Piece
from .methods.standard_form import StandardForm
from .reference import car_of, road_parameters
from .trajectory import Run

FEWEST = 10  # rows after the road's last edge
UNDAMPED = 1e-12  # of |λ|: decay rates as small as this are round-off
LARGEST = 0.1  # of the motion, that averaging may leave out and still describe it


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """The part of a run on which its input is a sum of lasting waves (or none): times (T,), states (14, T)."""

    t: Array
    x: Array
    amplitudes: Complex  # s (14, T): what is left of ξ without the forced motion, turned back by β
    form: StandardForm
    piece: Piece | None
    equations: AmplitudeEquations

    @property
    def left_out(self) -> float:
        """Bound on |W|, which averaging leaves out, for amplitudes that do not grow: Σ of its terms' sizes."""
        z = np.concatenate([np.abs(self.amplitudes[:, 0]), np.ones(len(self.equations.waves.frequencies))])
        sizes = (np.abs(W.coefficients) @ np.prod(z[W.monomials], axis=1) for W in self.equations.correction)
        return float(np.max(sum(sizes, np.zeros(len(self.x)))))

    @property
    def size(self) -> float:
        """Largest modal amplitude, free at the beginning or forced."""
        return max(
            float(np.abs(self.amplitudes[:, 0]).max()), float(np.abs(self.equations.waves.forced).max(initial=0))
        )


def stretch_of(run: Run) -> Stretch:
    """Where averaging applies. Raises InputError saying why it does not."""
    if np.any(run.trajectory.columns([q.name for q in FORCES])):
        raise InputError("the actuators act, and their forces are no part of the car's own equations")
    signal = road_signal(road_parameters(run.parameters), float(run.trajectory.time[0]))
    t = run.trajectory.time[run.trajectory.time >= signal.edges[-1]]
    if len(t) < FEWEST:
        raise InputError(f"the road changes its form until {signal.edges[-1]:g} s, and {len(t)} rows come after that")
    last = signal.pieces[-1]
    piece, form = last if np.any(last.amplitudes) else None, car_form(car_of(run.parameters), order=3)
    equations = average(form, piece)
    x, m, w = run.trajectory.columns([q.name for q in STATES])[-len(t) :].T, equations.modes, equations.waves
    turned = (m.K_inverse @ x - w.forced @ w.at(t)) * np.exp(-1j * np.multiply.outer(m.beta, t))
    found = Stretch(t=t, x=x, amplitudes=turned, form=form, piece=piece, equations=equations)
    if found.size == 0.0:
        raise InputError("the car stands still")
    if not found.left_out <= LARGEST * found.size:
        raise InputError(
            f"the motion is too large: averaging would leave out up to {found.left_out / found.size:.2g} of it"
        )
    return found


def averaged_findings(run: Run) -> tuple[list[Finding], str]:
    """Findings on a run that `check` takes: amplitudes, resonances, stability; if one is lacking, why."""
    findings = []
    try:
        stretch = stretch_of(run)
        findings.append(_envelope(stretch, own_error(run)))
        findings += _resonance(stretch)
        if stretch.piece:
            findings.append(_condition(stretch))
    except InputError as error:
        return findings, str(error)
    return findings, ""


def _envelope(stretch: Stretch, accuracy: float) -> Finding:
    """|s_run − s_averaged| ≤ |W(t)| + |W(0)|, and what the run's own deviation makes in modal coordinates.

    accuracy : deviation of the run's states, each over its maximum.
    """
    s, m = stretch.amplitudes, stretch.equations.modes
    averaged = stretch.equations.solve(s[:, 0], stretch.t)
    linear = s[:, :1] * np.exp(np.multiply.outer(m.alpha, stretch.t - stretch.t[0]))
    own = float(np.max(np.abs(m.K_inverse) @ (accuracy * np.abs(stretch.x).max(axis=1))))
    return Finding(
        claim=f"from {stretch.t[0]:g} s on the run's modal amplitudes are those of the averaged equations: largest "
        "deviation over the largest amplitude",
        equation="(3.18)–(3.20)",
        measured=float(np.abs(s - averaged).max()) / stretch.size,
        expected=0.0,
        tolerance=(2.0 * stretch.left_out + own) / stretch.size,
        unit="1",
        source=f"trajectory.csv; without averaged terms {np.abs(s - linear).max() / stretch.size:.3g}",
    )


def _condition(stretch: Stretch) -> Finding:
    """Raises InputError where the condition does not decide."""
    m = stretch.equations.modes
    if np.any(np.abs(m.alpha) <= UNDAMPED * np.abs(m.eigenvalues)):
        raise InputError("condition after (3.20): wanted damped modes, got one whose decay is round-off")
    found = stability(stretch.equations)
    k = int(np.argmax(found.growth / np.abs(m.alpha)))
    return Finding(
        claim="the forced motion is stable by averaging: largest Re(α_k + ε(A_k + B_k)) over |α_k|",
        equation="condition after (3.20)",
        measured=float(found.growth[k] / abs(m.alpha[k])),
        expected=-1.0,
        tolerance=1.0,
        unit="1",
        source=f"run.json; mode {k + 1}, margin of all {found.margin:.4g} 1/s, lost at "
        f"{found.critical_scale.min():.3g} times this road",
    )


def _resonance(stretch: Stretch) -> list[Finding]:
    """None where no two modes oscillate (and no mode with the road)."""
    rows = resonances(stretch.form, stretch.piece, found=stretch.equations.modes).occurring
    if not rows:
        return []
    strongest = max(rows, key=lambda row: row.gain)
    damped = min(rows, key=lambda row: row.relative_distance)
    finding = Finding(
        claim="modes and road are in no resonance: what the strongest combination adds to the motion, relative to it",
        equation="remark 3.2",
        measured=strongest.gain,
        expected=0.0,
        tolerance=LARGEST,
        unit="1",
        source=f"run.json; strongest {strongest}; nearest in frequency {rows[0]}, {rows[0].detuning:.3g} rad/s; "
        f"nearest with damping {damped}, {damped.distance:.3g} 1/s",
    )
    return [finding]
