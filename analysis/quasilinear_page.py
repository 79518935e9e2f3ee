"""The footnote of §3.2 as a page of Markdown: every coefficient of the quasi-linear equations, formula and number."""

from __future__ import annotations

from collections.abc import Sequence

from fmu_src.quantities import ACCELERATIONS, POSITIONS, Quantity

from .figures import readable
from .quasilinear import FACTORS, TERMS, Quasilinear, Tensor, symbolic

LETTERS = {"v": r"\dot q", "u": "u", "h": "h", "dh": r"\dot h", "q": "q"}
BARRED = ("b_ij", "c_ij", "d_ij", "m_ijkl", "b_ijkl", "c_ijkl")  # as in the print, which writes d_ijkl without a bar
ABOUT = {
    "b_ij": "Damping.",
    "c_ij": "Stiffness.",
    "d_ij": "Excitation by the road's heights, $Q(t)$.",
    "e_ij": "Excitation by the road's rates; not in the paper, whose tyres have no dampers.",
    "g_ij": "Actuators; not in the paper's §3.",
    "m_ijkl": "Inertia: gyroscopic terms of $J_y - J_z$.",
    "b_ijkl": "Cubic damping.",
    "c_ijkl": "Cubic stiffness. The paper leaves it out.",
    "d_ijkl": "Parametric excitation, $P(t, x)$, by the road's heights.",
    "e_ijkl": "Parametric excitation by the road's rates; not in the paper.",
    "g_ijkl": "Actuators; not in the paper.",
}

PROOF = """\
Names and shares after the kinetic energy of the motion. Each eigenvalue is proved, by ball arithmetic from the exact
parameters, to lie in a disc of the radius given; its centre is rounded here.
"""
CONVENTION = """\
Roads $h$ and actuators $u$ are numbered front left, front right, rear left, rear right. A tensor is symmetric in the
indices that belong to factors of the same kind; of equal entries one is listed, with their number. The coefficient of
the product in the equation is sign × number × entry. There are no other products up to third order, and none of second.
"""


def page(title: str, command: str, numbers: Quasilinear, modes: Sequence[Sequence[str]], picture: str) -> str:
    """The page for one car: its tensors beside the general formulas, and the table and picture of its modes."""
    formulas = symbolic()
    return "\n".join(
        [
            f"# Quasi-linear equations and modes: {title}",
            "",
            f"Made by `{command}`. Equation numbers are the paper's; SI units.",
            "",
            *_introduction(),
            "## Modes, (3.11)–(3.12)",
            "",
            *_table(modes),
            "",
            f"The same command draws the car in its seven modes, into the folder that it is given: `{picture}`; the "
            "repository holds this page alone.",
            "",
            PROOF,
            *(line for name in TERMS for line in _section(name, formulas[name], numbers[name])),
        ]
    )


def _introduction() -> list[str]:
    linear = " ".join(f"{_sign(name)} {_product(name)}" for name in TERMS if len(TERMS[name][0]) == 1)
    cubic = " ".join(f"{_sign(name)} {_product(name)}" for name in TERMS if len(TERMS[name][0]) == 3)
    coordinates = [(f"{i}", f"${q.symbol}$", f"`{q.name}`", q.unit) for i, q in enumerate(POSITIONS, start=1)]
    return [
        f"$$\\ddot q_i = {linear} {cubic} + O(5)$$",
        "",
        *_table([("index", "$q$", "variable of the FMU", "unit"), *coordinates]),
        "",
        CONVENTION,
    ]


def _section(name: str, formulas: Tensor, numbers: Tensor) -> list[str]:
    from sympy import latex

    body = [("entry", "in the equation of", "multiplies", "number", "formula", "value")]
    for index, expression in formulas.entries.items():
        body.append(
            (
                f"${_letter(name)}_{{{''.join(str(n + 1) for n in index)}}}$",
                f"${ACCELERATIONS[index[0]].symbol}$",
                f"${' '.join(q.symbol for q in _factors(formulas, index))}$",
                str(len(formulas.arrangements(index))),
                f"${latex(expression)}$",
                readable(numbers.entries.get(index, 0.0), 6),
            )
        )
    return [f"## ${_product(name)}$", "", ABOUT[name], "", *_table(body), ""]


def _factors(tensor: Tensor, index: tuple[int, ...]) -> list[Quantity]:
    return [FACTORS[kind][j] for kind, j in zip(tensor.kinds, index[1:], strict=True)]


def _letter(name: str) -> str:
    return rf"\bar {name[0]}" if name in BARRED else name[0]


def _sign(name: str) -> str:
    return "+" if TERMS[name][1] > 0 else "-"


def _product(name: str) -> str:
    factors = " ".join(f"{LETTERS[kind]}_{letter}" for kind, letter in zip(TERMS[name][0], "jkl", strict=False))
    return f"{_letter(name)}_{{{name[2:]}}} {factors}"


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    head, *body = ("| " + " | ".join(row) + " |" for row in rows)
    return [head, "|" + "---|" * len(rows[0]), *body]
