"""§3.3 after (3.20): the equation of the slow amplitudes, and the condition on its linear part."""

from __future__ import annotations

import numpy as np

from fmu_src.quantities import PARAMETERS
from fmu_src.road.profiles import RoadParameters
from fmu_src.vehicle.parameters import Car

from ..car import car_form, road_signal
from ..methods.floquet import floquet
from ..methods.modes import Complex
from . import modal
from .averaging import QUIET, A_corrected, missed, of_the_car, pair_sum, relative, still, textbook
from .rows import INSPECTION, Evidence, Row


def rows() -> list[Row]:
    """After (3.20), in the order of the paper."""
    return [_factor(), _coefficients(), _condition()]


def _factor() -> Row:
    epsilon = 0.01
    x = still(textbook(*QUIET))
    mean, pairs = epsilon * x.R_mean(), pair_sum(x, halved=True)
    return Row(
        equation="amplitude equation after (3.20)",
        printed="… + Σ_j ᾱ_kkjj+7 s_j s_j+7",
        derived="… + ε Σ_j ᾱ_kkjj+7 s_j s_j+7",
        evidence=[
            relative(
                "largest error of ṡ_k − α_k s_k at ε = 0.01, 2 oscillators on a flat road, sum halved as above",
                missed(mean, x.s * pairs),
                missed(mean, epsilon * x.s * pairs),
            )
        ],
    )


def _coefficients() -> Row:
    return Row(
        equation="before the condition after (3.20)",
        printed="all the coefficients s_k be negative",
        derived="all the coefficients of s_k: s_k are the unknowns",
        kind=INSPECTION,
    )


def growth(height: float) -> tuple[Complex, Complex]:
    """What the condition compares with 0, with the corrected A_k, less α_k; and Floquet exponents less λ_k; (14) [1/s].

    Default car on a sine road so high [m] under the front left wheel: of its periodic motion by the full equations.
    """
    bar, P, psi, _ = of_the_car()
    road = RoadParameters(profile="sine", A=height, excited=(True, False, False, False))
    exact = floquet(car_form(Car()), road_signal(road).pieces[-1]).exponents
    return A_corrected(bar, height * P, psi), exact - modal.modes().eigenvalues


def _condition() -> Row:
    height = 3.0 * PARAMETERS["A"].start
    compared, shift = growth(height)

    def error(rate: Complex) -> float:
        return float(np.linalg.norm(rate - shift.real) / np.linalg.norm(shift))

    return Row(
        equation="condition after (3.20)",
        printed="α_k + ε(A_k + B_k) < 0",
        derived="Re(α_k + ε(A_k + B_k)) < 0; the imaginary part shifts the frequency",
        evidence=[
            Evidence(
                measure="error, all k together, of what is compared with 0 as the rate at which perturbations grow, "
                "over the change of the exponents that the road makes, both by the full equations (Floquet); default "
                f"car, sine road of {1e3 * height:g} mm under the front left wheel",
                printed=error(compared),
                derived=error(compared.real.astype(complex)),
                unit="1",
                tolerance=1e-4,
                apart=0.1,
            )
        ],
    )
