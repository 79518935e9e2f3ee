"""The reference experiment: what is fed in, what comes out, and the FMI-LS-REF manifest that says so.

The results are those of the FMU itself, run by FMPy in a process of its own that has nothing of ours but the file.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from math import cos, exp, pi, sin
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..quantities import CORNERS
from ..road.profiles import RoadParameters, road
from .reader import Description

STOP, STEP = 0.5, 1e-3  # s; by then all wheels have left the default bump and the controller has begun
FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
EXPERIMENTS = "smoke-test.exp"
WORDS = {
    "RoadExcitation": "The four wheels meet the default bump, one after the other.",
    "Vehicle7DOF": "The car drives over the default bump while its actuators push with sines of 2 Hz.",
    "LqrController": "Heave and pitch swing and decay; control begins when the last wheel has come down from the bump.",
}
FEED_THROUGH = {"Vehicle7DOF": "accelerations and tyre forces", "LqrController": "all forces"}
PUSHES = dict(zip(CORNERS, (200.0, -100.0, 150.0, -50.0), strict=True))  # N; moves heave, roll and pitch
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
Stimuli = Callable[[int], dict[str, float]]
"""Inputs by name at the communication point of this number; what is not named is 0."""


# ------------------------------------------------------------------ what is fed in
def _road_and_pushes() -> Stimuli:
    """Heights, rates and bows of the default road, and a sine of force at each strut."""
    profile = road(RoadParameters())

    def at(n: int) -> dict[str, float]:
        t, before = n * STEP, max(n - 1, 0) * STEP
        h, dh, h0, dh0 = profile.heights(t), profile.rates(t), profile.heights(before), profile.rates(before)
        middle = profile.heights(0.5 * (before + t))
        values = {f"force_{corner}": push * sin(4.0 * pi * t) for corner, push in PUSHES.items()}
        for k, corner in enumerate(CORNERS):
            bow = middle[k] - 0.25 * (3.0 * h0[k] + h[k] + (t - before) * dh0[k])
            values |= {f"h_{corner}": h[k], f"dh_{corner}": dh[k], f"bow_{corner}": bow}
        return values

    return at


def _decaying_motion() -> Stimuli:
    """Heave and pitch that swing and decay, with their exact rates."""

    def at(n: int) -> dict[str, float]:
        t = n * STEP
        decay, c, s = exp(-2.0 * t), cos(8.0 * t), sin(8.0 * t)
        return {
            "body.heave": 0.01 * decay * c,
            "body.pitch": 0.005 * decay * s,
            "der(body.heave)": 0.01 * decay * (-2.0 * c - 8.0 * s),
            "der(body.pitch)": 0.005 * decay * (-2.0 * s + 8.0 * c),
        }

    return at


STIMULI: dict[str, Callable[[], Stimuli]] = {"Vehicle7DOF": _road_and_pushes, "LqrController": _decaying_motion}


def stimuli(model: str, inputs: list[str]) -> bytes | None:
    """CSV of these inputs at all communication points, after the rules of the FMI Cross-Check; None without inputs."""
    if not inputs:
        return None
    at = STIMULI[model]()
    rows = [",".join(f'"{name}"' for name in ("time", *inputs))]
    for n in range(round(STOP / STEP) + 1):
        values = at(n)
        # + 0.0 turns −0.0 into 0.0
        rows.append(",".join(repr(x) for x in (n * STEP, *(values.get(name, 0.0) + 0.0 for name in inputs))))
    return ("\n".join(rows) + "\n").encode()


# ------------------------------------------------------------------ what comes out
def results(fmu: Path, fed: bytes | None) -> bytes:
    """CSV of all outputs of the FMU at all communication points. Raises CalledProcessError with what FMPy said."""
    with tempfile.TemporaryDirectory(prefix="reference_") as temporary:
        folder = Path(temporary)
        command = [sys.executable, "-I", "-m", "fmpy", "simulate", str(fmu.resolve())]
        command += ["--output-file", str(folder / "out.csv")]
        command += ["--stop-time", repr(STOP), "--output-interval", repr(STEP)]
        if fed is not None:
            (folder / "in.csv").write_bytes(fed)
            command += ["--input-file", str(folder / "in.csv")]
        try:
            subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True, timeout=120)
        except subprocess.CalledProcessError as error:
            error.add_note(f"{error.stdout}{error.stderr}")
            raise
        return (folder / "out.csv").read_bytes().replace(b"\r\n", b"\n")


def entries(fmu: Path, description: Description) -> dict[str, bytes]:
    """The archive entries of the reference experiment of this FMU."""
    model = description.model
    fed = stimuli(model, description.inputs)
    files = {f"{FOLDER}/{model}_ref.csv": results(fmu, fed), f"{FOLDER}/{EXPERIMENTS}": _experiments(model, fed)}
    if fed is not None:
        files[f"{FOLDER}/{model}_in.csv"] = fed
    return {**files, f"{FOLDER}/fmi-ls-manifest.xml": _manifest(model, fed)}


# ------------------------------------------------------------------ FMI-LS-REF 1.0.0-alpha.1
def _manifest(model: str, fed: bytes | None) -> bytes:
    root = Element(
        "fmiReferences",
        {
            "xmlns:fmi-ls": NAMESPACE,
            "fmi-ls:fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            "fmi-ls:fmi-ls-version": "1.0.0-alpha.1",
            "fmi-ls:fmi-ls-description": "Layered Standard providing information on related files included in an FMU.",
        },
    )
    related = [("experiment", EXPERIMENTS, "application/x-ma-hs-experiments", "Reference experiment")]
    related.append(("result", f"{model}_ref.csv", "text/csv", "All outputs in the reference experiment"))
    if fed is not None:
        related.append(("other", f"{model}_in.csv", "text/csv", "All inputs in the reference experiment"))
    related.append(("document", "../../documentation/index.html", "text/html", "Equations, variables, limits"))
    for role, source, kind, words in related:
        SubElement(root, "Related", type=kind, source=source, role=role, description=words)
    return _xml(root)


def _experiments(model: str, fed: bytes | None) -> bytes:
    root = Element("Experiments", name=f"{model} smoke test", description="One run with default parameters")
    times = {"startTime": "0.0", "stopTime": repr(STOP), "stepSize": repr(STEP)}
    experiment = SubElement(root, "Experiment", {"name": model, "description": WORDS[model], **times})
    if fed is not None:
        SubElement(experiment, "Stimuli", source=f"{model}_in.csv")
    SubElement(experiment, "References", source=f"{model}_ref.csv")
    return _xml(root)


def _xml(root: Element) -> bytes:
    indent(root)
    return tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
