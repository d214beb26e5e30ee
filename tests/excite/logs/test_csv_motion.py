"""Names of columns with commas and quotation marks, against the standard library."""

from __future__ import annotations

import csv

import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.logs.layout import house_layout
from excite.storage.sampled_motion import header_names, header_text

NAMES = st.text(st.characters(exclude_categories=("Cc", "Cs", "Z")), min_size=1, max_size=8)


@given(st.lists(NAMES, min_size=2, max_size=5))
def test_names_are_read_back(names: list[str]) -> None:
    line = header_text(names)
    assert header_names(line) == names
    assert next(csv.reader([line])) == names


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("time, a.position", ["time", "a.position"]),
        ('"time","a.position"', ["time", "a.position"]),
        ('time,a"b.position', ["time", 'a"b.position']),
        ("", [""]),
        ("x" * 200_000, ["x" * 200_000]),
    ],
)
def test_headers_of_others(line: str, names: list[str]) -> None:
    assert header_names(line) == names


def test_plain_names_are_written_as_ever() -> None:
    assert header_text(["time", "q1.position", "=cmd()", "@x"]) == "time,q1.position,=cmd(),@x"


def test_joints_of_a_log_with_such_names() -> None:
    joints = ("a,b", '"c', 'd"e', "=f()")
    line = header_text(["time", *(f"{name}.{what}" for name in joints for what in ("position", "effort"))])
    layout = house_layout("log.csv", line, joints)
    assert (layout.joints, layout.used) == (joints, tuple(range(9)))
