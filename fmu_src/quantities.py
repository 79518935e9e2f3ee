"""The one table of quantities: name, unit, symbol of the paper, words, limits, nominal and start value.

FMI variables, CSV columns, plot labels, parameter checks and documentation are all read from it. SI units throughout.
Corners stand in the order fl, fr, rl, rr (front left, front right, rear left, rear right) everywhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, pi


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A real variable: `low` and `high` are its limits (`low` itself excluded if `positive`).

    `scale` is the typical size of its values, where that is not the size of its start value.
    """

    name: str
    unit: str
    symbol: str
    text: str
    start: float = 0.0
    low: float = -inf
    high: float = inf
    positive: bool = False
    scale: float = 0.0

    @property
    def nominal(self) -> float:
        """Typical size of the values: what is said, or that of the start value."""
        return self.scale or abs(self.start) or 1.0

    @property
    def description(self) -> str:
        """Words and the paper's symbol, in plain text, for the FMI description."""
        primed = re.sub(r"\\(d+)ot ?\{?(\\?\w+?)\}?(_|$)", lambda m: m[2] + "'" * len(m[1]) + m[3], self.symbol)
        plain = re.sub(r"[{}_]|\\", "", primed)
        return f"{self.text} ({plain}){', > 0' if self.positive else ''}"

    def fault(self, value: float) -> str | None:
        """What is wrong with this value, in words; None if nothing is."""
        if self.positive and not 0.0 < value < inf:
            return f"{self.name} = {value!r} {self.unit}: wanted a finite number > 0"
        if not (self.low <= value <= self.high and abs(value) < inf):
            limits = "" if self.low == -self.high == -inf else f" in [{self.low:g}, {self.high:g}]"
            return f"{self.name} = {value!r} {self.unit}: wanted a finite number{limits}"
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A string parameter that takes one of a few values."""

    name: str
    values: tuple[str, ...]
    text: str

    @property
    def start(self) -> str:
        return self.values[0]

    @property
    def description(self) -> str:
        return f"{self.text}; one of: {', '.join(self.values)}"

    def fault(self, value: str) -> str | None:
        """What is wrong with this value, in words; None if nothing is."""
        return None if value in self.values else f"{self.name} = {value!r}: wanted one of {', '.join(self.values)}"


CORNERS = ("fl", "fr", "rl", "rr")
CORNER_WORDS = ("front left", "front right", "rear left", "rear right")
WHEEL_INDICES = ("11", "12", "21", "22")  # the paper's numbering of the corners

# Exponents of the SI base units; rad is kept apart, as FMI does.
UNITS: dict[str, dict[str, int]] = {
    "s": {"s": 1},
    "m": {"m": 1},
    "rad": {"rad": 1},
    "m/s": {"m": 1, "s": -1},
    "rad/s": {"rad": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad/s2": {"rad": 1, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "kg": {"kg": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "N/m": {"kg": 1, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "N2/m2": {"kg": 2, "s": -4},
    "N2.s2/m2": {"kg": 2, "s": -2},
    "kg2": {"kg": 2},
    "1": {},
}


def _accented(accent: str, symbol: str) -> str:
    """LaTeX of a symbol with an accent on its letter, not on its index."""
    letter, _, index = symbol.partition("_")
    return rf"\{accent}{{{letter}}}" + (f"_{index}" if index else "")


def _corner_quantities(name: str, unit: str, symbol: str, text: str, scale: float) -> tuple[Quantity, ...]:
    return tuple(
        Quantity(name=name.format(corner), unit=unit, symbol=symbol.format(index), text=f"{text}, {words}", scale=scale)
        for corner, index, words in zip(CORNERS, WHEEL_INDICES, CORNER_WORDS, strict=True)
    )


# ------------------------------------------------------------------ the vehicle: q, q', q'' in the paper's order
POSITIONS = (
    Quantity(name="body.heave", unit="m", symbol=r"z", text="body heave, up", scale=0.01),
    Quantity(
        name="body.roll",
        unit="rad",
        symbol=r"\psi",
        text="body roll, left side up",
        low=-pi / 2,
        high=pi / 2,
        scale=0.01,
    ),
    Quantity(
        name="body.pitch",
        unit="rad",
        symbol=r"\varphi",
        text="body pitch, nose down",
        low=-pi / 2,
        high=pi / 2,
        scale=0.01,
    ),
    Quantity(name="wheel_fl.heave", unit="m", symbol=r"z_{11}", text="front left wheel heave, up", scale=0.01),
    Quantity(name="wheel_fr.heave", unit="m", symbol=r"z_{12}", text="front right wheel heave, up", scale=0.01),
    Quantity(name="axle_r.heave", unit="m", symbol=r"z_2", text="rear axle heave, up", scale=0.01),
    Quantity(
        name="axle_r.roll",
        unit="rad",
        symbol=r"\psi_2",
        text="rear axle roll, left side up",
        low=-pi / 2,
        high=pi / 2,
        scale=0.01,
    ),
)
RATES = tuple(
    Quantity(
        name=f"der({q.name})",
        unit=f"{q.unit}/s",
        symbol=_accented("dot", q.symbol),
        text=f"rate of {q.text}",
        scale=0.1,
    )
    for q in POSITIONS
)
STATES = POSITIONS + RATES
ACCELERATIONS = tuple(
    Quantity(
        name=f"{q.name}_acceleration",
        unit=f"{q.unit}/s2",
        symbol=_accented("ddot", q.symbol),
        text=f"acceleration of {q.text}",
        scale=1.0,
    )
    for q in POSITIONS
)
STRUT_TRAVELS = _corner_quantities("strut_{}.travel", "m", r"\Delta_{{{}}}", "strut travel, extension positive", 0.01)
TYRE_FORCES = _corner_quantities(
    "tyre_{}.force", "N", r"N_{{{}}}", "tyre force on the wheel over its static load, up", 1000.0
)

# ------------------------------------------------------------------ signals between the components
ROAD_HEIGHTS = _corner_quantities("h_{}", "m", r"h_{{{}}}", "road height under the wheel", 0.01)
ROAD_RATES = _corner_quantities(
    "dh_{}", "m/s", r"\dot{{h}}_{{{}}}", "rate of the road height just after this instant (right-hand limit)", 1.0
)
ROAD_BOWS = _corner_quantities(
    "bow_{}",
    "m",
    r"\beta_{{{}}}",
    "road height in the middle of the last step, over the parabola through the heights at its ends with its first rate",
    0.001,
)
ROAD = ROAD_HEIGHTS + ROAD_RATES + ROAD_BOWS
FORCES = _corner_quantities("force_{}", "N", r"u_{{{}}}", "actuator force, up on the body and down on the wheel", 100.0)

# ------------------------------------------------------------------ the controller of a real car; 0: without
FULL_CAR_WEIGHTS = (
    Quantity(name="H2", unit="m", symbol="H_2", text="weight of roll against heave, full car", start=1.0, low=0.0),
    Quantity(
        name="lambda_travel",
        unit="N2/m2",
        symbol=r"\lambda_s",
        text="weight of each strut's travel, full car",
        low=0.0,
        scale=1e10,
    ),
    Quantity(
        name="lambda_tyre",
        unit="N2/m2",
        symbol=r"\lambda_t",
        text="weight of each tyre's deflection, full car",
        low=0.0,
        scale=1e10,
    ),
    Quantity(
        name="lambda_hop",
        unit="N2.s2/m2",
        symbol=r"\lambda_w",
        text="weight of each wheel's speed, full car",
        low=0.0,
        scale=1e8,
    ),
    Quantity(
        name="lambda_acceleration",
        unit="kg2",
        symbol=r"\lambda_a",
        text="weight of heave acceleration, with H1 and H2 of pitch and roll acceleration, full car",
        low=0.0,
        scale=1e6,
    ),
)
HARDWARE = (
    Quantity(
        name="force_limit",
        unit="N",
        symbol="u_{max}",
        text="largest force of an actuator; 0: no limit",
        low=0.0,
        scale=1000.0,
    ),
    Quantity(
        name="actuator_lag",
        unit="s",
        symbol=r"\tau_a",
        text="time constant of the actuators; 0: none",
        low=0.0,
        scale=0.01,
    ),
    Quantity(
        name="valve_damping",
        unit="N.s/m",
        symbol="b_{max}",
        text="damping of a semi-active actuator with its valve shut",
        start=5000.0,
        positive=True,
    ),
    Quantity(
        name="sample_time",
        unit="s",
        symbol="T_s",
        text="time between samples, whose forces are held; 0: every communication point",
        low=0.0,
        scale=0.01,
    ),
    Quantity(
        name="sigma_acceleration",
        unit="m/s2",
        symbol=r"\sigma_a",
        text="noise of the accelerometers, standard deviation",
        start=0.02,
        positive=True,
    ),
    Quantity(
        name="sigma_travel",
        unit="m",
        symbol=r"\sigma_s",
        text="noise of the strut travel sensors, standard deviation",
        start=5e-5,
        positive=True,
    ),
    Quantity(
        name="sigma_road",
        unit="m",
        symbol=r"\sigma_h",
        text="road height that the filter reckons with, anew for each sample and wheel, standard deviation",
        start=2e-4,
        positive=True,
    ),
    Quantity(name="seed", unit="1", symbol="n", text="which noise: the same number, the same noise", start=1.0),
)

# ------------------------------------------------------------------ parameters; defaults: representative of a small car
PARAMETERS = {
    q.name: q
    for q in (
        Quantity(name="m", unit="kg", symbol="m", text="vehicle body mass", start=870.0, positive=True),
        Quantity(name="m11", unit="kg", symbol="m_{11}", text="front left wheel mass", start=30.0, positive=True),
        Quantity(name="m12", unit="kg", symbol="m_{12}", text="front right wheel mass", start=30.0, positive=True),
        Quantity(name="m21", unit="kg", symbol="m_{21}", text="rear left wheel mass", start=22.0, positive=True),
        Quantity(name="m22", unit="kg", symbol="m_{22}", text="rear right wheel mass", start=22.0, positive=True),
        Quantity(name="m2", unit="kg", symbol="m_2", text="rear twist beam mass", start=24.0, low=0.0),
        Quantity(name="Jx", unit="kg.m2", symbol="J_x", text="body roll inertia", start=300.0, positive=True),
        Quantity(name="Jy", unit="kg.m2", symbol="J_y", text="body pitch inertia", start=1060.0, positive=True),
        Quantity(name="Jz", unit="kg.m2", symbol="J_z", text="body yaw inertia", start=1090.0, positive=True),
        Quantity(name="J2", unit="kg.m2", symbol=r"J_{z\psi_2}", text="rear beam roll inertia", start=3.0, low=0.0),
        Quantity(name="c1", unit="N/m", symbol="c_1", text="front strut stiffness, each", start=15000.0, low=0.0),
        Quantity(name="c2", unit="N/m", symbol="c_2", text="rear strut stiffness, each", start=14000.0, low=0.0),
        Quantity(name="cp1", unit="N/m", symbol="c_{p1}", text="front tyre stiffness", start=160000.0, low=0.0),
        Quantity(name="cp2", unit="N/m", symbol="c_{p2}", text="rear tyre stiffness", start=160000.0, low=0.0),
        Quantity(name="b1", unit="N.s/m", symbol="b_1", text="front strut damping, each", start=1200.0, low=0.0),
        Quantity(name="b2", unit="N.s/m", symbol="b_2", text="rear strut damping, each", start=1100.0, low=0.0),
        Quantity(name="bp1", unit="N.s/m", symbol="b_{p1}", text="front tyre damping", start=0.0, low=0.0, scale=100.0),
        Quantity(name="bp2", unit="N.s/m", symbol="b_{p2}", text="rear tyre damping", start=0.0, low=0.0, scale=100.0),
        Quantity(name="a", unit="m", symbol="a", text="centre of gravity to front axle", start=1.0, low=0.0),
        Quantity(name="b", unit="m", symbol="b", text="centre of gravity to rear axle", start=1.5, low=0.0),
        Quantity(name="s0", unit="m", symbol="s_0", text="half distance of the rear struts", start=0.60, low=0.0),
        Quantity(name="s1", unit="m", symbol="s_1", text="half track, front", start=0.695, low=0.0),
        Quantity(name="s2", unit="m", symbol="s_2", text="half track, rear", start=0.685, low=0.0),
        Quantity(name="h_max", unit="s", symbol="h_{max}", text="longest internal step", start=5e-4, positive=True),
        Quantity(name="A", unit="m", symbol="A", text="amplitude of the road profile", start=0.01),
        Quantity(name="Lambda", unit="m", symbol=r"\Lambda", text="road wave length", start=1.0, positive=True),
        Quantity(name="v0", unit="m/s", symbol="v_0", text="forward speed", start=10.0, positive=True),
        Quantity(name="tau0", unit="s", symbol=r"\tau_0", text="delay of the right side after the left", start=0.02),
        Quantity(
            name="t_start", unit="s", symbol="t_{A1}", text="time at which the front left wheel meets the profile"
        ),
        *(
            Quantity(
                name=f"A_nu[{nu}]",
                unit="m",
                symbol=f"A_{{{nu}}}",
                text=f"Fourier amplitude of sin({nu} Omega t)",
                scale=0.01,
            )
            for nu in range(1, 9)
        ),
        Quantity(
            name="lambda",
            unit="N2/m2",
            symbol=r"\lambda",
            text="weight of heave in the control cost",
            start=1e10,
            low=0.0,
        ),
        Quantity(name="H1", unit="m", symbol="H_1", text="weight of pitch against heave", start=1.0, low=0.0),
        Quantity(name="T", unit="s", symbol="T", text="end of the finite control horizon", start=2.3),
        Quantity(name="t_on", unit="s", symbol="t_{on}", text="start of control if activation = at t_on", start=0.3),
        *FULL_CAR_WEIGHTS,
        *HARDWARE,
    )
}

TABLE: dict[str, Quantity] = {
    q.name: q for q in (*STATES, *ACCELERATIONS, *STRUT_TRAVELS, *TYRE_FORCES, *ROAD, *FORCES, *PARAMETERS.values())
}


class ParameterError(ValueError):
    """Parameters that no component can work with; the message lists every fault."""

    def __init__(self, faults: list[str]) -> None:
        super().__init__("; ".join(faults))
        self.faults = faults


def refuse(faults: Iterable[str | None]) -> None:
    """Raise ParameterError with all faults, if there are any."""
    found = [fault for fault in faults if fault]
    if found:
        raise ParameterError(found)
