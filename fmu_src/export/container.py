"""One FMU of the whole closed loop: fmpy's container_fmu with the components and the wiring of the .ssp inside.

Worked around in fmpy 0.3.32: connections must say Float64 where FMI 2 says Real; value reference 0 is the time, and the
others must be numbered through in the order of the variables; the model structure is left to the caller; its archive
carries the time of day, half of itself, and binaries for platforms that the components do not have. `parallelDoStep`
ends the host ("not yet implemented") and stays off.
"""

from __future__ import annotations

import hashlib
import tempfile
import zipfile
from pathlib import Path

from attrs import evolve
from fmpy import read_model_description
from fmpy.container_fmu.cli import create_container_fmu
from fmpy.container_fmu.config import Component, Configuration, Connection
from fmpy.model_description import CoSimulation, DefaultExperiment, ModelDescription, ModelVariable, Unknown
from fmpy.ssp.ssd import SystemStructureDescription, read_ssd

from .contents import container_documents

Mapping = dict[ModelVariable, list[tuple[Component, ModelVariable]]]


def container_contents(system: Path, step: float = 1e-3, stop: float = 5.0) -> dict[str, bytes]:
    """The files of the container FMU, by their names in the archive; the same .ssp gives the same bytes."""
    with tempfile.TemporaryDirectory(prefix="container_") as folder:
        unpacked = Path(folder, "ssp")
        with zipfile.ZipFile(system) as archive:
            archive.extractall(unpacked)
        ssd = read_ssd(system)
        files = {element.name: unpacked / element.source for element in ssd.system.elements}
        components = {name: Component(name, file, read_model_description(file)) for name, file in files.items()}
        variables = _variables(components)
        configuration = Configuration(
            parallelDoStep=False,
            modelDescription=_description(ssd, components, variables, system, step, stop),
            components=list(components.values()),
            connections=_connections(ssd, components),
            variableMappings=variables,
        )
        build, made = Path(folder, "build"), Path(folder, "made.fmu")
        build.mkdir()
        create_container_fmu(configuration, build, made)
        with zipfile.ZipFile(made) as archive:
            unwanted = ("Container.zip", "binaries/darwin64/")
            names = [n for n in archive.namelist() if not n.endswith("/") and not n.startswith(unwanted)]
            files_inside = {name: archive.read(name) for name in names}
        return {**files_inside, **container_documents(files_inside, step)}


def _connections(ssd: SystemStructureDescription, components: dict[str, Component]) -> list[Connection]:
    """One per pair of components, in the order of the .ssp: each reads its source anew, after those before it."""
    found = {name: {v.name: v for v in c.modelDescription.modelVariables} for name, c in components.items()}
    pairs: dict[tuple[str, str], Connection] = {}
    for c in ssd.system.connections:
        start, end = components[c.startElement], components[c.endElement]
        pair = pairs.setdefault((start.name, end.name), Connection(start, [], end, []))
        pair.startConnectors.append(evolve(found[start.name][c.startConnector], type="Float64"))
        pair.endConnectors.append(evolve(found[end.name][c.endConnector], type="Float64"))
    return list(pairs.values())


def _variables(components: dict[str, Component]) -> Mapping:
    """The container's variables: every output as component.name; every parameter once, for all that have it."""
    shared: dict[str, ModelVariable] = {}
    mapping: Mapping = {}
    for c in components.values():
        for v in c.modelDescription.modelVariables:
            if v.causality == "output":
                mapping[evolve(v, name=f"{c.name}.{v.name}", declaredType=None)] = [(c, v)]
            elif v.causality == "parameter":
                own = shared.setdefault(v.name, evolve(v, declaredType=None))
                mapping.setdefault(own, []).append((c, v))
    return mapping


def _description(
    ssd: SystemStructureDescription,
    components: dict[str, Component],
    variables: Mapping,
    system: Path,
    step: float,
    stop: float,
) -> ModelDescription:
    first = next(iter(components.values())).modelDescription
    time = ModelVariable(name="time", type="Real", causality="independent", variability="continuous")
    time.unit, time.description = "s", "time"
    units = {unit.name: unit for c in components.values() for unit in c.modelDescription.unitDefinitions}
    made = ModelDescription(
        fmiVersion="2.0",
        modelName=ssd.system.name,
        instantiationToken=hashlib.sha256(system.read_bytes() + Path(__file__).read_bytes()).hexdigest()[:32],
        description="Closed loop: " + "; ".join(c.modelDescription.description for c in components.values()),
        author=first.author,
        license=first.license,
        copyright=first.copyright,
        generationTool="fmpy.container_fmu",
        generationDateAndTime=first.generationDateAndTime,
        unitDefinitions=list(units.values()),
        defaultExperiment=DefaultExperiment(startTime="0.0", stopTime=str(stop), stepSize=str(step)),
        modelVariables=[time, *variables],
    )
    made.coSimulation = CoSimulation(
        modelIdentifier="container_fmu", fixedInternalStepSize=step, canHandleVariableCommunicationStepSize=False
    )
    outputs = [v for v in variables if v.causality == "output"]
    made.outputs = [Unknown(variable=v, dependencies=[]) for v in outputs]
    # without dependencies: on start values and parameters of all components, the container does not say which
    made.initialUnknowns = [Unknown(variable=v) for v in outputs if v.initial != "exact"]
    return made
