"""The set of files that the FMI Cross-Check asks of an exporting tool (rules 4.1), beside the FMU."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

from .reader import describe
from .reference import FOLDER, STEP, STOP

OPTIONS = {"StartTime": 0.0, "StopTime": STOP, "StepSize": STEP, "RelTol": 1e-6, "OutputIntervalLength": STEP}


def write_cross_check(fmu: Path, folder: Path) -> Path:
    """Write the set of this FMU, with a copy of it, under `folder`; returns where, in the layout of the rules."""
    description = describe(fmu)
    model = description.model
    tool, version = description.about["generationTool"].split()
    platform = "win64" if os.name == "nt" else "linux64"  # the one on which the reference results were computed
    place = folder / "fmus" / description.about["fmiVersion"] / "cs" / platform / tool / version / model
    place.mkdir(parents=True, exist_ok=True)
    (place / f"{model}.fmu").write_bytes(fmu.read_bytes())
    with zipfile.ZipFile(fmu) as archive:
        names = set(archive.namelist())
        for name in (f"{model}_ref.csv", f"{model}_in.csv"):
            if f"{FOLDER}/{name}" in names:
                (place / name).write_bytes(archive.read(f"{FOLDER}/{name}"))
        (place / "README.txt").write_bytes(archive.read("documentation/fmi-ls-ref.txt"))
    options = "".join(f"{name}, {value!r}\n" for name, value in OPTIONS.items())
    (place / f"{model}_ref.opt").write_bytes(options.encode())
    return place
