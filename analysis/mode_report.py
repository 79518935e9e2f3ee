"""What `python -m analysis modes` gives: a table, claims, and a folder of modes.json, modes.svg and quasilinear.md."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from fmu_src.quantities import STATES
from fmu_src.vehicle.parameters import Car

from .car import car_form
from .car_modes import MOTIONS, CarModes, car_modes
from .files import write_whole
from .findings import Finding
from .quasilinear import FACTORS, TERMS, Quasilinear, quasilinear
from .quasilinear_page import page

RECORD, PICTURE, PAGE = "modes.json", "modes.svg", "quasilinear.md"
LEAST_SHARE = 0.05  # of the kinetic energy, below which a motion is not named in the table


def claims(found: CarModes) -> list[Finding]:
    """That rest is asymptotically stable, and that no two eigenvalues coincide: both proved in ball arithmetic."""
    discs = found.discs
    right = int(np.count_nonzero(discs.centres.real + discs.radii >= 0.0))
    counts = {
        "every motion of the linear part decays: eigenvalues not proved to lie left of the imaginary axis "
        f"(the rightmost disc ends at {discs.abscissa:.6g} 1/s)": right,
        f"no two eigenvalues coincide: pairs of discs that touch (least gap {discs.gap:.3g} 1/s)": discs.touching,
    }
    source = f"discs around the eigenvalues of A, of radius {discs.radii.max():.1e} 1/s or less"
    return [
        Finding(
            claim=claim,
            equation="(3.11)",
            measured=float(count),
            expected=0.0,
            tolerance=0.0,
            unit="1",
            source=source,
        )
        for claim, count in counts.items()
    ]


def rows(found: CarModes) -> list[tuple[str, ...]]:
    """One row of text for each mode, below HEADINGS."""
    return [
        (
            found.names[k],
            found.words(k),
            _times(*found.pair(k)),
            _pair(*found.pair(k)),
            f"{found.discs.radii[[k, k + 7]].max():.1e}",
            _shares(found, k),
        )
        for k in range(7)
    ]


HEADINGS = ("mode", "damped frequency, damping ratio", "time constant", "eigenvalue [1/s]", "± (proved)", "what moves")


def _times(value: complex, other: complex) -> str:
    """Time constants, in which a motion decays to 1/e."""
    constants = dict.fromkeys(f"{-1.0 / each.real:.4g} s" if each.real else "∞" for each in (value, other))
    return ", ".join(constants)


def _pair(value: complex, other: complex) -> str:
    if value.imag:
        return f"{value.real:.9g} ± {value.imag:.9g} i".replace("-", "−")
    return f"{value.real:.9g}, {other.real:.9g}".replace("-", "−")


def _shares(found: CarModes, k: int) -> str:
    order = np.argsort(-found.shares[k])
    return ", ".join(f"{MOTIONS[i]} {found.shares[k, i]:.0%}" for i in order if found.shares[k, i] >= LEAST_SHARE)


def write(car: Car, found: CarModes, title: str, command: str, folder: Path) -> None:
    """Write the three files into the folder, which is made if need be."""
    from .mode_drawing import draw_modes

    numbers = quasilinear(car)
    text = json.dumps(_record(car, found, numbers), indent=1, ensure_ascii=False) + "\n"
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / RECORD, text.encode())
    write_whole(folder / PICTURE, draw_modes(car, found))
    write_whole(folder / PAGE, page(title, command, numbers, (HEADINGS, *rows(found)), PICTURE).encode())


def _record(car: Car, found: CarModes, numbers: Quasilinear) -> dict[str, Any]:
    """Modes and tensors as plain data; complex numbers as [Re, Im];
    modal_input: K⁻¹ B, (14, 8) for (h, ḣ); tensors as [i, j, …, entry] with indices from 1."""
    modes, discs = found.modes, found.discs

    def plain(values: Any) -> Any:
        return np.stack([values.real, values.imag], axis=-1).tolist()

    return {
        "states": [q.name for q in STATES],
        "factors": {kind: [q.name for q in factors] for kind, factors in FACTORS.items()},
        "eigenvalues": plain(discs.centres),
        "radii": discs.radii.tolist(),
        "stable": discs.abscissa < 0.0,
        "modes": [
            {
                "name": found.names[k],
                "damped_frequency_Hz": discs.centres[k].imag / (2.0 * np.pi),
                "damping_ratio": 0.0 - found.pair(k)[0].real / abs(discs.centres[k]),
                "kinetic_energy": dict(zip(MOTIONS, found.shares[k].tolist(), strict=True)),
            }
            for k in range(7)
        ],
        "K": plain(modes.K),
        "modal_input": plain(modes.input(car_form(car, order=1).B)),
        "tensors": {
            name: {
                "factors": list(kinds),
                "sign": sign,
                "entries": [[*(n + 1 for n in index), value] for index, value in numbers[name].entries.items()],
            }
            for name, (kinds, sign) in TERMS.items()
        },
    }


def run(car: Car, title: str, command: str, folder: Path | None) -> int:
    """Print the table and the verdicts, and write the folder if one is given; 0 if all claims hold, 1 if not."""
    found = car_modes(car)
    table = [HEADINGS, *rows(found)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    verdicts = claims(found)
    for finding in verdicts:
        print(finding.line)
    if folder is not None:
        write(car, found, title, command, folder)
        print(f"{folder}: written")
    return 0 if all(finding.holds for finding in verdicts) else 1
