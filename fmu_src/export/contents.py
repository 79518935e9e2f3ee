"""All that an FMU holds beside what PythonFMU puts into it; the same FMU gives the same bytes."""

from __future__ import annotations

import base64
from collections.abc import Callable
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from . import controller_drawing, drawing, reference, road_drawing, vehicle_drawing
from .formulas import with_formulas
from .reader import Description, describe

DRAWINGS: dict[str, Callable[[Any], None]] = {
    "RoadExcitation": road_drawing.draw,
    "Vehicle7DOF": vehicle_drawing.draw,
    "LqrController": controller_drawing.draw,
}
NUMERIC = ("numpy", "scipy")  # what a design for other than default parameters imports
LICENSE = Path(__file__).parents[2] / "LICENSE"
CPPFMU = """

----------------------------------------------------------------------------------------------------
The libraries in binaries/ are PythonFMU's. They hold CPPFMU, Copyright 2016-2019, SINTEF Ocean, under the
Mozilla Public License, v. 2.0 (mozilla.org/MPL/2.0); its source is part of PythonFMU's:
github.com/NTNU-IHB/PythonFMU, pythonfmu/pythonfmu-export.
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
        "documentation/externalDependencies.txt": _render("externalDependencies.txt", description, requirements=needed),
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


def requirements() -> list[str]:
    """What `pythonfmu deploy` installs for designs with other than default parameters, as this project asks for it."""
    wanted = distribution("bertolino-baksa").requires or []
    found = [line for line in wanted if line.startswith(NUMERIC)]
    if len(found) != len(NUMERIC):
        raise LookupError(f"wanted requirements on {', '.join(NUMERIC)} in pyproject.toml, found {found}")
    return sorted(found)


def _license_of_pythonfmu() -> bytes:
    installed = distribution("pythonfmu")
    text = next((found for name in ("licenses/LICENSE", "LICENSE") if (found := installed.read_text(name))), None)
    if text is None:
        raise LookupError("no licence is installed with pythonfmu, whose code goes into the FMU")
    return (text.rstrip() + CPPFMU).encode()


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
