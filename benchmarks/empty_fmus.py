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
        for i in range({inputs}):
            setattr(self, f"u{{i}}", 0.0)
            self.register_variable(Real(f"u{{i}}", causality=Fmi2Causality.input))
        for i in range({outputs}):
            setattr(self, f"y{{i}}", 0.0)
            self.register_variable(Real(f"y{{i}}", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
"""


def empty_system(folder: Path) -> Path:
    """An .ssp wired like ours, of empty FMUs on our shell."""
    contents = {"SystemStructure.ssd": (build.SYSTEM / "SystemStructure.ssd").read_bytes()}
    for model, module in build.MODELS.items():
        script = folder / f"empty_{model.lower()}.py"
        script.write_text(SHELL.format(model=model, module=module))
        fmu = _export(script, folder / f"{model}.fmu")
        contents[f"resources/{model}.fmu"] = fmu.read_bytes()
    target = folder / "Empty.ssp"
    build.write_archive(target, contents)
    return target


def stock_fmus(folder: Path) -> list[Path]:
    """Three empty FMUs (road, vehicle, controller) with as many variables as ours, all PythonFMU's own code."""
    fmus = []
    for model in (RoadExcitation, Vehicle7DOF, LqrController):
        script = folder / f"stock_{model.__name__.lower()}.py"
        name = f"Stock{model.__name__}"
        script.write_text(STOCK.format(model=name, inputs=len(model.inputs), outputs=len(model.outputs)))
        fmus.append(_export(script, folder / f"{name}.fmu"))
    return fmus


def _export(script: Path, target: Path) -> Path:
    path = list(sys.path)
    try:
        made = FmuBuilder.build_FMU(script, target, needsExecutionTool=False)
    finally:
        sys.path[:] = path
    return Path(made)
