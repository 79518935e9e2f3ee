"""What certificates print: rounded to the safe side, of the car that they say, never beyond what is proved."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_almost_stable import rehashed
from test_certificates import certified

from analysis.__main__ import main
from analysis.bertolino_baksa.balls import NotProvedError, precision
from analysis.bertolino_baksa.bounded_certificate import certify
from analysis.bertolino_baksa.certificate import Certificate, Claim, to_json
from analysis.bertolino_baksa.proof import Proof
from analysis.certificates import certificate_command
from analysis.certificates.car_bounded_roads import car_gains, flat, heights
from analysis.certificates.car_bounded_roads import statement as of_all_roads
from analysis.certificates.car_certificates import car_norms
from analysis.certificates.certificate_command import statement
from analysis.certificates.certificate_words import model_words, named_by_content, start_words
from analysis.certificates.directed import at_least, at_most
from analysis.certificates.exact_car import norms
from fmu_src.vehicle.parameters import Car


def test_bounds_are_rounded_to_the_side_on_which_they_stay_true() -> None:
    assert (at_most(0.0024634999), at_least(0.0024634999)) == ("0.002464", "0.002463")
    assert (at_most(1.0, 3), at_least(1.0, 3), at_least(-98.317)) == ("1", "1", "-98.32")
    rng = np.random.default_rng(0)
    for value in (10.0 ** rng.uniform(-12, 6, 300)).tolist():
        for digits in (2, 4, 6):
            up, down = float(at_most(value, digits)), float(at_least(value, digits))
            assert value * (1.0 - 10.0 ** (1 - digits)) < down <= value <= up < value * (1.0 + 10.0 ** (1 - digits))


def test_a_norm_is_called_by_name_only_if_it_is_that_norm() -> None:
    certificate, _ = certified(0.01)
    ours, claims = car_norms({"A": 0.01}), certificate.claims
    assert [c.norm.name for c in named_by_content(claims, ours)] == ["energy", "weighted sup", "Euclid"]
    for changed in (
        replace(claims[1].norm, T=claims[1].norm.T * np.where(np.arange(14) == 3, 1.0 + 1e-6, 1.0)[:, None]),
        replace(claims[1].norm, largest=False),
        replace(claims[0].norm, T=1e-6 * claims[0].norm.T),
        replace(claims[0].norm, T=claims[2].norm.T),
    ):
        named = named_by_content([claims[2], replace(claims[0], norm=changed)], ours)
        assert [c.norm.name for c in named] == ["Euclid", "#2 (the file's own)"]


def test_a_smaller_energy_in_a_file_is_not_the_energy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """T · 1e-6 is proved as well as T, but it is not what a reader takes it for."""
    content = json.loads(to_json(certified(0.01)[0]))
    claim = content["claims"][0]
    claim["norm"]["T"] = (1e-6 * np.array(claim["norm"]["T"])).tolist()
    for row in claim["delta of eps"]:
        row["eps"], row["delta"] = 1.001e-6 * row["eps"], 1e-6 * row["delta"]
    claim["l"] = claim["delta of eps"][0]["eps"]
    path = tmp_path / "c.json"
    path.write_bytes(rehashed(content))
    assert main(["verify", str(path)]) == 0
    said = capsys.readouterr().out
    assert "#1 (the file's own) norm: l <= 1.78" in said and "energy norm" not in said


def lowered(certificate: Certificate, floor: float) -> Certificate:
    first = certificate.claims[0]
    table = first.table.copy()
    table[0, 0] = floor
    return replace(certificate, claims=(Claim(first.norm, table), *certificate.claims[1:]))


def test_a_floor_below_what_a_motion_reaches_fails_whatever_the_proof_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    certificate, proof = certified(0.01)
    path = tmp_path / "c.json"
    path.write_bytes(to_json(lowered(certificate, 1e-9)))
    monkeypatch.setattr(certificate_command, "verify", lambda certificate, build: proof)
    assert main(["verify", str(path)]) == 1
    said = capsys.readouterr().out
    assert "NOT proved: energy norm: l = 1e-09, but a motion" in said and "almost stable" not in said


def test_a_statement_says_which_car_road_gain_and_start() -> None:
    gain = (0.5 * np.eye(4, 14)).tolist()
    model: dict[str, Any] = {"parameters": {"c1": 15000.0, "b1": 1212.5, "profile": "sine", "excite_rl": False}}
    first, second = model_words(model)
    assert (
        first
        == "  car and road: profile = sine, A = 0.01 m, b1 = 1212.5 N.s/m, excite_rl = False; the rest is the default"
    )
    assert second == "  without control"
    said = model_words({**model, "gain": gain})
    assert len(said) == 6 and said[2] == "    u_fl = - 0.5 body.heave"
    assert model_words({**model, "gain": [[0.0, -2.5, *[0.0] * 5, 1.0, *[0.0] * 6]] * 4})[2:] == [
        f"    u_{corner} = + 2.5 body.roll - 1 der(body.heave)" for corner in ("fl", "fr", "rl", "rr")
    ]
    assert model_words({**model, "gain": np.zeros((4, 14)).tolist()})[2] == "    u_fl = 0"
    flat = {"parameters": {"profile": "flat"}}
    assert model_words(flat, road=False) == ["  car: the default", "  without control"]
    assert start_words(np.zeros(14)) == "from rest"
    assert start_words(0.25 * np.eye(14)[1]) == "from body.roll = 0.25 rad"


def test_what_is_said_of_tyres_is_said_of_one_motion_and_for_how_long() -> None:
    """A = 1 mm keeps them down; what holds of x0 until the last piece is not said of all starts and of all times."""
    certificate, proof = certified(0.001)
    end = float(proof.tube.pieces[-1].end)
    text = "\n".join(statement(certificate, proof))
    assert "profile = bump, A = 0.001 m; the rest" in text
    assert f"of the motion from rest itself, until t = {end:g} s:" in text
    assert "stays on the ground; of other starts within delta this is not said" in text
    assert "contact is not proved" in "\n".join(statement(*certified(0.01)))


def test_bounded_roads_state_a_delta_beside_l_and_one_bound_for_all_wheels() -> None:
    with precision(2):
        driven = car_gains({}).under(heights({}, 0.01))
        made = certify(flat({}), driven, norms(Car(), driven.states[:, None]))
    said = "\n".join(of_all_roads(made, driven))
    for claim in made.claims:
        assert claim.table[0, 1] > 0.0
        floor, delta = at_most(claim.floor), at_least(claim.table[0, 1])
        assert f"{claim.norm.name} norm: l <= {floor}, which is eps for delta = {delta} (" in said
    sizes = made.bounds.sizes.copy()
    sizes[2] = 0.0
    for wrong in (
        replace(made, bounds=replace(made.bounds, sizes=sizes)),
        replace(made, model={**made.model, "gain": np.zeros((4, 14)).tolist()}),
        replace(made, claims=(replace(made.claims[0], table=1e-3 * made.claims[0].table),)),
    ):
        with pytest.raises(NotProvedError):
            of_all_roads(wrong, driven)


def test_a_controller_is_left_out_and_that_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made: tuple[Certificate, Proof] = certified(0.01)
    monkeypatch.setattr(certificate_command, "certify_car", lambda parameters: made)
    assert main(["certify", "bump-lqr"]) == 0
    said = capsys.readouterr()
    assert "without its controller; with it: --closed-loop" in said.err
    assert "  without control\n" in said.out
    assert main(["certify", "bump"]) == 0
    assert "controller" not in capsys.readouterr().err
