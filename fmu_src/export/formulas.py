r"""HTML of formulas, from the little LaTeX that the table of quantities and the templates are written in.

Known are indices and exponents, \dot and \ddot, \frac, \text, Greek letters, and the signs and functions listed here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

GREEK = {
    "psi": "ψ", "varphi": "φ", "Lambda": "Λ", "lambda": "λ", "tau": "τ", "Delta": "Δ", "beta": "β", "sigma": "σ",
    "Omega": "Ω", "nu": "ν", "pi": "π", "chi": "χ",
}  # fmt: skip
SIGNS = {
    "cdot": "·", "pm": "±", "leq": "≤", "geq": "≥", "infty": "∞", "sum": "∑", "int": "∫", "quad": "\u2003",
    "times": "×", ",": "\u2009", ";": " ", "in": "∈", "sin": "sin\u2009", "cos": "cos\u2009", "max": "max\u2009",
}  # fmt: skip
ACCENTS = {"dot": "\u0307", "ddot": "\u0308"}
TOKEN = re.compile(r"\\[A-Za-z]+|\\.|&\w+;|\s+|.", re.DOTALL)


def formula(latex: str) -> str:
    """HTML of one formula; what is escaped for HTML already stays so. Raises ValueError for a command not known."""
    written = _group(iter(TOKEN.findall(latex)))
    return re.sub("\u2009(<sup>.*?</sup>)", "\\1\u2009", written)  # the space after cos in cos²x goes behind the ²


def with_formulas(page: str) -> str:
    """The page with what stands between $ $ written inline, and between $$ $$ displayed."""
    shown = re.sub(
        r"\$\$(.+?)\$\$", lambda m: f'<span class="eq">{formula(m[1].strip())}</span>', page, flags=re.DOTALL
    )
    return re.sub(r"\$(.+?)\$", lambda m: f'<span class="m">{formula(m[1])}</span>', shown, flags=re.DOTALL)


def _group(tokens: Iterator[str]) -> str:
    """HTML of all up to the brace that closes, or the end."""
    written = []
    for token in tokens:
        if token == "}":
            break
        written.append(_item(token, tokens))
    return "".join(written)


def _item(token: str, tokens: Iterator[str]) -> str:
    """HTML of this token and the arguments that it takes."""

    def argument() -> str:
        following = next(tokens, "")
        return _item(next(tokens, "") if following.isspace() else following, tokens)

    if token == "{":
        return _group(tokens)
    if token in "_^":
        tag = {"_": "sub", "^": "sup"}[token]
        return f"<{tag}>{argument()}</{tag}>"
    if token.startswith("\\"):
        return _command(token[1:], argument)
    if token.isalpha() and token.isascii():
        return f"<i>{token}</i>"
    return {"-": "−", "'": "′"}.get(token, token)


def _command(name: str, argument: Callable[[], str]) -> str:
    if name in GREEK:
        return f"<i>{GREEK[name]}</i>"
    if name in SIGNS:
        return SIGNS[name]
    if name in ACCENTS:
        return argument().replace("</i>", ACCENTS[name] + "</i>", 1)
    if name == "frac":
        return f'<span class="frac"><span>{argument()}</span><span>{argument()}</span></span>'
    if name == "text":
        return re.sub(r"</?i>", "", argument())
    raise ValueError(f"\\{name}: not a command that is known here")
