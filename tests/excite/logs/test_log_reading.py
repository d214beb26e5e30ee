"""Logs read from files: round trips, foreign layouts, and every fault named by its line and column."""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from recordings import log_of, real_log
from refused import refusal

from excite.logs.log import Log, channels_of
from excite.logs.log_reading import read_log, read_sidecar, write_log
from excite.logs.mapping import read_mapping
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in

GOOD = "time,a.position,b.position\n0,1,2\n0.5,3,4\n1,5,6\n"


@pytest.fixture
def written(tmp_path):
    def write(content, name="log.csv"):
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        return tmp_path / name

    return write


def same(one: Log, other: Log) -> None:
    assert one.joints == other.joints
    assert channels_of(one).keys() == channels_of(other).keys()
    for name in ("time", *channels_of(one)):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), strict=True)


# --- the house format ------------------------------------------------------------------------------------------------


def test_what_is_written_reads_back_to_the_same_bits(tmp_path):
    random = np.random.default_rng(1)
    time = np.cumsum(random.uniform(0.001, 0.002, 50))
    parts = [random.normal(size=(50, 3)) * 10.0 ** random.integers(-9, 9, (50, 3)) for _ in range(5)]
    full = log_of(time, *parts[:3], wrench=random.normal(size=(50, 6)), temperature=parts[3], command=parts[4])
    bare = log_of(time, parts[0])
    for log in (full, bare):
        write_log(log, tmp_path / "log.csv")
        read = read_log(tmp_path / "log.csv")
        same(read, log)
        assert read.left_out == ()
        assert read.sha256 == hashlib.sha256((tmp_path / "log.csv").read_bytes()).hexdigest()


def test_commands_are_cut_with_the_rows_and_leave_the_identity_of_logs_without_them():
    time = np.arange(3.0)
    log = log_of(time, np.outer(time, [1.0, 2.0]), effort=np.outer(time, [3.0, 4.0]))
    assert log.identity == "bb506c0be088e026dd8ee21180c5e64b857c97d03053004625e3ddfbb14aca06"
    told = replace(log, command=np.outer(time, [5.0, 6.0]))
    assert told.identity != log.identity
    np.testing.assert_array_equal(told.rows(slice(1, 3)).of(["b"]).command, [[6.0], [12.0]])
    assert "command has shape (2, 2), not (3, 2)" in refusal(replace, log, command=np.zeros((2, 2)))


def test_columns_are_found_by_name_in_any_order_and_extra_ones_are_named(written):
    path = written("b.position,segment,time,a.position,a.acceleration\n1,excite,0,2,9\n3,excite,1,4,9\n")
    log = read_log(path, joints=["a", "b"])
    assert log.joints == ("a", "b")
    np.testing.assert_array_equal(np.column_stack([log.time, log.q]), [[0, 2, 1], [1, 4, 3]])
    assert log.left_out == ("2 columns not used: segment, a.acceleration",)
    assert read_log(path).joints == ("b", "a")
    assert read_log(path, joints=["a"]).q.shape == (2, 1)


def test_harmless_forms_of_the_same_log(written):
    for content, mended in (
        (GOOD.replace("\n", "\r\n"), ()),
        (b"\xef\xbb\xbf" + GOOD.encode(), ("the file starts with a byte order mark, which is ignored",)),
        (GOOD.replace(",", " , "), ()),
        ('"time","a.position","b.position"\n0,1,2\n0.5,3,4\n1,5,6\n', ()),
        ("time,a.position,b.position,,\n0,1,2,,\n0.5,3,4,,\n1,5,6,,\n", ()),
        ("time,a.position,b.position,note\n0,1,2,\n0.5,3,4,\n1,5,6,\n", ("1 column not used: note",)),
    ):
        log = read_log(written(content))
        np.testing.assert_array_equal(np.column_stack([log.time, log.q]), [[0, 1, 2], [0.5, 3, 4], [1, 5, 6]])
        assert log.left_out == mended


def rows(*lines):
    return "time,a.position,b.position\n" + "".join(f"{line}\n" for line in lines)


FAULTS = {
    "not a number": (rows("0,1,2", "1,abc,4"), "line 3, column a.position: 'abc' is not a number"),
    "decimal comma": ("time;a.position\n0,5;1\n", "no column 'time'; columns: time;a.position; .* separated by ';'"),
    "nan": (rows("0,1,2", "1,3,nan", "2,3,nan"), "line 3, column b.position: nan is not a measurement; 2 rows like th"),
    "infinite": (rows("0,1,2", "1,-inf,4"), "line 3, column a.position: -inf is not a measurement; 1 row like this"),
    "empty cell": (rows("0,1,2", "1,,4"), "line 3, column a.position: the cell is empty"),
    "short row": (rows("0,1,2", "1,3", "2,5,6"), "line 3 has 2 columns, expected 3"),
    "long row": (rows("0,1,2", "1,3,4,5", "2,5,6"), "line 3 has 4 columns, expected 3"),
    "two wrong rows that make up for each other": (rows("0,1,2", "1,2", "2,3,4,5"), "line 3 has 2 columns"),
    "empty row": (rows("0,1,2", "", "2,5,6"), "line 3 is empty, expected 3 columns"),
    "cut off": (rows("0,1,2", "1,3"), "line 3 ends early: 2 of 3 columns; the recording was cut off"),
    "cut off within a number": (rows("0,1,2", "1,3,4", "2,5,-")[:-1], "line 4 ends early: its last cell is '-'"),
    "backwards": (rows("0,1,2", "1,3,4", "0.5,3,4"), "line 4, column time: time runs backwards, from 1 to 0.5"),
    "repeated": (rows("0,1,2", "1,3,4", "1,3,4"), "line 4, column time: time 1 is repeated; 1 row like this"),
    "empty file": ("", "is empty"),
    "one row": (rows("0,1,2"), "holds one row"),
    "no header": ("0,1,2\n1,3,4\n", "None was recognised among 1, 2, 3; `guess_mapping` shows"),
    "no time": ("t,a.position\n0,1\n1,2\n", "When was each row taken.*; and 1 more; `guess_mapping`"),
    "no positions": ("time,a,b\n0,1,2\n", "no column NAME.position; columns: time, a, b"),
    "twice": ("time,a.position,a.position\n0,1,2\n", "two columns are named 'a.position'"),
    "half a channel": ("time,a.position,b.position,a.effort\n0,1,2,3\n1,1,2,3\n", "columns a.effort, but not b.effort"),
    "half a wrench": ("time,a.position,wrench.force.x\n0,1,2\n1,1,2\n", "not wrench.force.y, wrench.force.z"),
    "binary": (b"time,a.position\n0,1\n\x00\x01\x02", "is not a text file: it has a zero byte in line 3"),
    "UTF-16": (GOOD.encode("utf-16"), "is written in UTF-16"),
    "Latin 1": ("time,a.position,Kraft°\n0,1,2\n".encode("latin-1"), "is not UTF-8: byte 0xb0 in line 1"),
}


def test_faults_are_named(written):
    for case, (content, message) in FAULTS.items():
        told = refusal(read_log, written(content))
        assert re.search(message, told), case
        assert "log.csv" in told, case


def test_missing_file_and_missing_joint(tmp_path, written):
    path = written(GOOD)
    assert re.search(r"cannot read log .*none\.csv: No such file", refusal(read_log, tmp_path / "none.csv"))
    with pytest.raises(UnknownName, match=r"no joint in .* named 'c'; available: a, b"):
        read_log(path, joints=["a", "c"])
    with pytest.raises(UnknownName, match="no kind of row to drop named 'all'; available: truncated, nan, repeated"):
        read_log(path, drop=["all"])


def test_rows_may_be_left_out_and_are_counted(written):
    kinds = {"truncated", "nan", "repeated"}
    for content, drop, time, left_out in (
        (rows("0,1,2", "1,3,4", "2,5"), "truncated", [0, 1], "1 row cut off at the end"),
        (rows("0,1,2", "1,3,4", "2,5,-")[:-1], "truncated", [0, 1], "1 row cut off at the end"),
        (rows("0,1,2", "1,nan,4", "2,5,6"), "nan", [0, 2], "1 row with cells that are empty, NaN or infinite"),
        (rows("0,1,2", "1,,4", "2,inf,6", "3,5,6"), "nan", [0, 3], "2 rows with cells that are empty, NaN or infinite"),
        (rows("0,1,2", "0,7,7", "0,8,8", "1,3,4"), "repeated", [0, 1], "2 rows with time repeated"),
    ):
        path = written(content)
        log = read_log(path, drop=[drop])
        np.testing.assert_array_equal(log.time, time)
        assert log.left_out == (left_out,)
        with pytest.raises(InputError):
            read_log(path, drop=kinds - {drop})
    for content, drop, message in (
        (rows("0,1,2", "1,x,4", "2,5,6"), kinds, r"line 3, column a\.position: 'x' is not a number"),
        (rows("0,1,2", "1,3,4", "0,5,6"), kinds, "runs backwards"),
        (rows("0,1,2", "1,nan,4", "2,nan,6"), ["nan"], "fewer than two rows are left; left out: 2 rows with cells"),
    ):
        assert re.search(message, refusal(read_log, written(content), drop=drop))


# --- foreign layouts -------------------------------------------------------------------------------------------------

MOTOR_SIDE = """
separator: ";"
skip: 1
time: {column: stamp, unit: ms}
joints: [one, two]
position: {columns: [m1, m2], unit: deg, ratio: [100, -50], offset: [10, 0], sign: [1, -1]}
velocity: {columns: [3, 5], unit: rpm, ratio: [100, -50]}
current: {columns: [i1, i2], unit: mA, gain: 0.5, ratio: [100, -50]}
temperature: {columns: [k, k], unit: K, offset: 273.15}
"""


def test_motor_side_logs_become_joint_side(written):
    head = "recorded on the motors' side\nstamp;m1;v1;m2;v2;i1;i2;k\n"
    path = written(head + "1000;910;60;50;30;2000;-1000;293.15\n1010;1000;60;50;30;2000;-1000;293.15\n")
    log = read_log(path, mapping=read_mapping(written(MOTOR_SIDE, "map.yaml")))
    assert log.joints == ("one", "two")
    np.testing.assert_allclose(log.time, [1.0, 1.01])
    np.testing.assert_allclose(log.q[0], [math.radians(9), math.radians(1)])
    np.testing.assert_allclose(log.dq[0], [2 * math.pi / 100, -math.pi / 50])
    np.testing.assert_allclose(log.effort[0], [2.0 * 0.5 * 100, -1.0 * 0.5 * -50])
    np.testing.assert_allclose(log.temperature, 20.0)
    assert log.wrench is None
    assert read_log(path, ["two"], read_mapping(written(MOTOR_SIDE, "map.yaml"))).joints == ("two",)


def test_a_wrench_through_a_mapping(written):
    text = (
        "joints: [a]\nseparator: tab\ntime: {column: t}\nposition: {columns: [q], unit: turns}\n"
        "wrench: {columns: [3, 4, 5, 6, 7, 8], unit: kN}\n"
    )
    path = written("t\tq\tx\ty\tz\tr\tp\tw\n" + "".join(f"{t}\t0.25\t1\t2\t3\t4\t5\t6\n" for t in range(2)))
    log = read_log(path, mapping=read_mapping(written(text, "map.yaml")))
    np.testing.assert_array_equal(log.wrench[0], [1000, 2000, 3000, 4000, 5000, 6000])
    np.testing.assert_allclose(log.q, math.pi / 2)


BASE = "joints: [a, b]\ntime: {column: 1}\nheader: false\n"
POSITION = "position: {columns: [2, 3], unit: rad}\n"


EFFORT, CURRENT = "effort: {columns: [4, 5], unit: Nm}\n", "current: {columns: [4, 5], unit: A, gain: 1}\n"


def position(fields: str, columns: str = "[2, 3]") -> str:
    return f"{BASE}position: {{columns: {columns}, {fields}}}\n"


BAD_MAPPINGS = {
    "no positions": (BASE, "position .*is missing"),
    "unknown unit": (position("unit: furlong"), r"position.unit \(line 4\): no unit 'furlong'; available: rad, deg"),
    "unit of another channel": (position("unit: rad/s"), "no unit 'rad/s'; available: rad, deg"),
    "columns for other joints": (position("unit: rad", "[2]"), r"position \(line 4\): has 1 columns for 2 joints"),
    "values for other joints": (position("unit: rad, ratio: [1, 2, 3]"), "gives 3 values for 2 columns"),
    "unknown field": (BASE + POSITION + "speed: 3\n", r"speed \(line 5\): no such field; available: joints, time"),
    "current without gain": (BASE + POSITION + "current: {columns: [4, 5], unit: A}\n", "current.gain .*is missing"),
    "current and effort": (BASE + POSITION + EFFORT + CURRENT, "current .*is given as well as effort"),
    "joint twice": ("joints: [a, a]\ntime: {column: 1}\n" + POSITION, "joints .*'a' is given twice"),
    "not YAML": ("joints: [a\n", "line 2: not valid YAML"),
}


def test_bad_mappings_are_named(written):
    for text, message in BAD_MAPPINGS.values():
        assert re.search(f"map.yaml.*{message}", refusal(read_mapping, written(text, "map.yaml")))
    for text, content, message in (
        (BASE + POSITION, "0,1\n1,2\n", "has 2 columns, the mapping asks for number 3"),
        (BASE + POSITION, "t,a,b\n0,1,2\n", "line 1 holds no number: t, a, b; check header"),
        (BASE.replace("false", "true") + POSITION, "0,1,2\n1,2,3\n", "line 1 holds numbers, .* header: false"),
        (BASE + POSITION + "skip: 5\n", "0,1,2\n1,2,3\n", "has 2 lines, of which the mapping skips 5"),
        (BASE + "position: {columns: [x, y], unit: rad}\n", "0,1,2\n1,2,3\n", "no column in .* named 'x'"),
        (BASE + POSITION + "separator: ';'\n", "0;1,5,5;2\n1;2;3\n", "line 1, column 2: '1,5,5' is not a number"),
        (BASE + POSITION, "0,1,2\n1,x,3\n", "line 2, column 2: 'x' is not a number"),
    ):
        assert re.search(message, refusal(read_log, written(content), mapping=read_mapping(written(text, "map.yaml"))))


def test_a_recorded_log_reads_through_the_example(written):
    log = real_log("ur-20_02_10-30sec_12harm")
    assert (log.count, log.q.shape, log.joints) == (3691, (3691, 6), built_in("ur10e").joint_names)
    assert log.left_out == ("12 columns not used: 20, 21, 22, 23, 24, 25, 26, 27 and 4 more",)
    np.testing.assert_allclose(log.q[0], [0.013132, -1.527041, 0.022675, -1.588008, 0.009861, -0.008425])
    np.testing.assert_allclose(log.effort[0, :2], [0.033105 * 14.87, -0.103182 * 13.26])


# --- beside a log ----------------------------------------------------------------------------------------------------


def test_other_files_beside_a_log_are_refused(written):
    for content, message in (
        ("{}", "expected schema excite.log/2, given None"),
        ('{"schema": "excite.log/1"}', "robot should have a name"),
        ('{"schema": "excite.log/1", "robot": {"name": "a", "sha256": "b"}, "truth": {"m1": "x"}}', "truth should map"),
        ("[", "is not JSON"),
    ):
        path = written(content, "log.json")
        assert re.search(message, refusal(read_sidecar, path.with_suffix(".csv")))
