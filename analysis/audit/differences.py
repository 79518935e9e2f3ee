"""Printed minus derived, term by term: the misprints of (3.1)–(3.7), found by algebra.

Both sides are expanded over one basis (cos² → 1 − sin²) in which equal functions have equal coefficients, so the
difference is zero exactly if the equations agree. What is left is grouped into the changes that an editor would make.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import sympy as sp

from ..derivation import derive
from . import printed_car

SIGNS = {"A": sp.eye(7), "B": sp.diag(1, 1, 1, 1, 1, 1, -1)}
"""Coordinates of a convention from those of the derivation: A, ψ2 positive like ψ; B, ψ2 opposite."""

CONVENTION = "B"  # the one that is reported, as it needs the fewer changes of the print; a test asserts that it does

Term = tuple[sp.Expr, sp.Expr, sp.Expr]  # parameters, trigonometric functions, motion or road


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One change to a printed equation: `printed` is to be replaced by `derived`; both are parts of its left side."""

    row: int  # of q
    printed: sp.Expr
    derived: sp.Expr

    @property
    def equation(self) -> str:
        return f"({printed_car.NUMBERS[self.row]})"


@cache
def derived_equations(convention: str) -> sp.Matrix:
    """The seven left sides by the energies, without actuators and tyre dampers, in the convention's coordinates."""
    d, sign = derive(), SIGNS[convention]
    swap = {old: new for vector in (d.q, d.v, d.a) for old, new in zip(vector, sign * vector, strict=True)}
    absent = dict.fromkeys([*d.f, printed_car.bp1, printed_car.bp2], sp.S.Zero)
    return sign * d.equations.xreplace(absent).xreplace(swap)


@cache
def differences(convention: str) -> tuple[Difference, ...]:
    """All changes that make the printed equations those of the energies, in the order of the equations' numbers."""
    found = []
    for row, (printed, derived) in enumerate(zip(printed_car.EQUATIONS, derived_equations(convention), strict=True)):
        left, right = _terms(printed), _terms(derived)
        wrong = [term for term in {**left, **right} if left.get(term, 0) != right.get(term, 0)]
        for group in _changes(wrong):
            found.append(Difference(row=row, printed=_sum(left, group), derived=_sum(right, group)))
    return tuple(sorted(found, key=lambda f: (f.equation, sp.default_sort_key(f.printed))))


def _terms(equation: sp.Expr) -> dict[Term, sp.Expr]:
    """Coefficient of each product parameters · sines and cosines · motion in the expanded equation."""
    cosines = {f: f.args[0] for f in equation.atoms(sp.cos)}
    powers = sp.expand(equation).replace(
        lambda e: e.is_Pow and e.base in cosines and e.exp.is_Integer and e.exp >= 2,
        lambda e: (1 - sp.sin(cosines[e.base]) ** 2) ** (e.exp // 2) * e.base ** (e.exp % 2),
    )
    d = derive()
    parameters, motion = {*d.parameters, printed_car.m_z}, {*d.q, *d.v, *d.a, *d.h}
    terms: dict[Term, sp.Expr] = {}
    for product in sp.Add.make_args(sp.expand(powers)):
        number, rest = product.as_coeff_Mul()
        by_parameters, functions = rest.as_independent(*motion, as_Add=False)
        moving = sp.Mul(*(f for f in sp.Mul.make_args(functions) if f.as_base_exp()[0] in motion))
        if by_parameters.free_symbols - parameters:
            raise ArithmeticError(f"{product}: symbols of neither the car nor its motion")
        term = (by_parameters, functions / moving, moving)
        terms[term] = terms.get(term, sp.S.Zero) + number
    return {term: number for term, number in terms.items() if number}


def _changes(terms: list[Term]) -> list[list[Term]]:
    """Terms on the same motion that share their parameters or their functions are one change; so are those of h."""
    groups: list[list[Term]] = []
    for term in terms:
        joined = [group for group in groups if any(_together(term, other) for other in group)]
        groups = [group for group in groups if group not in joined] + [[term, *(t for g in joined for t in g)]]
    return groups


def _together(one: Term, other: Term) -> bool:
    road = {*derive().h}
    same_motion = one[2] == other[2] or {one[2], other[2]} <= road
    return same_motion and (one[0] == other[0] or one[1] == other[1])


def _sum(coefficients: dict[Term, sp.Expr], terms: Iterable[Term]) -> sp.Expr:
    return sp.factor_terms(sp.factor(sum((coefficients.get(t, 0) * t[0] * t[1] * t[2] for t in terms), sp.S.Zero)))


# ------------------------------------------------------------------ for reading
DOTS = {"dd": "\N{COMBINING DIAERESIS}", "d": "\N{COMBINING DOT ABOVE}", "": ""}


def plain(expression: sp.Expr) -> str:
    """An expression in the paper's letters, in one line of text."""
    if isinstance(expression, sp.Add):
        return " + ".join(map(plain, expression.args)).replace("+ −", "− ")
    number, product = expression.as_coeff_Mul()
    sign, size = ("−" if number < 0 else ""), abs(number)
    factors = [_factor(f) for f in sorted(sp.Mul.make_args(product), key=_place)]
    shown = [str(size)] if size != 1 or product == 1 else []
    return sign + " ".join(shown + [f for f in factors if f != "1"])


def _place(factor: sp.Expr) -> tuple[int, str]:
    """Parameters first, then sines and cosines, then the motion, as the paper has it."""
    base = factor.as_base_exp()[0]
    moving = base in {*derive().q, *derive().v, *derive().a, *derive().h}
    kind = 3 if moving else 2 if base.is_Function else 1 if isinstance(factor, sp.Add) and not base.has(sp.sin) else 0
    return (3 if isinstance(factor, sp.Add) and base.free_symbols & {*derive().h} else kind), str(factor)


def _factor(factor: sp.Expr) -> str:
    base, power = factor.as_base_exp()
    raised = "" if power == 1 else f"^{power}"
    if isinstance(base, sp.Add):
        return f"({plain(base)}){raised}"
    text = str(base).replace("psi", "ψ").replace("phi", "φ")
    text = re.sub(r"^(dd|d)([zψφ])", lambda found: found[2] + DOTS[found[1]], text)
    return re.sub(r"^(sin|cos)\((.+)\)$", rf"\1{raised} \2", text) if base.is_Function else text + raised
