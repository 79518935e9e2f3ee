"""SYSTEM.ssp COUNT RESULT [PARAMETER_SET]: run a system with ecospy, step 1 ms; record all outputs, the start included.

ecospy's library needs libtbb.so.12; the wheel `tbb` puts it into the environment's lib, from where it is loaded here.
"""

from __future__ import annotations

import ctypes
import sys
import xml.etree.ElementTree as ET
import zipfile
from array import array
from pathlib import Path

NS = {"ssd": "http://ssp-standard.org/SSP1/SystemStructureDescription"}


def outputs(system: str) -> list[tuple[str, str]]:
    root = ET.fromstring(zipfile.ZipFile(system).read("SystemStructure.ssd"))
    return [
        (component.attrib["name"], connector.attrib["name"])
        for component in root.iterfind(".//ssd:Component", NS)
        for connector in component.iterfind("ssd:Connectors/ssd:Connector[@kind='output']", NS)
    ]


def main(system: str, count: int, result: Path, parameter_set: str | None) -> None:
    ctypes.CDLL(str(Path(sys.prefix, "lib", "libtbb.so.12")))
    from ecospy import EcosSimulation  # loads the library

    found = outputs(system)
    data = array("d")
    with EcosSimulation(ssp_path=system, step_size=1e-3) as simulation:
        assert simulation.init(parameter_set=parameter_set)
        for k in range(count + 1):
            if k:
                simulation.step()
            data.append(simulation.get_time())
            data.extend(simulation.get_real(f"{component}::{variable}") for component, variable in found)
        simulation.terminate()
    names = ["time", *(f"{component}.{variable}" for component, variable in found)]
    result.write_bytes(" ".join(names).encode() + b"\n" + data.tobytes())


main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4] if len(sys.argv) > 4 else None)
