"""One writer of a folder at a time: the lock, and who holds it."""

from __future__ import annotations

import os
import platform
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING

from excite.operating_system import is_running
from excite.storage.atomic import Destination, read_json, write_json, writing
from regressors.errors import InputError

if TYPE_CHECKING:
    from filelock import BaseFileLock


_held: set[tuple[int, int, str]] = set()


class InUseError(InputError):
    """Another process or thread writes to the destination."""


@contextmanager
def locked(at: Destination) -> Iterator[None]:
    """Hold the lock of a destination; in a block that holds it already, nothing changes."""
    key = (os.getpid(), threading.get_ident(), os.path.realpath(at.path))
    if key in _held:
        yield
        return
    lock = _acquired(at)
    holder = at.hidden("writer.json")
    try:
        with writing(at.path):
            write_holder(holder)
        _held.add(key)
        yield
    finally:
        _held.discard(key)
        for path in (holder, at.hidden("lock")):  # a waiting process sees that the lock's file has lost its name
            with suppress(OSError):
                path.unlink(missing_ok=True)
        with suppress(OSError):
            lock.release()
        if os.name == "nt":
            with suppress(OSError):
                at.hidden("lock").unlink(missing_ok=True)  # which cannot be done there while it is open


def _acquired(at: Destination) -> BaseFileLock:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of systems that know no locks: a file stands for one there
        from filelock import FileLock, Timeout

    lock = FileLock(at.hidden("lock"))
    with writing(at.path):
        try:
            lock.acquire(blocking=False)
        except Timeout as error:
            who = holder_text(at.hidden("writer.json")) or "another process"
            other = "another name" if at.name else "another `folder`"
            raise InUseError(f"{at.path} is being written by {who}; wait for it, or choose {other}") from error
    return lock


def is_noted(at: Destination) -> bool:
    """True if a process that may still run has written down that it holds the lock; for those who may not write."""
    return holder_text(at.hidden("writer.json")) is not None


_LONGEST = 60  # characters of a command in a message


def write_holder(path: Path) -> None:
    """Write down this process, which holds the lock; what a killed one has left of its own note is removed."""
    for unfinished in path.parent.glob(f".{escape(path.name)}.*"):
        unfinished.unlink(missing_ok=True)
    program, *arguments = sys.argv or ["python"]
    name = Path(program).parent.name if Path(program).name == "__main__.py" else Path(program).name
    command = " ".join([name or "python", *arguments])[:1000]
    since = datetime.now().isoformat(timespec="seconds")
    write_json(path, {"process": os.getpid(), "host": platform.node(), "command": command, "since": since})


def holder_text(path: Path) -> str | None:
    """The holder as written down; None where nothing can be read, or no process of this host has its number."""
    try:
        content = read_json(path)
        process, host, began = int(content["process"]), content["host"], datetime.fromisoformat(content["since"])
        if process > 0 and host == platform.node() and not is_running(process):
            return None
        form = "%H:%M" if began.date() == datetime.now().date() else "%Y-%m-%d %H:%M"
        return f"process {process} on {_clean(host)} ({_clean(content['command'])}, since {began:{form}})"
    except (InputError, AttributeError, KeyError, TypeError, ValueError):
        return None


def _clean(text: str) -> str:
    printable = "".join(letter if letter.isprintable() else "?" for letter in text)
    return printable if len(printable) <= _LONGEST else f"{printable[: _LONGEST - 3]}..."
