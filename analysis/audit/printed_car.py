"""Eqs. (3.1)–(3.7) and the matrix R before them, exactly as printed: same terms, same order, same signs.

Symbols are those of the derivation (dz for ż, ddz for z̈); the print's J_zψ2 is J2, and its m_z, which its own list of
symbols does not have, stays m_z. Nothing here is corrected.
"""

from __future__ import annotations

import sympy as sp
from sympy import cos, sin

from ..derivation import derive

d = derive()
m, m11, m12, m21, m22, m2, Jx, Jy, Jz, J2, c1, c2, cp1, cp2, b1, b2, bp1, bp2, a, b, s0, s1, s2 = d.parameters
z, ψ, φ, z11, z12, z2, ψ2 = d.q
dz, dψ, dφ, dz11, dz12, dz2, dψ2 = d.v
ddz, ddψ, ddφ, ddz11, ddz12, ddz2, ddψ2 = d.a
h11, h12, h21, h22 = d.h
m_z, l = sp.symbols("m_z l", real=True)  # noqa: E741  the paper's letter

NUMBERS = ("3.1", "3.5", "3.6", "3.2", "3.3", "3.4", "3.7")
"""Equation numbers in the order of q = (z, ψ, φ, z11, z12, z2, ψ2), in which EQUATIONS stand."""

NOMENCLATURE = {*d.parameters, l}
"""The list of symbols after (3.7)."""

EQ_3_1 = (
    m * ddz + 2 * (b1 + b2) * dz + 2 * (c1 + c2) * z + 2 * (b2 * b - b1 * a) * cos(φ) * dφ
    - b1 * dz11 - c1 * z11 - b1 * dz12 - c1 * z12 - 2 * b2 * dz2 - 2 * c2 * z2 + 2 * (c2 * b - c1 * a) * sin(φ)
)  # fmt: skip
EQ_3_2 = (
    -b1 * dz - c1 * z - b1 * s1 * cos(ψ) * cos(φ) * dψ
    + b1 * (a * cos(φ) + s1 * sin(ψ) * cos(φ)) * dφ + m11 * ddz11 + b1 * dz11
    + (c1 + cp1) * z11 + c1 * a * sin(φ) - c1 * s1 * sin(ψ) * cos(φ) - cp1 * h11
)  # fmt: skip
EQ_3_3 = (
    -b1 * dz - c1 * z + b1 * s1 * cos(ψ) * cos(φ) * dψ
    + b1 * (a * cos(φ) - s1 * sin(ψ) * cos(φ)) * dφ + m12 * ddz12 + b1 * dz12
    + (c1 + cp1) * z12 + c1 * a * sin(φ) + c1 * s1 * sin(ψ) * cos(φ) - cp1 * h12
)  # fmt: skip
EQ_3_4 = (
    -2 * b2 * dz - 2 * c2 * z - 2 * b2 * b * cos(φ) * dφ + (m21 + m22 + m_z) * ddz2
    + 2 * b2 * dz2 + 2 * (c2 + cp2) * z2 - 2 * c2 * b * sin(φ) - cp2 * h21 - cp2 * h22
)  # fmt: skip
EQ_3_5 = (
    Jx * ddψ + 2 * (b1 * s1**2 + b2 * s0**2) * cos(ψ)**2 * cos(φ)**2 * dψ + (Jy - Jz) * sin(ψ) * cos(ψ) * dφ**2
    - 2 * (b1 * s1**2 + b2 * s0**2) * sin(ψ) * cos(ψ) * sin(φ) * cos(φ) * dφ - b1 * s1 * cos(ψ) * cos(φ) * dz11
    - c1 * s1 * cos(ψ) * cos(φ) * z11 + b1 * s1 * cos(ψ) * cos(φ) * dz12 + c1 * s1 * cos(ψ) * cos(φ) * z12
    - 2 * b2 * s0**2 * cos(ψ) * cos(φ) * cos(ψ2) * dψ2 + 2 * (c1 * s1**2 + c2 * s0**2) * sin(ψ) * cos(ψ) * cos(φ)**2
    + 2 * c2 * s0**2 * cos(ψ) * cos(φ) * sin(ψ2)
)  # fmt: skip
EQ_3_6 = (
    (b2 * b - b1 * a) * cos(φ) * dz + 2 * (c2 * b - c1 * a) * cos(φ) * z
    - 2 * (b1 * s1**2 + b2 * s0**2) * sin(ψ) * cos(ψ) * sin(φ) * cos(φ) * dψ
    - 2 * (Jy - Jz) * sin(ψ) * cos(ψ) * dψ * dφ + (Jy - (Jy - Jz) * sin(ψ)**2) * ddφ
    + 2 * ((b1 * a**2 + b2 * b**2) * cos(φ)**2 + (b1 * s1**2 + b2 * s0**2) * sin(ψ)**2 * sin(φ)**2) * dφ
    + b1 * (a * cos(φ) + s1 * sin(ψ) * sin(φ)) * dz11 + c1 * (a * cos(φ) + s1 * sin(ψ) * sin(φ)) * z11
    + b1 * (a * cos(φ) - s1 * sin(ψ) * sin(φ)) * dz12 + c1 * (a * cos(φ) - s1 * sin(ψ) * sin(φ)) * z12
    - 2 * b2 * b * cos(φ) * dz2 - 2 * c2 * b * cos(φ) * z2 - 2 * b2 * s0**2 * sin(ψ) * sin(φ) * cos(ψ2) * dψ2
    + 2 * (c1 * a**2 + c2 * b**2) * sin(φ) * cos(φ) - 2 * (c1 * s1**2 + c2 * s0**2) * sin(ψ)**2 * sin(φ) * cos(φ)
    - 2 * c2 * s0**2 * sin(ψ) * sin(φ) * sin(ψ2)
)  # fmt: skip
EQ_3_7 = (
    2 * b2 * s0**2 * cos(ψ) * cos(φ) * cos(ψ2) * dψ - 2 * b2 * s0**2 * sin(ψ) * sin(φ) * cos(ψ2) * dφ
    + ((m21 + m22) * s2**2 + J2) * ddψ2 + 2 * b2 * s0**2 * cos(ψ2)**2 * dψ2 + 2 * c2 * s0**2 * sin(ψ) * cos(φ) * cos(ψ2)
    + 2 * (c2 * s0**2 + cp2 * s2**2) * sin(ψ2) * cos(ψ2) - cp2 * s2 * (h21 - h22) * cos(ψ2)
)  # fmt: skip
EQUATIONS = sp.Matrix([EQ_3_1, EQ_3_5, EQ_3_6, EQ_3_2, EQ_3_3, EQ_3_4, EQ_3_7])

R = sp.Matrix([
    [cos(φ), sin(ψ) * sin(φ), cos(ψ) * sin(φ)],
    [0, cos(ψ), -sin(ψ)],
    [-sin(φ), sin(ψ) * cos(φ), cos(ψ) * cos(φ)],
])  # fmt: skip
"""In the print e = R i, e the base vectors of the body, i the fixed ones."""
