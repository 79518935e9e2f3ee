"""The controller's FMU on the linear half car: a run whose plant is exactly (4.1), for what holds only there."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import expm

from analysis.component import Component
from analysis.trajectory import Array, Run, Trajectory
from fmu_src.controller.halfcar import STATE_NAMES, HalfCar, half_car_state
from fmu_src.quantities import FORCES

FORCE_NAMES = [q.name for q in FORCES]


def half_car_run(archive: Path, folder: Path, x0: Array, begin: float, end: float, step: float) -> Run:
    """Control from x0 (z, φ, ż, φ̇ of §4) at `begin` to `end` [s], the forces held over each step."""
    controller = Component("controller", archive, folder)
    try:
        controller.call(controller.fmu.setupExperiment, startTime=begin)
        controller.set_parameters({"activation": "at t_on", "t_on": begin, "T": end})
        controller.call(controller.fmu.enterInitializationMode)
        controller.call(controller.fmu.exitInitializationMode)
        rows = _rows(controller, x0, begin, round((end - begin) / step), step)
        record: dict[str, Any] = {
            "scenario": {"name": "half car"},
            "parameters": {"controller": controller.parameters()},
            "fmus": {"controller": {"file": archive.name, "sha256": controller.sha256}},
        }
    finally:
        controller.free()
    return Run(
        trajectory=Trajectory(time=rows[:, 0], names=(*STATE_NAMES, *FORCE_NAMES), values=rows[:, 1:]), record=record
    )


def _rows(controller: Component, x0: Array, begin: float, steps: int, step: float) -> Array:
    """Time, the car's heave, pitch (nose down) and their rates, and the four forces, at every communication point."""
    car = HalfCar()
    flow = expm(np.block([[np.array(car.A), np.array(car.B)], [np.zeros((2, 6))]]) * step)
    inputs, outputs = controller.references(STATE_NAMES), controller.references(FORCE_NAMES)
    x, rows = x0, []
    for k in range(steps + 1):
        t, seen = begin + k * step, list(half_car_state(*x))  # the change of sign undoes itself
        controller.call(controller.fmu.setReal, list(inputs), seen)
        forces = controller.call(controller.fmu.getReal, list(outputs))
        rows.append([t, *seen, *forces])
        if k < steps:
            x = flow[:4] @ np.concatenate([x, axle_forces(np.array(forces))])
            controller.call(controller.fmu.doStep, currentCommunicationPoint=t, communicationStepSize=step)
    return np.array(rows)


def axle_forces(forces: Array) -> Array:
    """u1, u2 (2, …) of §4 from the forces of the four struts (4, …)."""
    fl, fr, rl, rr = forces
    return np.array([-(fl + fr), -(rl + rr)])


def cost(run: Run) -> float:
    """½ ∫ xᵀQx + uᵀRu dt measured on the columns of a run: forces are held; what is seen is smooth between the rows.

    The integral of xᵀQx by the trapezoidal rule with its end correction in each step, from the rates; error O(step⁴).
    """
    car, t = HalfCar(), run.trajectory.time
    z, pitch, dz, dpitch = run.trajectory.columns(list(STATE_NAMES)).T
    u = axle_forces(run.trajectory.columns(FORCE_NAMES).T)
    h, weights = np.diff(t), (car.lam, car.lam * car.H1**2)
    state = weights[0] * z**2 + weights[1] * pitch**2
    slope = 2.0 * (weights[0] * z * dz + weights[1] * pitch * dpitch)
    smooth = 0.5 * h * (state[1:] + state[:-1]) + h**2 / 12.0 * (slope[:-1] - slope[1:])
    return float(0.5 * (smooth.sum() + (h * (u**2).sum(axis=0)[:-1]).sum()))
