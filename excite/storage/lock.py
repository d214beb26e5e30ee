"""A lock of a folder, or of a file, while a process writes to it; it vanishes with the process."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from excite.storage.atomic import writing
from excite.storage.destination import Destination
from excite.storage.holder import holder_text, may_run, write_holder
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
