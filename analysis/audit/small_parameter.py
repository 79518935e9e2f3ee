"""§3.3 before the averaging: the series (3.15)–(3.16) and the slow amplitudes of (3.18), on a textbook system."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from ..methods.modes import Complex
from .averaging import QUIET, Textbook, eigenvalues, textbook
from .rows import INSPECTION, RIGHT, Evidence, Row

END = 0.5  # s
SIZES = np.array([2e-4, 1e-4, 5e-5])  # ε
CIRCLE = 0.1 * np.exp(2j * np.pi * np.arange(8) / 8)  # ε's from whose values powers are told apart
Flow = Callable[[float, Complex], Complex]


def neglected() -> Row:
    return Row(
        equation="§3.3, its title and first sentence",
        printed="P(t, Kξ) = 0, then P_i(t, ξ), P̄_i and B_i in f_i, (3.20) and all that follows",
        derived="P is kept from “For simplicity” on",
        kind=INSPECTION,
    )


def cube(x: Textbook, a: Complex, b: Complex, c: Complex) -> Complex:
    """α_ijkl a_j b_k c_l (n)."""
    return x.alpha @ c @ b @ a


def forced(x: Textbook, t: float) -> Complex:
    """P_k sin(Ωt + ψ_k) (n)."""
    return x.P * np.sin(x.W * t + x.psi)


def force(x: Textbook, t: float) -> Complex:
    """f(t) (n), whose steady motion that is."""
    return x.P * x.W * np.cos(x.W * t + x.psi) - eigenvalues(x.beta) * forced(x, t)


def reached(rate: Flow, start: Complex) -> Complex:
    """The motion from `start` at END."""
    return solve_ivp(rate, (0.0, END), start.astype(complex), method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]


def exact(x: Textbook, epsilon: float) -> Complex:
    """ξ (n) at END of (3.14), from s plus the steady motion."""
    lam = eigenvalues(x.beta)
    return reached(lambda t, xi: lam * xi + force(x, t) + epsilon * cube(x, xi, xi, xi), x.s + forced(x, 0.0))


def by_print(x: Textbook, xi: Complex) -> Complex:
    """What (3.16) has on the right of orders 1 and 2 (2, n) besides Λξ, at ξ⁽⁰⁾, ξ⁽¹⁾, ξ⁽²⁾ (3, n)."""
    zero, one, _ = xi
    second = cube(x, one, zero, zero) + cube(x, zero, one, zero) + cube(x, zero, zero, one)
    return np.stack([cube(x, zero, zero, zero), second])


def by_powers(x: Textbook, xi: Complex) -> Complex:
    """The same: the powers 1 and 2 of ε in ε R(ξ⁽⁰⁾ + ε ξ⁽¹⁾ + ε² ξ⁽²⁾), by values on a circle of ε."""
    sums = [xi[0] + e * xi[1] + e**2 * xi[2] for e in CIRCLE]
    values = np.array([e * cube(x, total, total, total) for e, total in zip(CIRCLE, sums, strict=True)])
    return np.stack([np.mean(values / CIRCLE[:, None] ** power, axis=0) for power in (1, 2)])


def order_left(x: Textbook, right: Callable[[Textbook, Complex], Complex]) -> float:
    """Order in ε of |ξ − ξ⁽⁰⁾ − ε ξ⁽¹⁾ − ε² ξ⁽²⁾| at END, the orders by these right sides."""
    lam, n = eigenvalues(x.beta), len(x.beta)

    def rate(t: float, y: Complex) -> Complex:
        xi = y.reshape(3, n)
        return (lam * xi + np.concatenate([force(x, t)[None], right(x, xi)])).ravel()

    terms = reached(rate, np.concatenate([x.s + forced(x, 0.0), np.zeros(2 * n)])).reshape(3, n)
    left = [np.linalg.norm(exact(x, e) - terms[0] - e * terms[1] - e**2 * terms[2]) for e in SIZES]
    return float(np.polyfit(np.log(SIZES), np.log(left), 1)[0])


def series() -> Row:
    x = textbook(*QUIET)
    return Row(
        equation="(3.15), (3.16)",
        printed="ξ_i = ξ_i⁽⁰⁾ + ε ξ_i⁽¹⁾ + ε² ξ_i⁽²⁾ + O(ε³), with (3.16) for each",
        derived="the same",
        kind=RIGHT,
        evidence=[
            Evidence(
                measure="order in ε of what the three terms leave of ξ at t = 0.5, system of 2 oscillators, by (3.16) "
                "and by powers of ε",
                printed=order_left(x, by_print),
                derived=order_left(x, by_powers),
                unit="1",
                expected=3.0,
                tolerance=0.1,
                apart=0.5,
            )
        ],
    )


def transformed() -> Row:
    return Row(
        equation="before (3.18)",
        printed="the solution of the nonlinear equations (3.13); (3.13) transform into (3.18)",
        derived="(3.14): (3.13) is linear and has no Φ",
        kind=INSPECTION,
    )


def amplitudes() -> Row:
    x, epsilon = textbook(*QUIET), SIZES[0]
    lam = eigenvalues(x.beta)

    def Phi(t: float, free: Complex) -> Complex:
        xi = free + forced(x, t)
        return epsilon * cube(x, xi, xi, xi)

    turn = 1j * x.beta
    s = reached(lambda t, s: lam.real * s + np.exp(-turn * t) * Phi(t, s * np.exp(turn * t)), x.s)
    C = reached(lambda t, C: np.exp(-lam * t) * Phi(t, C * np.exp(lam * t)), x.s)
    xi = exact(x, epsilon)

    def error(free: Complex) -> float:
        return float(np.linalg.norm(free + forced(x, END) - xi) / np.linalg.norm(xi - exact(x, 0.0)))

    return Row(
        equation="(3.18)",
        printed="ṡ_k − α_k s_k = exp(−iβ_k t) Φ_k(ε, t, s_1, …, s_14)",
        derived="the same, with ε in Φ_k",
        kind=RIGHT,
        evidence=[
            Evidence(
                measure="error of ξ at t = 0.5 against (3.14), over what ε = 2·10⁻⁴ makes there, system of 2 "
                "oscillators: by (3.18), and by C_k of (3.17) varied",
                printed=error(s * np.exp(turn * END)),
                derived=error(C * np.exp(lam * END)),
                unit="1",
                tolerance=1e-7,
                apart=1e-2,
            )
        ],
    )
