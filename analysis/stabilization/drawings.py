"""Figures 8, 9 and 10 of the paper, and what it has not: dependence on λ, the long horizon, the misprints' cost."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import cycle

import numpy as np

from fmu_src.quantities import PARAMETERS

from ..figures import BLUE, DASHED, ORANGE, PURPLE, RED, TEAL, Axes, Subject, finish
from .study import Study, Weighted

SHADES = (TEAL, RED, PURPLE)  # of three weights; the default one red, as in the paper
SHOWN = (1e9, 1e10, 1e11)
CHOICE = "λ = {:g} N²/m², H1 = {:g} m, T = {:g} s".format(*(PARAMETERS[name].start for name in ("lambda", "H1", "T")))
COORDINATES = ((0, "$z$ [mm]"), (1, r"$\varphi$ [mrad]"))


def subjects(result: Study) -> list[Subject]:
    """All figures of the study."""
    end = float(result.times[-1])
    shown = [w for w in result.weighted if w.lam in SHOWN]
    behind = partial(_window, result.begin, end)

    def subject(
        file: str, title: str, caption: str, panels: Sequence[partial[Axes]], window: partial[_Span]
    ) -> Subject:
        return Subject(
            file=f"stabilization-{file}.svg",
            title=title,
            caption=lambda: caption,
            panels=panels,
            sources=(),
            needs=(),
            window=window,
        )

    return [
        subject("08-L14", "The history of L₁₄", f"As figure 8 of the paper; {CHOICE} (our choice). Below, by λ.",
                [partial(_L14, result), partial(_L14_by_weight, shown)], behind),
        subject("09-motion", "Heave and pitch of the half car",
                f"As figure 9 of the paper; {CHOICE} (our choice). Pitch is positive front up, as in section 4.",
                [partial(_motion, result, shown, *which) for which in COORDINATES], partial(_window, 0.0, end)),
        subject("10-forces", "Control forces of the half car",
                f"As figure 10 of the paper; {CHOICE} (our choice). Per axle, positive down on the body.",
                [partial(_forces, shown, axle) for axle in (0, 1)], behind),
        subject("printed", "What the misprints of (4.1) cost",
                "Optimal stabilization (full) and no control (dashed): (4.1) corrected, with B as printed, whose two "
                "controls are one, and wholly as printed: a saddle, which one control can hardly hold.",
                [partial(_models, result, *which) for which in COORDINATES], partial(_window, 0.0, end)),
        subject("limit", "From the finite to the infinite horizon",
                "What is still missing of L∞ along the slowest mode, against the time to go; dashed: twice the slowest "
                "decay of the closed loop.",
                [partial(_limit, result.weighted)], partial(_window, 0.0, 3.5)),
    ]  # fmt: skip


_Span = tuple[float, float]


def _window(start: float, end: float) -> _Span:
    return start, end


def _label(lam: float) -> str:
    return rf"$\lambda = 10^{{{round(np.log10(lam))}}}$ N²/m²"


def _L14(result: Study, ax: Axes) -> Axes:
    ax.plot(result.default.arc.t, result.default.L[:, 0, 3], color=RED, linestyle="-", label="$L_{14}$")
    ax.set_ylabel("$L_{14}$ [N² s²/m]")
    return finish(ax)


def _L14_by_weight(shown: Sequence[Weighted], ax: Axes) -> Axes:
    for w, color in zip(shown, cycle(SHADES), strict=False):
        L = w.solution.L[:, 0, 3]
        ax.plot(w.solution.arc.t, L / np.abs(L).max(), color=color, linestyle="-", label=_label(w.lam))
    ax.set_ylabel(r"$L_{14}$ over its largest value")
    return finish(ax)


def _motion(result: Study, shown: Sequence[Weighted], k: int, name: str, ax: Axes) -> Axes:
    free = result.free[result.default.model.name]
    ax.plot(result.times, 1e3 * free[k], color=BLUE, linestyle=DASHED, label="without control")
    for w, color in zip(shown, cycle(SHADES), strict=False):
        ax.plot(w.solution.arc.t, 1e3 * w.solution.arc.x[k], color=color, linestyle="-", label=_label(w.lam))
    ax.set_ylabel(name)
    return finish(ax)


def _forces(shown: Sequence[Weighted], axle: int, ax: Axes) -> Axes:
    for w, color in zip(shown, cycle(SHADES), strict=False):
        ax.plot(w.solution.arc.t, w.solution.arc.u[axle], color=color, linestyle="-", label=_label(w.lam))
    ax.set_ylabel(f"$u_{axle + 1}$ [N], {('front', 'rear')[axle]}")
    return finish(ax)


def _models(result: Study, k: int, name: str, ax: Axes) -> Axes:
    for s, color in zip((result.default, *result.printed), (RED, BLUE, ORANGE), strict=True):
        free = result.free[s.model.name]
        ax.plot(s.arc.t, 1e3 * s.arc.x[k], color=color, linestyle="-", label=s.model.name)
        ax.plot(result.times, 1e3 * free[k], color=color, linestyle=DASHED, linewidth=0.8)
    largest = 1e3 * np.abs(result.free[result.default.model.name][k]).max()
    ax.set_ylim(-3.0 * largest, 3.0 * largest)  # the saddle leaves the page
    ax.set_ylabel(name)
    return finish(ax)


def _limit(weighted: Sequence[Weighted], ax: Axes) -> Axes:
    for w, color in zip(weighted, cycle((BLUE, TEAL, RED, PURPLE, ORANGE, "#888888")), strict=False):
        a = w.approach
        ax.semilogy(a.s, a.gap, color=color, linestyle="-", label=_label(w.lam))
        ax.semilogy(a.s, a.gap[0] * np.exp(-a.rate * (a.s - a.s[0])), color="#222222", linestyle=DASHED, linewidth=0.8)
    ax.set_ylabel(r"$v^*(L_\infty - L)v\,/\,v^*L_\infty v$")
    finish(ax).set_xlabel("time to go [s]")
    return ax
