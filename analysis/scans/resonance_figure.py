"""The map of resonances over a parameter: frequencies, distances in frequency, distances with damping, gains."""

from __future__ import annotations

import numpy as np

from ..figures import BLUE, ORANGE, PURPLE, RED, TEAL, Axes, Panel, Subject, render
from ..methods.polynomials import Array
from .resonance_scan import Key, Scan

GREY, COLOURS = "#999999", (BLUE, ORANGE, TEAL, PURPLE, RED, "#bbaa33")
SYMBOLS = {"speed": "$v_0$", "c2/c1": "$c_2/c_1$", "Jy": "$J_y$", "b/a": "$b/a$"}


def draw(scan: Scan) -> bytes:
    """The map as SVG."""
    subject = Subject(
        file="",
        title=f"Resonances over {scan.variation.text}",
        caption=str,
        panels=[
            lambda ax: _frequencies(scan, ax),
            _curves(scan, "relative", "relative detuning"),
            _curves(scan, "relative_distance", "relative distance\nwith damping"),
            _curves(scan, "near_gain", "gain near\nresonance"),
        ],
        sources=(),
        needs=(),
        window=lambda: (float(scan.values[0]), float(scan.values[-1])),
    )
    return render(subject)


def _frequencies(scan: Scan, ax: Axes) -> Axes:
    """β_k, and Ω, 2Ω, 3Ω where the road has waves."""
    ax.plot(scan.values, scan.frequencies, color=BLUE, linestyle="-")
    highest = float(scan.frequencies.max())
    for numbers, beta in _bundles(scan.frequencies[-1], 0.05 * highest):
        ax.annotate(f"$\\beta_{{{numbers}}}$", (scan.values[-1], beta), xytext=(3, -3), textcoords="offset points")
    if np.isfinite(scan.road).any():
        ax.plot(scan.values, np.multiply.outer(scan.road, [1, 2, 3]), color=ORANGE, linestyle="-", linewidth=0.8)
    ax.set_ylim(0.0, 1.1 * highest)
    ax.set_ylabel(r"$\beta_k$, $\nu\Omega$ [rad/s]")
    return _finished(scan, ax)


def _curves(scan: Scan, attribute: str, words: str) -> Panel:
    """The leading resonances by one attribute, over the envelope of all."""

    def panel(ax: Axes) -> Axes:
        gain = attribute == "near_gain"
        values = [getattr(row, attribute) for row in (scan.strongest() if gain else scan.nearest(attribute))]
        what = "strongest near resonance" if gain else "nearest of those that change"
        ax.semilogy(scan.values, values, color=GREY, linestyle="-", linewidth=3.0, alpha=0.5, label=what)
        for key, color in zip(_leading(scan, attribute), COLOURS, strict=False):
            row = next(table[key] for table in scan.tables if key in table)
            curve = scan.curve(key, attribute)
            ax.semilogy(scan.values, np.where(curve > 0.0, curve, np.nan), color=color, linestyle="-", label=str(row))
        top = max(values) or 1.0
        ax.set_ylim(*((1e-3 * top, 2.0 * top) if gain else (0.5 * min(values), 1.0)))
        ax.set_ylabel(words)
        ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.2, fontsize=7.0)
        return _finished(scan, ax)

    return panel


def _leading(scan: Scan, attribute: str) -> list[Key]:
    """The resonances that come nearest, of those that change, or are strongest anywhere on the map."""
    sign = -1.0 if attribute == "near_gain" else 1.0
    keys = {key for table in scan.tables for key in table} if attribute == "near_gain" else scan.changing
    return sorted(keys, key=lambda key: (np.nanmin(sign * scan.curve(key, attribute)), key))[: len(COLOURS)]


def _bundles(frequencies: Array, apart: float) -> list[tuple[str, float]]:
    """Numbers of modes whose labels would overlap, together, with the height of the first of them."""
    found: list[tuple[str, float]] = []
    for k, beta in enumerate(frequencies.tolist(), start=1):
        if found and beta - found[-1][1] < apart:
            found[-1] = (f"{found[-1][0]},{k}", found[-1][1])
        else:
            found.append((str(k), beta))
    return found


def _finished(scan: Scan, ax: Axes) -> Axes:
    """The scenario's own value, and the axis below."""
    ax.axvline(scan.here, color=GREY, linestyle=":", linewidth=1.0)
    ax.set_xlabel(f"{SYMBOLS[scan.name]} [{scan.variation.unit}]")
    return ax
