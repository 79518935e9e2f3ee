"""The transcription of (3.1)–(3.7), R and (4.1) against the paper's own typesetting, read by a small reader of TeX."""

from __future__ import annotations

import re

import pytest
import sympy as sp

from analysis.audit import printed_car, section4
from analysis.audit.differences import derived_equations, differences
from analysis.derivation import derive

TEX = {
    "3.1": r"""m\ddot{z} + 2(b_1 + b_2)\dot{z} + 2(c_1 + c_2)z + 2(b_2b - b_1a) \cos \varphi \dot{\varphi}
        - b_1\dot{z}_{11} - c_1z_{11} - b_1\dot{z}_{12} - c_1z_{12} - 2b_2\dot{z}_2 - 2c_2z_2
        + 2(c_2b - c_1a) \sin \varphi""",
    "3.2": r"""-b_1\dot{z} - c_1z - b_1s_1 \cos \psi \cos \varphi \dot{\psi}
        + b_1(a \cos \varphi + s_1 \sin \psi \cos \varphi) \dot{\varphi} + m_{11}\ddot{z}_{11} + b_1\dot{z}_{11}
        + (c_1 + c_{p1})z_{11} + c_1a \sin \varphi - c_1s_1 \sin \psi \cos \varphi - c_{p1}h_{11}""",
    "3.3": r"""-b_1\dot{z} - c_1z + b_1s_1 \cos \psi \cos \varphi \dot{\psi}
        + b_1(a \cos \varphi - s_1 \sin \psi \cos \varphi) \dot{\varphi} + m_{12}\ddot{z}_{12} + b_1\dot{z}_{12}
        + (c_1 + c_{p1})z_{12} + c_1a \sin \varphi + c_1s_1 \sin \psi \cos \varphi - c_{p1}h_{12}""",
    "3.4": r"""-2b_2\dot{z} - 2c_2z - 2b_2b \cos \varphi \dot{\varphi} + (m_{21} + m_{22} + m_z)\ddot{z}_2
        + 2b_2\dot{z}_2 + 2(c_2 + c_{p2})z_2 - 2c_2b \sin \varphi - c_{p2}h_{21} - c_{p2}h_{22}""",
    "3.5": r"""J_x\ddot{\psi} + 2(b_1s_1^2 + b_2s_0^2) \cos^2 \psi \cos^2 \varphi \dot{\psi}
        + (J_y - J_z) \sin \psi \cos \psi \dot{\varphi}^2
        - 2(b_1s_1^2 + b_2s_0^2) \sin \psi \cos \psi \sin \varphi \cos \varphi \dot{\varphi}
        - b_1s_1 \cos \psi \cos \varphi \dot{z}_{11} - c_1s_1 \cos \psi \cos \varphi z_{11}
        + b_1s_1 \cos \psi \cos \varphi \dot{z}_{12} + c_1s_1 \cos \psi \cos \varphi z_{12}
        - 2b_2s_0^2 \cos \psi \cos \varphi \cos \psi_2 \dot{\psi}_2
        + 2(c_1s_1^2 + c_2s_0^2) \sin \psi \cos \psi \cos^2 \varphi + 2c_2s_0^2 \cos \psi \cos \varphi \sin \psi_2""",
    "3.6": r"""(b_2 b - b_1 a) \cos \varphi \dot{z} + 2(c_2 b - c_1 a) \cos \varphi z
        - 2(b_1 s_1^2 + b_2 s_0^2) \sin \psi \cos \psi \sin \varphi \cos \varphi \dot{\psi}
        - 2(J_y - J_z) \sin \psi \cos \psi \dot{\psi} \dot{\varphi} + [J_y - (J_y - J_z) \sin^2 \psi] \ddot{\varphi}
        + 2[(b_1 a^2 + b_2 b^2) \cos^2 \varphi + (b_1 s_1^2 + b_2 s_0^2) \sin^2 \psi \sin^2 \varphi] \dot{\varphi}
        + b_1(a \cos \varphi + s_1 \sin \psi \sin \varphi) \dot{z}_{11}
        + c_1(a \cos \varphi + s_1 \sin \psi \sin \varphi) z_{11}
        + b_1(a \cos \varphi - s_1 \sin \psi \sin \varphi) \dot{z}_{12}
        + c_1(a \cos \varphi - s_1 \sin \psi \sin \varphi) z_{12}
        - 2b_2 b \cos \varphi \dot{z}_2 - 2c_2 b \cos \varphi z_2
        - 2b_2 s_0^2 \sin \psi \sin \varphi \cos \psi_2 \dot{\psi}_2
        + 2(c_1 a^2 + c_2 b^2) \sin \varphi \cos \varphi
        - 2(c_1 s_1^2 + c_2 s_0^2) \sin^2 \psi \sin \varphi \cos \varphi
        - 2c_2 s_0^2 \sin \psi \sin \varphi \sin \psi_2""",
    "3.7": r"""2b_2 s_0^2 \cos \psi \cos \varphi \cos \psi_2 \dot{\psi}
        - 2b_2 s_0^2 \sin \psi \sin \varphi \cos \psi_2 \dot{\varphi}
        + [(m_{21} + m_{22}) s_2^2 + J_{z\psi_2}] \ddot{\psi}_2 + 2b_2 s_0^2 \cos^2 \psi_2 \dot{\psi}_2
        + 2c_2 s_0^2 \sin \psi \cos \varphi \cos \psi_2
        + 2(c_2 s_0^2 + c_{p2} s_2^2) \sin \psi_2 \cos \psi_2 - c_{p2} s_2 (h_{21} - h_{22}) \cos \psi_2""",
}
R = r"""\cos \varphi & \sin \psi \sin \varphi & \cos \psi \sin \varphi \\ 0 & \cos \psi & -\sin \psi \\
    -\sin \varphi & \sin \psi \cos \varphi & \cos \psi \cos \varphi"""
A_ROW_3 = "-(c_1 + c_2) & -(ac_1 - bc_2) & -(b_1 + b_2) & -(ab_1 - bb_2)"  # all over m
A_ROW_4 = "-(ac_1 + bc_2) & -(a^2c_1 - b^2c_2) & -(ab_1 - bb_2) & -(a^2b_1 + b^2b_2)"  # all over J
C_ROW_4 = r"ac_1z_A - bc_2z_B + ab_1\dot{z}_A - bb_2\dot{z}_B"  # over J

NAME = r"J_\{z\\psi_2\}|\\(?:psi|varphi)(?:_2)?|[a-zA-Z](?:_(?:\{\w+\}|\w))?"
TOKEN = re.compile(
    rf"\s*(?:(?P<trig>\\(?:sin|cos))(?P<square>\^2)?\s*(?P<angle>\\psi_2|\\psi|\\varphi)"
    rf"|\\(?P<dots>d?dot)\{{(?P<base>z|\\psi|\\varphi)\}}(?P<index>_(?:\{{\w+\}}|\w))?"
    rf"|(?P<name>{NAME})|(?P<number>\d)|\^(?P<power>\d)|(?P<mark>[-+()\[\]]))"
)


def plain_name(tex: str) -> str:
    """The derivation's name of a symbol in TeX."""
    tex = "J2" if tex == r"J_{z\psi_2}" else tex
    return re.sub(r"[\\{}]", "", tex).replace("var", "").replace("_", "") if tex != "m_z" else tex


def read(tex: str, symbols: dict[str, sp.Symbol]) -> sp.Expr:
    """The expression that this TeX sets; factors stand side by side."""
    text, place, factor_before = "", 0, False
    while place < len(tex.rstrip()):
        found = TOKEN.match(tex, place)
        assert found, tex[place:]
        place, g = found.end(), found.groupdict()
        if g["power"] or (g["mark"] and g["mark"] in ")]"):
            text, factor_before = text + (f"**{g['power']}" if g["power"] else ")"), True
            continue
        if g["mark"] and g["mark"] in "+-":
            text, factor_before = text + g["mark"], False
            continue
        text += "*" if factor_before else ""
        if g["mark"]:
            text, factor_before = text + "(", False
            continue
        if g["trig"]:
            text += f"{g['trig'][1:]}({plain_name(g['angle'])})" + ("**2" if g["square"] else "")
        elif g["dots"]:
            text += ("d" if g["dots"] == "dot" else "dd") + plain_name(g["base"] + (g["index"] or ""))
        else:
            text += plain_name(g["name"]) if g["name"] else g["number"]
        factor_before = True
    return sp.sympify(text, locals=symbols)


def car_symbols() -> dict[str, sp.Symbol]:
    d = derive()
    return {s.name: s for s in [*d.parameters, *d.q, *d.v, *d.a, *d.h, printed_car.m_z]}


@pytest.mark.parametrize("number", TEX)
def test_each_equation_is_transcribed_as_printed(number: str) -> None:
    transcribed = printed_car.EQUATIONS[printed_car.NUMBERS.index(number)]
    printed = read(TEX[number], car_symbols())
    assert printed == transcribed  # the same terms in the same brackets, not only the same function


def test_r_is_transcribed_as_printed() -> None:
    rows = [[read(entry, car_symbols()) for entry in row.split("&")] for row in R.split(r"\\")]
    assert sp.Matrix(rows) == printed_car.R


def test_the_half_car_is_transcribed_as_printed() -> None:
    known = {s.name: s for s in (*section4.SYMBOLS, *section4.ROAD)}
    road = dict(zip(("zA", "zB", "dzA", "dzB"), section4.ROAD, strict=True))
    for row, tex, divisor in ((2, A_ROW_3, section4.m), (3, A_ROW_4, section4.J)):
        printed = [read(entry, known) / divisor for entry in tex.split("&")]
        assert [sp.expand(x) for x in printed] == [sp.expand(x) for x in section4.A_PRINTED.row(row)]
    assert sp.expand(read(C_ROW_4, {**known, **road}) / section4.J - section4.C_PRINTED[3]) == 0


@pytest.mark.parametrize("convention", ["A", "B"])
def test_the_changes_turn_the_print_into_the_derivation(convention: str) -> None:
    corrected = sp.Matrix(printed_car.EQUATIONS)
    for change in differences(convention):
        corrected[change.row] += change.derived - change.printed
    off = corrected - derived_equations(convention)
    assert [sp.simplify(sp.expand(x)) for x in off] == [0] * 7


@pytest.mark.parametrize("row", range(7))
def test_a_new_misprint_would_be_found(row: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """From right equations, none; from one with a sign turned, that one, whichever term it is."""
    right = sp.Matrix(derived_equations("A"))
    monkeypatch.setattr(printed_car, "EQUATIONS", right)
    assert differences.__wrapped__("A") == ()
    for term in sp.Add.make_args(sp.expand(right[row]))[::12]:
        wrong = right.copy()
        wrong[row] -= 2 * term
        monkeypatch.setattr(printed_car, "EQUATIONS", wrong)
        (found,) = differences.__wrapped__("A")
        assert found.row == row and sp.simplify(found.printed - found.derived + 2 * term) == 0
