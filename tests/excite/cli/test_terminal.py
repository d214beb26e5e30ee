"""What terminals get: colours, moving lines, and within two seconds what a command is doing."""

from __future__ import annotations

import io
import os
import pty
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from commands import ENVIRONMENT, Here
from written_results import COMMANDS

import excite.cli.streams as module
from excite.cli.progress import progress_of_samples
from excite.cli.streams import (
    SECONDS,
    be_quiet,
    can_move,
    clear_line,
    has_colours,
    sign_of_life,
    something_is_shown,
    tell,
)
from excite.cli.summary import show
from excite.views.view import View, ViewTable, texts

# Colours on terminals only, and never where NO_COLOR is set; moving lines on terminals that can move them.


COLOUR = re.compile(r"\x1b\[[0-9;]*m")
PROGRAM = (
    "from excite.cli.summary import show\n"
    "from excite.views.view import View\n"
    "from excite.cli.design_run import progress_of_starts\n"
    "from types import SimpleNamespace as N\n"
    "kept = N(done=(), count=2, best=9.0)\n"
    "with progress_of_starts(kept) as report:\n"
    "    [report(N(value=v, cpu=1.0, status='done')) for v in (8.0, 7.0)]\n"
    "show(View('', 'All limits hold', holds=True), content=dict)\n"
)


class PipeEnd(io.StringIO):
    """One end of a pipe, or a terminal."""

    def __init__(self, handle: int, *, terminal: bool = False) -> None:
        super().__init__()
        self.handle, self.terminal = handle, terminal

    def isatty(self) -> bool:
        return self.terminal

    def fileno(self) -> int:
        return self.handle


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
    stream = PipeEnd(0, terminal=terminal)
    assert (has_colours(stream), can_move(stream)) == (colours, moves)


def on_a_terminal(**environment: str) -> str:
    """What the program prints where stdout and stderr are one terminal."""
    parent, child = pty.openpty()
    given = {k: v for k, v in ENVIRONMENT.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=child, stderr=child, env={**given, "TERM": "xterm", **environment}
    )
    os.close(child)
    read = b""
    with suppress(OSError):  # closed by the process
        while more := os.read(parent, 10_000):
            read += more
    os.close(parent)
    assert process.wait(60) == 0
    return read.decode()


def test_colours_on_a_terminal_unless_they_are_not_wanted() -> None:
    assert "\x1b[1;32mAll limits hold" in on_a_terminal()
    text = on_a_terminal(NO_COLOR="1")
    assert COLOUR.search(text) is None
    assert "2/2" in text  # the bar moves all the same
    dumb = on_a_terminal(TERM="dumb")
    assert "\x1b" not in dumb
    assert "start 2 of 2: best so far 7" in dumb


def test_a_summary_keeps_to_the_width(capsys: pytest.CaptureFixture[str]) -> None:
    table = ViewTable("names", "", texts("name", brief=True), (("word " * 60,),))
    notes = [f"note {number} " + "of many words " * 12 for number in range(20)]
    steps = ["excite design irp6 " + "--option value " * 20 + "--out d"]
    view = View("", "verdict " * 20, summary=("fact " * 40,), remarks=tuple(notes), tables=(table,))
    show(view, [Path("d/a.csv")], content=dict, next_steps=steps, all_in="d.json")
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 100
    assert len(lines) <= 24
    assert "notes: in d.json, or with --verbose" in "\n".join(lines)
    command = " ".join(line.strip().removesuffix(" \\") for line in lines[lines.index("written: d/a.csv") + 1 :])
    assert command == f"next: {steps[0]}"


# A command says within two seconds what it is doing, also where stderr is no terminal; quick ones say nothing.


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """The end to read from, and the end to write to."""
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


@pytest.mark.parametrize(("steps", "shown"), [((), "working"), (("reading", "drawing\x1b"), "drawing\\x1b")])
def test_the_step_at_work_is_shown(
    steps: tuple[str, ...], shown: str, pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert SECONDS < 2.0
    monkeypatch.setattr(module, "SECONDS", 0.2)
    stream = PipeEnd(pipe[1])
    monkeypatch.setattr(sys, "stderr", stream)
    with sign_of_life():
        for step in steps:
            tell(step)
        assert os.read(pipe[0], 100).decode() == f"excite: {shown} ...\n"
        tell("next")
        assert os.read(pipe[0], 100).decode() == "excite: next ...\n"
    assert stream.getvalue() == ""


def until_read(end: int, text: str) -> str:
    """What is read from a pipe until a text has come."""
    read = ""
    while text not in read:
        read += os.read(end, 1000).decode()
    return read


@pytest.mark.parametrize("term", ["xterm", "dumb"])
def test_on_a_terminal_the_step_moves(term: str, pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    """One line that is drawn again and again, and removed for other lines and at the end."""
    monkeypatch.setenv("TERM", term)
    monkeypatch.setattr(module, "SECONDS", 0.05)
    monkeypatch.setattr(module, "_BETWEEN", 0.01)
    monkeypatch.setattr(sys, "stderr", PipeEnd(pipe[1], terminal=True))
    with sign_of_life():
        tell("drawing")
        if term == "dumb":
            assert until_read(pipe[0], "\n") == "excite: drawing ...\n"
            return
        seen = until_read(pipe[0], "\r\\ excite: drawing ... 0 s\033[K")
        assert len(set(re.findall(r"\r(.) excite: drawing", seen))) > 1
        assert "\n" not in seen
        clear_line()
        until_read(pipe[0], "\r\033[K")
        tell("next")
        until_read(pipe[0], " excite: next ... 0 s\033[K")
    assert os.read(pipe[0], 10_000).decode().endswith("\r\033[K")


def test_a_quick_command_shows_nothing(pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = PipeEnd(pipe[1])
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(module, "SECONDS", 60.0)
    with sign_of_life():
        tell("reading")
        (sign,) = module._signs
    sign.watch.join(5.0)
    assert not sign.watch.is_alive()
    assert (stream.getvalue(), sign.shown, module._signs) == ("", False, [])
    tell("outside of any command")
    assert stream.getvalue() == ""


def test_no_step_comes_where_a_bar_is_shown_or_the_command_is_quiet(
    pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "stderr", PipeEnd(pipe[1], terminal=True))
    with sign_of_life():
        something_is_shown()
        (sign,) = module._signs
        sign.show()
        assert not sign.drawn
        tell("next")
        sign.show()
        assert sign.drawn
    with sign_of_life():
        (sign,) = module._signs
        be_quiet()
        tell("drawing")
        sign.show()
        assert not sign.drawn


def test_a_pipe_that_is_closed_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = os.pipe()
    os.close(ends[0])
    monkeypatch.setattr(sys, "stderr", PipeEnd(ends[1]))
    with sign_of_life():
        module._signs[0].show()
    os.close(ends[1])


@pytest.mark.parametrize("terminal", [False, True])
def test_the_share_of_a_simulation(terminal: bool, pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    clock = iter([0.0, 1.0, 2.5, 3.0, 5.0])
    monkeypatch.setattr("excite.cli.progress.time.monotonic", lambda: next(clock, 5.0))
    stream = PipeEnd(pipe[1], terminal=terminal)
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("excite.cli.progress.tell", lambda text: stream.write(f"{text}\n"))
    with progress_of_samples() as report:
        for done in (10, 25, 30, 50):
            report(done, 100)
    lines = "simulated 25 %\nsimulated 50 %\n"
    assert stream.getvalue() == ("\rsimulated 25 %\rsimulated 30 %\rsimulated 50 %\r\033[K" if terminal else lines)


STEPS = {
    "design": ("setting up the problem", "looking for the best motion", "writing", "drawing"),
    "simulate": ("simulating the motion", "writing"),
    "identify": ("reading the logs", "drawing"),
    "verify": ("judging any on run.csv", "drawing"),
    "friction plan": ("looking for poses and bounding torques", "drawing"),
    "friction fit": ("reading the logs", "drawing"),
    "payload design": ("looking for the best motion",),
    "payload gains": ("reading the logs and calibrating",),
    "payload identify": ("reading the logs and identifying",),
    "logs": ("reading run.csv",),
    "report": ("writing the page",),
    "study": ("drawing",),
}


@pytest.mark.parametrize("command", [name for name in COMMANDS if "figures" not in name])
def test_every_command_states_its_steps(command: str, here: Here) -> None:
    here.monkeypatch.setattr(module, "SECONDS", 0.0)
    COMMANDS[command].run(here.cwd, "old", here.monkeypatch, force=False)
    shown = [line for line in here.capfd.readouterr().err.splitlines() if line.endswith(" ...")]
    steps = [line for line in shown if line != "excite: working ..."]
    assert tuple(steps) == tuple(f"excite: {step} ..." for step in STEPS.get(command, ()))


def test_a_command_that_writes_nothing_states_its_step(here: Here) -> None:
    here.monkeypatch.setattr(module, "SECONDS", 0.0)
    here.monkeypatch.setattr("commands.without_steps", lambda text: text)
    shown = [line for line in here.run("plan", "irp6").stderr.splitlines() if line != "excite: working ..."]
    assert shown == ["excite: finding the parameters that each selection of drives identifies ..."]
