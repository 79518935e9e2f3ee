"""The car of `analysis.derivation` in numbers: the truth that the hand-written equations are compared with.

Neither it nor the derivation may import them.
Coordinates q = (z, psi, phi, z11, z12, z2, psi2) from static equilibrium; x = (q, dq/dt); SI units.
Corners are always in the order fl fr rl rr, which for the road is h11 h12 h21 h22.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import Any, TypeAlias

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from analysis.derivation import COORDINATES, PARAMETERS, derive

Array: TypeAlias = NDArray[np.float64]
Signal: TypeAlias = Callable[[float], Sequence[float] | Array]

NOTHING = (0.0, 0.0, 0.0, 0.0)


@cache
def _compiled(what: str) -> Callable[..., list[float]]:
    d = derive()
    return sp.lambdify([*d.parameters, *d.arguments], list(getattr(d, what)), modules="math", cse=True)


def _bound(what: str, p: Mapping[str, float]) -> Callable[..., list[float]]:
    """The named expression as a function of x (14), h, dh, f (4 each) for the parameters p."""
    function, values = _compiled(what), [float(p[name]) for name in PARAMETERS]

    def evaluate(x: Any, h: Any, dh: Any = NOTHING, f: Any = NOTHING) -> list[float]:
        return function(*values, *map(float, (*x, *h, *dh, *f)))

    return evaluate


def accelerations(p: Mapping[str, float]) -> Callable[[Any, Any, Any, Any], Array]:
    """(x (14), h (4) m, dh (4) m/s, f (4) N) -> second time derivative of q (7), m/s2 and rad/s2."""
    evaluate = _bound("accelerations", p)
    return lambda x, h, dh, f: np.array(evaluate(x, h, dh, f))


def energy(p: Mapping[str, float]) -> Callable[[Any, Any], float]:
    """(x (14), h (4) m) -> T + V, J."""
    evaluate = _bound("energy", p)
    return lambda x, h: evaluate(x, h)[0]


def power(p: Mapping[str, float]) -> Callable[[Any, Any, Any, Any], tuple[float, float, float]]:
    """(x (14), h, dh, f (4 each)) -> (road, actuators, dissipation), W; dE/dt = road + act. - diss."""
    evaluate = _bound("power", p)

    def balance(x: Any, h: Any, dh: Any, f: Any) -> tuple[float, float, float]:
        road, actuators, dissipation = evaluate(x, h, dh, f)
        return road, actuators, dissipation

    return balance


@cache
def _jacobian() -> Callable[..., list[list[float]]]:
    """The parameters -> 7 x 26 derivative of the accelerations by (x, h, dh, f) at the origin."""
    d = derive()
    at_rest = d.accelerations.jacobian(d.arguments).xreplace(dict.fromkeys(d.arguments, sp.S.Zero))
    return sp.lambdify(d.parameters, at_rest.tolist(), modules="math", cse=True)


def linear(p: Mapping[str, float]) -> tuple[Array, Array, Array, Array]:
    """A (14 x 14), Bf, Bh, Bdh (14 x 4 each) of x' = A x + Bf f + Bh h + Bdh dh, exact at the origin."""
    n = len(COORDINATES)
    lower = np.array(_jacobian()(*(float(p[name]) for name in PARAMETERS)))
    rows = np.vstack([np.eye(n, lower.shape[1], k=n), lower])
    A, Bh, Bdh, Bf = np.split(rows, [2 * n, 2 * n + 4, 2 * n + 8], axis=1)
    return A, Bf, Bh, Bdh


def bump(A: float, Lam: float, v0: float, delays: ArrayLike) -> tuple[Signal, Signal, list[float]]:
    """Half sine of height A m and wavelength Lam m at v0 m/s, met by each wheel (4) after its delay in s.

    Returns h(t) (4) m, dh(t) (4) m/s and the sorted times at which dh jumps. The branch is chosen by
    comparing t with these very times, not with differences that round.
    """
    omega = 2 * np.pi * v0 / Lam
    starts = np.array(delays, dtype=float)
    ends = starts + Lam / (2 * v0)

    def h(t: float) -> Array:
        return np.where((starts <= t) & (t <= ends), A * np.sin(omega * (t - starts)), 0.0)

    def dh(t: float) -> Array:
        return np.where((starts <= t) & (t <= ends), A * omega * np.cos(omega * (t - starts)), 0.0)

    return h, dh, sorted({*starts.tolist(), *ends.tolist()})


def integrate(
    p: Mapping[str, float],
    road: tuple[Signal, Signal],
    corners: Iterable[float],
    x0: ArrayLike,
    times: ArrayLike,
    forces: Signal | None = None,
    rtol: float = 1e-12,
    atol: float = 1e-15,
) -> Array:
    """States (len(times), 14) from x0 at times[0]; times increase, s; road = (h, dh); forces(t) (4), N.

    The inputs may jump at the corners (list those of `forces` too). Each stretch between two is integrated on
    its own and asks for its inputs never at its ends but a few roundings inside, so it sees its own branch.
    """
    h, dh = road
    force = forces or (lambda t: NOTHING)
    acceleration = _bound("accelerations", p)
    times, x = np.asarray(times, dtype=float), np.asarray(x0, dtype=float)
    inside = 16 * np.spacing(np.abs(times[[0, -1]]).max())
    breaks = [times[0]]
    for corner in sorted(corners):
        if breaks[-1] + 2 * inside < corner < times[-1] - 2 * inside:
            breaks.append(corner)

    def rate(t: float, y: Array, start: float, end: float) -> list[float]:
        t = min(max(t, start + inside), end - inside)
        return [*y[7:], *acceleration(y, h(t), dh(t), force(t))]

    states = np.empty((len(times), len(x)))
    for start, end in zip(breaks, [*breaks[1:], times[-1]], strict=True):
        here = (start <= times) & (times < end)
        stretch = {"args": (start, end), "t_eval": [*times[here], end]}
        run = solve_ivp(rate, (start, end), x, method="DOP853", rtol=rtol, atol=atol, **stretch)
        if not run.success:
            raise RuntimeError(f"integration from {start} s to {end} s: {run.message}")
        states[here], x = run.y[:, :-1].T, run.y[:, -1]
    states[-1] = x
    return states
