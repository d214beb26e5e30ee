"""A command says within two seconds what it is doing, also where stderr is no terminal; quick ones say nothing."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from written_results import COMMANDS

import excite.cli.sign_of_life as module
from excite.cli.main import main
from excite.cli.progress import progress_of_samples
from excite.cli.sign_of_life import SECONDS, be_quiet, clear_line, sign_of_life, something_is_shown, tell


class Stream(io.StringIO):
    """One end of a pipe, or a terminal."""

    def __init__(self, handle: int, *, terminal: bool = False) -> None:
        super().__init__()
        self.handle, self.terminal = handle, terminal

    def isatty(self) -> bool:
        return self.terminal

    def fileno(self) -> int:
        return self.handle


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
    stream = Stream(pipe[1])
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
    monkeypatch.setattr(sys, "stderr", Stream(pipe[1], terminal=True))
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


def test_a_quiet_command_shows_no_step(pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SECONDS", 0.0)
    monkeypatch.setattr(sys, "stderr", Stream(pipe[1], terminal=True))
    with sign_of_life():
        (sign,) = module._signs
        be_quiet()
        tell("drawing")
        sign.show()
        assert not sign.drawn


def test_a_quick_command_shows_nothing(pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Stream(pipe[1])
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


def test_no_step_comes_where_a_bar_is_shown(pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Stream(pipe[1], terminal=True))
    with sign_of_life():
        something_is_shown()
        (sign,) = module._signs
        sign.show()
        assert not sign.drawn
        tell("next")
        sign.show()
        assert sign.drawn


def test_a_pipe_that_is_closed_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    ends = os.pipe()
    os.close(ends[0])
    monkeypatch.setattr(sys, "stderr", Stream(ends[1]))
    with sign_of_life():
        module._signs[0].show()
    os.close(ends[1])


@pytest.mark.parametrize("stream", [None, io.StringIO()])
def test_nothing_is_started_elsewhere(stream: object, monkeypatch: pytest.MonkeyPatch) -> None:
    import threading

    monkeypatch.setattr(sys, "stderr", stream)
    before = threading.active_count()
    with sign_of_life():
        assert threading.active_count() == before


@pytest.mark.parametrize("terminal", [False, True])
def test_the_share_of_a_simulation(
    terminal: bool, pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    clock = iter([0.0, 1.0, 2.5, 3.0, 5.0])
    monkeypatch.setattr("excite.cli.progress.time.monotonic", lambda: next(clock, 5.0))
    stream = Stream(pipe[1], terminal=terminal)
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("excite.cli.progress.tell", lambda text: stream.write(f"{text}\n"))
    with progress_of_samples() as report:
        for done in (10, 25, 30, 50):
            report(done, 100)
    lines = "simulated 25 %\nsimulated 50 %\n"
    assert stream.getvalue() == ("\rsimulated 25 %\rsimulated 30 %\rsimulated 50 %\r\033[K" if terminal else lines)


STEPS = {
    "design": ("setting up the problem", "looking for the best motion", "writing and drawing"),
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
def test_every_command_states_its_steps(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "SECONDS", 0.0)
    COMMANDS[command].run(tmp_path, "old", monkeypatch, force=False)
    shown = [line for line in capfd.readouterr().err.splitlines() if line.endswith(" ...")]
    steps = [line for line in shown if line != "excite: working ..."]
    assert tuple(steps) == tuple(f"excite: {step} ..." for step in STEPS.get(command, ()))


@pytest.mark.parametrize(
    ("words", "steps"),
    [
        (("plan", "irp6", "--json"), ["finding the parameters that each selection of drives identifies"]),
        (("compare", "DESIGN", "--json"), ["reading DESIGN", "comparing the designs"]),
    ],
)
def test_commands_that_write_nothing_state_their_steps(
    words: tuple[str, ...],
    steps: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    if "DESIGN" in words:
        COMMANDS["design"].run(tmp_path, "old", monkeypatch, force=False)
        monkeypatch.undo()
    monkeypatch.setattr(module, "SECONDS", 0.0)
    folder = str(tmp_path / "out")
    monkeypatch.setattr(sys, "argv", ["excite", *(folder if word == "DESIGN" else word for word in words)])
    capfd.readouterr()
    with pytest.raises(SystemExit):
        main()
    shown = [line for line in capfd.readouterr().err.splitlines() if line != "excite: working ..."]
    assert shown == [f"excite: {step.replace('DESIGN', folder)} ..." for step in steps]
