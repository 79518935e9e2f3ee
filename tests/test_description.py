"""What an FMU says of itself: valid, complete, and true of what it does."""

from __future__ import annotations

import random
import re
import subprocess
import sys
import zipfile
from math import inf
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy import extract, read_model_description
from host import OK, Host
from lxml import etree
from pythonfmu import Boolean, Real, String

import build
from fmu_src.controller.lqr_controller import LqrController
from fmu_src.quantities import PARAMETERS, TABLE, UNITS
from fmu_src.road.road_excitation import RoadExcitation
from fmu_src.slave import Slave
from fmu_src.vehicle.vehicle7dof import Vehicle7DOF

SLAVES: dict[str, type[Slave]] = {s.__name__: s for s in (RoadExcitation, Vehicle7DOF, LqrController)}
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
every_model = pytest.mark.parametrize("model", build.MODELS)


def description(dist: Path, model: str) -> etree._Element:
    with zipfile.ZipFile(dist / f"{model}.fmu") as archive:
        return etree.fromstring(archive.read("modelDescription.xml"))


@every_model
def test_it_is_valid_against_the_schema_of_fmi_2(dist: Path, model: str) -> None:
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    assert schema.validate(description(dist, model)), schema.error_log


@every_model
def test_every_real_has_its_unit_its_limits_and_its_exact_start_value(dist: Path, model: str) -> None:
    root = description(dist, model)
    bases = {str(u.get("name")): u[0] for u in root.iterfind("UnitDefinitions/Unit")}
    assert {n: {str(k): int(v) for k, v in b.items()} for n, b in bases.items()} == {n: UNITS[n] for n in bases}
    reals = [(str(v.get("name")), v[0]) for v in root.iter("ScalarVariable") if v[0].tag == "Real"]
    assert {real.get("unit") for _, real in reals} == set(bases)
    for name, real in reals:
        q = TABLE[name]
        low, high = float(real.get("min", -inf)), float(real.get("max", inf))
        assert (low, high) == (0.0 if q.positive else q.low, q.high)
        nominal = float(real.get("nominal", "nan"))
        assert nominal == q.nominal and (not q.start or 0.1 <= abs(q.start) / nominal <= 10.0)
        if start := real.get("start"):
            assert start == repr(float(q.start))


@every_model
def test_limits_are_those_that_are_refused_beyond(dist: Path, model: str) -> None:
    """What `min` cannot say, that it is itself refused, stands in the description."""
    for v in description(dist, model).iter("ScalarVariable"):
        if v[0].tag == "Real" and v.get("causality") == "parameter" and v[0].get("min"):
            q, low = TABLE[str(v.get("name"))], float(v[0].get("min", "nan"))
            assert q.fault(np.nextafter(low, -inf)) and not q.fault(np.nextafter(low, inf))
            assert bool(q.fault(low)) == str(v.get("description")).endswith(", > 0")


@every_model
def test_choices_list_their_values(dist: Path, model: str) -> None:
    strings = {v.get("name"): v for v in description(dist, model).iter("ScalarVariable") if v[0].tag == "String"}
    assert set(strings) == {choice.name for choice in SLAVES[model].choices}
    for choice in SLAVES[model].choices:
        assert str(strings[choice.name].get("description")).endswith("; one of: " + ", ".join(choice.values))
        assert strings[choice.name][0].get("start") == choice.values[0]


@every_model
def test_it_names_author_version_licence_and_a_date_in_utc(dist: Path, model: str) -> None:
    root = description(dist, model)
    assert all(root.get(name) for name in ("author", "version", "license", "copyright", "description"))
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", root.get("generationDateAndTime", ""))
    assert [c.get("name") for c in root.iterfind("LogCategories/Category")] == ["logStatusError"]


@every_model
def test_its_guid_is_the_hash_that_its_code_is_named_by(dist: Path, model: str) -> None:
    with zipfile.ZipFile(dist / f"{model}.fmu") as archive:
        names = archive.namelist()
    guid = description(dist, model).get("guid", "")
    assert re.fullmatch("[0-9a-f]{32}", guid)
    assert f"resources/fmu_src_{guid[:12]}/quantities.py" in names
    assert f"resources/{model.lower()}_{guid[:12]}.py" in names
    assert not [name for name in names if name.startswith("resources/fmu_src") and guid[:12] not in name]


# ------------------------------------------------------------------ true of what it does
@every_model
def test_outputs_depend_on_those_inputs_at_once_that_the_structure_says(
    dist: Path, tmp_path: Path, rng: np.random.Generator, model: str
) -> None:
    """Every input is changed in turn in a state of no symmetry; parameters let everything through that can pass."""
    host = Host(Path(extract(dist / f"{model}.fmu", tmp_path)))
    if model == "LqrController":
        for name, text in (("activation", "at t_on"), ("design", "full-car")):
            assert host.set_string(host.reference[name], text) == OK
    start = {"Vehicle7DOF": {"bp1": 100.0, "bp2": 90.0, "m11": 28.0}, "LqrController": {"t_on": 0.0}}
    assert host.start(**start.get(model, {})) == OK
    held = dict.fromkeys(host.inputs, 0.0)
    for k in range(30):
        held = {name: 0.01 * float(rng.normal()) for name in held}
        assert host.set(held) == host.step(k * 1e-3, 1e-3) == OK
    host.set(held)  # outputs are now those under the inputs of this instant
    before = dict(zip(host.outputs, host.get(), strict=True))
    found: dict[str, set[str]] = {name: set() for name in host.outputs}
    for name, value in held.items():
        host.set({name: value + 1.0})
        after = dict(zip(host.outputs, host.get(), strict=True))
        host.set({name: value})
        for output in found:
            found[output] |= {name} if after[output] != before[output] else set()
    host.free()
    outputs = read_model_description(str(dist / f"{model}.fmu")).outputs
    assert found == {u.variable.name: {v.name for v in u.dependencies} for u in outputs}


def test_a_refusal_is_logged_in_the_category_that_it_declares_and_nothing_else_is(dist: Path, tmp_path: Path) -> None:
    code = (
        "import sys, fmpy\n"
        "def log(environment, name, status, category, message):\n"
        "    if status > 0: print(status, category.decode(), message.decode(), flush=True)\n"
        "def run(**start):\n"
        "    fmpy.simulate_fmu(sys.argv[1], stop_time=0.01, start_values=start, debug_logging=True, logger=log)\n"
        "run()\n"
        "try:\n    run(m=-1.0)\nexcept Exception:\n    pass\n"
    )
    command = [sys.executable, "-I", "-c", code, str(dist / "Vehicle7DOF.fmu")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    first, *rest = done.stdout.splitlines()
    assert re.fullmatch(r"3 logStatusError Vehicle7DOF: initialization: m = -1\.0 kg: wanted .*", first)
    assert all("Fatal py exception" in line or "m = -1.0 kg" in line for line in rest)


# ------------------------------------------------------------------ at the start
Point = dict[str, Any]  # values of variables; "time": the start time
NEAR = {"activation": "at t_on", "t_on": 0.25, "body.heave": 0.01, "body.pitch": 0.02, "der(body.roll)": 0.3}
LOOSE: dict[str, list[Point]] = {  # points at which, together, everything that can act does
    "RoadExcitation": [
        {"time": 0.317, "profile": "sine"},
        {"time": 0.317, "profile": "fourier", **{f"A_nu[{k}]": 0.001 * k for k in range(1, 9)}},
    ],
    "Vehicle7DOF": [{"bp1": 90.0, "bp2": 70.0, "m11": 28.0}],
    "LqrController": [
        {**NEAR, "time": 0.3, "T": 0.8},
        {"time": 0.321, "body.heave": 0.01, "body.pitch": 0.02},  # control begins at 0.32 s
        {**NEAR, "time": 0.3, "force_limit": 10.0},
        {**NEAR, "time": 0.3, "horizon": "infinite", "design": "full-car"},
        *(
            {**NEAR, "time": 0.3, "actuators": "semi-active", "valve_damping": 50.0, "der(body.heave)": rate}
            for rate in (-0.5, 0.5)
        ),
        {**NEAR, "time": 0.3, "sample_time": 0.01, "feedback": "estimate", "design": "full-car"},
        {**NEAR, "time": 0.3, "actuator_lag": 0.01},
    ],
}
STEP = {"v0": -4.0, "tau0": 0.013, "t_start": 0.017, "seed": 1.0, "Lambda": 1.0, "t_on": 0.1, "actuator_lag": 0.02}


def started(model: str, point: Point) -> dict[str, float]:
    """Outputs at the end of initialization, in a state of no symmetry but for what the point says."""
    slave = SLAVES[model](instance_name="x", resources="")
    references = {v.name: (r, type(v)) for r, v in slave.vars.items()}
    generator = random.Random(5)
    values = {q.name: 0.02 * generator.random() for q in (*slave.inputs, *slave.outputs[: slave.settable])} | point
    slave.setup_experiment(values.pop("time", 0.0))
    for name, value in values.items():
        reference, kind = references[name]
        {Real: slave.set_real, String: slave.set_string, Boolean: slave.set_boolean}[kind]([reference], [value])
    slave.exit_initialization_mode()
    return dict(zip((q.name for q in slave.outputs), slave.y, strict=True))


def perturbed(model: str, point: Point, name: str) -> Point:
    """The point with another value of one variable."""
    choices = {c.name: c for c in SLAVES[model].choices}
    if name in choices:
        now: Any = point.get(name, choices[name].start)
        changed: Any = [value for value in choices[name].values if value != now][-1]
    elif name in SLAVES[model].switches:
        changed = False
    else:
        q = TABLE[name]
        now = point.get(name, q.start if name in PARAMETERS else None)
        changed = 0.03 if now is None else now + STEP.get(name, 0.1 * q.nominal)
    extra = {"m21": {"m22": changed}, "m22": {"m21": changed}}.get(name, {})  # the car takes no others
    extra |= {"sample_time": 0.01} if changed == "estimate" else {}
    return {**point, name: changed, **extra}


@every_model
def test_initial_unknowns_depend_on_what_the_structure_says_and_on_nothing_else(dist: Path, model: str) -> None:
    """Each variable is changed at points where, together, everything acts; what cancels in equations is round-off."""
    md = read_model_description(str(dist / f"{model}.fmu"))
    declared = {u.variable.name: {v.name for v in u.dependencies} for u in md.initialUnknowns}
    assert set(declared) == {q.name for q in SLAVES[model].outputs[SLAVES[model].settable :]}
    causes = [v for v in md.modelVariables if v.initial == "exact" or v.causality in ("input", "parameter")]
    open_ones = {name: set(names) for name, names in declared.items()}
    for point in LOOSE[model]:
        before = started(model, point)
        for cause in (v.name for v in causes):
            if point is not LOOSE[model][0] and not any(cause in names for names in open_ones.values()):
                continue  # it has been seen to act wherever it is said to
            after = started(model, perturbed(model, point, cause))
            for name in declared:
                if abs(after[name] - before[name]) > 1e-9 * max(abs(after[name]), abs(before[name]), 1e-6):
                    assert cause in declared[name], (cause, name)
                    open_ones[name].discard(cause)
    assert {name: names for name, names in open_ones.items() if names} == {}
