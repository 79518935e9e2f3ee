"""The amplitude equations of a scenario's car in numbers, mode by mode: (3.20), its condition, its equilibria."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..car import car_form
from ..errors import InputError
from ..methods.amplitudes import LEFT_OUT, SIZES, Equilibrium, Stability, decided, equilibria, left_out
from ..methods.averaging import AmplitudeEquations, average, slow
from ..methods.modes import Complex, Modes, modes
from ..methods.polynomials import Array
from ..methods.signals import Piece
from ..methods.standard_form import only
from ..reference import Parameters, car_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Amplitudes:
    """Of the passive car on a road's lasting waves, by mode (7,) [1/s]: A_k and B_k of (3.20), ε counted in.

    second   : what the second approximation has in the place of A_k + B_k.
    own      : ᾱ_k, the coefficient of s_k |s_k|² in s_k' [1/s per m² or rad²].
    resting  : constant amplitudes s_k with how much of them averaging leaves out; those of rest first.
    """

    modes: Modes
    A: Complex
    B: Complex
    second: Complex
    own: Complex
    condition: Stability
    resting: tuple[tuple[Equilibrium, float], ...]


def car_amplitudes(parameters: Parameters, piece: Piece | None) -> Amplitudes:
    """Raises InputError where the amplitudes are coupled or forced, so that (3.20) decides nothing."""
    form = car_form(car_of(parameters))
    m, n = modes(form.A), len(form.A)
    half = n // 2
    equations = average(form, piece, found=m)
    A = average(only(form, lambda monomial: max(monomial) < n), piece, found=m).linear
    return Amplitudes(
        modes=m,
        A=A[:half],
        B=(equations.linear - A)[:half],
        second=average(form, piece, found=m, order=2).linear[:half],
        own=np.diag(equations.cubic[:half]),
        condition=decided(average(form, piece, found=m, detuning=slow(m))),
        resting=tuple((found, _left_out(equations, found)) for found in equilibria(equations)),
    )


def _left_out(equations: AmplitudeEquations, found: Equilibrium) -> float:
    """What averaging leaves out there, over the largest amplitude, free or forced; 0 at rest without a road."""
    size = max(float(found.amplitudes.max()), float(np.abs(equations.waves.forced).max(initial=0.0)))
    return left_out(equations, np.tile(found.amplitudes, 2).astype(complex)) / size if size else 0.0


def amplitude_lines(parameters: Parameters, piece: Piece | None) -> list[str]:
    """The table in words."""
    try:
        found = car_amplitudes(parameters, piece)
    except InputError as error:
        return [f"(3.20) mode by mode: not for this car and road: {error}"]
    half, condition = len(found.A), found.condition
    heads = ("mode", "alpha_k", "Re A_k", "Re B_k", "margin", "A+B, 2nd", "Re a_kk", "critical |s_k|", "reach |s_k|")
    text = [
        "(3.20) mode by mode [1/s; m or rad]: alpha_k + A_k + B_k < 0 and its margin, A_k + B_k to second order, own "
        "term a_kk |s_k|^2 s_k, the |s_k| at which that cancels the decay, and the |s_k| up to which averaging leaves "
        f"out at most {LEFT_OUT:g} of the motion",
        "{:>4}{:>11}{:>12}{:>12}{:>10}{:>11}{:>12}{:>16}{:>13}".format(*heads),
    ]
    margins: Array = -condition.growth[:half]
    for k in range(half):
        critical, reach = condition.critical_amplitude[k], condition.valid_amplitudes[k]
        mark, less = "*" if reach < critical < np.inf else " ", "~" if condition.sizes[k] > 0.0 else " "
        text.append(
            f"{k + 1:>4}{found.modes.alpha[k]:>11.4f}{found.A[k].real:>12.3g}{found.B[k].real:>12.3g}"
            f"{margins[k]:>10.4f}{less}{found.second[k].real:>10.3g}{found.own[k].real:>12.3g}"
            f"{critical:>15.3g}{mark}{reach:>13.3g}"
        )
    if np.any(condition.sizes[:half] > 0.0):
        text.append(f"   ~ {SIZES}")
    beyond = condition.critical_amplitude[:half] > condition.valid_amplitudes[:half]
    if np.any(beyond & np.isfinite(condition.critical_amplitude[:half])):
        text.append("   * beyond the reach of averaging: a number of the formula's, not of the car's")
    return [*text, f"the condition, with the road's height: {condition.lost}", *_resting(found)]


def _resting(found: Amplitudes) -> list[str]:
    """Constant amplitudes, rest first, of the others those that averaging reaches by name."""
    text = []
    for each, out in found.resting:
        moving = np.flatnonzero(each.amplitudes)
        what = ", ".join(f"|s_{k + 1}| = {each.amplitudes[k]:.3g}" for k in moving) or "s = 0"
        if out <= LEFT_OUT:
            text.append(
                f"constant amplitudes {what}: {'stable' if each.stable else 'not stable'}, slowest change "
                f"{each.growth.real.max():.4g} 1/s"
            )
        elif not len(moving):
            text.append(f"s = 0, the forced motion: beyond the reach of averaging, which leaves out {out:.2g} of it")
    if beyond := [each for each, out in found.resting if out > LEFT_OUT and each.amplitudes.any()]:
        nearest = min(beyond, key=lambda each: float(each.amplitudes.max()))
        k = int(np.argmax(nearest.amplitudes))
        text.append(
            f"{len(beyond)} more solve the equations where averaging ends, the smallest with |s_{k + 1}| = "
            f"{nearest.amplitudes[k]:.3g}: they say nothing of the car"
        )
    return text
