"""Scenarios: what is read from TOML and from run.json, with which units, and how each mistake is refused."""

from __future__ import annotations

import datetime
import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.errors import InputError
from analysis.scenario import MAX_STEPS, Scenario, built_in_scenarios, names_a_folder, read_scenario
from fmu_src.quantities import PARAMETERS, STATES

EVERYTHING = """title = "All that a scenario can hold"
simulation = {start_time = "-100 ms", stop_time = 2, step = "2 ms", coupling = "jacobi", record = ["body.heave", "m"]}
start = {"body.roll" = "1 deg", "der(body.heave)" = -0.125}
[parameters]
profile = "fourier"
"A_nu[3]" = "1 cm"
m = 900
enabled = false
"""


def read(folder: Path, text: str) -> Scenario:
    path = folder / "some.toml"
    path.write_text(text, encoding="utf-8")
    return read_scenario(str(path))


def faults(folder: Path, text: str) -> list[tuple[int, str]]:
    """Line (0: none) and words of each fault, in the order of the lines."""
    with pytest.raises(InputError) as refusal:
        read(folder, text)
    parsed = [re.fullmatch(r".*some\.toml(?::(\d+))?: (.+)", line) for line in str(refusal.value).split("\n")]
    return sorted((int(match[1] or 0), match[2]) for match in parsed if match)


# ------------------------------------------------------------------ what is read
def test_an_empty_file_is_the_default_scenario(tmp_path: Path) -> None:
    s = read(tmp_path, "")
    assert s == Scenario(name="some", title="some", parameters={"road_sampling": "end"})
    assert (s.start_time, s.stop_time, s.step, s.coupling, s.record) == (0.0, 5.0, 1e-3, "gauss-seidel", ())


def test_everything_that_is_set_is_read(tmp_path: Path) -> None:
    assert read(tmp_path, EVERYTHING) == Scenario(
        name="some",
        title="All that a scenario can hold",
        start_time=-0.1,
        stop_time=2.0,
        step=0.002,
        coupling="jacobi",
        record=("body.heave", "m"),
        parameters={"profile": "fourier", "A_nu[3]": 0.01, "m": 900.0, "enabled": False, "road_sampling": "start"},
        start={"body.roll": math.radians(1.0), "der(body.heave)": -0.125},
    )


def test_every_built_in_scenario_reads_by_name_and_has_a_title_of_its_own() -> None:
    assert {"bump", "bump-lqr", "fourier-fl", "sine"} <= set(built_in_scenarios())
    assert [read_scenario(name).name for name in built_in_scenarios()] == built_in_scenarios()
    assert all(read_scenario(name).title != name for name in built_in_scenarios())


@pytest.mark.parametrize(
    ("section", "key", "text", "value"),
    [
        ("parameters", "v0", "36 km/h", 10.0),
        ("parameters", "tau0", "20 ms", 0.02),
        ("parameters", "A", "1 cm", 0.01),
        ("parameters", "A", "-0.5 inch", -0.0127),
        ("parameters", "c1", "15 kN/m", 15000.0),
        ("parameters", "Jx", "300 kg.m2", 300.0),
        ("parameters", "Jx", "300 kg·m²", 300.0),
        ("simulation", "step", "500 µs", 5e-4),
        ("start", '"body.roll"', "1 deg", math.pi / 180),
        ("start", '"der(body.pitch)"', "180 deg/s", math.pi),
    ],
)
def test_a_string_with_a_unit_is_read_in_si(tmp_path: Path, section: str, key: str, text: str, value: float) -> None:
    scenario = read(tmp_path, f'[{section}]\n{key} = "{text}"')
    found = {**scenario.parameters, **scenario.start, "step": scenario.step}
    assert found[key.strip('"')] == pytest.approx(value, rel=1e-15)


def test_the_unit_that_a_message_suggests_is_accepted(tmp_path: Path) -> None:
    written = "".join(
        f'"{q.name}" = "{q.start!r} {q.unit}"\n' if q.unit != "1" else f"{q.name} = {q.start!r}\n"
        for q in PARAMETERS.values()
    )
    start = "".join(f'"{q.name}" = "0 {q.unit}"\n' for q in STATES)
    scenario = read(tmp_path, f"[parameters]\n{written}[start]\n{start}")
    assert scenario.parameters == {"road_sampling": "end", **{q.name: q.start for q in PARAMETERS.values()}}


def test_the_road_is_sampled_as_the_coupling_steps_it_and_the_other_way_is_refused(tmp_path: Path) -> None:
    assert read(tmp_path, "[parameters]\nm = 900").parameters["road_sampling"] == "end"
    assert read(tmp_path, '[simulation]\ncoupling = "jacobi"').parameters == {"road_sampling": "start"}
    ((line, said),) = faults(tmp_path, '[parameters]\nroad_sampling = "start"')
    assert (line, said) == (2, "road_sampling = 'start': coupling = 'gauss-seidel' wants 'end'")


def test_control_shorter_than_a_step_is_refused(tmp_path: Path) -> None:
    ((line, said),) = faults(tmp_path, "[simulation]\nstep = 0.01\n[parameters]\ntau0 = 0.0\nT = 0.305")
    assert line == 5
    assert said == "T = 0.305 s: wanted at least a step of 0.01 s of control, begun at 0.3 s"
    assert read(tmp_path, "[simulation]\nstep = 0.01\n[parameters]\nT = 0.305\nenabled = false")


def test_control_that_would_never_act_is_refused(tmp_path: Path) -> None:
    ((line, said),) = faults(tmp_path, "[simulation]\nstart_time = 1.0\n[parameters]\nT = 0.9")
    assert (line, said) == (4, "T = 0.9 s: wanted an end of control after the start of the run at 1 s")
    ((line, said),) = faults(tmp_path, "[parameters]\nsample_time = 0.1\nT = 0.39")
    assert line == 3
    assert said.startswith("T = 0.39 s, sample_time = 0.1 s: wanted a sample within the control from 0.32 s on, got")
    assert read(tmp_path, "[simulation]\nstart_time = 1.0\n[parameters]\nT = 0.9\nenabled = false")


# ------------------------------------------------------------------ a run.json is a scenario again
def record(folder: Path, scenario: object) -> str:
    path = folder / "run.json"
    path.write_text(json.dumps({"scenario": scenario, "parameters": {}, "fmus": {}}), encoding="utf-8")
    return str(path)


def test_a_run_json_is_a_scenario_again_with_identical_content(tmp_path: Path) -> None:
    scenarios = [read(tmp_path, EVERYTHING), read(tmp_path, ""), *map(read_scenario, built_in_scenarios())]
    for scenario in scenarios:
        assert read_scenario(record(tmp_path, scenario.as_json())) == scenario


def test_a_run_json_without_a_name_is_called_after_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record(tmp_path, {})
    monkeypatch.chdir(tmp_path)
    assert read_scenario("run.json").name == tmp_path.name


@pytest.mark.parametrize(
    ("scenario", "words"),
    [
        ({"stopp_time": 1.0}, "unknown key 'stopp_time'.*known are:.* stop_time"),
        ({"step": None}, "step = None: wanted communication step in s .* got NoneType"),
        ({"step": 0}, "step = 0.0 s: wanted a finite number > 0"),
        ({"name": "../../home"}, "name = '../../home': wanted the name of a file or folder"),
        ({"name": "a\0b"}, "name = "),
        ({"parameters": [1]}, "parameters: wanted a table"),
        (5, "scenario: wanted an object"),
    ],
)
def test_a_run_json_with_a_mistake_is_refused(tmp_path: Path, scenario: object, words: str) -> None:
    with pytest.raises(InputError, match=rf"run\.json: .*{words}"):
        read_scenario(record(tmp_path, scenario))


# ------------------------------------------------------------------ what is refused, and where it stands
@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ('title = "x"\nstep = 1\n[start]', 2, "unknown key 'step' at the top level; known are: title, simulation"),
        ("[simulation]\nstep = 1\n\n[extra]\nx = 1", 4, "unknown key 'extra' at the top level"),
        ("[simulation]\n# eh\nstopp = 1", 3, r"unknown key 'stopp' in \[simulation\]; known are: .*, stop_time, step"),
        ("[parameters]\nmass = 1", 2, r"unknown key 'mass' in \[parameters\]; known are: A, .* m, .*profile.*enabled"),
        ("parameters.m = 1\nparameters.mass = 1", 2, r"unknown key 'mass' in \[parameters\]"),
        ("[parameters.mass]\nm = 1", 1, r"unknown key 'mass' in \[parameters\]"),
        ('[start]\n"body.yaw" = 1', 2, r"unknown key 'body.yaw' in \[start\]; known are: body.heave, body.roll, body"),
        ("[start]\nbody.heave = 1", 2, r"unknown key 'body' in \[start\] \(write 'body.heave' in quotes\); known are"),
        ("title = 1", 1, "title = 1: wanted a string"),
        ("[[simulation]]\nstep = 1", 1, r"simulation: wanted a table \[simulation\], got \["),
        ('[parameters]\nv0 = "20 kg"', 2, r"v0 = '20 kg': wanted forward speed in m/s .*'10 m/s'\), got the unit 'kg'"),
        ('[parameters]\nv0 = "fast"', 2, "v0 = 'fast': wanted .* got a string that is not a number with a unit"),
        ('[parameters]\nv0 = "10 m/s*9**9**9"', 2, "not a number with a unit"),
        ('[parameters]\nv0 = "10 (m/s"', 2, "not a number with a unit"),
        ('[parameters]\nv0 = "1e999 m/s"', 2, "v0 = inf m/s: wanted a finite number > 0"),
        ('[parameters]\nA = "1 dB*dB"', 2, "got the unit"),
        ('[parameters]\nA = "1 Ym**40*m**-39"', 2, "A = '1 Ym.*got the unit"),
        ("[parameters]\nv0 = true", 2, "v0 = True: wanted .* got bool"),
        ("[parameters]\nv0 = 2026-11-22", 2, "v0 = .*2026.* got date"),
        ("[parameters]\nv0 = nan", 2, "v0 = nan m/s: wanted a finite number > 0"),
        ("[parameters]\nA = inf", 2, "A = inf m: wanted a finite number"),
        (f"[parameters]\nA = 1{'0' * 400}", 2, "A = 1000.*0000: wanted .* got a number beyond all doubles"),
        (f"[parameters]\nA = 0x{'f' * 9000}", 2, "A = .*got a number beyond all doubles"),
        (f'[parameters]\nA = "{"long " * 90000}"', 2, r"A = '.{,60}': wanted .{,200}"),
        ("[parameters]\nenabled = 1", 2, "enabled = 1: wanted true or false"),
        ('[parameters]\nprofile = "wave"', 2, "profile = 'wave': wanted one of bump, sine, fourier, step, flat"),
        ('[simulation]\ncoupling = "loose"', 2, "coupling = 'loose': wanted one of gauss-seidel, jacobi"),
        ("[simulation]\nstep = -1e-3", 2, "step = -0.001 s: wanted a finite number > 0"),
        ("[simulation]\nstep = 0", 2, "step = 0.0 s: wanted a finite number > 0"),
        ("[simulation]\nstop_time = -1", 2, r"stop_time = -1.0 s: wanted more than start_time = 0.0 s"),
        ("\n[simulation]\nstart_time = 5", 2, r"stop_time = 5.0 s: wanted more than start_time = 5.0 s"),
        ("[simulation]\nstep = 1e-9", 2, f"step = 1e-09 s: wanted at most {MAX_STEPS} steps to stop_time = 5.0 s"),
        ("[simulation]\nstart_time = 1e9\nstop_time = 1000000001\nstep = 1e-5", 4, "step = 1e-05 s: wanted at least"),
        ("[simulation]\nrecord = [1]", 2, r"record = \[1\]: wanted a list of variable names"),
        ("[simulation]\nrecord = ['m', 'A', 'm']", 2, "record: 'm' stands there 2 times"),
        ('[start]\n"body.roll" = "100 deg"', 2, "body.roll = 1.745.* rad: wanted a finite number in"),
    ],
)
def test_a_mistake_is_refused_with_its_line_once(tmp_path: Path, text: str, line: int, words: str) -> None:
    ((where, said),) = faults(tmp_path, text)
    assert (where, bool(re.search(words, said)), len(said) < 1000) == (line, True, True), said


def test_all_faults_are_listed_at_once(tmp_path: Path) -> None:
    text = (
        "titel = 1\n[simulation]\nstep = -1\ncoupling = 'loose'\nrecord = 1\n[parameters]\nv0 = '20 kg'\n"
        "profile = 'wave'\nenabled = 'yes'\nmass = 1\n[start]\n'body.roll' = '2 rad'\n'body.yaw' = 0\n"
    )
    assert [line for line, _ in faults(tmp_path, text)] == [1, 3, 4, 5, 7, 8, 9, 10, 12, 13]


def test_faults_come_in_the_same_order_every_time(tmp_path: Path) -> None:
    """A set of strings has another order in every process."""
    with pytest.raises(InputError) as refusal:
        read(tmp_path, "\n".join(f"key{number} = 1" for number in range(50)))
    assert re.findall(r"'key(\d+)'", str(refusal.value)) == [str(number) for number in range(50)]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"[simulation\n", "not TOML: .*line 1"),
        (b"a = 1\na = 2\n", "not TOML: .*line 2"),
        (b"a = " + b"[" * 100_000, "not TOML"),
        (b"a = " + b"1" * 5000, "not TOML"),
        (b"\x00\xff\xfe\x80", "cannot be read"),
        (b"parameters.v0" + b".a" * 3_000 + b" = 1", "v0 = .*got dict"),
    ],
)
def test_what_is_not_toml_is_refused_with_the_file(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=rf"broken\.toml:.*{words}"):
        read_scenario(str(path))


@pytest.mark.parametrize("content", ["", "{", "[" * 100_000, "[]", "3", '{"scenario": {}}', "\ud800"])
def test_what_is_no_run_json_is_refused_with_the_file(tmp_path: Path, content: str) -> None:
    path = tmp_path / "broken.json"
    path.write_bytes(content.encode("utf-8", "surrogatepass"))
    with pytest.raises(InputError, match=r"broken\.json: "):
        read_scenario(str(path))


@pytest.mark.parametrize("name", ["bumb", "", ".", "a\0b", "x" * 5000, "nothing.json", "a\0b.json"])
def test_what_is_no_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="^bumb: no such file.*known are: bump" if name == "bumb" else None):
        read_scenario(name)


# ------------------------------------------------------------------ any content at all
UNIT = st.lists(st.sampled_from([*"*/.^ ()-·²;#", "**", "2", "m", "s", "kg", "N", "degC", "if", "x", "dB"]), max_size=6)
QUANTITIES = st.builds(lambda number, unit: f"{number} {''.join(unit)}", st.floats(), UNIT)
SCALARS = st.one_of(st.booleans(), st.integers(), st.floats(), st.text(max_size=8), QUANTITIES, st.dates())
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
)
LIKELY = st.floats(0.01, 10.0) | st.sampled_from(["jacobi", "bump", "1 m", "2 s", True, "end"])


def section(*keys: str) -> st.SearchStrategy[Any]:
    known = st.dictionaries(st.sampled_from(keys), LIKELY | VALUES, max_size=3)
    return known | st.dictionaries(st.text(max_size=5), VALUES, max_size=3) | VALUES


TABLES = st.fixed_dictionaries(
    {},
    optional={
        "title": st.text(max_size=5) | VALUES,
        "simulation": section("start_time", "stop_time", "step", "coupling", "record"),
        "parameters": section("m", "A", "v0", "A_nu[3]", "profile", "enabled", "road_sampling"),
        "start": section("body.heave", "body.roll"),
        "step": VALUES,
    },
)


def toml(value: Any) -> str:
    match value:
        case dict():
            return "{" + ", ".join(f"{toml(key)} = {toml(inner)}" for key, inner in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(toml, value)) + "]"
        case float() | datetime.date():
            return str(value)
        case _:
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


@settings(max_examples=200, deadline=None)
@given(data=TABLES)
def test_any_table_is_a_scenario_or_is_refused(tmp_path_factory: pytest.TempPathFactory, data: dict[str, Any]) -> None:
    folder = tmp_path_factory.getbasetemp()
    try:
        scenario = read(folder, "".join(f"{toml(key)} = {toml(value)}\n" for key, value in data.items()))
    except InputError as refusal:
        assert "not TOML" not in str(refusal)
    else:
        assert scenario.stop_time > scenario.start_time
        assert scenario.step > 0.0
        assert read_scenario(record(folder, scenario.as_json())) == scenario


@settings(max_examples=200, deadline=None)
@given(text=QUANTITIES | st.text())
def test_any_string_is_a_length_or_is_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    try:
        scenario = read_scenario(record(tmp_path_factory.getbasetemp(), {"parameters": {"A": text}}))
    except InputError as refusal:
        assert "\n" not in str(refusal)
    else:
        assert math.isfinite(float(scenario.parameters["A"]))


def test_a_built_in_scenario_is_meant_also_where_a_folder_has_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bump").mkdir()
    (tmp_path / "mine").mkdir()
    assert not names_a_folder("bump") and names_a_folder("./bump") and names_a_folder("mine")
    assert read_scenario("bump").name == "bump"
