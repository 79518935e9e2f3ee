"""`python -m analysis conditions`: conditions 1 and 2 after (2.11) for a scenario's car on its road."""

from __future__ import annotations

from ..bertolino_baksa.conditions import Verdict, conditions
from ..car import car_form, road_signal
from ..methods.signals import Piece
from ..reference import Parameters, car_of, road_parameters
from .car_amplitudes import amplitude_lines
from .car_certificates import prove_reference

TITLES = {
    "C0": "conditions 1 and 2 after (2.11), as printed",
    "C1": "averaging, only exp(i beta t) taken out",
    "C2": "normal form of Poincare and Dulac",
    "C3": "proved contraction of the full equations",
}


def car_verdicts(parameters: Parameters) -> tuple[Verdict, ...]:
    """C0 to C3 for the car, passive, with x_lin from rest. Raises InputError for a road that stays at a height."""
    return conditions(car_form(car_of(parameters), order=3), _last(parameters), lambda: prove_reference(parameters))


def _last(parameters: Parameters) -> Piece | None:
    """The road's last piece; None if it is flat."""
    piece = road_signal(road_parameters(parameters)).pieces[-1]
    return piece if piece.amplitudes.any() else None


def command(parameters: Parameters) -> int:
    """Print the verdicts and the amplitudes' table; 0 if the verdict of record, C3's, is that it holds, else 1."""
    verdicts = car_verdicts(parameters)
    for v in verdicts:
        print(f"{v.name}  {'holds' if v.holds else 'fails'}  {v.number:11.4g}  {TITLES[v.name]}")
        print(f"                        {v.reason}")
    print("\n".join(amplitude_lines(parameters, _last(parameters))))
    print(
        f"verdict of record (C3): x_lin {'is' if verdicts[-1].holds else 'is not proved to be'} almost stable for all t"
    )
    return 0 if verdicts[-1].holds else 1
