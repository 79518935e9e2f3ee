"""The car's modes of vibration: what moves in each, and by which name it goes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from fmu_src.vehicle.linear import masses
from fmu_src.vehicle.parameters import Car

from .car import car_form, exact_A
from .methods.modes import Complex, Enclosures, Modes, enclosures, modes
from .methods.polynomials import Array

MOTIONS = (
    "heave",
    "roll",
    "pitch",
    "front wheel hop, in phase",
    "front wheel hop, opposite",
    "rear axle hop",
    "rear axle tramp",
)
"""Names of modes, after the motion that has the largest part in their energy; in the order of `energy_shares`."""


@dataclass(frozen=True, slots=True)
class CarModes:
    """Modes of a car with proved discs for their eigenvalues; the seven modes are the first seven of the paper's order.

    shares : (7 modes, 7 motions), each row with the sum 1.
    """

    modes: Modes
    discs: Enclosures
    names: tuple[str, ...]
    shares: Array

    def pair(self, k: int) -> tuple[complex, complex]:
        """The two eigenvalues of the mode k [1/s]; a real part that its disc does not tell from 0 is 0."""
        both = [k, k + 7]
        real = np.where(
            np.abs(self.discs.centres[both].real) > self.discs.radii[both], self.discs.centres[both].real, 0.0
        )
        first, second = (real + 1j * self.discs.centres[both].imag).tolist()
        return first, second

    def words(self, k: int) -> str:
        """Damped frequency and damping ratio of the mode k, or the rates at which an aperiodic pair decays."""
        value, other = self.pair(k)
        if value.imag:
            return f"{value.imag / (2.0 * np.pi):.3f} Hz, ζ = {0.0 - value.real / abs(value):.3f}".replace("-", "−")
        return f"aperiodic, {0.0 - value.real:.4g} and {0.0 - other.real:.4g} 1/s".replace("-", "−")


def car_modes(car: Car) -> CarModes:
    """Modes of the uncontrolled car at rest, (3.11). Raises InputError if A has no full set of eigenvectors."""
    found = modes(car_form(car, order=1).A)
    shares = energy_shares(car, found.K[:7, :7])
    return CarModes(found, enclosures(exact_A(car), found.eigenvalues), _names(shares), shares)


def energy_shares(car: Car, shapes: Array | Complex) -> Array:
    """Parts (k, 7) of z, ψ, φ, z11 and z12 in phase and opposite, z2, ψ2 in the kinetic energy of k shapes (7, k).

    The mass matrix at rest is diagonal, so that coordinates share the energy out; the two front wheels' part is split
    by rotating their mass-weighted amplitudes by 45°.
    """
    weighted = np.sqrt(masses(car))[:, None] * shapes
    left, right = weighted[3], weighted[4]
    weighted[3], weighted[4] = (left + right) / np.sqrt(2.0), (left - right) / np.sqrt(2.0)
    energies = np.abs(weighted.T) ** 2
    return energies / energies.sum(axis=1, keepdims=True)


def _names(shares: Array) -> tuple[str, ...]:
    """A name for each mode, none twice, so that the named motions together have the largest part in the energies."""
    table = shares.tolist()
    chosen = max(permutations(range(7)), key=lambda order: sum(row[i] for row, i in zip(table, order, strict=True)))
    return tuple(MOTIONS[i] for i in chosen)
