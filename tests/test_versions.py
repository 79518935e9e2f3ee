"""Two versions of one FMU in one process each run their own code; and the shell costs hardly more than a bare list."""

from __future__ import annotations

import shutil
import subprocess
import sys
import timeit
from pathlib import Path

import build
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

HOST = """
import sys
from pathlib import Path
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

def load(archive, name):
    folder = extract(archive)
    md = read_model_description(folder)
    identifier = md.coSimulation.modelIdentifier
    fmu = FMU2Slave(guid=md.guid, modelIdentifier=identifier, unzipDirectory=folder, instanceName=name)
    fmu.instantiate()
    refs = {v.name: v.valueReference for v in md.modelVariables}
    fmu.setupExperiment()
    fmu.setReal([refs["body.heave"]], [0.01])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu, [refs["body.heave_acceleration"]]

pair = [load(archive, f"v{i}") for i, archive in enumerate(sys.argv[1:])]
for round in range(3):
    print(*(fmu.getReal(vr)[0] for fmu, vr in pair))
    for fmu, _ in pair:
        fmu.doStep(round * 1e-3, 1e-3)
assert not [name for name in sys.modules if name == "fmu_src"]
for fmu, _ in pair:
    fmu.terminate()
    fmu.freeInstance()
"""


def test_two_versions_with_different_physics_in_one_process_run_their_own_code(dist: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / "fmu_src"
    shutil.copytree(build.PACKAGE, other, ignore=shutil.ignore_patterns("__pycache__"))
    equations = other / "vehicle" / "equations.py"
    text = equations.read_text(encoding="utf-8")
    assert text.count("(F1 + F2) / m,") == 1
    equations.write_text(text.replace("(F1 + F2) / m,", "3.0 * (F1 + F2) / m,"), encoding="utf-8")
    build.build_fmu("Vehicle7DOF", other, tmp_path / "Vehicle7DOF.fmu")

    archives = [str(dist / "Vehicle7DOF.fmu"), str(tmp_path / "Vehicle7DOF.fmu")]
    for order in (archives, archives[::-1]):
        done = subprocess.run(
            [sys.executable, "-I", "-c", HOST, *order], cwd=tmp_path, capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stderr
        first = [float(x) for x in done.stdout.splitlines()[0].split()]
        ours, theirs = first if order is archives else first[::-1]
        assert abs(theirs / ours - 3.0) < 1e-12
        assert len(set(done.stdout.splitlines())) == 3


def test_the_shells_getter_costs_at_most_a_fifth_more_than_a_hand_written_one() -> None:
    """Over any list of references; medians of interleaved rounds, since machines are noisy."""
    slave = Vehicle7DOF(instance_name="v", resources="")
    slave.exit_initialization_mode()
    references = [slave._output_refs[i] for i in (0, 7, 3, 20, 28, 14, 2)]
    cells = [(slave.y, i) for i in range(-len(slave.u), 200)]

    def hand_written(vrs: list[int]) -> list[float]:
        return [where[i] for where, i in [cells[vr] for vr in vrs]]

    ratios = sorted(
        timeit.timeit(lambda: slave.get_real(references), number=2000)
        / timeit.timeit(lambda: hand_written(references), number=2000)
        for _ in range(101)
    )
    assert ratios[50] <= 1.2
