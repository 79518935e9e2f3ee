"""Runs on disk: every bit comes back, no other file passes for one, and nothing half-written stays behind."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_run import made_up_run

from analysis.errors import InputError
from analysis.trajectory import (
    CSV,
    RECORD,
    Run,
    Trajectory,
    new_run_folder,
    read_csv,
    read_record,
    read_run,
    write_csv,
    write_run,
)

EXTREMES = (5e-324, -2.2250738585072014e-308, -0.0, 1e308, -1.7976931348623157e308, 0.1, 1 / 3, 1e22, 123456789.0)
GOOD = "time,body.heave,h_fl\n0.0,1.0,2.0\n0.1,1.5,2.5\n0.2,-1.0,-2.0\n"
RECORD_OF_A_RUN: dict[str, Any] = {"scenario": {"step": 0.1}, "parameters": {"vehicle": {"m": 870.0}}, "fmus": {}}
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\r"), max_size=4)
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def trajectory(rows: list[list[float]]) -> Trajectory:
    table = np.array(rows)
    return Trajectory(time=table[:, 0], names=tuple("abcdef"[: table.shape[1] - 1]), values=table[:, 1:])


def bits(t: Trajectory) -> tuple[object, ...]:
    return t.names, t.values.shape, t.time.tobytes(), t.values.tobytes()


# ------------------------------------------------------------------ the table
@settings(deadline=None)
@given(data=st.data(), width=st.integers(0, 4))
def test_every_double_comes_back_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, width: int
) -> None:
    times = sorted(data.draw(st.lists(FINITE, min_size=1, max_size=6, unique=True)))
    value = FINITE | st.sampled_from(EXTREMES)
    written = trajectory([[t, *data.draw(st.lists(value, min_size=width, max_size=width))] for t in times])
    path = tmp_path_factory.getbasetemp() / CSV
    write_csv(written, path)
    assert bits(read_csv(path)) == bits(written)


@settings(deadline=None)
@given(names=st.lists(st.sampled_from(["der(x,2)", "", ' "', "a\nb", "ψ"]) | TEXT, unique=True))
def test_every_name_comes_back(tmp_path_factory: pytest.TempPathFactory, names: list[str]) -> None:
    names = [name for name in names if name != "time"]
    path = tmp_path_factory.getbasetemp() / CSV
    write_csv(Trajectory(time=np.arange(2.0), names=tuple(names), values=np.ones((2, len(names)))), path)
    assert read_csv(path).names == tuple(names)


def test_the_smallest_and_the_largest_doubles_come_back(tmp_path: Path) -> None:
    written = trajectory([[float(k), x, -x] for k, x in enumerate(EXTREMES)])
    write_csv(written, tmp_path / CSV)
    assert bits(read_csv(tmp_path / CSV)) == bits(written)
    assert math.copysign(1.0, read_csv(tmp_path / CSV).values[2, 0]) == -1.0


def test_a_file_is_a_header_and_numbers_as_python_writes_them(tmp_path: Path) -> None:
    write_csv(trajectory([[0.0, 0.1, -0.0], [0.001, 1e308, 5e-324]]), tmp_path / CSV)
    assert (tmp_path / CSV).read_bytes() == b"time,a,b\n0.0,0.1,-0.0\n0.001,1e+308,5e-324\n"


def test_columns_are_found_by_name_and_a_missing_one_is_named(tmp_path: Path) -> None:
    (tmp_path / CSV).write_text(GOOD)
    found = read_csv(tmp_path / CSV)
    np.testing.assert_array_equal(found["h_fl"], [2.0, 2.5, -2.0])
    np.testing.assert_array_equal(found.columns(["h_fl", "body.heave"]), [[2.0, 1.0], [2.5, 1.5], [-2.0, -1.0]])
    with pytest.raises(InputError, match=r"'body.roll' is not in the trajectory; recorded are: body\.heave, h_fl"):
        found["body.roll"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (GOOD, "", "row 1: wanted a header that begins with 'time', got nothing"),
        ("time,", "t,", r"row 1: wanted a header that begins with 'time', got \['t', 'body.heave', 'h_fl'\]"),
        ("time,body.heave,h_fl\n", "", "row 1: wanted a header that begins with 'time'"),
        ("h_fl", "body.heave", "row 1: column 'body.heave' stands there twice"),
        ("h_fl", "time", "row 1: column 'time' stands there twice"),
        ("0.0,1.0,2.0\n0.1,1.5,2.5\n0.2,-1.0,-2.0\n", "", "wanted at least one row of numbers .* got none"),
        ("1.5,2.5", "1.5", "row 3: wanted 3 columns as in the header, got 2"),
        ("1.5,2.5", "1.5,2.5,3.5", "row 3: wanted 3 columns as in the header, got 4"),
        ("0.1,1.5,2.5\n", "\n", "row 3: wanted 3 columns as in the header, got 0"),
        ("-2.0\n", "-2.0\n\n", "row 5: wanted 3 columns as in the header, got 0"),
        ("1.5", "", "row 3, column 'body.heave': wanted a finite number, got ''"),
        ("2.5", "nan", "row 3, column 'h_fl': wanted a finite number, got 'nan'"),
        ("2.5", "-inf", "row 3, column 'h_fl': wanted a finite number, got '-inf'"),
        ("2.5", "1e999", "row 3, column 'h_fl': wanted a finite number, got '1e999'"),
        ("-1.0", "low", "row 4, column 'body.heave': wanted a finite number, got 'low'"),
        ("0.1,", "inf,", "row 3, column 'time': wanted a finite number, got 'inf'"),
        ("0.1,", "0.3,", r"row 4, column 'time': wanted more than 0\.3 s, got 0\.2 s$"),
        ("0.2,", "0.1,", r"row 4, column 'time': wanted more than 0\.1 s, got 0\.1 s$"),
        ("0.0,", "1e308,", r"row 3, column 'time': wanted more than 1e\+308 s, got 0\.1 s$"),
        ("2.5", '"2.5', "row 3, column 'h_fl': wanted a finite number"),
        ("2.5", "7" * 200_000, "cannot be read"),
    ],
)
def test_what_is_no_trajectory_is_refused_with_row_and_column(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert GOOD.count(old) == 1
    (tmp_path / CSV).write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=rf"{CSV}: {words}"):
        read_csv(tmp_path / CSV)


def test_times_as_far_apart_as_doubles_go_are_compared_without_overflow(tmp_path: Path) -> None:
    (tmp_path / CSV).write_text("time\n-1.7e308\n1.7e308\n")
    assert read_csv(tmp_path / CSV).time.tolist() == [-1.7e308, 1.7e308]


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"time,a\n0,\x00\n1,2\n", b"PK\x03\x04", None])
def test_what_is_no_text_is_refused_with_the_file(tmp_path: Path, content: bytes | None) -> None:
    (tmp_path / CSV).mkdir() if content is None else (tmp_path / CSV).write_bytes(content)
    with pytest.raises(InputError, match=rf"{CSV}: "):
        read_csv(tmp_path / CSV)


# ------------------------------------------------------------------ the record
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fmus": None}, "fmus: wanted an object, got None"),
        ({"scenario": []}, r"scenario: wanted an object, got \[\]"),
        ({"parameters": 1}, "parameters: wanted an object, got 1"),
        ({"parameters": {"road": 1}}, "parameters: road: wanted an object, got 1"),
        ({"parameters": {"road": {"A": "1"}}}, "parameters: road: A = '1': wanted a finite number"),
        ({"parameters": {"road": {"A": True}}}, "parameters: road: A = True: wanted a finite number"),
        ({"parameters": {"road": {"A": math.nan}}}, "parameters: road: A = nan: wanted a finite number"),
        ({"parameters": {"road": {"A": 10**309}}}, "parameters: road: A = 1000.*: wanted a finite number"),
        ({"parameters": {"x": {"a": 1.0}, "y": {"a": 2.0}}}, r"parameters: y: a = 2\.0: wanted 1\.0, as in another"),
    ],
)
def test_a_record_that_no_run_has_is_refused(tmp_path: Path, change: dict[str, object], words: str) -> None:
    (tmp_path / RECORD).write_text(json.dumps(RECORD_OF_A_RUN | change))
    with pytest.raises(InputError, match=rf"{RECORD}: {words}"):
        read_record(tmp_path / RECORD)


def test_a_record_that_lacks_something_says_what(tmp_path: Path) -> None:
    (tmp_path / RECORD).write_text('{"fmus": {}}')
    with pytest.raises(InputError, match=rf"{RECORD}: wanted the record of a run, but parameters, scenario is missing"):
        read_record(tmp_path / RECORD)


# ------------------------------------------------------------------ the folder
A_RUN = Run(trajectory=trajectory([[float(k), x] for k, x in enumerate(EXTREMES)]), record=RECORD_OF_A_RUN)


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below, and every folder (as a name that ends with a slash)."""
    found = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*")}
    return {name + "/" * path.is_dir(): path.read_bytes() if path.is_file() else b"" for name, path in found.items()}


def test_a_run_comes_back_with_the_same_bits(tmp_path: Path) -> None:
    with new_run_folder(tmp_path / "far" / "away" / "run") as folder:
        write_run(A_RUN, folder)
    assert set(contents(tmp_path)) == {
        "far/",
        "far/away/",
        "far/away/run/",
        *(f"far/away/run/{n}" for n in (CSV, RECORD)),
    }
    found = read_run(tmp_path / "far" / "away" / "run")
    assert bits(found.trajectory) == bits(A_RUN.trajectory)
    assert found.record == A_RUN.record
    assert found.parameters == {"m": 870.0}


def test_no_folder_no_run(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"wanted a run folder .* got no folder there"):
        read_run(tmp_path / "none")


def test_a_run_folder_is_open_to_whom_the_user_opens_new_folders(tmp_path: Path) -> None:
    (tmp_path / "usual").mkdir()
    with new_run_folder(tmp_path / "run"):
        pass
    assert (tmp_path / "run").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_an_older_run_is_replaced_as_a_whole(tmp_path: Path) -> None:
    (tmp_path / "run" / "figures").mkdir(parents=True)
    (tmp_path / "run" / "figures" / "old.svg").touch()
    write_run(A_RUN, tmp_path / "run")
    with new_run_folder(tmp_path / "run") as folder:
        (folder / "new").touch()
    assert set(contents(tmp_path)) == {"run/", "run/new"}


def test_an_empty_folder_takes_a_run_and_so_does_the_folder_that_a_link_leads_to(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "link").symlink_to("empty")
    (tmp_path / "link to come").symlink_to("later")
    for name in ("empty", "link", "link to come", "n" * 250):
        with new_run_folder(tmp_path / name) as folder:
            write_run(A_RUN, folder)
        assert read_run(tmp_path / name).record == A_RUN.record
    assert (tmp_path / "link").readlink() == Path("empty")


@pytest.mark.parametrize("what", ["file", "folder", "foreign run.json", "file above", "long name", "loop"])
def test_a_target_that_cannot_become_a_run_is_refused_at_once_and_untouched(tmp_path: Path, what: str) -> None:
    target = tmp_path / "target"
    match what:
        case "file":
            target.touch()
        case "folder" | "foreign run.json":
            target.mkdir()
            (target / ("thesis.tex" if what == "folder" else RECORD)).write_text('{"scripts": "of another program"}')
        case "file above":
            target.touch()
            target /= "run"
        case "long name":
            target /= "x" * 300
        case "loop":
            target.symlink_to("target")
    before = contents(tmp_path)
    with pytest.raises(InputError, match=r"target.*: "), new_run_folder(target):
        pytest.fail("the body must not be reached")
    assert contents(tmp_path) == before


@pytest.mark.parametrize("error", [InputError, KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("target", ["run", "new", "far/away/new"])
def test_nothing_stays_behind_and_an_older_run_stays_whole_if_the_body_raises(
    tmp_path: Path, error: type[BaseException], target: str
) -> None:
    (tmp_path / "run").mkdir()
    write_run(A_RUN, tmp_path / "run")
    before = contents(tmp_path)
    with pytest.raises(error), new_run_folder(tmp_path / target) as folder:
        write_run(A_RUN, folder)
        raise error
    assert contents(tmp_path) == before


def test_the_older_run_stays_where_it_is_if_the_new_one_cannot_take_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run").mkdir()
    write_run(A_RUN, tmp_path / "run")
    before, rename = contents(tmp_path), Path.rename

    def fails_for_the_new(path: Path, target: Path) -> Path:
        if path.parent.name == "new":
            raise PermissionError("no")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", fails_for_the_new)
    with pytest.raises(InputError, match="run: the run cannot be put there: no"), new_run_folder(tmp_path / "run"):
        pass
    assert contents(tmp_path) == before


def test_a_run_folder_that_holds_more_than_a_run_is_left_alone(tmp_path: Path) -> None:
    """What somebody put there would be lost with the older run."""
    target = tmp_path / "run"
    for _ in range(2):  # the second one replaces the first
        with new_run_folder(target) as folder:
            write_run(made_up_run(), folder)
    (target / "notes.txt").write_text("mine")
    said = r"run: holds notes\.txt, not of a run; it is left alone"
    with pytest.raises(InputError, match=said), new_run_folder(target):
        raise AssertionError("it must be refused before anything is made")
    assert (target / "notes.txt").read_text() == "mine"
