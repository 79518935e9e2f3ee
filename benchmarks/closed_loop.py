"""Cost of the default closed loop beside the alternatives; prints medians of ratios of one run.

    ours   VehicleOnRoad.ssp in our master: scenario bump-lqr, all outputs recorded
    (a)    three empty FMUs with the same interface, on our shell, in our master
    (b)    three empty stock PythonFMU FMUs in a plain loop over fmpy's list calls, recording all outputs
    (c)    our FMUs in fmpy's ssp.simulation
    (d)    scipy's DOP853, rtol 1e-8, on the closed loop as one system of equations

All do 5 s at 1 ms. Machines are noisy: the candidates take turns, and what is printed is the median of the ratios of
each round. Loading is timed apart (a run of one step) and taken off where a line says "stepping".
"""

from __future__ import annotations

import dataclasses
import platform
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.ssp.simulation import simulate_ssp
from tqdm import tqdm

from analysis.cosimulation import DEFAULT_SYSTEM, simulate
from analysis.reference import closed_loop
from analysis.scenario import read_scenario
from benchmarks.empty_fmus import empty_system, stock_fmus

ROUNDS = 7
STEPS, STEP = 5000, 1e-3


def list_loop(fmus: list[Path], folder: Path) -> None:
    """What one writes first: fmpy's getReal and setReal with lists, results as a list of tuples."""
    slaves = []
    for fmu in fmus:
        unpacked = folder / fmu.stem
        extract(fmu, unpacked)
        description = read_model_description(unpacked, validate=False)
        slave = FMU2Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=str(unpacked),
            instanceName=fmu.stem,
        )
        slave.instantiate()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        ins = [v.valueReference for v in description.modelVariables if v.causality == "input"]
        outs = [v.valueReference for v in description.modelVariables if v.causality == "output"]
        slaves.append((slave, ins, outs))
    rows = []
    (road, _, heights), (car, car_in, states), (controller, controller_in, forces) = slaves
    u = [0.0] * len(forces)
    for k in range(STEPS):
        t = k * STEP
        road.doStep(t, STEP)
        h = road.getReal(heights)
        car.setReal(car_in, u + h)
        car.doStep(t, STEP)
        x = car.getReal(states)
        controller.setReal(controller_in, x[: len(controller_in)])
        controller.doStep(t, STEP)
        u = controller.getReal(forces)
        rows.append((t, *h, *x, *u))
    np.array(rows)
    for slave, _, _ in slaves:
        slave.terminate()
        slave.freeInstance()


def timed(candidate: Callable[[], object]) -> float:
    begin = time.perf_counter()
    candidate()
    return time.perf_counter() - begin


def main() -> None:
    scenario = read_scenario("bump-lqr")
    one_step = dataclasses.replace(scenario, stop_time=scenario.step)
    times = scenario.step * np.arange(STEPS + 1, dtype=np.float64)
    with tempfile.TemporaryDirectory(prefix="bench_") as temporary:
        folder = Path(temporary)
        empty, stock = empty_system(folder), stock_fmus(folder)
        bare = dataclasses.replace(scenario, parameters={})
        bare_step = dataclasses.replace(one_step, parameters={})
        candidates: dict[str, Callable[[], object]] = {
            "ours": lambda: simulate(scenario),
            "ours, one step": lambda: simulate(one_step),
            "(a) empty, our shell, our master": lambda: simulate(bare, empty),
            "(a) empty, one step": lambda: simulate(bare_step, empty),
            "(b) empty, stock, fmpy lists": lambda: list_loop(stock, Path(tempfile.mkdtemp(dir=folder))),
            "(c) ours in ssp.simulation": lambda: simulate_ssp(str(DEFAULT_SYSTEM), stop_time=5.0, step_size=STEP),
            "(d) DOP853, one system": lambda: closed_loop(scenario, times, rtol=1e-8),
        }
        seconds: dict[str, list[float]] = {name: [] for name in candidates}
        for _ in tqdm(range(ROUNDS), desc="rounds", disable=None):
            for name, candidate in candidates.items():
                seconds[name].append(timed(candidate))
    report(seconds)


def report(seconds: dict[str, list[float]]) -> None:
    """Print a table: median time, and median of our time over theirs, round by round, against the goal."""
    s = {name: np.array(values) for name, values in seconds.items()}
    ours, a = s["ours"], s["(a) empty, our shell, our master"]
    stepping, a_stepping = ours - s["ours, one step"], a - s["(a) empty, one step"]
    rows = [
        ("(a) whole run", a, ours / a, "1.8"),
        ("(a) stepping", a_stepping, stepping / a_stepping, "1.8"),
        ("(b) whole run", s["(b) empty, stock, fmpy lists"], ours / s["(b) empty, stock, fmpy lists"], "0.5"),
        ("(c) whole run", s["(c) ours in ssp.simulation"], ours / s["(c) ours in ssp.simulation"], "0.12"),
        ("(d) whole run", s["(d) DOP853, one system"], ours / s["(d) DOP853, one system"], "1"),
    ]
    print(f"Python {platform.python_version()}, {platform.machine()}, {len(ours)} rounds, 5000 steps of 1 ms")
    print(f"ours: {statistics.median(ours):.3f} s a run, {statistics.median(stepping) / STEPS * 1e6:.1f} us a step")
    print(f"{'':16}{'theirs, s':>10}{'ours/theirs':>13}{'goal':>8}")
    for name, theirs, ratio, goal in rows:
        print(f"{name:16}{statistics.median(theirs):10.3f}{statistics.median(ratio):13.2f}{'<= ' + goal:>8}")


if __name__ == "__main__":
    main()
