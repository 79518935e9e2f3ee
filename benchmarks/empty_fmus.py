"""FMUs with the interface of ours that do nothing: on our shell, and as one writes them first with stock PythonFMU."""

from __future__ import annotations

import sys
from pathlib import Path

from pythonfmu import FmuBuilder

import build
from fmu_src.controller.lqr_controller import LqrController
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

SHELL = """import fmu_src.{module} as ours
from fmu_src.slave import Slave


class {model}(Slave):
    inputs, outputs = ours.{model}.inputs, ours.{model}.outputs
    references = []

    def __init__(self, **kwargs):
        self.references.append(globals())
        super().__init__(**kwargs)

    def configure(self):
        pass

    def begin(self):
        pass

    def advance(self, t, step):
        pass

    def feed_through(self):
        pass
"""
STOCK = """from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class {model}(Fmi2Slave):
    references = []

    def __init__(self, **kwargs):
        self.references.append(globals())
        super().__init__(**kwargs)
        self.value = dict.fromkeys({inputs} + {outputs}, 0.0)
        for name in {inputs}:
            self.declare(name, Fmi2Causality.input)
        for name in {outputs}:
            self.declare(name, Fmi2Causality.output)

    def declare(self, name, causality):
        getter, setter = lambda: self.value[name], lambda value: self.value.__setitem__(name, value)
        self.register_variable(Real(name, causality=causality, getter=getter, setter=setter), nested=False)

    def do_step(self, current_time, step_size):
        return True
"""


def empty_system(folder: Path, *, stock: bool) -> Path:
    """An .ssp wired like ours, of empty FMUs: all PythonFMU's own code if `stock`, on our shell if not."""
    folder.mkdir()
    contents = {"SystemStructure.ssd": (build.SYSTEM / "SystemStructure.ssd").read_bytes()}
    for model in (RoadExcitation, Vehicle7DOF, LqrController):
        name = model.__name__
        script = folder / f"{folder.name}_{name.lower()}.py"
        variables = {kind: [q.name for q in getattr(model, kind)] for kind in ("inputs", "outputs")}
        template = STOCK if stock else SHELL
        script.write_text(template.format(model=name, module=build.MODELS[name], **variables))
        contents[f"resources/{name}.fmu"] = _export(script, folder / f"{name}.fmu").read_bytes()
    target = folder / "Empty.ssp"
    build.write_archive(target, contents)
    return target


def _export(script: Path, target: Path) -> Path:
    path = list(sys.path)
    try:
        return Path(FmuBuilder.build_FMU(script, target, needsExecutionTool=False))
    finally:
        sys.path[:] = path
