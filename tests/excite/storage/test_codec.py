"""The codec and files of curves: read as written, what does not fit is named, nothing that is not finite is written."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, strategies as st
from refused import refusal
from written_files import assert_alike

from excite.logs.log import Log
from excite.logs.log_reading import write_log
from excite.storage.atomic import check_table, write_json
from excite.storage.codec import INLINE, OBJECT, content_of, named, record_of
from excite.storage.records import chosen, every, read_curves, write_curves
from regressors.errors import InputError, NumericalError
from regressors.robot.robot import Robot
from regressors.samples import Array

# The codec: what is read is what was written, whatever it holds, and what does not fit is named with its place.


class Colour(Enum):
    """Two members with long values."""

    RED = "as a rose"
    BLUE = "as the sky"


@dataclass(frozen=True)
class Part:
    """A part whose fields stand beside those of the whole."""

    against: tuple[str, ...] = ()
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve."""

    joints: tuple[str, ...]
    q: Array


@dataclass(frozen=True, eq=False)
class Whole:
    """A record with everything that records have."""

    beside: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"holds": lambda whole: not whole.part.against}

    name: str
    number: float
    count: int
    colour: Colour
    part: Part = field(metadata=INLINE)
    spans: tuple[tuple[float, float], ...] = ()
    parts: tuple[Part, ...] = ()
    shares: dict[str, float] = field(default_factory=dict)
    maybe: Part | None = None
    robot: Robot | None = None
    curve: Curve | None = None


WHOLE = Whole(
    "a", 0.1, 3, Colour.BLUE, Part(("x",), 2.0), ((0.0, 1.0),), (Part(), Part(("y",))), {"z": 0.25}, Part(("m",))
)  # fmt: skip


def again(whole: Whole) -> Whole:
    """Written to text and read back."""
    content, arrays = content_of(whole)
    return record_of(Whole, json.loads(json.dumps(content, allow_nan=False)), arrays)


def test_a_record_is_read_as_written_and_its_entries_are_its_fields_with_what_follows_from_them() -> None:
    assert_alike(again(WHOLE), WHOLE)
    content, arrays = content_of(WHOLE)
    assert arrays == {}
    assert content["holds"] is False
    assert (content["against"], content["weight"], content["colour"]) == (["x"], 2.0, "BLUE")
    assert "part" not in content


@given(st.floats(), st.text(), st.integers(-(10**12), 10**12))
def test_values_keep_every_bit(number: float, name: str, count: int) -> None:
    read = again(Whole(name, number, count, Colour.RED, Part()))
    assert (read.name, read.count) == (name, count)
    np.testing.assert_array_equal([read.number, np.copysign(1.0, read.number)], [number, np.copysign(1.0, number)])


def test_arrays_stand_beside_under_the_names_of_their_fields() -> None:
    q = np.random.default_rng(0).normal(size=(5, 2))
    q[2, 1] = np.nan
    content, arrays = content_of(Whole("a", 1.0, 1, Colour.RED, Part(), curve=Curve(("j", "k"), q)))
    assert content["curve"] == {"joints": ["j", "k"], "q": {"array": "curve.q"}}
    read = record_of(Whole, content, arrays)
    np.testing.assert_array_equal(read.curve.q, q)
    assert record_of(Whole, content, {}).curve is None
    assert "expected an array of numbers" in refusal(record_of, Whole, content, {"curve.q": np.array(["x"])})


def test_what_does_not_fit_or_is_missing_is_named_with_its_place() -> None:
    content, arrays = content_of(WHOLE)
    for change, message in (
        ({"name": 3}, "^name: expected str, given 3"),
        ({"count": True}, "^count: expected int, given True"),
        ({"count": 1.5}, "^count: expected int, given 1.5"),
        ({"number": "much"}, "^number: expected a number, given 'much'"),
        ({"number": None}, "^number: expected a number, given None"),
        ({"colour": "GREEN"}, "^colour: 'GREEN' is missing"),
        ({"weight": "heavy"}, "^weight: expected a number"),
        ({"parts": [{"against": []}, {"against": [1]}]}, r"^parts\[1\].against\[0\]: expected str, given 1"),
        ({"parts": 3}, "^parts: "),
        ({"maybe": 3}, "^maybe: expected an object, given 3"),
        ({"curve": {"joints": ["j"], "q": [1.0]}}, "^curve.q: expected an array of numbers"),
        ({"robot": {}}, "^robot: 'description' is missing"),
    ):
        assert re.search(message, refusal(record_of, Whole, {**content, **change}, arrays))
    for name in ("name", "number", "colour"):
        with pytest.raises(InputError, match=f"'{name}' is missing"):
            record_of(Whole, {key: value for key, value in content.items() if key != name}, arrays)


@dataclass(frozen=True)
class Entries:
    """A record whose entries have other names than its fields."""

    parts: tuple[Part, ...] = field(metadata=named("pieces"))
    weights: tuple[float, ...] = field(default=(), metadata=named("heavy"))


def test_entries_may_have_names_of_their_own() -> None:
    content, _ = content_of(Entries((Part(),), (1.0,)))
    assert content == {"pieces": [{"against": [], "weight": 1.0}], "heavy": [1.0]}
    assert record_of(Entries, content, {}) == Entries((Part(),), (1.0,))
    for wrong, message in (
        ({"pieces": "a b"}, "pieces: expected a list, given 'a b'"),
        ({}, "'pieces' is missing"),
        ({"pieces": [{"weight": "a"}]}, r"pieces\[0\].weight: expected a number, given 'a'"),
    ):
        assert re.search(message, refusal(record_of, Entries, wrong, {}))


@dataclass(frozen=True, eq=False)
class Small:
    """A part whose arrays are lists in the file, one of them under another name."""

    listed: ClassVar[bool] = True

    values: Array
    flags: Array = field(metadata=named("set"))
    table: Array | None = None
    path: tuple[Array, Array] | None = None


@dataclass(frozen=True, eq=False)
class Holder:
    """A record of a part that stands inside it, and of an object that the codec does not know."""

    own: object = field(metadata=OBJECT)
    small: Small | None = field(default=None, metadata=INLINE)


def test_small_arrays_are_lists_and_objects_are_left_to_who_reads() -> None:
    values = np.array([0.1, np.nan, -np.inf])
    small = Small(values, np.array([True, False]), np.arange(4).reshape(2, 2), (np.zeros(3), np.ones(3)))
    content, arrays = content_of(Holder(own=object(), small=small))
    assert content.keys() == {"values", "set", "table", "path"}
    assert (content["values"], content["set"]) == ([0.1, "nan", "-inf"], [True, False])
    assert arrays.keys() == {"path.0", "path.1"}
    mine = object()
    read = record_of(Holder, {**json.loads(json.dumps(content, allow_nan=False)), "own": mine}, arrays)
    assert read.own is mine
    assert_alike(read.small, small)
    assert record_of(Holder, {**content, "own": mine}, {}).small.path is None


def test_lists_that_are_no_arrays_are_refused() -> None:
    content, arrays = content_of(Holder(own=1, small=Small(np.zeros(2), np.zeros(2))))
    for values in (["x"], [[1.0], [1.0, 2.0]], [None], 3):
        assert re.search(r"^(values: )?", refusal(record_of, Holder, {**content, "own": 1, "values": values}, arrays))


# Files of curves: read back as written, refused where they are damaged or far too large.


ROWS: dict[str, Any] = {
    "time": np.arange(4.0),
    "log": np.zeros(4, dtype=np.int16),
    "measured": np.ones(4, dtype=np.float32),
    "joints": np.array(["a", "b"]),
    "motion_q": np.zeros((3, 2)),
}


def test_arrays_are_read_as_written(tmp_path: Path) -> None:
    write_curves(tmp_path / "c.npz", ROWS)
    read = read_curves(tmp_path / "c.npz")
    assert set(read) == set(ROWS)
    for name, array in ROWS.items():
        np.testing.assert_array_equal(read[name], array)


def archive(member: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as written:
        written.writestr("time.npy", member)
    return stream.getvalue()


def test_damaged_and_far_too_large_files_are_named(tmp_path: Path) -> None:
    np.save(objects := io.BytesIO(), np.array([{"a": 1}], dtype=object), allow_pickle=True)
    damaged = map(archive, (b"no array", b"\x93NUMPY\x01\x00", objects.getvalue()))
    for content, message in (
        *((content, r"c\.npz") for content in (b"", b"PK\x03\x04", *damaged)),
        (archive(bytes(70_000_000)), "expected at most"),
    ):
        (tmp_path / "c.npz").write_bytes(content)
        assert re.search(message, refusal(read_curves, tmp_path / "c.npz"))


def test_strides_and_choices() -> None:
    assert [every(n, 10) for n in (1, 10, 11, 20, 21)] == [1, 1, 2, 2, 3]
    assert chosen(3, 10).tolist() == [0, 1, 2]
    assert chosen(100, 5)[[0, -1]].tolist() == [0, 99]


# No file holds a number that is not finite: what is not is named by its place, and nothing is written.


NAN, INF = float("nan"), float("inf")


def test_what_is_not_finite_is_named_and_not_written(tmp_path: Path) -> None:
    for content, place in (
        ({"a": NAN}, "a is not finite"),
        ({"a": {"b": [1.0, INF]}}, r"a.b\[2\] is not finite"),
        ([[0.0], [-INF]], r"\[2\]\[1\] is not finite"),
        (NAN, "it is not finite"),
    ):
        with pytest.raises(NumericalError, match=f"^out.json is not written: {place}"):
            write_json(tmp_path / "out.json", content)
    table = np.zeros((4, 3))
    check_table(Path("motion.csv"), ("time", "a", "b"), table)
    table[2, 1] = NAN
    with pytest.raises(NumericalError, match=r"^motion.csv is not written: a is not finite in row 3"):
        check_table(Path("motion.csv"), ("time", "a", "b"), table)
    log = Log("log", "0" * 64, ("j",), np.arange(3.0), np.zeros((3, 1)))
    object.__setattr__(log, "q", np.array([[0], [INF], [0]]))  # by other means than its constructor, which refuses it
    with pytest.raises(NumericalError, match=r"j.position is not finite in row 2"):
        write_log(log, tmp_path / "log.csv")
    assert list(tmp_path.iterdir()) == []
