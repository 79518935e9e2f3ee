"""Road heights under the wheels, and their exact rates, as functions of time.

A profile is laid on the road once; each wheel meets it after its own delay, at the speed v0:

    front left 0, front right τ0, rear left (a + b)/v0, rear right (a + b)/v0 + τ0        (§3.4 and §4)

In §3.4 the print has h12(t) = h11(t + τ0); what it calls a delay is h12(t) = h11(t − τ0), as here. Rates at a corner of
the profile are right-hand limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from math import cos, inf, pi, sin

from ..quantities import PARAMETERS, Choice, refuse

SNAP = 1e-9  # s; a time this close below a corner is the corner: sums of steps and of delays differ by round-off

PROFILE = Choice(
    name="profile",
    values=("bump", "sine", "fourier", "step", "flat"),
    text="road profile: half-sine bump, endless sine, Fourier series A_nu, step of height A, or flat",
)
HARMONICS = tuple(f"A_nu[{nu}]" for nu in range(1, 9))


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """Height [m] and rate [m/s] against the time s [s] since the wheel met the profile; 0 before.

    corners : times s at which the height or the rate jumps.  end : from then on the rate is 0.
    """

    height: Callable[[float], float]
    rate: Callable[[float], float]
    corners: tuple[float, ...] = (0.0,)
    end: float = inf


def half_sine(A: float, omega: float) -> Profile:
    """The paper's bump, A sin ωs over half a wave (§3.4, §4, figure 2), flat behind it."""
    end = pi / omega
    return Profile(
        height=lambda s: A * sin(omega * s) if s < end - SNAP else 0.0,
        rate=lambda s: A * omega * cos(omega * s) if s < end - SNAP else 0.0,
        corners=(0.0, end),
        end=end,
    )


def fourier(amplitudes: tuple[float, ...], omega: float) -> Profile:
    """χ(s) = Σ A_ν sin νΩs (§3.3); amplitudes = (A_1, A_2, …)."""
    terms = tuple((A, nu * omega) for nu, A in enumerate(amplitudes, start=1) if A)
    return Profile(
        height=lambda s: sum(A * sin(w * s) for A, w in terms),
        rate=lambda s: sum(A * w * cos(w * s) for A, w in terms),
    )


def step(A: float) -> Profile:
    """A jump to the height A; its rate is 0 on both sides."""
    return Profile(height=lambda s: A, rate=lambda s: 0.0, end=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadParameters:
    """What the road FMU is told; units and words in `quantities.PARAMETERS`. Raises ParameterError with every fault."""

    profile: str = PROFILE.start
    A: float = PARAMETERS["A"].start
    Lambda: float = PARAMETERS["Lambda"].start
    v0: float = PARAMETERS["v0"].start
    a: float = PARAMETERS["a"].start
    b: float = PARAMETERS["b"].start
    tau0: float = PARAMETERS["tau0"].start
    t_start: float = PARAMETERS["t_start"].start
    amplitudes: tuple[float, ...] = tuple(PARAMETERS[name].start for name in HARMONICS)
    excited: tuple[bool, bool, bool, bool] = (True, True, True, True)

    def __post_init__(self) -> None:
        reals = [f.name for f in fields(self) if f.name in PARAMETERS]
        refuse(
            [PROFILE.fault(self.profile)]
            + [PARAMETERS[name].fault(getattr(self, name)) for name in reals]
            + [PARAMETERS[name].fault(A) for name, A in zip(HARMONICS, self.amplitudes, strict=True)]
            + (["a + b = 0.0 m: wanted a wheelbase > 0"] if self.a + self.b == 0 else [])
        )

    @property
    def omega(self) -> float:
        """Ω = 2π v0/Λ [rad/s]."""
        return 2.0 * pi * self.v0 / self.Lambda

    @property
    def delays(self) -> tuple[float, float, float, float]:
        """Times [s] at which the wheels fl, fr, rl, rr meet the profile."""
        rear = self.t_start + (self.a + self.b) / self.v0
        return self.t_start, self.t_start + self.tau0, rear, rear + self.tau0

    def shape(self) -> Profile:
        """The profile that is laid on the road."""
        match self.profile:
            case "bump":
                return half_sine(self.A, self.omega)
            case "sine":
                return fourier((self.A,), self.omega)
            case "fourier":
                return fourier(self.amplitudes, self.omega)
            case "step":
                return step(self.A)
            case _:
                return step(0.0)


@dataclass(frozen=True, slots=True)
class Road:
    """Heights and rates under the four wheels at any time."""

    shape: Profile
    delays: tuple[float, ...]  # of the wheels, inf where the road is flat

    def heights(self, t: float) -> list[float]:
        """h_fl, h_fr, h_rl, h_rr [m] at the time t [s]."""
        height = self.shape.height
        return [height(max(t - d, 0.0)) if t - d >= -SNAP else 0.0 for d in self.delays]

    def rates(self, t: float) -> list[float]:
        """Their rates [m/s] just after the time t."""
        rate = self.shape.rate
        return [rate(max(t - d, 0.0)) if t - d >= -SNAP else 0.0 for d in self.delays]

    @property
    def end(self) -> float:
        """Time [s] from which no height changes any more."""
        return max((d + self.shape.end for d in self.delays if d < inf), default=-inf)

    def corners(self, until: float) -> list[float]:
        """Times [s] before `until` at which a height or a rate jumps, sorted."""
        return sorted({d + c for d in self.delays for c in self.shape.corners if d + c < until})


def road(p: RoadParameters) -> Road:
    """The road that these parameters describe."""
    return Road(p.shape(), tuple(d if on else inf for d, on in zip(p.delays, p.excited, strict=True)))
