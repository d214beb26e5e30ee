"""A command on a terminal says within two seconds that it works, unless it shows something itself."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator

import pytest

from excite.cli.sign_of_life import SECONDS, _timers, sign_of_life, something_is_shown


class Terminal:
    """One end of a pipe that says it is a terminal."""

    def __init__(self, handle: int) -> None:
        self.handle = handle

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return self.handle


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    """The end to read from, and the end to write to."""
    ends = os.pipe()
    yield ends
    for end in ends:
        os.close(end)


def test_the_line_comes(pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    assert SECONDS < 2.0
    monkeypatch.setattr("excite.cli.sign_of_life.SECONDS", 0.01)
    monkeypatch.setattr(sys, "stderr", Terminal(pipe[1]))
    with sign_of_life():
        assert _timers
        assert os.read(pipe[0], 100) == b"excite: working ...\n"


def test_the_line_does_not_come_where_a_bar_is_shown(pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Terminal(pipe[1]))
    with sign_of_life():
        something_is_shown()
        assert all(timer.finished.is_set() for timer in _timers)
        assert _timers
    assert not _timers


@pytest.mark.parametrize("stream", [None, io.StringIO()])
def test_nothing_is_started_elsewhere(stream: object, monkeypatch: pytest.MonkeyPatch) -> None:
    import threading

    monkeypatch.setattr(sys, "stderr", stream)
    before = threading.active_count()
    with sign_of_life():
        assert threading.active_count() == before
