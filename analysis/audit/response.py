"""The printed car on the bump beside the derived one; the claim of a lasting shift behind it (§3.4, figures 3, 4)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache

import numpy as np
import sympy as sp
from scipy.optimize import least_squares

from fmu_src.quantities import PARAMETERS as QUANTITIES
from fmu_src.quantities import POSITIONS, Quantity
from fmu_src.road.profiles import road
from fmu_src.vehicle.parameters import Car

from ..derivation import derive
from . import printed_car
from .differences import CONVENTION, derived_equations
from .rows import REFUTED, Evidence, Row
from .system import SAMPLING, SMALL, Array, System, bump, derived, energy, printed

HEIGHT = QUANTITIES["A"].start  # m
TIMES = np.linspace(0.0, 6.0, round(6.0 / SAMPLING) + 1)  # s
LONG = 60.0  # s
CARS, SPREAD = 15, 0.3  # besides the default car; each parameter within ± SPREAD of its default, evenly
HEIGHTS = (1.0, 10.0)  # of the bump, over HEIGHT
STARTS = 100
ANGLES = [1, 2, 6]  # places of ψ, φ, ψ2 in q
TO_ROUND_OFF = {"xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14}


# ------------------------------------------------------------------ what the misprints do to the response
@dataclass(frozen=True, slots=True)
class Deviation:
    """A coordinate's peak by both systems, and their largest difference over the derived peak; SI units."""

    quantity: Quantity
    derived: float
    printed: float
    difference: float


@cache
def responses() -> dict[str, Array]:
    """q (n, 7) at TIMES over the default bump, of both systems, in the derivation's coordinates.

    The print's ψ2 is drawn in the sense in which its road term drives it, ψ2 positive like ψ: in the other it would be
    off by twice its peak.
    """
    return {
        "derived": derived("A").over_the_bump(TIMES, HEIGHT)[:, :7],
        "printed": printed("A").over_the_bump(TIMES, HEIGHT)[:, :7],
    }


def deviations() -> list[Deviation]:
    """Of the seven coordinates."""
    right, wrong = responses()["derived"], responses()["printed"]
    peaks, printed_peaks = np.abs(right).max(axis=0), np.abs(wrong).max(axis=0)
    off = np.abs(wrong - right).max(axis=0) / peaks
    numbers = zip(POSITIONS, peaks.tolist(), printed_peaks.tolist(), off.tolist(), strict=True)
    return [Deviation(*each) for each in numbers]


# ------------------------------------------------------------------ the claim of a lasting shift
def rows() -> list[Row]:
    """The claim of §3.4 that displacements remain behind the bump."""
    names = ("printed", "derived")
    ends = {name: max(remainder(*run) for run in runs() if run[0] == name) for name in names}
    growth = {name: growth_rates(name) for name in names}
    curvatures = {name: np.array([least_curvature(name, car) for car in cars()]) for name in names}
    found = {name: rests(flat_and_still(name)) for name in names}
    barrier = energy_over_barrier()
    return [
        Row(
            equation="§3.4, figures 3, 4",
            printed="displacements do not vanish but remain constant behind the unevenness (“vibrational shift”)",
            derived="everything decays to q = 0, the only equilibrium with |ψ|, |φ|, |ψ2| < π/2",
            kind=REFUTED,
            evidence=[
                _both(
                    f"largest |q| at t = {LONG:g} s over its peak, {len(runs()) // 2} runs: default car and "
                    f"{CARS} within ± {100 * SPREAD:.0f} %, bumps of 10 and 100 mm",
                    ends["printed"],
                    ends["derived"],
                    tolerance=1e-9,
                ),
                _both(
                    f"of these {CARS + 1} cars, those with an eigenvalue of real part ≥ 0",
                    *(float(np.sum(growth[name] >= 0.0)) for name in names),
                ),
                _both(
                    "equations whose static part on a flat road is not ∂V/∂q, V = ½ yᵀ K y, by algebra",
                    *(float(statics_that_differ(name)) for name in names),
                ),
                _both(
                    f"of these {CARS + 1} cars, those for which V is not strictly convex in y",
                    *(float(np.sum(curvatures[name] <= 0.0)) for name in names),
                ),
                _both(
                    "(det ∂y/∂q)² over (cos ψ cos² φ cos ψ2)², less 1: by algebra, and largest of 20 by numbers",
                    jacobian_off(),
                    jacobian_off_in_numbers(),
                    tolerance=1e-9,
                ),
                _both(
                    f"searches for a rest with |angles| < π/2, from {STARTS} starts there, that find one",
                    *(float(len(found[name])) for name in names),
                    expected=float(STARTS),
                ),
                _both("of these rests, those that are not q = 0", *(float(others(found[name])) for name in names)),
                _both(
                    "energy behind the bump of 100 mm over the least V with an angle at π/2",
                    barrier["printed"],
                    barrier["derived"],
                    tolerance=0.5,
                ),
            ],
            note=f"Slowest decay of the {CARS + 1} cars: printed {-growth['printed'].max():.3g} 1/s, derived "
            f"{-growth['derived'].max():.3g} 1/s. " + PROOF,
        )
    ]


PROOF = (
    "Why q = 0 is alone: V = ½ yᵀ K y in y = (z, sin ψ cos φ, sin φ, z11, z12, z2, sin ψ2), "
    "strictly convex, so ∂V/∂y = 0 only at y = 0; the Jacobian ∂y/∂q has the determinant ± cos ψ cos² φ cos ψ2 ≠ 0, "
    "so ∂V/∂q = 0 only there too. In the derived car energy falls behind the bump and cannot reach the barrier."
)


def _both(measure: str, wrong: float, right: float, *, tolerance: float = 0.0, expected: float = 0.0) -> Evidence:
    return Evidence(
        measure=measure, printed=wrong, derived=right, unit="1", expected=expected, tolerance=tolerance, apart=1.0
    )


@cache
def cars() -> tuple[Car, ...]:
    """The default car and CARS others, drawn around it; left and right stay alike, as the model asks."""
    rng, default = np.random.default_rng(34), asdict(Car())
    drawn = [Car()]
    for _ in range(CARS):
        values = {name: value * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD) for name, value in default.items()}
        drawn.append(Car(**{**values, "m12": values["m11"], "m22": values["m21"]}))
    return tuple(drawn)


def _system(name: str, car: Car | None = None) -> System:
    return printed(CONVENTION, car) if name == "printed" else derived(CONVENTION, car)


def runs() -> list[tuple[str, Car, float]]:
    """All runs of the test: system, car, height of the bump [m]."""
    return [(name, car, HEIGHT * k) for name in ("printed", "derived") for car in cars() for k in HEIGHTS]


@cache
def remainder(name: str, car: Car, height: float) -> float:
    """Largest |q| at LONG over the peak of the same coordinate; implicit steps, as most of the time nothing happens."""
    times = np.append(np.linspace(0.0, 2.0, 201), LONG)
    q = np.abs(_system(name, car).over_the_bump(times, height, rtol=1e-7, method="LSODA")[:, :7])
    return float((q[-1] / q.max(axis=0)).max())


def growth_rates(name: str) -> Array:
    """Largest real part of the eigenvalues of each car [1/s]."""
    return np.array([np.linalg.eigvals(_system(name, car).linear.A).real.max() for car in cars()])


def _y() -> sp.Matrix:
    """y = (z, sin ψ cos φ, sin φ, z11, z12, z2, sin ψ2), in which V is quadratic."""
    z, psi, phi, z11, z12, z2, psi2 = derive().q
    return sp.Matrix([z, sp.sin(psi) * sp.cos(phi), sp.sin(phi), z11, z12, z2, sp.sin(psi2)])


def statics_that_differ(name: str) -> int:
    """Equations that at rest on a flat road are not the gradient of V = ½ yᵀ K y, by algebra."""
    d, y = derive(), _y()
    own = sp.Matrix(printed_car.EQUATIONS if name == "printed" else derived_equations(CONVENTION))
    K = derived_equations(CONVENTION).jacobian(d.q).xreplace(SMALL)
    still = dict.fromkeys([*d.v, *d.a, *d.h], sp.S.Zero)
    off = own.xreplace(still) - y.jacobian(d.q).T * K * y
    return sum(sp.trigsimp(sp.expand(term)) != 0 for term in off)


def jacobian_off() -> float:
    """(det ∂y/∂q)² over (cos ψ cos² φ cos ψ2)², less 1, by algebra."""
    _, psi, phi, *_, psi2 = derive().q
    claimed = sp.cos(psi) * sp.cos(phi) ** 2 * sp.cos(psi2)
    return float(sp.simplify(_y().jacobian(derive().q).det() ** 2 / claimed**2) - 1)


def jacobian_off_in_numbers() -> float:
    """The same at 20 places with |angles| < 1.5, by differences."""
    q = sp.Matrix(derive().q)
    y, rng = sp.lambdify([q], _y()), np.random.default_rng(5)
    off = []
    for place in rng.uniform(-1.5, 1.5, (20, 7)):
        columns = [np.imag(y(place + 1e-30j * unit)).ravel() / 1e-30 for unit in np.eye(7)]
        _, psi, phi, *_, psi2 = place
        off.append(np.linalg.det(columns) ** 2 / (np.cos(psi) * np.cos(phi) ** 2 * np.cos(psi2)) ** 2 - 1.0)
    return float(np.abs(off).max())


def least_curvature(name: str, car: Car) -> float:
    """Least eigenvalue of K, which is the Hessian of V in y, scaled to a unit diagonal."""
    K = _system(name, car).linear.K
    size = np.sqrt(K.diagonal())
    return float(np.linalg.eigvalsh(K / np.outer(size, size)).min())


def rests(accelerations: Callable[[Array], Array]) -> Array:
    """Rests (n, 7) inside |angles| < π/2 at which STARTS searches from there end; accelerations (7) of q (7) at rest.

    What is searched for a zero is divided by the product of the cosines of the angles: it has the same zeros inside,
    and not those at π/2, to which most of the searches would go.
    """
    rng, limits = np.random.default_rng(7), np.full(7, np.inf)
    limits[ANGLES] = np.pi / 2.0
    found = []
    for _ in range(STARTS):
        start = rng.uniform(-1.0, 1.0, 7) * np.where(np.isfinite(limits), 1.5, 1.0)
        end = least_squares(
            lambda q: accelerations(q) / np.prod(np.cos(q[ANGLES])), start, bounds=(-limits, limits), **TO_ROUND_OFF
        ).x
        at_rest = np.abs(accelerations(end)).max() < 1e-8 * np.abs(accelerations(start)).max()
        if at_rest and np.abs(end[ANGLES]).max() < 0.999 * np.pi / 2.0:
            found.append(end)
    return np.reshape(found, (-1, 7))


def others(found: Array) -> int:
    """How many of these rests (n, 7) are not q = 0."""
    return int(np.sum(np.abs(found).max(axis=1) > 1e-6))


def flat_and_still(name: str) -> Callable[[Array], Array]:
    """q̈ (7) of a system at rest on a flat road, as a function of q (7)."""
    system, still, flat = _system(name), np.zeros(7), np.zeros(4)
    return lambda q: system.accelerations(q, still, flat)


def energy_over_barrier() -> dict[str, float]:
    """Energy [1] when the last wheel has left the highest bump, over the least V with ψ, φ or ψ2 at ± π/2.

    There (sin ψ cos φ)² + sin² φ = 1, or sin² ψ2 = 1; the least V for given y_i is ½ y_iᵀ (K⁻¹)_ii⁻¹ y_i.
    """
    inverse = np.linalg.inv(derived(CONVENTION).linear.K)
    barrier = 0.5 / max(np.linalg.eigvalsh(inverse[1:3, 1:3]).max(), inverse[6, 6])
    height = HEIGHT * HEIGHTS[-1]
    times = np.array([0.0, road(bump(Car(), height)).end])
    systems = {name: _system(name) for name in ("printed", "derived")}
    return {name: float(energy(s, s.over_the_bump(times, height))[-1] / barrier) for name, s in systems.items()}
