"""What is transcribed, (2.10) to (4.1), against the paper's own typesetting, read by a small reader of TeX."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
import sympy as sp

from analysis.audit import assumptions, averaging, modal, oscillator, permanent, printed_car, section4
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
C_ROW_3 = r"c_1z_A + c_2z_B + b_1\dot{z}_A + b_2\dot{z}_B"  # over m
C_ROW_4 = r"ac_1z_A - bc_2z_B + ab_1\dot{z}_A - bb_2\dot{z}_B"  # over J
B_ROWS = r"0 & 0 \\ 0 & 0 \\ -1/m & -1/m \\ -1/J & -1/J"
P_3_17 = r"\frac{\gamma_{k1} A_{\nu}}{\sqrt{(\lambda_k^2 + \nu^2 \Omega^2)}}"
PSI_3_17 = r"\arctan\left(\frac{\nu \Omega}{\lambda_k}\right)"
A_3_20 = r"\frac{1}{2} \sum_{j,k}^{14} \bar{\alpha}_{iijk} \sum_{\nu}^{\infty} P_{j\nu} P_{k\nu}"
B_3_20 = r"\frac{1}{2} \sum_j^{14} \sum_{\nu}^{\infty} (B_{vii} + B_{vij}) P_{j\nu} \cos \psi_{\nu j}"
ALPHA_BAR = (
    r"\alpha_{ijkl} + \alpha_{iklj} + \alpha_{iljk} + \alpha_{ikjl} + \alpha_{ijlk} + \alpha_{ilkj}"  # ≡ 6 α_i(jkl)
)
PAIRS = r"\sum_j^7 \bar{\alpha}_{kkjj+7} s_j s_{j+7}"  # of the amplitude equation
S_1 = r"X^{-1}(t)\Phi[t, X(t)v]"  # its mean, in (2.10)
EQ_2_13 = r"\varepsilon S_1(v) - \varepsilon \frac{\partial w}{\partial v} [\varepsilon S_1(v) + O(v)]"
EQ_2_14 = r"\frac{\partial w}{\partial v} [\varepsilon S_1(v) + O(\varepsilon)]"
EQ_3_8 = r"""\tilde{M}_{ij}(q) \ddot{q}_j - \tilde{M}_{ijk}(q) \dot{q}_j \dot{q}_k = -\tilde{C}_i(q)
        - \tilde{B}_{ij}(q) \dot{q}_j + \tilde{D}_i(q, h)"""

NAME = (
    r"J_\{z\\psi_2\}|A_\{\\nu\}|\\(?:gamma|lambda|nu|Omega)(?:_(?:\{\w+\}|\w))?"
    r"|\\(?:psi|varphi)(?:_2)?|[a-zA-Z](?:_(?:\{\w+\}|\w))?"
)
TOKEN = re.compile(
    rf"\s*(?:(?P<trig>\\(?:sin|cos))(?P<square>\^2)?\s*(?P<angle>\\psi_2|\\psi|\\varphi)"
    rf"|\\(?P<function>root|arctan)"
    rf"|\\(?P<dots>d?dot)\{{(?P<base>z|\\psi|\\varphi)\}}(?P<index>_(?:\{{\w+\}}|\w))?"
    rf"|(?P<name>{NAME})|(?P<number>\d)|\^(?P<power>\d)|(?P<mark>[-+()\[\]/]))"
)


def plain_name(tex: str) -> str:
    """The derivation's name of a symbol in TeX."""
    tex = "J2" if tex == r"J_{z\psi_2}" else tex
    return re.sub(r"[\\{}]", "", tex).replace("var", "").replace("_", "") if tex != "m_z" else tex


def read(tex: str, symbols: dict[str, sp.Symbol]) -> sp.Expr:
    """The expression that this TeX sets; factors stand side by side."""
    tex = re.sub(r"\\sqrt\{(.+)\}\}", r"\\root(\1)}", tex)
    tex = re.sub(r"\\frac\{(.+)\}\{(.+)\}", r"((\1)/(\2))", re.sub(r"\\left|\\right", "", tex))
    text, place, factor_before = "", 0, False
    while place < len(tex.rstrip()):
        found = TOKEN.match(tex, place)
        assert found, tex[place:]
        place, g = found.end(), found.groupdict()
        if g["power"] or (g["mark"] and g["mark"] in ")]"):
            text, factor_before = text + (f"**{g['power']}" if g["power"] else ")"), True
            continue
        if g["mark"] and g["mark"] in "+-/":
            text, factor_before = text + g["mark"], False
            continue
        text += "*" if factor_before else ""
        if g["mark"] or g["function"]:
            text, factor_before = text + {"root": "sqrt", "arctan": "atan"}.get(g["function"], "("), False
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
    known |= dict(zip(("zA", "zB", "dzA", "dzB"), section4.ROAD, strict=True))
    for row, tex, divisor in ((2, A_ROW_3, section4.m), (3, A_ROW_4, section4.J)):
        printed = [read(entry, known) / divisor for entry in tex.split("&")]
        assert [sp.expand(x) for x in printed] == [sp.expand(x) for x in section4.A_PRINTED.row(row)]
    assert sp.expand(read(C_ROW_3, known) / section4.m - section4.C_PRINTED[2]) == 0
    assert sp.expand(read(C_ROW_4, known) / section4.J - section4.C_PRINTED[3]) == 0
    B = [[read(entry, known) for entry in row.split("&")] for row in B_ROWS.split(r"\\")]
    assert sp.Matrix(B) == section4.B_PRINTED


# ------------------------------------------------------------------ §2 and §3.3
INDEXED = re.compile(
    r"\s*(?:(?P<half>\\frac\{1\}\{2\})|(?P<cos>\\cos)|\\sum_(?:\{(?P<over>[^}]+)\}|(?P<one>\w))\^(?:\{(?P<set>[^}]+)\}|(?P<upto>\d))"
    r"|(?P<name>\\bar\{\\alpha\}|\\alpha|\\psi|[PBs])_(?:\{(?P<places>[^}]+)\}|(?P<place>\w))|(?P<mark>[-+()]))"
)


def read_indexed(tex: str, arrays: dict[str, np.ndarray], n: int) -> Callable[..., complex]:
    """The value of an indexed sum for given free indices, for one harmonic ν; 14 stands for n, 7 for n/2."""
    ranges: dict[str, int] = {}
    text, place = "", 0
    while place < len(tex.rstrip()):
        found = INDEXED.match(tex, place)
        assert found, tex[place:]
        place, g = found.end(), found.groupdict()
        if over := g["over"] or g["one"]:
            size = {"14": n, "7": n // 2, r"\infty": 1}[g["set"] or g["upto"]]
            ranges |= dict.fromkeys(over.replace("\\", "").split(","), size)
            continue
        text += "*" if text and text[-1] not in "(+-" and g["mark"] in (None, "(") and not text.endswith("cos") else ""
        if g["name"]:
            marks = re.sub(r"\\nu|v|\s", "", g["places"] or g["place"])  # the print's v is ν
            at = [letter + shift.replace("+7", f"+{n // 2}") for letter, shift in re.findall(r"([a-z])(\+7)?", marks)]
            name = re.sub(r"[\\{}]", "", g["name"]) + (str(len(at)) if g["name"] == "B" else "")
            text += f"({name}[{','.join(at)}])"
        else:
            text += "0.5" if g["half"] else "cos" if g["cos"] else g["mark"]
    names = {**arrays, "cos": np.cos}

    def value(**free: int) -> complex:
        choices = product(*(range(size) for size in ranges.values()))
        return sum(eval(text, names, {**free, **dict(zip(ranges, chosen, strict=True))}) for chosen in choices)

    return value


def test_the_averages_are_transcribed_as_printed() -> None:
    """(3.20) and the sum of the amplitude equation, on a textbook system, each element by itself."""
    x = averaging.textbook(*averaging.QUIET)
    n = len(x.beta)
    arrays = {"alpha": x.alpha, "baralpha": x.alpha_bar, "P": x.P, "psi": x.psi, "B2": x.B2, "B3": x.B3, "s": x.s}
    A, B, bar, pairs = (read_indexed(tex, arrays, n) for tex in (A_3_20, B_3_20, ALPHA_BAR, PAIRS))
    np.testing.assert_allclose(averaging.A_printed(x.alpha_bar, x.P), [A(i=i) for i in range(n)], rtol=1e-12)
    np.testing.assert_allclose(averaging.B_printed(x), [B(i=i) for i in range(n)], rtol=1e-12)
    np.testing.assert_allclose(averaging.pair_sum(x, halved=False), [pairs(k=k) for k in range(n)], rtol=1e-12)
    places = [dict(zip("ijkl", place, strict=True)) for place in product(range(n), repeat=4)]
    np.testing.assert_allclose(x.alpha_bar.ravel(), [bar(**place) for place in places], rtol=1e-12)


def test_the_linear_amplitude_and_phase_are_transcribed_as_printed() -> None:
    names = ("gammak1", "Anu", "lambdak", "nu", "Omega")
    symbols = dict(zip(names, sp.symbols(names), strict=True))
    lam, gain, w = np.array([-1.0 + 9.0j, -0.3 - 4.0j, -2.0 + 0.0j]), np.array([2.0 - 1.0j, 0.5j, 1.0 + 0.0j]), 7.0
    printed = [
        [complex(read(tex, symbols).subs(dict(zip(symbols.values(), (g, 1, l, 1, w), strict=True)))) for tex in both]
        for both in [(P_3_17, PSI_3_17)]
        for l, g in zip(lam, gain, strict=True)  # noqa: E741  λ
    ]
    np.testing.assert_allclose(np.array(printed).T, modal.printed_amplitude(lam, gain, w), rtol=1e-12)


def test_the_averaging_of_2_7_is_transcribed_as_printed() -> None:
    """(2.10) before its mean is taken, (2.13) and what is known of (2.14), at a time and a place, O(·) left out."""
    t, v, epsilon = np.asarray(2.0), permanent.START, 0.03
    product_of = S_1.replace("X^{-1}(t)", "inv(X(t)) @ ").replace(r"\Phi[t, ", "Phi(").replace("X(t)v", "X(t) @ v")
    known = {"X": oscillator.X, "Phi": oscillator.Phi, "inv": np.linalg.inv, "t": t, "v": v}
    printed = eval(product_of.replace("]", ")"), known)
    np.testing.assert_allclose(oscillator.pulled_back(oscillator.S_printed)(t, v), printed, rtol=1e-12)

    def bracket(tex: str) -> np.ndarray:
        words = {
            r"\frac{\partial w}{\partial v} [": "W @ (",
            "]": ")",
            "S_1(v)": "* S_1",
            "O(v)": "0",
            r"O(\varepsilon)": "0",
        }
        for old, new in words.items():
            tex = tex.replace(old, new)
        tex = tex.replace(r"\varepsilon W", "e * W").replace(r"\varepsilon", "e")
        return eval(tex, {"W": slopes, "S_1": oscillator.mean(oscillator.S, v), "e": epsilon})

    def w(at: np.ndarray) -> np.ndarray:
        return oscillator.w(oscillator.S, lambda _, u: oscillator.mean(oscillator.S, u), at, float(t))

    slopes = np.column_stack([(w(v + 1e-4 * e) - w(v - 1e-4 * e)) / 2e-4 for e in np.eye(2)])
    np.testing.assert_allclose(permanent.right_sides(float(t), v, epsilon)[1], bracket(EQ_2_13), rtol=1e-7)
    assert permanent.perturbations(v, epsilon)[1] == pytest.approx(np.linalg.norm(bracket(EQ_2_14)), rel=1e-6)


def test_the_short_form_is_transcribed_as_printed() -> None:
    words = EQ_3_8.replace("(q)", "")
    for name, mark in {
        "tilde": "\N{COMBINING TILDE}",
        "ddot": "\N{COMBINING DIAERESIS}",
        "dot": "\N{COMBINING DOT ABOVE}",
    }.items():
        words = re.sub(rf"\\{name}\{{(\w)\}}", rf"\1{mark}", words)
    words = re.sub(r"\s+", " ", re.sub(r"_\{(\w+)\}", r"_\1", words).replace("-", "−"))
    assert unicodedata.normalize("NFC", words) == unicodedata.normalize("NFC", assumptions.form().printed)


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
