"""Processes of a command, looked at through /proc."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path


def until(condition: Callable[[], object], seconds: float = 90.0) -> None:
    """Wait for a condition."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def alive(group: int) -> dict[int, int]:
    """Processes of a group that have not ended, each with its parent."""
    found = {}
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError, IndexError):
            state, parent, its_group = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
            if int(its_group) == group and state not in "ZX":
                found[int(entry.name)] = int(parent)
    return found


def workers(leader: int) -> list[int]:
    """Worker processes of a group's leader, forked from it or started anew."""
    found = []
    for pid, parent in alive(leader).items():
        with suppress(OSError):
            command = Path(f"/proc/{pid}/cmdline").read_bytes()
            forked = command == Path(f"/proc/{leader}/cmdline").read_bytes()
            if parent == leader and (forked or b"spawn_main" in command):
                found.append(pid)
    return found


def stderr_of(cwd: Path) -> str:
    """What a command has printed beside its result."""
    return (cwd / "stderr").read_text()
