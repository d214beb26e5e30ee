"""A command says within two seconds what it is doing, also where stderr is no terminal; quick ones say nothing."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from written_results import COMMANDS

import excite.cli.sign_of_life as module
from excite.cli.main import main
from excite.cli.progress import progress_of_samples
from excite.cli.sign_of_life import SECONDS, sign_of_life, something_is_shown, tell


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


@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize(("steps", "shown"), [((), "working"), (("reading", "drawing\x1b"), "drawing\\x1b")])
def test_the_step_at_work_is_shown(
    terminal: bool, steps: tuple[str, ...], shown: str, pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert SECONDS < 2.0
    monkeypatch.setattr(module, "SECONDS", 0.2)
    stream = Stream(pipe[1], terminal=terminal)
    monkeypatch.setattr(sys, "stderr", stream)
    with sign_of_life():
        for step in steps:
            tell(step)
        assert stream.getvalue() == ""
        assert os.read(pipe[0], 100).decode() == f"excite: {shown} ...\n"
        tell("next")
        assert stream.getvalue() == "excite: next ...\n"


def test_a_quick_command_shows_nothing(pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Stream(pipe[1])
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(module, "SECONDS", 60.0)
    with sign_of_life():
        tell("reading")
        (sign,) = module._signs
    sign.timer.join(5.0)
    assert (stream.getvalue(), sign.shown, module._signs) == ("", False, [])
    tell("outside of any command")
    assert stream.getvalue() == ""


def test_no_step_comes_where_a_bar_is_shown(pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Stream(pipe[1], terminal=True))
    with sign_of_life():
        something_is_shown()
        assert all(sign.timer.finished.is_set() for sign in module._signs)


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
    "design": ("looking for the best motion", "writing and drawing"),
    "simulate": ("simulating the motion", "writing"),
    "identify": ("drawing",),
    "verify": ("judging any on run.csv", "drawing"),
    "friction plan": ("looking for poses and bounding torques", "drawing"),
    "friction fit": ("drawing",),
    "study": ("drawing",),
}


@pytest.mark.parametrize("command", COMMANDS)
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
