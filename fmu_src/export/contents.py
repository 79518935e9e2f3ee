"""All that an FMU holds beside what PythonFMU puts into it; the same FMU gives the same bytes."""

from __future__ import annotations

import base64
from collections.abc import Callable
from importlib.metadata import distribution
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import fromstring

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from ..controller.law import CAR, HALF_CAR, WEIGHTS
from . import controller_drawing, drawing, reference, road_drawing, system_drawing, vehicle_drawing
from .formulas import with_formulas
from .reader import Description, describe

DRAWINGS: dict[str, Callable[[Any], None]] = {
    "RoadExcitation": road_drawing.draw,
    "Vehicle7DOF": vehicle_drawing.draw,
    "LqrController": controller_drawing.draw,
}
NUMERIC = ("numpy", "scipy")  # what a design for other than default parameters imports
LICENSE = Path(__file__).parents[2] / "LICENSE"
NOTICE = """

----------------------------------------------------------------------------------------------------
The libraries in binaries/ are PythonFMU's. Changed is one byte of that of version 0.7.0 for Linux, at 0x16f34: the
function `onLibraryUnload` returns at once, since at the exit of a process it released what was released already.
They hold CPPFMU, Copyright 2016-2019, SINTEF Ocean, under the Mozilla Public License, v. 2.0 (mozilla.org/MPL/2.0);
its source, in which nothing is changed, is part of PythonFMU's: github.com/NTNU-IHB/PythonFMU,
pythonfmu/pythonfmu-export.
"""
CONTAINER = """

----------------------------------------------------------------------------------------------------
The libraries in binaries/ are fmpy's container_fmu. They are written in Rust and hold its standard library and the
crates serde, serde_json, url, idna, percent-encoding, smallvec (each MIT or Apache-2.0), icu (Unicode-3.0) and fmi-rs;
their texts are at crates.io.
"""


def extra_entries(fmu: Path) -> dict[str, bytes]:
    """Archive entries, by name, to be added to this FMU, which is run once for its reference results."""
    description = describe(fmu)
    model = description.model
    needed = requirements() if model == "LqrController" else []
    picture = drawing.png(DRAWINGS[model])
    entries = {
        "model.png": picture,
        "documentation/index.html": _page(description, picture),
        "documentation/externalDependencies.txt": _render(
            "externalDependencies.txt",
            description,
            requirements=needed,
            half_car=HALF_CAR,
            full_car=dict.fromkeys([*CAR, *WEIGHTS]),
        ),
        "documentation/fmi-ls-ref.txt": _render(
            "fmi-ls-ref.txt",
            description,
            what=reference.WORDS[model],
            feedthrough=reference.FEED_THROUGH.get(model),
            inputs=description.inputs,
            stop=reference.STOP,
            step=reference.STEP,
        ),
        "documentation/licenses/license.txt": LICENSE.read_text(encoding="utf-8").encode(),
        "documentation/licenses/pythonfmu.txt": _license_of_pythonfmu(),
        **reference.entries(fmu, description),
    }
    if needed:
        entries["resources/requirements.txt"] = "".join(f"{line}\n" for line in needed).encode()
    return entries


def container_documents(files: dict[str, bytes], step: float) -> dict[str, bytes]:
    """Picture, page and licences of the container FMU that holds these files and makes steps of this length [s]."""
    description = Description(fromstring(files["modelDescription.xml"]))
    picture = drawing.png(system_drawing.draw)
    components = sorted({name.split("/")[1] for name in files if name.count("/") > 1 and name.startswith("resources/")})
    values = {"variables": description.variables, "picture": base64.b64encode(picture).decode()}
    needs = files["resources/LqrController/documentation/externalDependencies.txt"]  # the one that needs most
    return {
        "model.png": picture,
        "documentation/index.html": _render(
            "VehicleOnRoad.html", description, components=components, step=step, **values
        ),
        "documentation/externalDependencies.txt": needs,
        "documentation/licenses/license.txt": LICENSE.read_text(encoding="utf-8").encode(),
        "documentation/licenses/pythonfmu.txt": _license_of_pythonfmu(),
        "documentation/licenses/fmpy.txt": (_license_of("fmpy") + CONTAINER).encode(),
    }


def requirements() -> list[str]:
    """What `pythonfmu deploy` installs for designs with other than default parameters, as this project asks for it."""
    wanted = distribution("bertolino-baksa").requires or []
    found = [line for line in wanted if line.startswith(NUMERIC)]
    if len(found) != len(NUMERIC):
        raise LookupError(f"wanted requirements on {', '.join(NUMERIC)} in pyproject.toml, found {found}")
    return sorted(found)


def _license_of_pythonfmu() -> bytes:
    return (_license_of("pythonfmu") + NOTICE).encode()


def _license_of(package: str) -> str:
    installed = distribution(package)
    names = ("licenses/LICENSE", "LICENSE", "licenses/LICENSE.txt", "LICENSE.txt")
    text = next((found for name in names if (found := installed.read_text(name))), None)
    if text is None:
        raise LookupError(f"no licence is installed with {package}, whose code goes into the FMU")
    return text.rstrip()


# ------------------------------------------------------------------ pages
def _render(template: str, description: Description, **values: object) -> bytes:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        undefined=StrictUndefined,
        autoescape=template.endswith(".html"),
        keep_trailing_newline=True,
    )
    about = {"version": "", **description.about}
    return environment.get_template(template).render(about=about, **values).encode()


def _page(description: Description, picture: bytes) -> bytes:
    values = {"variables": description.variables, "picture": base64.b64encode(picture).decode()}
    return with_formulas(_render(f"{description.model}.html", description, **values).decode()).encode()
