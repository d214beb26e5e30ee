"""Lines of a log that are read when they are needed: the same as if the whole text were held."""

from __future__ import annotations

import csv
import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from refused import refusal
from written_files import text_file

from excite.logs import table, text, text as lines
from excite.logs.layout import MOST_COLUMNS, house_layout
from excite.logs.log_reading import read_log
from excite.logs.text import text_of
from excite.storage.sampled_motion import header_names, header_text
from regressors.errors import InputError

HEADER = "time,a.position,a.effort"
CHARACTERS = st.sampled_from(["a", "1", ",", " ", "\t", "\r", "\n", "\r\n", "\x1c", "\x85", "\xa0", "\u3000", "\xe9"])


def held(content: bytes) -> tuple[list[str], bool]:
    """Lines of a text that is held as a whole, and whether the last one has its end."""
    whole = content.removeprefix(b"\xef\xbb\xbf").decode()
    body = whole.rstrip()
    return body.replace("\r\n", "\n").split("\n"), "\n" in whole[len(body) :]


@given(st.lists(CHARACTERS, max_size=40), st.booleans(), st.sampled_from([1, 2, 7, 4096]))
def test_lines_are_those_of_the_whole_text(tmp_path_factory, characters, marked, block) -> None:
    content = b"\xef\xbb\xbf" * marked + "".join(characters).encode()
    path = tmp_path_factory.mktemp("text") / "log.csv"
    path.write_bytes(content)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lines, "_BLOCK", block)
        patch.setattr(lines, "_AT_ONCE", 3)
        expected, complete = held(content)
        if not "".join(expected):
            with pytest.raises(InputError, match="is empty"), text_of(path):
                pass
            return
        with text_of(path) as read:
            assert list(read.lines) == expected
            assert [read.lines[k] for k in range(len(read.lines))] == expected
            assert list(read.lines[1:-1]) == expected[1:-1]
            assert list(read.lines[np.arange(1, len(expected), 2)]) == expected[1::2]
            assert read.complete == complete
            assert read.sha256 == hashlib.sha256(content).hexdigest()


def test_many_rows_are_the_same_as_few_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [f"{k * 0.01:.17g},{np.sin(k):.17g},{k}" for k in range(100)]
    rows[41] = "4.1e-1,,7"
    (tmp_path / "log.csv").write_text("\n".join([HEADER, *rows, "0.9"]))
    drop = ("nan", "truncated")
    at_once = read_log(tmp_path / "log.csv", drop=drop)
    monkeypatch.setattr(table, "_AT_ONCE", 7)
    in_parts = read_log(tmp_path / "log.csv", drop=drop)
    assert at_once.count == 99
    assert np.array_equal(at_once.q, in_parts.q)
    assert at_once.left_out == in_parts.left_out


def test_a_file_that_becomes_shorter(tmp_path: Path) -> None:
    path = text_file(tmp_path / "log.csv", HEADER + 3000 * "\n1,2,3")

    def lines_of_shorter() -> list[str]:
        with text_of(path) as read:
            path.write_text("")
            return list(read.lines)

    assert "it became shorter while it was read" in refusal(lines_of_shorter)


def test_a_line_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text, "LONGEST_LINE", 2**20)
    (tmp_path / "log.csv").write_text(f"{HEADER}\n" + 3 * 2**20 * "1")
    assert "has a line of more than 1.05 MB, line 2" in refusal(read_log, tmp_path / "log.csv")


def test_too_many_columns_are_refused_at_once(tmp_path: Path) -> None:
    for count in (MOST_COLUMNS + 1, 200_000):
        (tmp_path / "log.csv").write_text(",".join(["time", *(f"{k}.position" for k in range(count))]) + "\n")
        with pytest.raises(InputError, match=rf"has {count + 1} columns, more than the {MOST_COLUMNS} that"):
            read_log(tmp_path / "log.csv")


BAD = 5000 * "z"
ESCAPE = "\x1b[31m"


def test_cells_and_names_are_echoed_cut_and_literally(tmp_path: Path) -> None:
    for content, message in (
        (f"{HEADER}\n0,0,{BAD}\n1,0,0\n", "is not a number"),
        (f"time,a.position,{BAD},{BAD}\n0,0,0,0\n", "two columns are named"),
        (f"time,{ESCAPE}.position\n0,0\n1,z\n", "is not a number"),
        (f"time,{BAD}\n0,0\n", "no column NAME.position"),
    ):
        (tmp_path / "log.csv").write_text(content)
        told = refusal(read_log, tmp_path / "log.csv")
        assert message in told
        assert len(told) < 500
        assert told.isprintable()
    (tmp_path / "log.csv").write_text(f"time,a.position,{BAD},{ESCAPE}\n0,0,0,0\n1,0,0,0\n")
    (note,) = read_log(tmp_path / "log.csv").left_out
    assert note.startswith("2 columns not used: zzz")
    assert len(note) < 120
    assert note.isprintable()


@pytest.mark.filterwarnings("error")
def test_numbers_that_no_float_holds_do_not_warn(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for cell in ("1e999", "-1e400", "1" * 400):
        path.write_text(f"{HEADER}\n0,0,{cell}\n1,0,0\n")
        assert "inf is not a measurement" in refusal(read_log, path)
    path.write_text(f"{HEADER}\n0,0,1e-999\n1,0,0\n")
    assert read_log(path).count == 2


NAMES = st.text(st.characters(exclude_categories=("Cc", "Cs", "Z")), min_size=1, max_size=8)


@given(st.lists(NAMES, min_size=2, max_size=5))
def test_names_are_read_back(names: list[str]) -> None:
    line = header_text(names)
    assert header_names(line) == names
    assert next(csv.reader([line])) == names


def test_headers_of_others() -> None:
    for line, names in (
        ("time, a.position", ["time", "a.position"]),
        ('"time","a.position"', ["time", "a.position"]),
        ('time,a"b.position', ["time", 'a"b.position']),
        ("", [""]),
        ("x" * 200_000, ["x" * 200_000]),
    ):
        assert header_names(line) == names
    assert header_text(["time", "q1.position", "=cmd()", "@x"]) == "time,q1.position,=cmd(),@x"


def test_joints_of_a_log_with_such_names() -> None:
    joints = ("a,b", '"c', 'd"e', "=f()")
    line = header_text(["time", *(f"{name}.{what}" for name in joints for what in ("position", "effort"))])
    layout = house_layout("log.csv", header_names(line), joints)
    assert (layout.joints, layout.used) == (joints, tuple(range(9)))
