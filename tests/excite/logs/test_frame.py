"""Logs of frames, mappings and arrays are those of files, down to the messages, with hashes of their own."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings, strategies as st
from refused import refusal

from excite.logs.log import Log, channels_of
from excite.logs.log_reading import read_log, write_log
from excite.logs.mapping import LogMapping
from regressors.errors import InputError, UnknownName
from regressors.models.differential import DifferentialModel
from regressors.readers.library import built_in

CHANNELS = ("dq", "effort", "temperature", "command")
FLOATS = st.floats(-1e9, 1e9)


class Labelled:
    """A frame as pandas has it: its labels need not be text, and a column is no array."""

    def __init__(self, columns: dict[Any, list[Any]]) -> None:
        self._columns = columns

    @property
    def columns(self) -> Any:
        return iter(self._columns)

    def __getitem__(self, label: Any) -> Any:
        return pa.chunked_array([self._columns[label]])

    def reset_index(self) -> None:
        raise AssertionError("nothing is changed")


FRAMES: dict[str, Callable[[dict[str, list[Any]]], Any]] = {
    "dict of lists": lambda columns: columns,
    "dict of arrays": lambda columns: {name: np.array(column) for name, column in columns.items()},
    "pyarrow": pa.table,
    "labelled": Labelled,
}


def same(one: Log, other: Log) -> None:
    assert one.joints == other.joints
    assert channels_of(one).keys() == channels_of(other).keys()
    for name in ("time", *channels_of(one)):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), strict=True)


def written(columns: dict[str, list[Any]], path: Path) -> Path:
    """A CSV file of columns, whose cells are empty where there is no number."""
    rows = [",".join("" if x != x else repr(x) for x in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([",".join(columns), *rows, ""]))
    return path


def columns_in(path: Path) -> dict[str, list[Any]]:
    """Columns of a CSV file, as a library of frames reads them."""
    with path.open() as stream:
        names, *rows = csv.reader(stream)
    columns = ([float(cell or "nan") for cell in column] for column in zip(*rows, strict=True))
    return dict(zip(names, columns, strict=True))


@st.composite
def logs(draw: st.DrawFn) -> Log:
    """Logs of a few joints, with some of the channels."""
    joints = draw(st.lists(st.sampled_from(["a", "B 2", "ü", "wrist.1"]), min_size=1, max_size=3, unique=True))
    steps = draw(st.lists(st.floats(1e-4, 10.0), min_size=1, max_size=5))
    rows = len(steps) + 1

    def table(width: int) -> Any:
        cells = st.lists(FLOATS, min_size=rows * width, max_size=rows * width)
        return np.array(draw(cells)).reshape(rows, width)

    parts = {name: table(len(joints)) for name in CHANNELS if draw(st.booleans())}
    parts |= {"wrench": table(6)} if draw(st.booleans()) else {}
    return Log("made", "", tuple(joints), np.cumsum([0.0, *steps]), table(len(joints)), **parts)


@settings(deadline=None, max_examples=40)
@given(logs())
def test_a_frame_of_a_file_is_read_as_the_file(tmp_path_factory: pytest.TempPathFactory, log: Log) -> None:
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    write_log(log, path)
    read, columns = read_log(path), columns_in(path)
    hashes = set()
    for make in FRAMES.values():
        of_frame = Log.from_frame(make(columns))
        same(of_frame, read)
        assert of_frame.left_out == read.left_out
        hashes.add(of_frame.sha256)
    of_arrays = Log.from_arrays(log.time, **channels_of(log), joints=log.joints)
    same(of_arrays, read)
    assert len(hashes) == 1


GOOD: dict[str, list[Any]] = {
    "time": [0.0, 0.5, 1.0, 1.5],
    "a.position": [1.0, 2.0, 3.0, 4.0],
    "b.position": [5, 6, 7, 8],
    "a.effort": [0.1, 0.2, 0.3, 0.4],
    "b.effort": [0.5, 0.6, 0.7, 0.8],
}
NAN = float("nan")
ROWS = {
    "nan": {**GOOD, "b.effort": [0.5, NAN, 0.7, 0.8]},
    "repeated": {**GOOD, "time": [0.0, 0.5, 0.5, 1.5]},
}


@pytest.mark.parametrize("kind", ROWS)
@pytest.mark.parametrize("how", [{}, {"drop": True}, {"only": (1, 9)}, {"joints": ["b"]}, {"joints": ["c"]}])
def test_faulty_rows_are_told_and_left_out_as_in_files(tmp_path: Path, kind: str, how: dict[str, Any]) -> None:
    """The messages differ in nothing but the name of the place."""
    columns, path = ROWS[kind], tmp_path / "log.csv"
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows), ""]))
    how = {name: (kind,) if name == "drop" else value for name, value in how.items()}

    def outcome(read: Callable[[], Log]) -> Any:
        try:
            return read()
        except InputError as error:
            return str(error)

    of_file, of_frame = outcome(lambda: read_log(path, **how)), outcome(lambda: Log.from_frame(columns, **how))
    if isinstance(of_file, str):
        of_frame = re.sub(r"frame, row (\d),", lambda found: f"{path}, line {int(found[1]) + 1},", of_frame)
        assert of_frame.replace("frame", str(path)) == of_file
    else:
        same(of_frame, of_file)
        assert of_frame.left_out == of_file.left_out
        np.testing.assert_array_equal(of_frame.row_numbers, of_file.row_numbers)


FOREIGN = LogMapping.model_validate(
    {
        "time": {"column": "stamp", "unit": "ms"},
        "joints": ["a", "b"],
        "position": {"columns": ["p1", "p2"], "unit": "deg"},
        "current": {"columns": ["i1", 5], "unit": "A", "gain": [2.0, -3.0]},
    }
)


def test_foreign_names_go_through_a_mapping(tmp_path: Path) -> None:
    stamps = (np.arange(40) * 2 + 1_700_000_000_000).tolist()
    random = np.random.default_rng(0)
    columns = {"stamp": stamps, **{name: random.normal(size=40).tolist() for name in ("p1", "p2", "i1", "i2")}}
    path = written(columns, tmp_path / "foreign.csv")
    read = read_log(path, mapping=FOREIGN)
    for make in FRAMES.values():
        same(log := Log.from_frame(make(columns), FOREIGN), read)
        assert log.left_out == read.left_out
    numbered = dict(enumerate(columns.values()))
    text = tmp_path / "map.yaml"
    text.write_text(
        "time: {column: '0', unit: ms}\njoints: [a, b]\nposition: {columns: [2, 3], unit: deg}\n"
        "current: {columns: [4, 5], unit: A, gain: [2.0, -3.0]}\n"
    )
    same(Log.from_frame(Labelled(numbered), text), read)
    with pytest.raises(UnknownName, match=r"column in mine.*'p1'.*q1"):
        Log.from_frame({"q1" if name == "p1" else name: c for name, c in columns.items()}, FOREIGN, source="mine")


def test_columns_of_other_rates_are_aligned_as_in_files(tmp_path: Path) -> None:
    """Joined on their times, three of four rows have positions, and every fourth has currents."""
    time = np.arange(0, 400.0)
    sampled = np.where(time % 4, NAN, np.sin(time / 50))
    columns = {"stamp": time.tolist(), "p1": np.sin(time / 100).tolist(), "p2": np.cos(time / 100).tolist()}
    columns |= {"i1": sampled.tolist(), "i2": sampled.tolist()}
    path = written(columns, tmp_path / "joined.csv")
    read, log = read_log(path, mapping=FOREIGN), Log.from_frame(columns, FOREIGN)
    same(log, read)
    assert log.left_out == read.left_out
    assert any("interpolated linearly" in note for note in log.left_out)


def test_the_hash_is_that_of_what_is_read() -> None:
    log = Log.from_frame(GOOD)
    assert Log.from_frame({**GOOD, "note": ["x"] * 4}).sha256 == log.sha256
    assert Log.from_frame(GOOD, only=(1, 3)).sha256 == log.sha256
    assert Log.from_frame(GOOD, source="again").sha256 == log.sha256
    assert Log.from_frame({**GOOD, "b.effort": [0.5, 0.6, 0.7, 0.8 + 1e-15]}).sha256 != log.sha256
    assert Log.from_frame({**GOOD, "time": [0.0, 0.5, 1.0, 1.6]}).sha256 != log.sha256


def test_arrays_may_be_lists_and_have_one_dimension_for_one_joint() -> None:
    log = Log.from_arrays([0, 1, 2], [1, 2, 3], effort=(4, 5, 6), joints=["a"], source="bench")
    assert (log.source, log.joints, log.count) == ("bench", ("a",), 3)
    np.testing.assert_array_equal(log.effort, [[4.0], [5.0], [6.0]], strict=True)
    robot = built_in("irp6")
    assert Log.from_arrays([0, 1], np.zeros((2, robot.n)), robot=robot).joints == robot.joint_names


TIMES, ANGLES = [0.0, 1.0, 2.0], [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]
STAMPS = np.array([0, 1, 2, 3], dtype="datetime64[s]")
REFUSED: dict[str, tuple[Callable[[], Log], str]] = {
    "no time": (
        lambda: Log.from_frame({"t": [0, 1], "a.position": [0, 1]}),
        r"^frame: expected the columns time and NAME.position, given t, a.position; rename them, or give `mapping`, "
        r"which says what columns of other names are$",
    ),
    "time is an index": (
        lambda: Log.from_frame(Labelled({"a.position": [0.0, 1.0]})),
        r"other names are; an index is no column, `reset_index\(\)` makes one of it$",
    ),
    "no columns": (lambda: Log.from_frame({}), "given none"),
    "columns without names": (lambda: Log.from_frame(Labelled({0: TIMES, 1: TIMES})), "given 0, 1; rename them"),
    "one joint lacks a column": (
        lambda: Log.from_frame({k: v for k, v in GOOD.items() if k != "b.effort"}),
        "^frame: the log has the columns a.effort, but not b.effort$",
    ),
    "something with columns": (
        lambda: Log.from_frame(DifferentialModel(built_in("irp6"))),
        "^frame: expected a frame or a dict of columns, given DifferentialModel$",
    ),
    "one row": (lambda: Log.from_frame({k: v[:1] for k, v in GOOD.items()}), "^frame holds one row; a log has two"),
    "not a frame": (lambda: Log.from_frame([GOOD]), "^frame: expected a DataFrame or a mapping, given"),
    "turned": (
        lambda: Log.from_arrays(TIMES, np.transpose(ANGLES), joints=["a", "b"]),
        r"^arrays: q has shape \(2, 3\), expected \(3, 2\): a row for each time, and a column for each joint \(a, b\); "
        "transpose it$",
    ),
    "another length": (
        lambda: Log.from_arrays(TIMES, ANGLES, effort=ANGLES[:2], joints=["a", "b"]),
        r"^arrays: effort has shape \(2, 2\), expected \(3, 2\)",
    ),
    "five components": (
        lambda: Log.from_arrays(TIMES, ANGLES, wrench=np.zeros((3, 5)), joints=["a", "b"]),
        r"^arrays: wrench has shape \(3, 5\), expected \(3, 6\): .* for each component$",
    ),
    "no names": (
        lambda: Log.from_arrays(TIMES, ANGLES),
        r"^arrays: the joints have no names; give joints=\[\.\.\.\], as the columns are, or robot$",
    ),
    "uneven": (lambda: Log.from_arrays(TIMES, [[1], [2, 3], [4]], joints=["a"]), "^q: expected an array of real numb"),
    "gaps": (
        lambda: Log.from_arrays(TIMES, [[1, 2], [NAN, 4], [5, 6]], joints=["a", "b"]),
        "^arrays, row 2, column a.position: nan is not a measurement",
    ),
    "times of arrays": (
        lambda: Log.from_arrays([[0.0, 1.0, 2.0]], ANGLES, joints=["a", "b"]),
        r"^arrays, column time: expected a number in each row, given an array of shape \(1, 3\)$",
    ),
}


COLUMNS: tuple[tuple[str, Any, str], ...] = (
    ("b.effort", [1.0, 2.0], "^frame, column b.effort: 2 rows, but column time has 4$"),
    ("time", STAMPS, r"column time: expected a number in each row, given datetime64\[s\], such as '1970-.*; give sec"),
    ("time", [0.0, 1.0, 0.5, 2.0], "^frame, row 3, column time: time runs backwards, from 1 to 0.5; "),
    ("a.effort", ["1,5", "2", "3", "4"], "a.effort: expected a number in each row, given <U3, such as '1,5'$"),
    ("a.effort", [1.0, {}, 3.0, 4.0], "^frame, column a.effort: expected a number in each row, given .*'dict'"),
    (
        "a.effort",
        [1.0, None, 3.0, 4.0],
        r"^frame, row 2, column a.effort: nan is not .*; 1 row like this \(`drop='nan'` l",
    ),
    ("a.effort", np.ones((4, 2)), r"expected a number in each row, given an array of shape \(4, 2\)$"),
    ("a.effort", [[1.0], [2.0, 3.0], [4.0], [5.0]], "expected a number in each row, given .*inhomogeneous"),
    ("a.effort", 1.0, r"^frame, column a.effort: expected a number in each row, given an array of shape \(\)$"),
)


@pytest.mark.parametrize(("name", "values", "message"), COLUMNS, ids=range(len(COLUMNS)))
def test_columns_that_do_not_fit_are_refused(name: str, values: Any, message: str) -> None:
    assert re.search(message, refusal(Log.from_frame, {**GOOD, name: values}))


@pytest.mark.parametrize("name", REFUSED)
def test_what_does_not_fit_is_refused(name: str) -> None:
    make, message = REFUSED[name]
    assert re.search(message, refusal(make))
