"""A run in words: its road, times, coupling and control."""

from __future__ import annotations

from fmu_src.quantities import CORNER_WORDS, CORNERS
from fmu_src.road.profiles import HARMONICS

from .run_figures import is_controlled
from .trajectory import Run


def summary(run: Run) -> str:
    """The scenario in one line: road, speed, times, coupling, control."""
    scenario = run.record["scenario"]
    (v0,) = run.reals("v0")
    times = f"{run.trajectory.time[0]:g} s to {run.trajectory.time[-1]:g} s"
    if isinstance(scenario.get("step"), (int, float)):
        times += f" in steps of {1e3 * scenario['step']:g} ms"
    coupling = f"coupling {scenario.get('coupling', 'not recorded')}"
    return " · ".join((road_words(run), f"{v0:g} m/s", times, coupling, control_words(run)))


def control_words(run: Run) -> str:
    """Whether the controller is on, with which horizon, and from when."""
    if not is_controlled(run):
        return "controller off"
    known = run.parameters
    horizon = f"{known.get('horizon', 'unknown')} horizon"
    if known.get("horizon") == "finite":
        horizon += ", T = {:g} s".format(*run.reals("T"))
    begin = "the come-down of the last wheel"
    if known.get("activation") == "at t_on":
        begin = "t = {:g} s".format(*run.reals("t_on"))
    words = [f"{known['design']} design"] if "design" in known else []
    return f"controller on ({', '.join([*words, horizon, *hardware_words(run)])}, from {begin})"


def hardware_words(run: Run) -> list[str]:
    """What stands between the law and the struts, if anything does."""
    known, found = run.parameters, []
    if known.get("actuators") == "semi-active":
        found.append("semi-active")
    if known.get("feedback") == "estimate":
        found.append("from estimates")
    for name, factor, text in (
        ("force_limit", 1.0, "forces up to {:g} N"),
        ("actuator_lag", 1e3, "lag {:g} ms"),
        ("sample_time", 1e3, "samples every {:g} ms"),
    ):
        if known.get(name):
            found.append(text.format(factor * run.reals(name)[0]))
    return found


def road_words(run: Run) -> str:
    """The road in words, and under which wheels it is uneven if not under all."""
    known = run.parameters
    profile = known.get("profile", "not recorded")
    if profile == "flat":
        return "flat road"
    A, Lambda = run.reals("A", "Lambda")
    names = [name for name in HARMONICS if known.get(name)]
    series = zip(names, run.reals(*names), strict=True)
    what = {
        "bump": f"half-sine bump, {1e3 * A:g} mm high and {Lambda / 2:g} m long",
        "sine": f"endless sine road, amplitude {1e3 * A:g} mm, wave length {Lambda:g} m",
        "fourier": f"Fourier series on {Lambda:g} m, " + ", ".join(f"{name} = {1e3 * a:g} mm" for name, a in series),
        "step": f"step of {1e3 * A:g} mm",
    }.get(str(profile), f"road profile {profile}")
    under = [words for corner, words in zip(CORNERS, CORNER_WORDS, strict=True) if known.get(f"excite_{corner}", True)]
    return what if len(under) == len(CORNERS) else f"{what}, under {', '.join(under) or 'no wheel'} only"
