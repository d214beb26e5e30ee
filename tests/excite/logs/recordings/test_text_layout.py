"""Tables found in texts: separators, headers, units, comments; any text is a table, none, or refused in one line."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings, strategies as st

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
    for name in ("target_q_0", "state.q_d[0]", "q_cmd_1", "joint1.error.position", "q_desired_3"):
        assert not parsed_name(name).measured
    assert [is_clock(name) for name in ("__time", "timestamp", "t", "t1")] == [True, True, True, False]


CELL = st.one_of(
    st.sampled_from(
        ["", "nan", "inf", "1", "-2.5e3", "q1", "dq1 [deg/s]", "time", "__time", '"', "1,5", "#", "a.position"]
    ),
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
    path = tmp_path / "any"
    path.write_text(text, encoding="utf-8")
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
    path = tmp_path / "sparse"
    rows = "".join(f"{k / 10},{k if k % 2 else ''},{'' if k % 2 else -k}\n" for k in range(20))
    path.write_text("t,a,b\n" + rows, encoding="utf-8")
    columns = excite.read_recording(path).streams["table"].columns
    np.testing.assert_array_equal(columns["a"][1::2], np.arange(1, 20, 2))
    np.testing.assert_array_equal(columns["b"][::2], -np.arange(0, 20, 2))
    assert np.isnan(columns["a"][::2]).all()
    assert np.isnan(columns["b"][1::2]).all()


def test_a_line_that_was_not_written_to_its_end_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "cut"
    path.write_text("t,q1,dq1\n" + "".join(f"{k / 10},{k},{k}\n" for k in range(20)) + "2.0,2", encoding="utf-8")
    recording = excite.read_recording(path)
    assert recording.streams["table"].rows == 20
    assert recording.notes == ("1 row cut off at the end",)
