"""§4 computed for the default half car and bump: at the chosen weights, as functions of λ, and as printed; how robust
the half-car and the full-car design are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import brentq
from tqdm import tqdm

from fmu_src.controller.fullcar import FullCar
from fmu_src.controller.halfcar import HalfCar
from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car

from ..methods.polynomials import Array
from .certified import Certified, Plant, around, certify, growth, state_space
from .full_car import AXLES, car_plant, full_gain, half_car_plant, strut_gain, varied_values
from .half_car import Model, come_down, corrected, over_the_bump, printed, printed_control
from .limit import Approach, approach
from .margins import Margins, margins
from .pontryagin import by_collocation, by_exponentials, hamiltonian
from .regulator import (
    Arc,
    Regulator,
    by_riccati,
    energy_to_rest,
    instants,
    modal_reach,
    quadrature,
    riccati_solution,
    stationary,
)

STEP = 1e-3  # s, between two samples of an arc
SPREAD = 0.3  # of masses and stiffnesses
LATTICE = (1.0 - SPREAD, 1.0, 1.0 + SPREAD)  # of each parameter
WEIGHTS = (1e8, 1e9, 1e10, 1e11, 1e12, 1e13)  # λ [N²/m²]; the default is 1e10


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The optimal arc of a model from x(t_B2) to T, and its cost by ½ x0ᵀ L x0 and by quadrature [N² s]."""

    model: Model
    regulator: Regulator
    arc: Arc
    L: Array  # (k, n, n) at the times of the arc
    cost: float
    measured: float
    energy_to_rest: float  # [N² s]

    @property
    def peaks(self) -> Array:
        """Largest |u1|, |u2| [N]."""
        peaks: Array = np.abs(self.arc.u).max(axis=1)
        return peaks

    @property
    def weakest(self) -> float:
        """How far the control reaches the mode that it reaches least, see `modal_reach`."""
        return modal_reach(self.model.A, self.model.B)

    @property
    def growth(self) -> float:
        """Largest real part of the eigenvalues of A [1/s]."""
        return float(np.linalg.eigvals(self.model.A).real.max())


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """Largest difference from the arc of exponentials, over the largest value of each state, co-state or control; and
    the largest change of H over the largest running cost."""

    riccati: float
    collocation: float
    hamiltonian: float


@dataclass(frozen=True, slots=True, eq=False)
class Robustness:
    """Of u = K x of the infinite horizon on a plant: growth of the closed loop [1/s], nominal and the largest at the
    corners of the box of ± SPREAD and halfway between them; margins, if it is stable; what is proved over the box."""

    growth: float
    worst: float
    margins: Margins | None
    certified: Certified


@dataclass(frozen=True, slots=True, eq=False)
class Weighted:
    """What a weight λ gives: the optimal arc, the way to the infinite horizon, and how robust u = K x is of the
    half-car design on the half car and on the car with its wheels, and of the full-car design on the latter."""

    lam: float
    solution: Solution
    approach: Approach
    half: Robustness
    half_on_car: Robustness
    full_on_car: Robustness


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """Everything; times in s from the front wheels' meeting the bump. free: x (4, k) of (4.1) without control."""

    times: Array
    free: dict[str, Array]
    default: Solution
    agreement: Agreement
    printed: tuple[Solution, ...]
    weighted: tuple[Weighted, ...]
    lost: float  # λ from which the half-car design makes the car with its wheels unstable
    lost_in_box: float  # and from which it does so somewhere in the box

    @property
    def begin(self) -> float:
        """t_B2 [s]."""
        return float(self.default.arc.t[0])


def study(progress: bool = False) -> Study:
    """All of it, in about a minute."""
    car, road = HalfCar(), RoadParameters()
    models = (corrected(car), printed_control(car), printed(car))
    default, *as_printed = (solve(model, car, road) for model in models)
    times = np.arange(0.0, default.arc.t[-1] + 0.5 * STEP, STEP)
    weights = tqdm(WEIGHTS, desc="stabilize", unit="weight", disable=None if progress else True)
    return Study(
        times=times,
        free={model.name: over_the_bump(model, road, times) for model in models},
        default=default,
        agreement=agree(default),
        printed=tuple(as_printed),
        weighted=tuple(weigh(replace(car, lam=lam), road) for lam in weights),
        lost=lost_at(car),
        lost_in_box=lost_at(car, (1.0 - SPREAD, 1.0 + SPREAD)),
    )


def solve(model: Model, car: HalfCar, road: RoadParameters, end: float = PARAMETERS["T"].start) -> Solution:
    """The optimal arc of this model behind the bump, from t_B2 to `end` [s]."""
    begin = come_down(road)
    regulator, t = model.regulator(car), instants(begin, end, STEP)
    x0 = over_the_bump(model, road, t[:1])[:, 0]
    arc, L = by_riccati(regulator, x0, t), riccati_solution(regulator, end - begin)(end - t)
    return Solution(
        model=model,
        regulator=regulator,
        arc=arc,
        L=L,
        cost=0.5 * float(x0 @ L[0] @ x0),
        measured=quadrature(regulator, arc.t, arc.x, arc.u),
        energy_to_rest=energy_to_rest(model.A, model.B, x0, end - begin),
    )


def agree(solution: Solution) -> Agreement:
    """The arc by Riccati's equation beside those of the two-point problem."""
    regulator, arc = solution.regulator, solution.arc
    exact, collocated = (way(regulator, arc.x[:, 0], arc.t) for way in (by_exponentials, by_collocation))
    values = hamiltonian(regulator, exact)
    running = regulator.running_cost(exact.x, exact.u).max()
    return Agreement(difference(arc, exact), difference(collocated, exact), float(np.ptp(values) / running))


def difference(one: Arc, other: Arc) -> float:
    """Largest difference of two arcs at the same times, over each row's largest value."""
    rows = [np.vstack([arc.x, arc.p, arc.u]) for arc in (one, other)]
    return float(np.max(np.abs(rows[0] - rows[1]).max(axis=1) / np.abs(rows[1]).max(axis=1)))


def weigh(car: HalfCar, road: RoadParameters) -> Weighted:
    """What the weights of this half car give."""
    model = corrected(car)
    solution, whole = solve(model, car, road), Car()
    _, K = stationary(solution.regulator)
    return Weighted(
        lam=car.lam,
        solution=solution,
        approach=approach(solution.regulator),
        half=robustness(half_car_plant(car), K, varied_values(car)),
        half_on_car=robustness(car_plant(whole), strut_gain(K), varied_values(whole), AXLES),
        full_on_car=robustness(car_plant(whole), full_gain(FullCar(car=whole, lam=car.lam)), varied_values(whole)),
    )


def robustness(
    plant: Plant, K: Array, values: dict[str, float], signals: Sequence[Sequence[int]] | None = None
) -> Robustness:
    """Of u = K x on the plant at these values of its parameters, and in the box of ± SPREAD around them.

    signals : the actuators that one signal commands, see `margins`.
    """
    nominal = growth(plant, K, values)
    lattice = (dict(zip(values, np.multiply(f, list(values.values())).tolist(), strict=True))
               for f in product(LATTICE, repeat=len(values)))  # fmt: skip
    return Robustness(
        growth=nominal,
        worst=max(growth(plant, K, each) for each in lattice),
        margins=margins(*state_space(plant, values), K, signals) if nominal < 0.0 else None,
        certified=certify(plant, K, around(values, SPREAD)),
    )


def lost_at(car: HalfCar, factors: Sequence[float] = (1.0,)) -> float:
    """The least λ in `WEIGHTS`' range from which the half car's control makes the car with its wheels unstable, with
    what is varied of it at some of these factors of its value; infinite if none does."""
    plant, whole = car_plant(Car()), varied_values(Car())
    cars = [
        dict(zip(whole, np.multiply(f, list(whole.values())).tolist(), strict=True))
        for f in product(factors, repeat=len(whole))
    ]

    def worst(log_lam: float) -> float:
        _, K = stationary(corrected(car).regulator(replace(car, lam=10.0**log_lam)))
        return max(growth(plant, strut_gain(K), each) for each in cars)

    decades = np.log10(WEIGHTS)
    over = next((k for k, x in enumerate(decades) if worst(x) > 0.0), None)
    if over is None:
        return float("inf")
    return float(10.0 ** (brentq(worst, decades[over - 1], decades[over], xtol=1e-4) if over else decades[0]))
