"""Cost of the default closed loop beside the alternatives; prints medians of ratios of one run.

    ours   VehicleOnRoad.ssp in our master: scenario bump-lqr, all outputs recorded
    (a)    three empty FMUs with the same interface in our master: on our shell, and all stock PythonFMU
    (b)    three empty stock PythonFMU FMUs in a plain loop over fmpy's list calls, recording all outputs
    (c)    our FMUs in fmpy's ssp.simulation
    (d)    scipy's DOP853, rtol 1e-8, on the closed loop as one system of equations; then all outputs of each row

All do 5 s at 1 ms. Machines are noisy: the candidates take turns, and what is printed is the median of the ratios of
each round. Loading is timed apart (a run of one step) and taken off where a line says "stepping".
"""

from __future__ import annotations

import dataclasses
import platform
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
from analysis.reference import closed_loop, outputs
from analysis.scenario import read_scenario
from benchmarks.empty_fmus import empty_system

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
        shell, stock = (empty_system(folder / name, stock=name == "stock") for name in ("shell", "stock"))
        fmus = [folder / "stock" / f"{model}.fmu" for model in ("RoadExcitation", "Vehicle7DOF", "LqrController")]
        bare = dataclasses.replace(scenario, parameters={})
        bare_step = dataclasses.replace(one_step, parameters={})
        candidates: dict[str, Callable[[], object]] = {
            "ours": lambda: simulate(scenario),
            "ours, one step": lambda: simulate(one_step),
            "shell": lambda: simulate(bare, shell),
            "shell, one step": lambda: simulate(bare_step, shell),
            "stock": lambda: simulate(bare, stock),
            "stock, one step": lambda: simulate(bare_step, stock),
            "lists": lambda: list_loop(fmus, Path(tempfile.mkdtemp(dir=folder))),
            "ssp": lambda: simulate_ssp(str(DEFAULT_SYSTEM), stop_time=5.0, step_size=STEP),
            "DOP853": lambda: outputs(scenario, times, closed_loop(scenario, times, rtol=1e-8)),
        }
        seconds: dict[str, list[float]] = {name: [] for name in candidates}
        for _ in tqdm(range(ROUNDS), desc="rounds", disable=None):
            for name, candidate in candidates.items():
                seconds[name].append(timed(candidate))
    report(seconds)


def report(seconds: dict[str, list[float]]) -> None:
    """Print a table: median time, and median of our time over theirs, round by round, against the goal."""
    s = {name: np.array(values) for name, values in seconds.items()}
    stepping = {name: s[name] - s[f"{name}, one step"] for name in ("ours", "shell", "stock")}
    rows = [
        ("(a) our shell", s["shell"], s["ours"], "1.8"),
        ("(a) our shell, stepping", stepping["shell"], stepping["ours"], "1.8"),
        ("(a) stock", s["stock"], s["ours"], "1.8"),
        ("(a) stock, stepping", stepping["stock"], stepping["ours"], "1.8"),
        ("(b) stock, fmpy lists", s["lists"], s["ours"], "0.5"),
        ("(c) ssp.simulation", s["ssp"], s["ours"], "0.12"),
        ("(d) DOP853", s["DOP853"], s["ours"], "1"),
    ]
    print(f"Python {platform.python_version()}, {platform.machine()}, {ROUNDS} rounds, {STEPS} steps of 1 ms")
    print(f"ours: {np.median(s['ours']):.3f} s a run, {np.median(stepping['ours']) / STEPS * 1e6:.1f} us a step")
    print(f"{'':25}{'theirs, s':>10}{'ours/theirs':>13}{'goal':>8}")
    for name, theirs, ours, goal in rows:
        print(f"{name:25}{np.median(theirs):10.3f}{np.median(ours / theirs):13.2f}{'<= ' + goal:>8}")


if __name__ == "__main__":
    main()
