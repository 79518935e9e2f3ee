"""Quasi-linearization (§3.2): the tensors of (3.9) expanded to third order, for numbers or for symbols, and (3.10).

    q̈_i + b_ij q̇_j + c_ij q_j − d_ij h_j [− e_ij ḣ_j − g_ij u_j]
        = m_ijkl q̇_j q̇_k q_l − b_ijkl q̇_j q_k q_l − c_ijkl q_j q_k q_l
        + d_ijkl h_j q_k q_l [+ e_ijkl ḣ_j q_k q_l + g_ijkl u_j q_k q_l]

(bars left out). The print drops c_ijkl, the cubic stiffness, which is of the same order as what it keeps and on the
paper's bump the largest term of all; it writes the b-term with q̇_j q̇_k q_l. Not in the print, whose tyres have no
dampers and whose struts have no actuators, are e (rates of the road) and g (actuator forces). There are no other
monomials of degree ≤ 3, and none of degree 2.

Convention: a tensor is symmetric in those indices that belong to factors of the same kind, which makes it unique: m in
jk; b, d, e, g of four indices in kl; c in jkl. So the coefficient of a monomial in q̈_i is the entry times the number of
its different arrangements, up to the sign above. Indices count from 0 in code, from 1 where tensors are printed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from itertools import permutations, product
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_src.quantities import FORCES, PARAMETERS, POSITIONS, RATES, ROAD_HEIGHTS, ROAD_RATES, Quantity
from fmu_src.vehicle.equations import equations_of_motion
from fmu_src.vehicle.parameters import Car

from .car import car_form
from .methods.polynomials import Array
from .methods.power_series import Monomial, cos, sin, variables
from .methods.standard_form import StandardForm, only

FACTORS: dict[str, tuple[Quantity, ...]] = {
    "v": RATES,
    "u": FORCES,
    "h": ROAD_HEIGHTS,
    "dh": ROAD_RATES,
    "q": POSITIONS,
}
"""What tensors are contracted with, by kind, in the order in which the indices j, k, l stand for them."""

TERMS: dict[str, tuple[tuple[str, ...], int]] = {
    "b_ij": (("v",), -1),
    "c_ij": (("q",), -1),
    "d_ij": (("h",), 1),
    "e_ij": (("dh",), 1),
    "g_ij": (("u",), 1),
    "m_ijkl": (("v", "v", "q"), 1),
    "b_ijkl": (("v", "q", "q"), -1),
    "c_ijkl": (("q", "q", "q"), -1),
    "d_ijkl": (("h", "q", "q"), 1),
    "e_ijkl": (("dh", "q", "q"), 1),
    "g_ijkl": (("u", "q", "q"), 1),
}
"""Kinds of the factors of each tensor, and its sign on the right-hand side of q̈_i = …"""

_ORDER = ("q", "v", "u", "h", "dh")  # of the expansion's variables
_VARIABLES = [(kind, j) for kind in _ORDER for j in range(len(FACTORS[kind]))]
_OF_KINDS = {kinds: (name, sign) for name, (kinds, sign) in TERMS.items()}


@dataclass(frozen=True, slots=True)
class Tensor:
    """Sparse: entries by (i, j, …), of equal ones the arrangement with rising indices; SI units."""

    kinds: tuple[str, ...]
    entries: Mapping[tuple[int, ...], Any]

    def arrangements(self, index: tuple[int, ...]) -> list[tuple[int, ...]]:
        """All different (i, j, …) whose entries are equal to this one by symmetry."""
        groups = [[j for kind, j in zip(self.kinds, index[1:], strict=True) if kind == k] for k in FACTORS]
        orders = product(*(sorted(set(permutations(group))) for group in groups))
        return [(index[0], *(j for group in order for j in group)) for order in orders]

    def dense(self) -> NDArray[Any]:
        """The array (7, …), one axis for each index."""
        shape = (len(POSITIONS), *(len(FACTORS[kind]) for kind in self.kinds))
        full = np.zeros(shape, dtype=np.result_type(float, *map(np.asarray, self.entries.values())))
        for index, value in self.entries.items():
            for place in self.arrangements(index):
                full[place] = value
        return full


@dataclass(frozen=True, slots=True)
class Quasilinear:
    """Tensors by name (all of TERMS; one that vanishes has no entries), and what (3.10) makes of them."""

    tensors: Mapping[str, Tensor]

    def __getitem__(self, name: str) -> Tensor:
        return self.tensors[name]

    @property
    def A(self) -> NDArray[Any]:
        """(14, 14)."""
        stiffness, damping = self["c_ij"].dense(), self["b_ij"].dense()
        return np.block([[np.zeros((7, 7), int), np.eye(7, dtype=int)], [-stiffness, -damping]])

    def Q(self, h: Array, dh: Array) -> Array:
        """Q(t) (14, …) [m/s, m/s², …] of road heights h (4, …) [m] and their rates dh (4, …) [m/s]."""
        return _below(self._term("d_ij", h=h) + self._term("e_ij", dh=dh))

    def R(self, x: Array, *, complete: bool = True) -> Array:
        """R(x) (14, …) of states x (14, …); as in the paper, without the cubic stiffness, unless complete."""
        q, v = x[:7], x[7:]
        kept = ("m_ijkl", "b_ijkl", "c_ijkl") if complete else ("m_ijkl", "b_ijkl")
        return _below(sum(self._term(name, q=q, v=v) for name in kept))

    def P(self, h: Array, dh: Array, x: Array) -> Array:
        """P(t, x) (14, …): parametric excitation; shapes as above."""
        return _below(self._term("d_ijkl", q=x[:7], h=h) + self._term("e_ijkl", q=x[:7], dh=dh))

    def _term(self, name: str, **factors: Array) -> Any:
        """One term of the right-hand side of q̈ (7, …), with its sign."""
        kinds, sign = TERMS[name]
        letters = "jkl"[: len(kinds)]
        contraction = f"i{letters}," + ",".join(f"{letter}..." for letter in letters) + "->i..."
        return sign * np.einsum(contraction, self[name].dense(), *(factors[kind] for kind in kinds))


def quasilinear(car: Car) -> Quasilinear:
    """Tensors of this car, in numbers."""
    return _expanded(car, 1.0, lambda value: value)


def symbolic() -> Quasilinear:
    """Tensors of any car, as factored sympy expressions in positive symbols that are written as in the paper."""
    import sympy as sp

    symbols = {f.name: sp.Symbol(PARAMETERS[f.name].symbol, positive=True) for f in fields(Car)}
    return _expanded(SimpleNamespace(**symbols), sp.Integer(1), sp.factor)


def _expanded(car: Any, one: Any, tidy: Callable[[Any], Any]) -> Quasilinear:
    """Expand (3.9) for a car whose parameters are of the kind of `one`; tidy: brings sums that vanish to 0."""
    y = variables(len(_VARIABLES), 3, one)
    q, v, u, h, dh = ([x for x, (kind, _) in zip(y, _VARIABLES, strict=True) if kind == wanted] for wanted in _ORDER)
    accelerations, _, _ = equations_of_motion(car, sin, cos)(q, v, u, h, dh)
    entries: dict[str, dict[tuple[int, ...], Any]] = {name: {} for name in TERMS}
    for i, series in enumerate(accelerations):
        for monomial, coefficient in sorted(series.terms.items()):
            name, index = _place(i, monomial)
            sign = TERMS[name][1]
            count = len(Tensor(TERMS[name][0], {}).arrangements(index))
            value = tidy(coefficient * sign / count)
            if value != 0:
                entries[name][index] = value
    return Quasilinear({name: Tensor(TERMS[name][0], dict(sorted(found.items()))) for name, found in entries.items()})


def quasilinear_form(car: Car, *, complete: bool = True) -> StandardForm:
    """(3.10) in the form (2.1): cubic; without the cubic stiffness, as in the paper, unless complete."""
    form = car_form(car, order=3)
    return form if complete else only(form, lambda monomial: max(monomial) >= len(POSITIONS))


def _place(i: int, monomial: Monomial) -> tuple[str, tuple[int, ...]]:
    """Name of the tensor that a monomial in q̈_i belongs to, and the index (i, j, …) of its entry there."""
    order = list(FACTORS)
    factors = sorted((_VARIABLES[m] for m in monomial), key=lambda factor: (order.index(factor[0]), factor[1]))
    name, _ = _OF_KINDS[tuple(kind for kind, _ in factors)]
    return name, (i, *(j for _, j in factors))


def _below(accelerations: Any) -> Array:
    """Zeros for the rates of q over the accelerations."""
    return np.concatenate([np.zeros_like(accelerations), accelerations])
