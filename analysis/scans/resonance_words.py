"""What `python -m analysis resonances` says: the table, and where over a parameter it is nearest and strongest."""

from __future__ import annotations

import numpy as np

from ..methods.floquet import period_of
from ..methods.modes import Modes, modes
from ..methods.resonance import NEAR, SMALL, Resonance, Resonances, remark_as_printed
from ..methods.series import exact_series
from ..methods.signals import Piece, Signal, constant
from ..methods.standard_form import StandardForm
from ..reference import Parameters
from .car_scans import lasting_road, system_of
from .resonance_scan import Scan, crossings

SHOWN, MET = 15, 6  # rows, and frequencies that meet, on the terminal


def lines(table: Resonances, parameters: Parameters) -> list[str]:
    """The nearest resonances in words, and what was left out."""
    form, _ = system_of(parameters)
    found = modes(form.A)
    beta = ", ".join(f"β{k} = {b:.3f}" for k, b in enumerate(found.beta[: len(found.beta) // 2], start=1))
    piece = lasting_road(parameters)
    omega = f"; Ω = {2.0 * np.pi / period_of(piece):.3f}" if piece else "; the road has no lasting waves"
    left_out = ", ".join(f"{count} with {waves} waves" for waves, count in table.trivial.items())
    occurring = table.occurring
    heads = (
        "equality",
        "off [rad/s]",
        "relative",
        "with damping [1/s]",
        "relative",
        "gain",
        "in remark 3.2",
    )
    text = [
        f"the passive car, actuators at rest: {beta}{omega} [rad/s]",
        f"{table.terms} terms state {len(table.rows)} equalities; {len(occurring)} of these occur in Φ. Left out as "
        f"identities (s_k s_j s_j+{len(found.beta) // 2}, s_k with opposite waves): {left_out}. Modes that do not "
        f"oscillate: {table.silent}.",
        "{:<24}{:>12}{:>10}{:>20}{:>10}{:>11}{:>15}".format(*heads),
    ]
    if not occurring:
        return text
    text += [_line(row) for row in occurring[:SHOWN]]
    nearest = min(occurring, key=lambda row: row.relative_distance)
    text.append(
        f"nearest with damping: {nearest}, {nearest.distance:.3g} 1/s ({nearest.relative_distance:.2g} relative)"
    )
    text += strength_lines(table)
    text += secular_lines(form, found, piece)
    three, four = remark_as_printed(found.eigenvalues)
    for name, remark in (("three", three), ("four", four)):
        i, j = int(np.argmin(remark.detuning)), int(np.argmin(remark.distance))
        text.append(
            f"remark 3.2 as printed, {name} modes ({len(remark.distance)}): nearest in frequency "
            f"{remark.detuning[i]:.3g} rad/s at {remark.indices[i].tolist()}, in the complex plane "
            f"{remark.distance[j]:.3g} 1/s at {remark.indices[j].tolist()}"
        )
    return text


def strength_lines(table: Resonances) -> list[str]:
    """What the strongest combination near resonance adds, and what one far off does, if that is more."""
    strongest = max(table.occurring, key=lambda row: row.near_gain)
    text = [f"near resonance: off by less than {NEAR:g} of the largest frequency, or than the damping; "]
    text[0] += (
        f"strongest of these: {strongest} adds {strongest.near_gain:.2g} of a motion of {table.size:.2g} (m, rad)"
        if strongest.near_gain > 0.0
        else "there is none"
    )
    largest = max(table.occurring, key=lambda row: row.gain)
    if largest.gain > largest.near_gain:
        text.append(
            f"off resonance, merely forced: {largest}, {largest.detuning:.3g} rad/s off, adds {largest.gain:.2g} of it"
        )
    return text


def secular_lines(form: StandardForm, found: Modes, piece: Piece | None) -> list[str]:
    """Terms t exp(λt) of the first correction by name; from rest on the lasting road, else in a free motion."""
    n = len(found.eigenvalues)
    signal = Signal((piece,)) if piece else constant([0.0] * form.B.shape[1])
    start = np.zeros(n) if piece else (found.K @ np.full(n, SMALL)).real
    what = "from rest on this road" if piece else f"in a free motion of {SMALL:g} (m, rad) in each mode"
    terms = exact_series(form, found, signal, start, 1).secular
    text = [f"first correction of the series, {what}: {len(terms) or 'no'} terms that grow like t exp(λ_k t)"]
    if piece:
        text[0] += f"; σ = {', '.join(f'{s.imag:+.4g}i' for s in piece.exponents.tolist())} 1/s"
    return text + [f"  {term}, {abs(term.coefficient):.2g} (m, rad)/s times that" for term in terms[:SHOWN]]


def _line(row: Resonance) -> str:
    return (
        f"{row!s:<24}{row.detuning:>12.4f}{row.relative:>10.5f}{row.distance:>20.3f}{row.relative_distance:>10.4f}"
        f"{row.gain:>11.2g}{'yes' if row.in_print else 'no':>15}"
    )


def scan_lines(result: Scan) -> list[str]:
    """Where the nearest resonance is nearest and where farthest."""
    leading = result.strongest()
    gains = [row.near_gain for row in leading]
    text = [
        f"{result.name} = {result.values[i]:.4g} {result.variation.unit}: the strongest near resonance, {leading[i]}, "
        f"adds {what}, {gains[i]:.2g}"
        for i, what in ((int(np.argmax(gains)), "most"), (int(np.argmin(gains)), "least"))
    ]
    span = f"{result.name} from {result.values[0]:.4g} to {result.values[-1]:.4g} {result.variation.unit}"
    met = crossings(result)
    strongest = f", the strongest: {'; '.join(map(str, met[:MET]))}" if met else ""
    text.append(f"{span}: {len(met) or 'no'} frequencies meet exactly{strongest}")
    text.append(f"of the {len(result.changing)} resonances that it detunes:")
    for attribute, words in (("relative", "in frequency"), ("relative_distance", "with damping")):
        nearest = result.nearest(attribute)
        sizes = [getattr(row, attribute) for row in nearest]
        for i, what in ((int(np.argmin(sizes)), "nearest"), (int(np.argmax(sizes)), "farthest")):
            if what == "farthest" or attribute != "relative" or not met:  # a sampled smallest detuning says nothing
                text.append(
                    f"{span}: the nearest is {what} {words} at {result.values[i]:.4g}: {nearest[i]}, {sizes[i]:.3g} "
                    "relative"
                )
    return text
