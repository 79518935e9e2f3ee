"""Averaging and resonances on an exported run: its modal amplitudes against the averaged ones, once its road lasts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import nextafter

import numpy as np

from fmu_src.quantities import FORCES, STATES

from .car import car_form, road_signal
from .check import own_error
from .errors import InputError
from .findings import Finding
from .methods.amplitudes import LEFT_OUT, UNDAMPED, left_out, stability
from .methods.averaging import AmplitudeEquations, average, slow
from .methods.modes import Complex, Modes, modes
from .methods.polynomials import Array
from .methods.resonance import NEAR, resonances
from .methods.signals import Piece, Signal
from .methods.standard_form import StandardForm
from .reference import car_of, road_parameters
from .trajectory import Run

FEWEST = 10  # rows after the road's last edge
MOST_ROWS, BLOCK = 20_000, 200  # that are compared, from the first of them; that are held at a time
DEGREE = 3  # of Φ: what a relative error of its arguments is multiplied with


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """A run's car and road in the methods' terms, and its states x (14, T)."""

    run: Run
    form: StandardForm
    modes: Modes
    signal: Signal
    x: Array

    @property
    def piece(self) -> Piece | None:
        """The waves of the road in the end; None if it is level then."""
        last = self.signal.pieces[-1]
        return last if np.any(last.amplitudes) else None

    @property
    def size(self) -> float:
        """Largest modal amplitude |ξ_k| [m or rad]."""
        return float(np.abs(self.modes.K_inverse @ self.x).max())


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """The part of a run on which its input is a sum of lasting waves (or none): times (T,), states (14, T)."""

    t: Array
    x: Array
    amplitudes: Complex  # s (14, T): what is left of ξ without the forced motion and without W, turned back by β
    equations: AmplitudeEquations
    left_out: float  # bound on |W|, for amplitudes that do not grow

    @property
    def size(self) -> float:
        """Largest modal amplitude, free at the beginning or forced."""
        return _size(self.amplitudes, self.equations)


def averaged_findings(run: Run) -> tuple[list[Finding], str]:
    """Findings on a run that `check` takes: resonances, amplitudes, stability; for what is lacking, why."""
    findings: list[Finding] = []
    reasons: list[str] = []

    def attempt(judge: Callable[[], list[Finding]]) -> None:
        try:
            findings.extend(judge())
        except InputError as error:
            reasons.append(str(error))

    try:
        moved = moved_by(run)
    except InputError as error:
        return [], str(error)
    attempt(lambda: _resonance(moved))
    try:
        stretch = stretch_of(moved)
    except InputError as error:
        return findings, "; ".join([*reasons, str(error)])
    attempt(lambda: [_envelope(stretch, own_error(run))])
    if moved.piece:
        attempt(lambda: [_condition(stretch)])
    return findings, "; ".join(reasons)


def moved_by(run: Run) -> Moved:
    """Raises InputError for a car without modes, or that stands still."""
    form = car_form(car_of(run.parameters), order=DEGREE)
    signal = road_signal(road_parameters(run.parameters), float(run.trajectory.time[0]))
    x = run.trajectory.columns([q.name for q in STATES]).T
    if not x.any():
        raise InputError("the car stands still")
    return Moved(run=run, form=form, modes=modes(form.A), signal=signal, x=x)


@np.errstate(over="ignore", invalid="ignore")  # of motions that are far too large
def stretch_of(moved: Moved) -> Stretch:
    """Where averaging applies. Raises InputError saying why it does not."""
    trajectory, begin = moved.run.trajectory, moved.signal.edges[-1]
    if np.any(trajectory.columns([q.name for q in FORCES])):
        raise InputError("the actuators act, and their forces are no part of the car's own equations")
    t = trajectory.time[trajectory.time >= begin]
    if len(t) < FEWEST:
        raise InputError(f"the road changes its form until {begin:g} s, and {len(t)} rows come after that")
    equations = average(moved.form, moved.piece, found=moved.modes, detuning=slow(moved.modes))
    t, x = t[:MOST_ROWS], moved.x[:, -len(t) :][:, :MOST_ROWS]
    first = equations.amplitudes(x[:, 0], t[0])
    out, size = left_out(equations, first), _size(first[:, None], equations)
    if not out <= LEFT_OUT * size:
        raise InputError(
            f"the motion is too large: averaging would leave out up to {out / size:.2g} of it, wanted <= {LEFT_OUT:g}"
        )
    parts = [slice(i, i + BLOCK) for i in range(0, len(t), BLOCK)]
    amplitudes = np.concatenate([equations.amplitudes(x[:, p], t[p], exact=True) for p in parts], axis=1)
    return Stretch(t=t, x=x, amplitudes=amplitudes, equations=equations, left_out=out)


def _size(s: Complex, equations: AmplitudeEquations) -> float:
    return max(float(np.abs(s[:, 0]).max()), float(np.abs(equations.waves.forced).max(initial=0.0)))


def _envelope(stretch: Stretch, accuracy: float) -> Finding:
    """s of the run, W taken off, against the averaged equations from its first row on.

    What they leave is of the next order: at most DEGREE times the square of what this one left out and put in. And the
    run's own deviation makes something in modal coordinates.

    accuracy : deviation of the run's states, each over its maximum.
    """
    s, m, size = stretch.amplitudes, stretch.equations.modes, stretch.size
    averaged = stretch.equations.solve(s[:, 0], stretch.t)
    linear = s[:, :1] * np.exp(np.multiply.outer(m.alpha, stretch.t - stretch.t[0]))
    own = float(np.max(np.abs(m.K_inverse) @ (accuracy * np.abs(stretch.x).max(axis=1))))
    put_in, without = (float(np.abs(other - linear).max()) / size for other in (averaged, s))
    tolerance = DEGREE * (stretch.left_out / size + put_in) ** 2 + own / size
    words = "" if put_in > tolerance else ", which this run cannot tell from them"
    return Finding(
        claim=f"from {stretch.t[0]:g} s on the run's modal amplitudes are those of the averaged equations: largest "
        "deviation over the largest amplitude",
        equation="(3.18)–(3.20)",
        measured=float(np.abs(s - averaged).max()) / size,
        expected=0.0,
        tolerance=tolerance,
        unit="1",
        source=f"trajectory.csv; from plain linear decay {without:.3g}{words}",
    )


def _condition(stretch: Stretch) -> Finding:
    """Raises InputError where the condition does not decide."""
    m = stretch.equations.modes
    if np.any(np.abs(m.alpha) <= UNDAMPED * np.abs(m.eigenvalues)):
        raise InputError("condition after (3.20): wanted damped modes, got one whose decay is round-off")
    found = stability(stretch.equations)
    taken = 1.0 + found.growth / np.abs(m.alpha)
    k = int(np.argmax(taken))
    return Finding(
        claim="the forced motion is stable by averaging, Re(α_k + ε(A_k + B_k)) < 0: largest share of a mode's decay "
        "|α_k| that the road takes from it",
        equation="condition after (3.20)",
        measured=max(0.0, float(taken[k])),
        expected=0.0,
        tolerance=nextafter(1.0, 0.0),
        unit="1",
        source=f"run.json; mode {k + 1}, margin of all {found.margin:.4g} 1/s, {found.lost}",
    )


def _resonance(moved: Moved) -> list[Finding]:
    """Judged by what is near to resonance; none where no two modes oscillate (and no mode with the road)."""
    rows = resonances(moved.form, moved.piece, found=moved.modes, size=moved.size).occurring
    if not rows:
        return []
    strongest, largest = max(rows, key=lambda row: row.near_gain), max(rows, key=lambda row: row.gain)
    near = f"strongest near resonance {strongest}" if strongest.near_gain > 0.0 else "none is near resonance"
    if largest.gain > largest.near_gain:
        near += (
            f"; off resonance too a term adds to a large motion: most {largest}, {largest.detuning:.3g} rad/s off, "
            f"{largest.gain:.3g}"
        )
    damped = min(rows, key=lambda row: row.relative_distance)
    return [
        Finding(
            claim="modes of the passive car and road are in no resonance: what the strongest of the combinations near "
            f"one (off by less than {NEAR:g} of the largest frequency, or than the damping) adds to a motion as large "
            "as the run's, relative to it",
            equation="remark 3.2",
            measured=strongest.near_gain,
            expected=0.0,
            tolerance=LEFT_OUT,
            unit="1",
            source=f"run.json; {near}; nearest in frequency {rows[0]}, {rows[0].detuning:.3g} rad/s; "
            f"nearest with damping {damped}, {damped.distance:.3g} 1/s",
        )
    ]
