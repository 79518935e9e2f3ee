"""Starts on the FMUs themselves, by the command that tries them."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from analysis.__main__ import main
from analysis.certificates import adversary_points, certificate_command, fmu_starts
from analysis.certificates.car_certificates import certify_car
from analysis.scenario import read_scenario


def test_starts_on_the_fmus_come_near_epsilon_and_stay_within() -> None:
    certificate, _ = certify_car({})
    lines, within = fmu_starts.on_the_fmus(certificate, read_scenario("bump"), 18)
    shares = [float(re.search(r"reach (\S+) of eps", line).group(1)) for line in lines]  # type: ignore[union-attr]
    assert within and len(lines) == 3 and all(0.9 < share < 1.0 for share in shares)
    tight = replace(certificate, claims=tuple(replace(c, table=c.table * [0.9, 1.0]) for c in certificate.claims))
    lines, within = fmu_starts.on_the_fmus(tight, read_scenario("bump"), 3)
    assert not within


def test_the_command_fails_where_a_start_gets_beyond(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def found(certificate: object, scenario: object, count: int) -> tuple[list[str], bool]:
        asked.append(count)
        return ["  some reach 1.1 of eps"], False

    made = certify_car({})
    monkeypatch.setattr(certificate_command, "certify_car", lambda parameters: made)
    monkeypatch.setattr(adversary_points, "adversary_points", lambda certificate: [])
    monkeypatch.setattr(fmu_starts, "on_the_fmus", found)
    assert main(["certify", "bump", "--fmu-starts", "7"]) == 1
    assert asked == [7] and "1.1 of eps" in capsys.readouterr().out
    for wrong in (["--quick"], ["--closed-loop"], ["--bounded", "0.01"]):
        assert main(["certify", "bump", "--fmu-starts", "7", *wrong]) == 2
    assert main(["certify", "bump", "--fmu-starts", "-1"]) == 2
    assert main(["certify", "bump", "--closed-loop", "--quick"]) == 2
