"""The largest ‖e + M z‖ over a ball: no z gets further, one gets there, however the bound was computed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from analysis.bertolino_baksa import joint
from analysis.bertolino_baksa.joint import furthest

DELTA = np.array([0.0, 1e-9, 1e-3, 0.1, 1.0, 10.0, 1e6])


def drawn(seed: int, count: int = 20, n: int = 5) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count, n)), rng.normal(size=(count, n, n)) * 10.0 ** rng.uniform(-3, 3, (count, 1, 1))


def exactly(e: np.ndarray, M: np.ndarray, delta: float) -> float:
    """By the stationary z = (μ² − MᵀM)⁻¹ Mᵀ e with ‖z‖ = delta."""
    s2, Q = np.linalg.eigh(M.T @ M)
    g = Q.T @ M.T @ e

    def off(logarithm: float) -> float:
        return float(np.linalg.norm(g / (s2[-1] * np.exp(logarithm) + (s2[-1] - s2))) / delta - 1.0)

    z = Q @ (g / (s2[-1] * np.exp(brentq(off, -60.0, 80.0, xtol=1e-13)) + (s2[-1] - s2)))
    return float(np.linalg.norm(e + M @ z))


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_exact_maximum(seed: int) -> None:
    e, M = drawn(seed)
    found = furthest(e, M, DELTA)
    for i in range(len(e)):
        for k in range(2, 6):
            exact = exactly(e[i], M[i], float(DELTA[k]))
            assert exact <= found[i, k] <= exact * (1.0 + 1e-7)
    np.testing.assert_allclose(found[:, 0], np.linalg.norm(e, axis=1), rtol=1e-9)


def test_where_e_is_no_help_or_lies_across_the_longest_direction() -> None:
    """e = 0, and the hard case of a trust region: e has no part along the largest singular value."""
    M = np.stack([np.diag([3.0, 1.0])] * 2)
    e = np.array([[0.0, 0.0], [0.0, 1.0]])
    # z = (√(δ² − y²), y): 9 (δ² − y²) + (1 + y)² is largest at y = 1/8
    found = furthest(e, M, np.array([1.0, 2.0]))
    expected = [[3.0, 6.0], [np.sqrt(9.0 * (d * d - 1.0 / 64.0) + (9.0 / 8.0) ** 2) for d in (1.0, 2.0)]]
    assert np.all(found >= expected)
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_a_bad_multiplier_or_a_bad_decomposition_only_widens_it(monkeypatch: pytest.MonkeyPatch) -> None:
    e, M = drawn(7)
    sharp = furthest(e, M, DELTA)
    monkeypatch.setattr(joint, "NEWTON", 0)
    assert np.all(furthest(e, M, DELTA) >= sharp * (1.0 - 1e-9))
    svd = np.linalg.svd

    def wrong(m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        U, s, Vt = svd(m)
        return U * 1.001, s * 0.99, Vt * 0.999

    monkeypatch.setattr(joint.np.linalg, "svd", wrong)
    assert np.all(furthest(e, M, DELTA) >= sharp * (1.0 - 1e-12))
