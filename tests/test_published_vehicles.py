"""Third-party truth: vehicles of other people, as cars of ours.

The quarter truck of the Open Simulation Platform is the symmetric heave of a car of four of it: 400 kg on 15000 N/m and
1000 N s/m, 40 kg on a tyre of 150000 N/m. Published: its poles, and its response from rest to a step of 0.1 m, z1 of
the chassis and z2 of the wheel. Vehicle 2 of CommonRoad (a BMW 320i; package commonroad-vehicle-models, BSD) is a whole
car; its anti-roll bars, which ours lacks, are idle where left and right move alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from analysis.car_modes import car_modes
from analysis.check import check
from analysis.cosimulation import simulate
from analysis.scenario import Scenario
from fmu_src.vehicle.parameters import Car

POLES = (-1.04270 + 5.78118j, -12.7073 + 62.5581j)
CORNER: dict[str, float] = {
    "m": 4 * 400.0,
    **dict.fromkeys(("m11", "m12", "m21", "m22"), 40.0),
    "m2": 0.0,
    **dict.fromkeys(("c1", "c2"), 15000.0),
    **dict.fromkeys(("b1", "b2"), 1000.0),
    **dict.fromkeys(("cp1", "cp2"), 150000.0),
    **dict.fromkeys(("bp1", "bp2"), 0.0),
    **dict.fromkeys(("a", "b"), 1.25),
}
HEAVES = ("body.heave", "wheel_fl.heave", "wheel_fr.heave", "axle_r.heave")


def test_its_poles_are_those_of_heave_and_of_wheels_hopping_together() -> None:
    found = car_modes(Car(**CORNER))
    together = [k for k in range(7) if found.shares[k, [0, 3, 5]].sum() > 1.0 - 1e-9]  # z, z11 + z12, z2
    poles = found.discs.centres[together]
    for pole in POLES:
        assert np.abs(poles - pole).min() < 1e-6 * abs(pole)
    same = [k for k in together if np.ptp(found.modes.K[[3, 4, 5], k]) < 1e-9]  # all four wheels alike
    np.testing.assert_allclose(found.discs.centres[same], POLES, rtol=1e-6)


def test_its_poles_are_the_roots_of_its_own_characteristic_polynomial() -> None:
    chassis, wheel, strut = (
        np.poly1d([400.0, 1000.0, 15000.0]),
        np.poly1d([40.0, 1000.0, 165000.0]),
        np.poly1d([1e3, 15e3]),
    )
    roots = (chassis * wheel - strut * strut).roots
    centres = car_modes(Car(**CORNER)).discs.centres
    for root in roots:
        assert np.abs(centres - root).min() < 1e-12 * abs(root)


def stepped() -> tuple[dict[str, Any], dict[str, float], float]:
    """The step profile met by all wheels at once at t = 0: so fast that the rear wheels follow within a nanosecond."""
    return {"profile": "step", "A": 0.1, "tau0": 0.0, "v0": 1e11}, {}, 0.0


def lowered() -> tuple[dict[str, Any], dict[str, float], float]:
    """The same seen from the upper level: a flat road, and a car that starts 0.1 m below it."""
    return {"profile": "flat"}, dict.fromkeys(HEAVES, -0.1), 0.1


@pytest.mark.parametrize("case", [stepped, lowered])
def test_its_published_step_response_comes_through_the_fmus(case: Any) -> None:
    road, start, level = case()
    parameters = {**CORNER, **road, "enabled": False}
    run = simulate(Scenario(name="quarter truck", step=2e-4, stop_time=1.0, start=start, parameters=parameters))
    z, z11, z12, z2 = (run.trajectory[name] + level for name in HEAVES)
    assert z[-1] == pytest.approx(0.0652894, abs=5e-8)
    for wheel in (z11, z12, z2):
        assert wheel[-1] == pytest.approx(0.0966065, abs=5e-8)
    assert z.max() == pytest.approx(0.1618399, abs=5e-8)
    angles = [run.trajectory[name] for name in ("body.roll", "body.pitch", "axle_r.roll")]
    assert np.abs(angles).max() < 1e-12  # it is the symmetric motion
    assert all(finding.holds for finding in check(run))


# ---------------------------------------------------------------------------------------------------- vehicle 2
BMW = Car(
    m=965.7108098804363,
    **dict.fromkeys(("m11", "m12", "m21", "m22"), 0.5 * 63.7921826056784),
    m2=0.0,
    Jx=207.26524557936952,
    Jy=1565.8178787125541,
    Jz=1791.5995300122856,
    J2=0.0,
    c1=24453.137879749014,
    c2=19635.504745231297,
    **dict.fromkeys(("cp1", "cp2"), 158294.1398119115),
    **dict.fromkeys(("b1", "b2"), 0.0),
    a=1.1561957064,
    b=1.4227170936,
    s1=0.5 * 1.38684,
    **dict.fromkeys(("s0", "s2"), 0.5 * 1.36398),
)


def test_a_bmw_bounces_and_hops_at_its_published_undamped_frequencies() -> None:
    """Those of the seven in which left and right move alike: heave, pitch, and both axles' hop [Hz]."""
    found = car_modes(BMW)
    alike = found.shares[:, [0, 2, 3, 5]].sum(axis=1) > 0.5  # z, φ, z11 + z12, z2
    frequencies = found.modes.beta[:7][alike] / (2.0 * np.pi)
    np.testing.assert_allclose(frequencies[:2], [1.4203, 1.4360], atol=5e-5)
    np.testing.assert_allclose(frequencies[2:], [11.898, 12.060], atol=5e-4)
