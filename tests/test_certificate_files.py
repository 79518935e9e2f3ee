"""A certificate file says what it says, once, in the numbers and words that are proved; anything else is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from test_almost_stable import certified, cubic, rehashed
from test_bounded_inputs import tied_gains
from test_switched_certificate import oscillator

from analysis.bertolino_baksa import bounded_certificate, strict, switched_certificate
from analysis.bertolino_baksa.balls import NotProvedError, precision
from analysis.bertolino_baksa.bounded_inputs import Bounds
from analysis.bertolino_baksa.certificate import certificate_of, from_json, opened, to_json, verify
from analysis.bertolino_baksa.norms import euclid
from analysis.certificates.car_certificates import build, model_of
from analysis.errors import InputError
from analysis.scenario import read_scenario

Change = Callable[[dict[str, Any]], Any]


@cache
def motion() -> bytes:
    return to_json(certified(cubic, 1)[0])


@cache
def bounded() -> bytes:
    found, _ = tied_gains()
    with precision(2):
        driven = found.under(Bounds(strict.numbers([0.3, 0.3], 1), tied=True))
        return bounded_certificate.to_json(bounded_certificate.certify({}, driven, [euclid(2)]))


@cache
def switched() -> bytes:
    return switched_certificate.to_json(oscillator()[0])


def refuse(data: bytes) -> None:
    kind = json.loads(data).get("kind")
    read: Callable[[dict[str, Any]], Any] = {
        bounded_certificate.KIND: bounded_certificate.certificate_of,
        switched_certificate.KIND: switched_certificate.certificate_of,
    }.get(kind, certificate_of)
    with pytest.raises(InputError, match=r"cannot be read as a certificate|wanted a certificate of format"):
        opened(data, "here", read)


def test_an_altered_file_is_told_so_plainly() -> None:
    with pytest.raises(InputError, match=r"^here: the content does not have the hash that it states"):
        opened(motion().replace(b'"sha256": "', b'"sha256": "0'), "here", certificate_of)


COMMON: list[Change] = [
    lambda c: c.update(theorem="All motions are stable."),
    lambda c: c.pop("theorem"),
    lambda c: c.update(remark="stable"),
    lambda c: c.update(format=True),
    lambda c: c.update(format=1.0),
    lambda c: c["claims"][0].update(remark="stable"),
    lambda c: c["claims"][0]["norm"].update(weights=[1.0]),
    lambda c: c["claims"][0]["norm"].update(name=1),
    lambda c: c["claims"][0]["norm"].update(largest=1),
    lambda c: c["claims"][0]["norm"].update(largest="false"),
    lambda c: c["claims"][0].update(l=str(c["claims"][0]["l"])),
    lambda c: c["claims"][0]["delta of eps"][1].update(at=0.0),
    lambda c: c["claims"][0]["delta of eps"][1].update(eps=str(c["claims"][0]["delta of eps"][1]["eps"])),
    lambda c: c["claims"][0].update({"delta of eps": []}),
    lambda c: c.update(claims={"norm": 1}),
    lambda c: c["claims"][0]["norm"]["T"][0].__setitem__(0, True),
]
OF_METRICS: list[Change] = [lambda c: c["metric"][0].__setitem__(0, 1)]
OF_PIECES: list[Change] = [
    lambda c: c["pieces"][0].update(remark=""),
    lambda c: c["pieces"][0].update(begin=0),
    lambda c: c["pieces"][0].update(begin="0_0"),
    lambda c: c["pieces"][0].update(begin="0/7"),
    lambda c: c["pieces"][-1].update(end=" " + c["pieces"][-1]["end"]),
]
OF_MOTIONS: list[Change] = [
    lambda c: c["x0"].__setitem__(0, False),
    lambda c: c["x0"].__setitem__(0, "0.0"),
]
OF_PHASES: list[Change] = [
    lambda c: c.update(phases=[]),
    lambda c: c.update(x0=[0.0, 0.0]),
    lambda c: c.update(kind="bounded"),
    lambda c: c["phases"][1].update(end="2"),
    lambda c: c["phases"][1].update(begin=1),
    lambda c: c["phases"][1].update(begin="2/2"),
    lambda c: c["phases"][1]["metric"][0].__setitem__(0, 1),
    lambda c: c["phases"][1]["metric"].pop(),
]
OF_BOUNDS: list[Change] = [
    lambda c: c.update(tied=1),
    lambda c: c.update(bounds=["0.3", 0.3]),
]


@pytest.mark.parametrize("change", [*COMMON, *OF_METRICS, *OF_PIECES, *OF_MOTIONS])
def test_a_file_of_a_motion_that_says_anything_else_is_refused(change: Change) -> None:
    content = json.loads(motion())
    change(content)
    refuse(rehashed(content))


@pytest.mark.parametrize("change", [*COMMON, *OF_PIECES, *OF_PHASES])
def test_a_file_of_a_changing_linear_part_that_says_anything_else_is_refused(change: Change) -> None:
    content = json.loads(switched())
    change(content)
    refuse(rehashed(content))


@pytest.mark.parametrize("change", [*COMMON, *OF_METRICS, *OF_BOUNDS])
def test_a_file_of_bounded_inputs_that_says_anything_else_is_refused(change: Change) -> None:
    content = json.loads(bounded())
    change(content)
    refuse(rehashed(content))


def test_a_file_of_another_number_of_states_is_of_another_system() -> None:
    """The numbers of x' = −x + x³ with the car's name on them."""
    with pytest.raises(NotProvedError, match="wanted 14 states, got 1"):
        verify(replace(from_json(motion(), "here"), model=model_of({})), build)
    with pytest.raises(NotProvedError, match="wanted 14 states, got 2"):
        few = opened(bounded(), "here", bounded_certificate.certificate_of)
        bounded_certificate.verify(replace(few, model=model_of({}), bounds=Bounds(np.ones(8))), build)


def test_a_key_stands_once_and_a_number_is_one_that_a_double_holds() -> None:
    """Whoever reads the file with another tool reads the same."""
    assert from_json(motion(), "here").claims[0].floor == json.loads(motion())["claims"][0]["l"]
    text = motion().decode()
    floor = json.loads(text)["claims"][0]["l"]
    for changed in (f'"l": 1e-99, "l": {floor!r}', f'"l": {floor!r}0000000001', '"l": 1e-99999999999999999999'):
        refuse(text.replace(f'"l": {floor!r}', changed).encode())


@pytest.mark.parametrize(
    "change",
    [
        {"profil": "sine"},
        {"excite_rl": "false"},
        {"A": "0.05"},
        {"A": True},
        {"A": 1},
        {"profile": 1.0},
        {"enabled": True},
    ],
)
def test_a_car_of_unknown_parameters_or_of_other_kinds_is_refused(change: dict[str, Any]) -> None:
    build({"kind": "car", "parameters": {"A": 0.01}})
    with pytest.raises(InputError, match=f"model: {next(iter(change))}"):
        build({"kind": "car", "parameters": {"A": 0.01, **change}})


def test_a_model_of_more_than_the_car_is_refused() -> None:
    for more in ({"road": "any"}, {"gain": "none"}, {"gain": [[0.0]]}, {"gain": None}):
        with pytest.raises(InputError, match="model: "):
            build({"kind": "car", "parameters": {}, **more})


def test_the_controller_has_no_part_in_a_model() -> None:
    scenario = read_scenario("bump-lqr").parameters
    assert scenario["enabled"] is True
    assert not {"enabled", "lambda", "horizon", "road_sampling"} & set(model_of(scenario)["parameters"])
    assert "profil" in model_of({"profil": "sine"})["parameters"]  # `build` refuses it
