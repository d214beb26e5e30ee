"""One writer of a folder at a time: the lock, and who holds it."""

from __future__ import annotations

import os
import platform
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import datetime
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING

from excite.operating_system import is_running
from excite.storage.atomic import read_json, write_json, writing
from excite.storage.destination import Destination
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


def is_noted(at: Destination) -> bool:
    """True if a process that may still run has written down that it holds the lock; for those who may not write."""
    return may_run(at.hidden("writer.json"))


def _acquired(at: Destination) -> BaseFileLock:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of systems that know no locks: a file stands for one there
        from filelock import FileLock, Timeout

    lock = FileLock(at.hidden("lock"))
    with writing(at.path):
        try:
            lock.acquire(blocking=False)
        except Timeout as error:
            who, other = holder_text(at.hidden("writer.json")), "another name" if at.name else "another `folder`"
            raise InUseError(f"{at.path} is being written by {who}; wait for it, or choose {other}") from error
    return lock


_LONGEST = 60  # characters of a command in a message


@dataclass(frozen=True)
class Holder:
    """A process that writes to a folder."""

    process: int
    host: str
    command: str
    since: str  # date and time, ISO 8601, local

    @property
    def text(self) -> str:
        """For a message."""
        began = datetime.fromisoformat(self.since)
        today = began.date() == datetime.now().date()
        at = f"{began:%H:%M}" if today else f"{began:%Y-%m-%d %H:%M}"
        return f"process {self.process} on {_clean(self.host)} ({_clean(self.command)}, since {at})"


def this_process() -> Holder:
    """Holder of the locks of this process."""
    program, *arguments = sys.argv or ["python"]
    name = Path(program).name
    name = Path(program).parent.name if name == "__main__.py" else name
    command = " ".join([name or "python", *arguments])
    return Holder(os.getpid(), platform.node(), command[:1000], datetime.now().isoformat(timespec="seconds"))


def write_holder(path: Path) -> None:
    """Write down this process, which holds the lock; what a killed one has left of its own note is removed."""
    for unfinished in path.parent.glob(f".{escape(path.name)}.*"):
        unfinished.unlink(missing_ok=True)
    write_json(path, asdict(this_process()))


def holder_text(path: Path) -> str:
    """The holder as written down; another process where nothing can be read, or the one written down is gone."""
    holder = _read(path)
    return "another process" if holder is None or _is_gone(holder) else holder.text


def may_run(path: Path) -> bool:
    """True if a holder is written down, and is not known to be gone."""
    holder = _read(path)
    return holder is not None and not _is_gone(holder)


def _read(path: Path) -> Holder | None:
    try:
        content = read_json(path)
        holder = Holder(**{**content, "process": int(content["process"])})
        return holder if holder.text else None  # of values that no text can be made of
    except (InputError, KeyError, TypeError, ValueError):
        return None


def _is_gone(holder: Holder) -> bool:
    """True if no process of this host has the number, so that what is written down is of an earlier holder."""
    return holder.process > 0 and holder.host == platform.node() and not is_running(holder.process)


def _clean(text: str) -> str:
    printable = "".join(letter if letter.isprintable() else "?" for letter in text)
    return printable if len(printable) <= _LONGEST else f"{printable[: _LONGEST - 3]}..."
