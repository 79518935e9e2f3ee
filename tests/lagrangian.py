"""The seven-degree-of-freedom car derived a second time, from nothing but its energies.

This is the truth that the hand-written equations are compared with, so it must never import them.
Coordinates q = (z, psi, phi, z11, z12, z2, psi2) from static equilibrium; x = (q, dq/dt); SI units.
Corners are always in the order fl fr rl rr, which for the road is h11 h12 h21 h22.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

Array: TypeAlias = NDArray[np.float64]
Signal: TypeAlias = Callable[[float], Sequence[float] | Array]

COORDINATES = "z psi phi z11 z12 z2 psi2".split()
PARAMETERS = "m m11 m12 m21 m22 m2 Jx Jy Jz J2 c1 c2 cp1 cp2 b1 b2 bp1 bp2 a b s0 s1 s2".split()
NOTHING = (0.0, 0.0, 0.0, 0.0)


class Derivation(NamedTuple):
    """Symbols and expressions; vectors are columns."""

    parameters: list[sp.Symbol]  # in the order of PARAMETERS
    q: sp.Matrix  # 7, m and rad
    v: sp.Matrix  # 7, rates of q
    h: sp.Matrix  # 4, height of the road under each wheel
    dh: sp.Matrix  # 4, rate of h
    f: sp.Matrix  # 4, actuator forces, positive pushes the body up and the wheel down
    mass: sp.Matrix  # 7 x 7, diagonal
    accelerations: sp.Matrix  # 7
    energy: sp.Matrix  # 1, T + V, J
    power: sp.Matrix  # 3, W: road, actuators, dissipation

    @property
    def arguments(self) -> list[sp.Symbol]:
        """Everything an expression may depend on besides the parameters: q, v, h, dh, f (26)."""
        return [*self.q, *self.v, *self.h, *self.dh, *self.f]


def _column(names: Iterable[str]) -> sp.Matrix:
    return sp.Matrix([sp.Symbol(name, real=True) for name in names])


def _half_squares(weights: Sequence[sp.Expr], values: Iterable[sp.Expr]) -> sp.Expr:
    return sum(w * x**2 for w, x in zip(weights, values, strict=True)) / 2


def _geometry(q: sp.Matrix, h: sp.Matrix, lengths: Sequence[sp.Symbol]) -> tuple[sp.Matrix, sp.Matrix]:
    """Extension of the four struts (top minus bottom) and of the four tyres (wheel minus road)."""
    z, psi, phi, z11, z12, z2, psi2 = q
    a, b, s0, s1, s2 = lengths
    front, rear = z - a * sp.sin(phi), z + b * sp.sin(phi)
    lean, tilt = sp.sin(psi) * sp.cos(phi), sp.sin(psi2)
    tops = sp.Matrix([front + s1 * lean, front - s1 * lean, rear + s0 * lean, rear - s0 * lean])
    bottoms = sp.Matrix([z11, z12, z2 + s0 * tilt, z2 - s0 * tilt])
    wheels = sp.Matrix([z11, z12, z2 + s2 * tilt, z2 - s2 * tilt])
    return tops - bottoms, wheels - h


@cache
def derive() -> Derivation:
    """Lagrange's equations d/dt dT/dv - dT/dq + dV/dq + dR/dv = Q, solved for the accelerations."""
    parameters = list(_column(PARAMETERS))
    m, m11, m12, m21, m22, m2, Jx, Jy, Jz, J2, c1, c2, cp1, cp2, b1, b2, bp1, bp2, *lengths = parameters
    s2 = lengths[-1]
    q, v = _column(COORDINATES), _column("d" + name for name in COORDINATES)
    h, dh = _column(["h11", "h12", "h21", "h22"]), _column(["dh11", "dh12", "dh21", "dh22"])
    f = _column(["f_fl", "f_fr", "f_rl", "f_rr"])

    struts, tyres = _geometry(q, h, lengths)
    strut_rates = struts.jacobian(q) * v
    tyre_rates = tyres.jacobian(q) * v + tyres.jacobian(h) * dh
    pitch_inertia = Jy * sp.cos(q[1]) ** 2 + Jz * sp.sin(q[1]) ** 2
    inertias = [m, Jx, pitch_inertia, m11, m12, m21 + m22 + m2, (m21 + m22) * s2**2 + J2]
    T = _half_squares(inertias, v)
    V = _half_squares([c1, c1, c2, c2], struts) + _half_squares([cp1, cp1, cp2, cp2], tyres)
    R = _half_squares([b1, b1, b2, b2], strut_rates) + _half_squares([bp1, bp1, bp2, bp2], tyre_rates)

    def gradient(energy: sp.Expr, by: sp.Matrix) -> sp.Matrix:
        return sp.Matrix([energy.diff(s) for s in by])

    momenta = gradient(T, v)
    mass = momenta.jacobian(v)
    if not mass.is_diagonal():
        raise ArithmeticError("the mass matrix is not diagonal")
    applied = struts.jacobian(q).T * f - gradient(R, v)
    forces = applied + gradient(T - V, q) - momenta.jacobian(q) * v
    accelerations = sp.Matrix([force / mass[i, i] for i, force in enumerate(forces)])
    road = (gradient(V, h) + gradient(R, dh)).dot(dh)
    power = sp.Matrix([road, strut_rates.dot(f), 2 * R])
    return Derivation(parameters, q, v, h, dh, f, mass, accelerations, sp.Matrix([T + V]), power)


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
