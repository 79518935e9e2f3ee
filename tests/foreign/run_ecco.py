"""SYSTEM.ssp STOP RESULT STEP MIN MAX TOLERANCE: run a system with libcosim's ECCO algorithm; record as run_libcosimpy.

libcosim takes no algorithm but the fixed step from an .ssp, so the system is put together here from its .ssp. The bonds
join controller and car: the four forces with the body's heave rate, whose products sum to the power into the heave.
"""

from __future__ import annotations

import sys
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from array import array
from pathlib import Path

from libcosimpy.CosimAlgorithm import CosimAlgorithm, EccoParams
from libcosimpy.CosimEnums import CosimVariableCausality, CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

NS = {"ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription"}
RATE = "der(body.heave)"


class System:
    """The slaves of an .ssp in an execution: their indices, and the references of their real variables."""

    def __init__(self, execution: CosimExecution, folder: Path) -> None:
        self.index: dict[str, int] = {}
        self.reference: dict[str, dict[str, int]] = {}
        self.outputs: dict[str, list[str]] = {}
        ssd = ET.parse(folder / "SystemStructure.ssd")
        self.slaves = []  # keeps them alive
        for c in ssd.iterfind(".//ssd:Component", NS):
            slave = CosimLocalSlave(str(folder / c.attrib["source"]), c.attrib["name"])
            self.slaves.append(slave)
            self.index[c.attrib["name"]] = index = execution.add_local_slave(slave)
            reals = [v for v in execution.slave_variables(index) if v.type == CosimVariableType.REAL.value]
            self.reference[c.attrib["name"]] = {v.name.decode(): v.reference for v in reals}
            output = CosimVariableCausality.OUTPUT.value
            self.outputs[c.attrib["name"]] = [v.name.decode() for v in reals if v.causality == output]
        for k in ssd.iterfind(".//ssd:Connection", NS):
            start = self.port(k.attrib["startElement"], k.attrib["startConnector"])
            end = self.port(k.attrib["endElement"], k.attrib["endConnector"])
            assert execution.connect_real_variables(*start, *end) == 0

    def port(self, component: str, variable: str) -> tuple[int, int]:
        return self.index[component], self.reference[component][variable]

    def bond(self, algorithm: CosimAlgorithm) -> None:
        for corner in ("fl", "fr", "rl", "rr"):
            index, force = self.port("controller", f"force_{corner}")
            _, felt = self.port("controller", RATE)
            car, rate = self.port("vehicle", RATE)
            _, acting = self.port("vehicle", f"force_{corner}")
            assert algorithm.add_power_bond(index, force, felt, car, rate, acting) == 0


def main(archive: str, stop: float, result: Path, step: float, least: float, most: float, tolerance: float) -> None:
    log_output_level(CosimLogLevel.WARNING)
    parameters = EccoParams(
        safety_factor=0.9,
        step_size=step,
        min_step_size=least,
        max_step_size=most,
        min_change_rate=0.2,
        max_change_rate=1.5,
        abs_tolerance=tolerance,
        rel_tolerance=tolerance,
    )
    algorithm = CosimAlgorithm.create_ecco_algorithm(parameters)
    execution = CosimExecution.from_algorithm(algorithm)
    with tempfile.TemporaryDirectory() as folder:
        zipfile.ZipFile(archive).extractall(folder)
        system = System(execution, Path(folder))
    system.bond(algorithm)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    data = array("d")
    while execution.status().current_time < round(stop * 1e9) - 1000:
        assert execution.step(1)
        data.append(execution.status().current_time / 1e9)
        for name, outputs in system.outputs.items():
            references = [system.reference[name][v] for v in outputs]
            data.extend(observer.last_real_values(system.index[name], references))
    names = ["time", *(f"{name}.{v}" for name, outputs in system.outputs.items() for v in outputs)]
    result.write_bytes(" ".join(names).encode() + b"\n" + data.tobytes())


main(sys.argv[1], float(sys.argv[2]), Path(sys.argv[3]), *map(float, sys.argv[4:8]))
