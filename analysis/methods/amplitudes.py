"""What the amplitude equations say: stability of the forced motion, critical amplitudes, equilibria (after (3.20))."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..errors import InputError
from .averaging import AmplitudeEquations
from .modes import Complex
from .polynomials import Array

SIZES = "less the sizes of what nearly resonates"  # of a margin that they are taken from
MOST_MODES = 12  # whose subsets are tried
LEFT_OUT = 0.1  # of a motion, that averaging may leave out and still describe it
UNDAMPED = 1e-12  # of |λ|: decay rates as small as this are round-off


@dataclass(frozen=True, slots=True, kw_only=True)
class Stability:
    """The condition Re(α_k + ε(A_k + B_k)) < 0, mode by mode (n,).

    growth            : the left-hand side [1/s]; where s_k' is linear in other s_j too (modes of equal frequency, a
                        resonance near by) with the sizes of those terms added: it bounds the growth of max |s_k|.
    sizes             : what of it are those sizes [1/s]; 0 where it is Re(α_k + ε(A_k + B_k)) itself.
    critical_scale    : factor on the input at which it becomes 0; inf if it never does.
    critical_amplitude: |s_k| at which the mode's own cubic term cancels its decay; inf if it never does.
    valid_scale       : factor on the input up to which averaging leaves out at most LEFT_OUT of a small free motion
                        and of the forced one; a critical scale beyond it is the formula's, not the system's.
    valid_amplitudes  : |s_k| up to which it leaves out at most LEFT_OUT of a motion of mode k alone.
    """

    growth: Array
    sizes: Array
    critical_scale: Array
    critical_amplitude: Array
    valid_scale: float
    valid_amplitudes: Array

    @property
    def margin(self) -> float:
        """Smallest decay rate [1/s]; the condition holds if > 0."""
        return float(-self.growth.max())

    @property
    def words(self) -> str:
        """What is added to the margin, if anything."""
        return SIZES if self.sizes[int(np.argmax(self.growth))] > 0.0 else ""

    @property
    def lost(self) -> str:
        """At which height of the input the condition is lost, as far as averaging can tell."""
        critical = float(self.critical_scale.min())
        if critical < np.inf and critical <= self.valid_scale:
            return f"lost at {critical:.3g} times this input"
        if self.valid_scale < np.inf:
            return f"not lost up to {self.valid_scale:.3g} times this input, where averaging ends"
        return "at any height of this input"


def stability(equations: AmplitudeEquations) -> Stability:
    """The condition with its margins.

    Raises InputError where it does not decide: a resonance forces an amplitude, or couples some too strongly.
    """
    _not_forced(equations)
    (plain, sizes), alpha, own = _linear_by_waves(equations), equations.modes.alpha, equations.cubic.real
    by_waves = plain + sizes
    growth = alpha + by_waves.sum(axis=1)
    coupled = _coupled(equations)
    if coupled and not growth.max() < 0.0:
        k = int(np.argmax(growth))
        raise InputError(
            f"condition after (3.20): wanted s_{k + 1}' to have no linear term but s_{k + 1}, or small ones, got "
            f"{', '.join(coupled)}: modes of equal frequency (or that do not oscillate), or near a resonance"
        )
    half = own.shape[1]
    return Stability(
        growth=growth,
        sizes=sizes.sum(axis=1),
        critical_scale=np.array([_first_root([a, *row[1:]]) for a, row in zip(alpha, by_waves, strict=True)]),
        critical_amplitude=np.array([_amplitude(growth[k], own[k, k % half]) for k in range(len(growth))]),
        valid_scale=_valid_scale(equations),
        valid_amplitudes=np.array([_valid_amplitude(equations, k) for k in range(len(growth))]),
    )


def decided(equations: AmplitudeEquations) -> Stability:
    """The condition with its margins, where the sign of each is more than round-off.

    Raises InputError where it does not decide, or where no mode grows and what is left of a decay is round-off.
    """
    found, least = stability(equations), UNDAMPED * np.abs(equations.modes.eigenvalues)
    if np.all(found.growth <= least) and np.any(found.growth >= -least):
        raise InputError("condition after (3.20): wanted damped modes, got one whose decay is round-off")
    return found


def left_out(equations: AmplitudeEquations, s: Complex) -> float:
    """Bound on |W| [m or rad], which averaging leaves out, at amplitudes s (n,): Σ of its terms' sizes."""
    z = np.concatenate([np.abs(s), np.ones(len(equations.waves.frequencies))])
    sizes = (np.abs(W.coefficients) @ np.prod(z[W.monomials], axis=1) for W in equations.correction)
    return float(np.max(sum(sizes, np.zeros(equations.n))))


def _not_forced(equations: AmplitudeEquations) -> None:
    """Raise InputError if s_k' has a constant."""
    for part in equations.resonant:
        for k, monomial, _ in part.entries():
            if all(i >= equations.n for i in monomial):
                raise InputError(
                    f"condition after (3.20): wanted s_{k + 1}' to have no linear term but s_{k + 1}, got a constant: "
                    "a road in resonance, or modes that do not oscillate"
                )


def _coupled(equations: AmplitudeEquations) -> list[str]:
    """The first other s_j that each s_k' is linear in, in words."""
    found: dict[int, str] = {}
    for part, delta in zip(equations.resonant, equations.detunings, strict=True):
        for k, column in zip(*np.nonzero(part.coefficients), strict=True):
            free = [i for i in part.monomials[column] if i < equations.n]
            if len(free) == 1 and (free[0] != k or delta[k, column] != 0.0):
                found.setdefault(int(k), f"s_{free[0] + 1} in s_{k + 1}'")
    return list(found.values())


def _linear_by_waves(equations: AmplitudeEquations) -> tuple[Array, Array]:
    """What terms linear in s add to the growth of |s_k| (n, P) by the number of waves in them: a power of the input.

    First of s_k itself, the real part; then of the others, and of those that turn, the size.
    """
    n, most = equations.n, max((part.degree for part in equations.resonant), default=1)
    own, other = np.zeros((n, max(most, 2)), complex), np.zeros((n, max(most, 2)))
    for part, delta in zip(equations.resonant, equations.detunings, strict=True):
        for column, row in enumerate(part.monomials.tolist()):
            free = [i for i in row if i < n]
            if len(free) == 1:
                still = (np.arange(n) == free[0]) & (delta[:, column] == 0.0)
                own[still, len(row) - 1] += part.coefficients[still, column]
                other[~still, len(row) - 1] += np.abs(part.coefficients[~still, column])
    return own.real, other


def _valid_scale(equations: AmplitudeEquations) -> float:
    """See `Stability`; inf without an input."""
    n, forced = equations.n, float(np.abs(equations.waves.forced).max(initial=0.0))
    degree = max((W.degree for W in equations.correction), default=1)
    steady, free = np.zeros((2, n, degree))  # by powers of the input: of W without s over the forced motion, of ∂W/∂s
    for W in equations.correction:
        count = np.count_nonzero(W.monomials < n, axis=1)
        steady[:, W.degree - 1] += np.abs(W.coefficients[:, count == 0]).sum(axis=1) / (forced or 1.0)
        free[:, W.degree - 1] += np.abs(W.coefficients[:, count == 1]).sum(axis=1)
    return min(_first_root([-LEFT_OUT, *row[1:]]) for row in (*steady, *free))


def _valid_amplitude(equations: AmplitudeEquations, k: int) -> float:
    n, half = equations.n, equations.n // 2
    alone = np.zeros((n, max((W.degree for W in equations.correction), default=1)))
    for W in equations.correction:
        chosen = np.isin(W.monomials, [k % half, k % half + half]).all(axis=1)
        alone[:, W.degree - 1] += np.abs(W.coefficients[:, chosen]).sum(axis=1)
    return min(_first_root([-LEFT_OUT, *row[1:]]) for row in alone)


def _first_root(coefficients: list[float]) -> float:
    """Smallest positive root of Σ c_p κᵖ, inf if there is none."""
    roots = np.roots(np.trim_zeros(np.array(coefficients), "b")[::-1])
    real = roots[np.abs(roots.imag) <= 1e-9 * np.abs(roots)].real
    return float(min(real[real > 0.0], default=np.inf))


def _amplitude(growth: float, own: float) -> float:
    return float(np.sqrt(-growth / own)) if growth * own < 0.0 else np.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Equilibrium:
    """Constant |s_k| (n/2,) of the modes, their frequencies [rad/s], and growth rates of small changes [1/s]."""

    amplitudes: Array
    frequencies: Array
    growth: Complex

    @property
    def stable(self) -> bool:
        return bool(np.all(self.growth.real < 0.0))


def equilibria(equations: AmplitudeEquations) -> list[Equilibrium]:
    """All constant amplitudes of s_k' = s_k (μ_k + Σ_j c_kj |s_j|²), modes at rest included, by the modes that move.

    For each set of moving modes |s|² solves linear equations. Raises InputError if other resonant terms were kept (see
    `steady_states`), or for more than MOST_MODES modes.
    """
    half = equations.n // 2
    _only_trivial(equations)
    if half > MOST_MODES:
        raise InputError(f"equilibria: wanted at most {MOST_MODES} modes, got {half}")
    mu = (equations.modes.alpha + equations.linear)[:half]
    C, beta = equations.cubic[:half], equations.modes.beta[:half]
    found = []
    for size in range(half + 1):
        for moving in combinations(range(half), size):
            chosen = list(moving)
            block = C.real[np.ix_(chosen, chosen)]
            if size and np.linalg.matrix_rank(block) < size:
                continue
            squares = np.zeros(half)
            squares[chosen] = np.linalg.solve(block, -mu.real[chosen])
            if np.all(squares[chosen] > 0.0):
                r, total = np.sqrt(squares), mu + C @ squares
                jacobian = np.diag(total.real) + 2.0 * np.outer(r, r) * C.real
                found.append(
                    Equilibrium(
                        amplitudes=r, frequencies=beta + total.imag, growth=np.linalg.eigvals(jacobian).astype(complex)
                    )
                )
    return found


def _only_trivial(equations: AmplitudeEquations) -> None:
    """Raise InputError unless every resonant term is s_k, or s_k s_j s_(j + n/2)."""
    n, half = equations.n, equations.n // 2
    for part in equations.resonant:
        for k, monomial, _ in part.entries():
            free = [i for i in monomial if i < n]
            rest = [i for i in free if i != k] + [k] * (free.count(k) - 1)
            paired = len(rest) == 2 and abs(rest[0] - rest[1]) == half
            if k not in free or (rest and not paired):
                raise InputError(
                    f"equilibria: wanted terms s_k and s_k s_j s_j+{half} alone, got s{free} in s_{k}'; use "
                    "steady_states, or a smaller detuning"
                )


def steady_states(equations: AmplitudeEquations, starts: list[Complex]) -> list[tuple[Complex, Complex, Array]]:
    """Amplitudes s_k = S_k exp(iδ_k t) locked to the input or to each other, found by Newton's method from `starts`.

    Each start is (n/2,). Returns for each one found S (n,), the growth rates of small changes (n,) [1/s], and δ (n,)
    [rad/s]. Raises InputError if no rotation δ makes the equations autonomous.
    """
    delta = _rotation(equations)
    found: list[tuple[Complex, Complex, Array]] = []
    for start in starts:
        S = np.concatenate([start, np.conj(start)])
        for _ in range(60):
            value, slope = _rotating(equations, delta, S)
            step = np.linalg.solve(slope, value)
            S = S - step
            if np.abs(step).max() <= 1e-13 * max(1e-300, float(np.abs(S).max())):
                if not any(np.abs(S - other).max() <= 1e-8 * np.abs(S).max() for other, _, _ in found):
                    found.append((S, np.linalg.eigvals(slope).astype(complex), delta))
                break
    return found


def _rotation(equations: AmplitudeEquations) -> Array:
    """δ with δ_k − Σ δ_j = detuning for every term."""
    n, half = equations.n, equations.n // 2
    sign = np.vstack([np.eye(half), -np.eye(half)])
    rows, values = [np.zeros(half)], [0.0]
    for part, detunings in zip(equations.resonant, equations.detunings, strict=True):
        for k, monomial in zip(*np.nonzero(part.coefficients), strict=True):
            rows.append(sign[k] - sum((sign[i] for i in part.monomials[monomial] if i < n), np.zeros(half)))
            values.append(detunings[k, monomial])
    delta, *_ = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)
    if not np.allclose(np.array(rows) @ delta, values, atol=1e-9 * max(1.0, float(np.abs(values).max()))):
        raise InputError("steady states: the detunings of the kept terms fit no common rotation; wanted fewer of them")
    return sign @ delta


def _rotating(equations: AmplitudeEquations, delta: Array, S: Complex) -> tuple[Complex, Complex]:
    """S' and its derivative in the rotating amplitudes."""
    n = equations.n
    z = np.concatenate([S, np.ones(len(equations.waves.frequencies))])
    value = (equations.modes.alpha - 1j * delta) * S
    slope = np.diag(equations.modes.alpha - 1j * delta)
    for part in equations.resonant:
        value, slope = value + part(z), slope + part.jacobian(z)[:, :n]
    return value, slope
