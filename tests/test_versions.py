"""Two versions of one FMU in one process each run their own code; and the shell costs hardly more than a bare list."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
import timeit
from collections.abc import Callable
from pathlib import Path

import pytest

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


class ByHand:
    """What one writes who has all values in one list and checks nothing."""

    def __init__(self, values: list[float]) -> None:
        self.values = values

    def get_real(self, vrs: list[int]) -> list[float]:
        values = self.values
        return [values[i] for i in vrs]

    def set_real(self, vrs: list[int], new: list[float]) -> None:
        values = self.values
        for i, value in zip(vrs, new, strict=False):
            values[i] = value


def cost(ours: Callable[[], object], theirs: Callable[[], object]) -> float:
    """Ratio of the least times of many short interleaved rounds: what else runs on the machine only adds.

    Up to four times, as a processor that changes its pace between the two makes any ratio; the least is nearest.
    """
    ratios: list[float] = []
    while len(ratios) < 4 and not min(ratios, default=2.0) <= 1.2:
        times = [(timeit.timeit(ours, number=200), timeit.timeit(theirs, number=200)) for _ in range(300)]
        ratios.append(min(a for a, _ in times) / min(b for _, b in times))
    return min(ratios)


@pytest.mark.parametrize("shuffled", [False, True])
@pytest.mark.parametrize("count", [1, 7, 16, 28, 29])
def test_the_shells_getter_costs_at_most_a_fifth_more_than_a_hand_written_one(count: int, shuffled: bool) -> None:
    """Whatever list of outputs a host reads; every reference is known to be one, as PythonFMU's own getter asks."""
    slave = Vehicle7DOF(instance_name="v", resources="")
    slave.exit_initialization_mode()
    hand = ByHand([*slave.u, *slave.y, *slave.p])
    references = [*range(len(slave.u), len(slave.u) + len(slave.y))]
    if shuffled:
        random.Random(7).shuffle(references)
    references = references[:count]
    assert slave.get_real(references) == hand.get_real(references)
    assert cost(lambda: slave.get_real(references), lambda: hand.get_real(references)) <= 1.2


@pytest.mark.parametrize("shuffled", [False, True])
@pytest.mark.parametrize("count", [1, 4, 7, 16])
def test_the_shells_setter_costs_at_most_a_fifth_more_than_a_hand_written_one(count: int, shuffled: bool) -> None:
    """Whatever stretch of the inputs a host sets, in whatever order."""
    slave = Vehicle7DOF(instance_name="v", resources="")
    slave.exit_initialization_mode()
    hand = ByHand([*slave.u, *slave.y, *slave.p])
    references = [*range(count)]
    if shuffled:
        random.Random(7).shuffle(references)
    values = [0.5 + i for i in references]
    slave.set_real(references, values)
    assert slave.u[:count] == [0.5 + i for i in range(count)]
    assert cost(lambda: slave.set_real(references, values), lambda: hand.set_real(references, values)) <= 1.2


@pytest.mark.parametrize("references", [[0, 5], [5, 0], [3, 3], [9, 2, 9, 4], [15], [1, 0, 1], [*range(0, 16, 3)]])
def test_lists_of_inputs_with_gaps_and_repetitions_are_set_as_one_by_one(references: list[int]) -> None:
    slave, plain = (Vehicle7DOF(instance_name="v", resources="") for _ in range(2))
    for round in range(3):  # the first works it out
        values = [round + 0.1 * k for k in range(len(references))]
        slave.set_real(references, values)
        for reference, value in zip(references, values, strict=True):
            plain.u[reference] = value
        assert slave.u == plain.u


def test_lists_of_inputs_outputs_and_parameters_are_read_as_one_by_one_and_the_memory_for_them_is_bounded() -> None:
    slave = Vehicle7DOF(instance_name="v", resources="")
    slave.exit_initialization_mode()
    values = [*slave.u, *slave.y, *slave.p]
    generator = random.Random(7)
    for _ in range(1000):
        references = generator.choices(range(len(values)), k=generator.randint(0, 9))
        expected = [values[i] for i in references]
        assert [slave.get_real(references), slave.get_real(references)] == [expected, expected]
        inputs = generator.choices(range(16), k=9)
        slave.set_real(inputs, [0.0] * 9)
    assert max(len(slave._reading), len(slave._writing)) <= 256


@pytest.mark.parametrize("reference", [-1, 2**31, 4711])
def test_a_reference_that_is_none_is_refused_in_every_list(reference: int) -> None:
    """PythonFMU hands on what is above 2^31 as a negative number, which a plain list would take for one of its end."""
    for known in ([0], [0, 1], [16]):
        for act in ("get", "set"):
            slave = Vehicle7DOF(instance_name="v", resources="")
            slave.get_real(known)
            with pytest.raises(RuntimeError, match="value reference"):
                if act == "get":
                    slave.get_real([*known, reference])
                else:
                    slave.set_real([0, reference], [0.0, 0.0])
