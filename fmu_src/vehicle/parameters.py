"""The car's parameters (nomenclature after Eq. (3.7)), SI units, checked as a whole."""

from __future__ import annotations

from dataclasses import dataclass, fields

from ..quantities import PARAMETERS, refuse


def _default(name: str) -> float:
    return PARAMETERS[name].start


@dataclass(frozen=True, slots=True, kw_only=True)
class Car:
    """The 24 numbers of the car; units and words in `quantities.PARAMETERS`.

    The defaults are representative of a small front-driven car, not the paper's own (its data are not public).
    Struts and tyres are per wheel. Raises ParameterError with every fault.
    """

    m: float = _default("m")
    m11: float = _default("m11")
    m12: float = _default("m12")
    m21: float = _default("m21")
    m22: float = _default("m22")
    m2: float = _default("m2")
    Jx: float = _default("Jx")
    Jy: float = _default("Jy")
    Jz: float = _default("Jz")
    J2: float = _default("J2")
    c1: float = _default("c1")
    c2: float = _default("c2")
    cp1: float = _default("cp1")
    cp2: float = _default("cp2")
    b1: float = _default("b1")
    b2: float = _default("b2")
    bp1: float = _default("bp1")
    bp2: float = _default("bp2")
    a: float = _default("a")
    b: float = _default("b")
    s0: float = _default("s0")
    s1: float = _default("s1")
    s2: float = _default("s2")

    def __post_init__(self) -> None:
        faults = [PARAMETERS[f.name].fault(getattr(self, f.name)) for f in fields(self)]
        if self.a + self.b == 0:
            faults.append("a + b = 0.0 m: wanted a wheelbase > 0")
        if self.m21 != self.m22:
            faults.append(
                f"m21 = {self.m21!r} kg, m22 = {self.m22!r} kg: wanted equal masses (Eqs. (3.4) and (3.7) hold only "
                "for an axle whose centre of gravity lies in its middle)"
            )
        if (self.m21 + self.m22) * self.s2**2 + self.J2 == 0:
            faults.append("(m21 + m22) s2^2 + J2 = 0.0 kg.m2: wanted a rear axle with roll inertia > 0")
        refuse(faults)
