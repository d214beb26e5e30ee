"""Tables found in texts: separators, headers, units, comments; any text is a table, none, or refused in one line."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import motion
from hypothesis import HealthCheck, given, settings, strategies as st
from recordings import so101_folder
from refused import refusal
from written_files import text_file

import excite
from excite.logs.recordings.recording import ColumnName, is_clock, parsed_name
from excite.logs.recordings.text_table import text_layout
from regressors.errors import InputError

ROWS = ["0,1,2", "1,2,3", "2,3,4"]
LAYOUTS = {
    "header": (["t,a,b", *ROWS], (",", 1, ("t", "a", "b"), 0)),
    "no header": (ROWS, (",", 0, ("1", "2", "3"), None)),
    "semicolons": (["t;a;b", *(row.replace(",", ";") for row in ROWS)], (";", 1, ("t", "a", "b"), 0)),
    "tabs": ([row.replace(",", "\t") for row in ["t,a,b", *ROWS]], ("\t", 1, ("t", "a", "b"), 0)),
    "white space": ([row.replace(",", "   ") for row in ["t,a,b", *ROWS]], (None, 1, ("t", "a", "b"), 0)),
    "preface": (["robot: x", "", "t,a,b", *ROWS], (",", 3, ("t", "a", "b"), 2)),
    "comment": (["# t,a,b", *ROWS], (",", 1, ("# t", "a", "b"), 0)),
    "comment of words": (["# t a b", *(row.replace(",", " ") for row in ROWS)], (None, 1, ("1", "2", "3"), None)),
    "row of units": (["t,a,b", "s,deg,deg/s", *ROWS], (",", 2, ("1", "2", "3"), None)),
    "twice": (["t,a,a", *ROWS], (",", 1, ("1", "2", "3"), None)),
    "empty cells": (["t,a,b", "0,1,", "1,,2", "2,3,"], (",", 1, ("t", "a", "b"), 0)),
    "words": (["t,a,state", "0,1,idle", "1,2,runs", "2,3,runs"], (",", 1, ("t", "a", "state"), 0)),
    "decimal commas": (["t;a", "0,5;1,5", "1,5;2,5", "2,5;3,5"], (";", 1, ("t", "a"), 0)),
    "decimal commas, white space": (["0,5 1 2,5", "1,5 2 3,5", "2,5 3 4,5"], (None, 0, ("1", "2", "3"), None)),
}


def test_layouts() -> None:
    for lines, expected in LAYOUTS.values():
        layout = text_layout(lines)
        assert (layout.separator, layout.first, layout.names, layout.header) == expected
    for lines in ([], ["a"], ["a,b", "c,d"], ["1,2"]):
        assert text_layout(lines) is None
    layout = text_layout(["t,q1,dq1", "s,deg,deg/s", *ROWS])
    assert (layout.titles, layout.units) == (("t", "q1", "dq1"), ("s", "deg", "deg/s"))


NAMES = {
    "q1 [deg]": ("position", "deg", ("1",)),
    "dq1 (deg/s)": ("velocity", "deg/s", ("1",)),
    "axis1_pos_deg": ("position", "deg", ("axis", "1")),
    "vel_2_rad_s": ("velocity", "rad/s", ("2",)),
    "tau_1_Nm": ("effort", "Nm", ("1",)),
    "J1 torque [Nm]": ("effort", "Nm", ("j", "1")),
    "i3 [A]": ("current", "A", ("3",)),
    "t_ms": ("time", "ms", ()),
    "Time (ms)": ("time", "ms", ()),
    "elbow_joint.vel": ("velocity", "", ("elbow", "joint")),
    "state.tau_J[6]": ("effort", "", ("state", "j", "6")),
    "success_rate": ("", "", ("success", "rate")),
}


def test_names_say_quantity_unit_and_joint() -> None:
    assert {name: parsed_name(name) for name in NAMES} == {name: ColumnName(*of, True) for name, of in NAMES.items()}
    for name in ("target_q_0", "state.q_d[0]", "q_cmd_1", "joint1.error.position", "q_desired_3", "q_soll", "qCmptd1"):
        assert not parsed_name(name).measured
    assert [is_clock(name) for name in ("__time", "timestamp", "t", "t1")] == [True, True, True, False]


WORDS = ["", "nan", "inf", "1", "-2.5e3", "q1", "dq1 [deg/s]", "time", "__time", '"', "1,5", "#", "a.position"]
CELL = st.one_of(
    st.sampled_from(WORDS),
    st.text(st.characters(codec="utf-8", exclude_characters="\0\n\r"), max_size=6),
    st.floats().map(str),
)
TEXTS = st.tuples(
    st.sampled_from([",", ";", "\t", " "]),
    st.lists(st.lists(CELL, min_size=1, max_size=5), max_size=4),
    st.lists(st.lists(st.integers(-9, 99), min_size=3, max_size=3), max_size=40),
).map(lambda drawn: "\n".join(drawn[0].join(map(str, row)) for row in [*drawn[1], *drawn[2]]))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=TEXTS)
def test_any_text_is_read_or_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = text_file(tmp_path / "any", text)
    try:
        guess = excite.guess_mapping(path)
    except InputError as error:
        said = str(error)
    else:
        said = " ".join(guess.questions)
        assert said
        if guess.mapping is not None:
            with suppress(InputError):
                log = excite.read_log(path, mapping=guess.mapping, drop=["nan", "repeated", "garbage"])
                assert np.all(np.diff(log.time) > 0)
    assert "\n" not in said


def test_cells_that_are_empty_cost_no_row_of_other_columns(tmp_path: Path) -> None:
    rows = "".join(f"{k / 10},{k if k % 2 else ''},{'' if k % 2 else -k}\n" for k in range(20))
    path = text_file(tmp_path / "sparse", "t,a,b\n" + rows)
    columns = excite.read_recording(path).streams["table"].columns
    np.testing.assert_array_equal(columns["a"][1::2], np.arange(1, 20, 2))
    np.testing.assert_array_equal(columns["b"][::2], -np.arange(0, 20, 2))
    assert np.isnan([columns["a"][::2], columns["b"][1::2]]).all()


def test_decimal_commas_are_points_and_columns_of_words_are_left_out(tmp_path: Path) -> None:
    rows = "".join(f"{k / 10};{k / 7:.4f};runs;{'' if k % 2 else -k}\n" for k in range(20)).replace(".", ",")
    path = text_file(tmp_path / "german", "t;a, first;state;b\n" + rows)
    columns = excite.read_recording(path).streams["table"].columns
    assert list(columns) == ["t", "a, first", "b"]
    np.testing.assert_allclose(columns["t"], np.arange(20) / 10)
    np.testing.assert_allclose(columns["a, first"], np.arange(20) / 7, atol=1e-4)
    np.testing.assert_array_equal(columns["b"][::2], -np.arange(0, 20, 2))


def test_columns_without_names_are_asked_about_by_their_numbers(tmp_path: Path) -> None:
    path = text_file(tmp_path / "numbers", "5,2,3\n2,5,7\n4,4,4\n")
    assert "None was recognised among 1, 2, 3" in " ".join(excite.guess_mapping(path).questions)


def test_a_line_that_was_not_written_to_its_end_is_left_out(tmp_path: Path) -> None:
    path = text_file(tmp_path / "cut", "t,q1,dq1\n" + "".join(f"{k / 10},{k},{k}\n" for k in range(20)) + "2.0,2")
    recording = excite.read_recording(path)
    assert recording.streams["table"].rows == 20
    assert recording.notes == ("1 row cut off at the end",)


# --- folders of commands and states of servos -------------------------------------------------------------------------


def write_servos(folder: Path, time: Sequence[float], **lists: Sequence[Sequence[float]]) -> Path:
    """A folder as sage writes it: lists of one number for each joint, quoted."""
    folder.mkdir(exist_ok=True)
    told = {"positions": lists.pop("command")}
    for name, columns in (("control", told), ("state_motor", lists)):
        table = zip(time, *columns.values(), strict=True)
        rows = ([repr(t), *(f'"{json.dumps(list(cell))}"' for cell in row)] for t, *row in table)
        lines = [",".join(["type", "timestamp", *columns]), *(",".join([name.upper(), *row]) for row in rows)]
        (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder


NUMBER = st.floats(-1e6, 1e6, allow_subnormal=False)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), joints=st.integers(1, 4), rows=st.integers(4, 9))
def test_servo_folders_read_back_to_the_same_numbers(tmp_path: Path, data: st.DataObject, joints: int, rows: int):
    time = np.cumsum(data.draw(st.lists(st.floats(1e3, 1e5), min_size=rows, max_size=rows)))
    table = st.lists(st.lists(NUMBER, min_size=joints, max_size=joints), min_size=rows, max_size=rows)
    command, q, tau = (data.draw(table) for _ in range(3))
    dq = np.gradient(np.array(q), time * 1e-6, axis=0).tolist()
    folder = write_servos(tmp_path / "s", time.tolist(), command=command, positions=q, velocities=dq, torques=tau)
    log = excite.read_log(folder)
    assert log.joints == tuple(f"{k}" for k in range(1, joints + 1))
    np.testing.assert_array_equal(log.time, time * 1e-6)
    np.testing.assert_array_equal(log.q, q)
    np.testing.assert_array_equal(log.command, command)
    magnitudes = np.min(tau) >= 0
    assert magnitudes == any("efforts are magnitudes, never negative: not used" in note for note in log.left_out)
    assert (log.effort is None) if magnitudes else np.array_equal(log.effort, tau)
    disagree = any("Velocities that disagree" in note for note in log.left_out)
    assert (log.dq is None) if disagree else np.array_equal(log.dq, dq)


def servos(folder: Path, joints: int = 3) -> Path:
    m = motion(joints)
    lists = {"command": m.q + 0.1, "positions": m.q, "velocities": m.dq, "torques": m.tau}
    return write_servos(folder, (1e6 * m.time).tolist(), **lists)


def test_joints_of_servo_folders_are_those_of_the_robot_from_the_base_on(tmp_path: Path) -> None:
    robot = excite.load_robot("panda")
    log = excite.read_log(servos(tmp_path / "s", 7), robot=robot)
    assert log.joints == robot.joint_names
    np.testing.assert_array_equal(log.dq, motion(7).dq)
    shorter = excite.load_robot("ur10e")
    log = excite.read_log(servos(tmp_path / "s", 7), robot=shorter)
    assert log.joints == shorter.joint_names
    np.testing.assert_array_equal(log.command, motion(7).q[:, :6] + 0.1)
    assert "1 further number in each list is of no joint of the robot" in log.left_out[-1]
    with pytest.raises(InputError, match=r"Which of the 7 joints of panda .* are the 3 of the recording \(1, 2, 3\)\?"):
        excite.read_log(servos(tmp_path / "s", 3), robot=robot)


SPOILT_SERVOS = {  # file, its last lines, what is said, the kind to drop
    "torn": (
        "state_motor",
        'STATE_MOTOR,6e6,"[1, 2, 3]","[0,',
        r"state_motor\.csv, line 602: a row cut o",
        "truncated",
    ),
    "torn type": ("control", "CONTR", r"control\.csv, line 602: a row cut off at the end; 1 row like th", "truncated"),
    "NaN": ("control", 'CONTROL,6e6,"[NaN, 1, 2]"', r"control\.csv, line 602: a row with numbers that are NaN", "nan"),
    "null": ("control", 'CONTROL,6e6,"[null, 1, 2]"', "line 602: a row with numbers that are NaN", "nan"),
    "other length": ("control", 'CONTROL,6e6,"[1, 2]"', "line 602: a row without a list of 3 numbers in", "garbage"),
    "no list": ("control", 'CONTROL,6e6,"7"\nCONTROL,7e6,"[1, 2, 3]"', "line 602: a row without a list", "garbage"),
    "repeated": ("control", 'CONTROL,5990000.0,"[1, 2, 3]"', "control, row 601: time .* is repeated", "repeated"),
}


@pytest.mark.parametrize("name", SPOILT_SERVOS)
def test_faulty_rows_of_servo_folders_are_named_and_may_be_dropped(tmp_path: Path, name: str) -> None:
    file, lines, message, kind = SPOILT_SERVOS[name]
    path = servos(tmp_path / "s") / f"{file}.csv"
    path.write_text(path.read_text() + lines)
    assert re.search(message, refusal(excite.read_log, path.parent))
    log = excite.read_log(path.parent, drop=[kind])
    np.testing.assert_array_equal(log.q, motion(3).q)
    np.testing.assert_array_equal(log.command, motion(3).q + 0.1)


def test_servo_folders_without_rows_or_with_unlike_lists_are_refused(tmp_path: Path) -> None:
    path = servos(tmp_path / "s") / "control.csv"
    good = path.read_text()
    path.write_text(good + 'OTHER,6e6,"[1, 2, 3]"\n')
    assert "1 row of control.csv of another type left out" in excite.read_log(path.parent).left_out
    for content, message in (
        (good.replace("CONTROL", "STATE"), r"control\.csv: expected rows of the type CONTROL, with lists"),
        (re.sub(r", [^,]*\]", "]", good), "state_motor.csv have lists of different lengths"),
        (re.sub(r"\[.*\]", "[]", good), r"control\.csv: expected rows of the type CONTROL, with lists"),
        ("type,timestamp,positions\n", r"control\.csv: expected rows of the type CONTROL, with lists"),
    ):
        path.write_text(content)
        assert re.search(message, refusal(excite.read_log, path.parent))


def test_recorded_servos_are_read_without_a_mapping(tmp_path: Path) -> None:
    log = excite.read_log(so101_folder("multisine", tmp_path))
    assert (log.count, log.q.shape, log.effort, log.dq) == (6000, (6000, 6), None, None)
    np.testing.assert_allclose(log.q[0, :2], [0.03451456772742693, 0.05062136600022616], rtol=0)
    np.testing.assert_allclose(log.command[0, :2], [0.039468, 0.039468], rtol=0)
    assert "efforts are magnitudes, never negative: not used" in log.left_out
