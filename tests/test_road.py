"""The road: profiles, delays, exact rates, corners; and the road between two communication points."""

from __future__ import annotations

from functools import partial
from math import pi, sin

import numpy as np
import pytest
from numpy.testing import assert_allclose
from orders import observed_order

from fmu_src.integrate import cubic_road, straight_road
from fmu_src.quantities import ParameterError
from fmu_src.road.profiles import HARMONICS, RoadParameters, road

PROFILES = [
    RoadParameters(),
    RoadParameters(profile="sine", tau0=-0.03),
    RoadParameters(profile="fourier", amplitudes=(5e-3, 0.0, 2e-3, 0.0, 0.0, 0.0, 0.0, 1e-3), Lambda=4.0),
    RoadParameters(profile="step", t_start=0.1),
    RoadParameters(profile="flat"),
]


def test_the_bump_is_the_papers_half_sine_under_every_wheel_in_its_turn() -> None:
    r = road(RoadParameters())
    for t in np.linspace(-0.1, 0.5, 601):
        expected = [0.01 * sin(2 * pi * 10 * (t - d)) if 0 <= t - d <= 0.05 else 0.0 for d in (0.0, 0.02, 0.25, 0.27)]
        assert_allclose(r.heights(t), expected, atol=1e-13)


@pytest.mark.parametrize("parameters", PROFILES, ids=lambda p: p.profile)
def test_rates_are_the_derivatives_of_the_heights(parameters: RoadParameters) -> None:
    r = road(parameters)
    corners = np.array(r.corners(2.0))
    for t in np.random.default_rng(1).uniform(-0.2, 1.5, 300):
        if corners.size and np.abs(corners - t).min() < 1e-4:
            continue
        e = 1e-6
        slope = (np.array(r.heights(t + e)) - np.array(r.heights(t - e))) / (2 * e)
        assert_allclose(r.rates(t), slope, atol=2e-7 * (1 + np.abs(slope).max()))


def test_rates_at_corners_are_right_hand_limits_whatever_the_round_off() -> None:
    """Corners are sums of delays, communication points are n·H: they differ in the last bits."""
    r = road(RoadParameters())
    rise = 0.01 * 2 * pi * 10
    for corner, wheel, rate in [(0.0, 0, rise), (0.02, 1, rise), (0.05, 0, 0.0), (0.27, 3, rise), (0.32, 3, 0.0)]:
        for t in (np.nextafter(corner, -1), corner, np.nextafter(corner, 1)):
            assert r.rates(t)[wheel] == pytest.approx(rate, rel=1e-12)


def test_corners_and_end_are_where_the_road_changes() -> None:
    r = road(RoadParameters())
    assert_allclose(r.corners(10.0), [0.0, 0.02, 0.05, 0.07, 0.25, 0.27, 0.3, 0.32])
    assert r.end == pytest.approx(0.32)
    assert road(RoadParameters(profile="sine")).end == float("inf")


def test_a_fourier_road_can_lie_under_one_wheel_alone() -> None:
    p = RoadParameters(
        profile="fourier", amplitudes=(0.01, 0, 0, 0, 0, 0, 0, 0.002), excited=(True, False, False, False)
    )
    t = 0.123
    assert_allclose(road(p).heights(t), [0.01 * sin(p.omega * t) + 0.002 * sin(8 * p.omega * t), 0, 0, 0])
    assert len(p.amplitudes) == len(HARMONICS)


@pytest.mark.parametrize("profile", ["pothole", "", "Bump"])
def test_an_unknown_profile_lists_the_known_ones(profile: str) -> None:
    with pytest.raises(ParameterError, match="bump, sine, fourier, step, flat"):
        RoadParameters(profile=profile)


def test_all_faults_of_a_road_are_named_at_once() -> None:
    with pytest.raises(ParameterError) as refusal:
        RoadParameters(v0=0.0, Lambda=-1.0, A=float("nan"), a=0.0, b=0.0)
    assert all(name in str(refusal.value) for name in ("v0 = 0.0", "Lambda = -1.0", "A = nan", "wheelbase"))


def _interpolation_error(step: float, bowed: bool) -> float:
    """Largest error of the interpolated height over a step on a smooth stretch of the bump."""
    r = road(RoadParameters(tau0=0.0))
    t0 = 0.01
    h0, dh0, h1, middle = r.heights(t0), r.rates(t0), r.heights(t0 + step), r.heights(t0 + step / 2)
    bow = [m - (3 * a + b + step * d) / 4 for m, a, b, d in zip(middle, h0, h1, dh0, strict=True)]
    within = cubic_road(h0, dh0, h1, bow if bowed else [0.0] * 4, step)
    return max(abs(within(s)[0][0] - r.heights(t0 + s * step)[0]) for s in np.linspace(0, 1, 41))


def test_the_parabola_is_right_to_order_3_and_with_the_bow_to_order_4() -> None:
    steps = 4e-3 * 0.5 ** np.arange(5)
    for bowed, order in ((False, 3.0), (True, 4.0)):
        slope, bend = observed_order(partial(_interpolation_error, bowed=bowed), steps.tolist())
        assert slope == pytest.approx(order, abs=0.1)
        assert bend < 0.1


def test_interpolation_meets_the_ends_and_its_rate_is_its_derivative() -> None:
    h0, dh0, h1, bow = [0.01, 0, 0, 1], [0.3, 0, -1, 0], [0.012, 0, 0, 2], [1e-4, 0, 0, 0.1]
    within = cubic_road(h0, dh0, h1, bow, 1e-3)
    assert_allclose(within(0.0)[0], h0)
    assert_allclose(within(1.0)[0], h1, rtol=1e-14)
    assert_allclose(
        within(0.5)[0], [(3 * a + b + 1e-3 * d) / 4 + w for a, b, d, w in zip(h0, h1, dh0, bow, strict=True)]
    )
    e = 1e-5
    for s in (0.2, 0.7, 1.0 - e):
        slope = (np.array(within(s + e)[0]) - np.array(within(s - e)[0])) / (2e-3 * e)
        assert_allclose(within(s)[1], slope, atol=1e-6 * np.abs(slope).max())
    assert_allclose(straight_road(h0, dh0, 1e-3)(0.5)[0], np.array(h0) + 0.5e-3 * np.array(dh0))
