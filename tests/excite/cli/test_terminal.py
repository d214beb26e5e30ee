"""Colours on terminals only, and never where NO_COLOR is set; moving lines on terminals that can move them."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest
from commands import ENVIRONMENT, run
from rich.table import Table

from excite.cli.summary import Summary, _print_text
from excite.cli.terminal import can_move, has_colours

COLOUR = re.compile(r"\x1b\[[0-9;]*m")
PROGRAM = (
    "from excite.cli.summary import Summary, _print_text\n"
    "from excite.cli.progress import progress_of_starts\n"
    "from types import SimpleNamespace as N\n"
    "kept = N(done=(), count=2, best=9.0)\n"
    "with progress_of_starts(kept) as report:\n"
    "    [report(N(value=v, cpu=1.0, status='done')) for v in (8.0, 7.0)]\n"
    "_print_text(Summary('All limits hold', True), None)\n"
)


class Stream:
    """A stream that is a terminal, or none."""

    def __init__(self, *, terminal: bool) -> None:
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


@pytest.mark.parametrize(
    ("terminal", "environment", "colours", "moves"),
    [
        (True, {"TERM": "xterm"}, True, True),
        (True, {"TERM": "xterm", "NO_COLOR": "1"}, False, True),
        (True, {"TERM": "xterm", "NO_COLOR": ""}, True, True),  # empty counts as not set
        (True, {"TERM": "dumb"}, False, False),
        (True, {"TERM": "dumb", "FORCE_COLOR": "1"}, False, False),
        (False, {"TERM": "xterm"}, False, False),
        (False, {"TERM": "xterm", "FORCE_COLOR": "1"}, True, False),
        (False, {"TERM": "xterm", "FORCE_COLOR": "1", "NO_COLOR": "1"}, False, False),
    ],
)
def test_what_a_stream_gets(
    terminal: bool, environment: dict[str, str], colours: bool, moves: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    stream = Stream(terminal=terminal)
    assert (has_colours(stream), can_move(stream)) == (colours, moves)  # type: ignore[arg-type]


def on_a_terminal(**environment: str) -> str:
    """What the program prints where stdout and stderr are one terminal."""
    parent, child = pty.openpty()
    given = {k: v for k, v in ENVIRONMENT.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=child, stderr=child, env={**given, "TERM": "xterm", **environment}
    )
    os.close(child)
    read = b""
    while True:
        try:
            more = os.read(parent, 10_000)
        except OSError:  # closed by the process
            break
        if not more:
            break
        read += more
    os.close(parent)
    assert process.wait(60) == 0
    return read.decode()


def test_colours_on_a_terminal() -> None:
    text = on_a_terminal()
    assert "\x1b[1;32mAll limits hold" in text
    assert "2/2" in text


def test_no_colours_where_they_are_not_wanted() -> None:
    text = on_a_terminal(NO_COLOR="1")
    assert COLOUR.search(text) is None
    assert "2/2" in text  # the bar moves all the same
    dumb = on_a_terminal(TERM="dumb")
    assert "\x1b" not in dumb
    assert "start 2 of 2: best so far 7" in dumb


def test_no_sequences_where_stdout_is_no_terminal(tmp_path: Path) -> None:
    ended = run("robots", "irp6", cwd=tmp_path, TERM="xterm")
    assert "\x1b" not in ended.stdout + ended.stderr


def test_a_summary_keeps_to_the_width(capsys: pytest.CaptureFixture[str]) -> None:
    table = Table(box=None)
    table.add_column("name", overflow="fold")
    table.add_row("word " * 60)
    notes = [f"note {number} " + "of many words " * 12 for number in range(20)]
    steps = ["excite design irp6 " + "--option value " * 20 + "--out d"]
    _print_text(
        Summary("verdict " * 20, None, False, ["fact " * 40, table], notes, [Path("d/a.csv")], steps, "d.json"), None
    )
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 100
    assert len(lines) <= 24
    assert "notes: in d.json, or with --verbose" in "\n".join(lines)
    command = " ".join(line.strip().removesuffix(" \\") for line in lines[lines.index("written: d/a.csv") + 1 :])
    assert command == f"next: {steps[0]}"
