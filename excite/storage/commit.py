"""Files that replace others all at once, by one writer at a time: prepared in a hidden folder, renamed, put in place.

A crash before the rename leaves everything as it was; one after it is made good by whoever opens the folder next.
"""

from __future__ import annotations

import os
import platform
import shutil
import sys
import threading
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from excite.operating_system import is_running, replace_file, sync_folder
from excite.storage.atomic import JOURNAL, MANIFEST, NEXT, Destination, plain_name, read_json, write_json, writing
from regressors.errors import InputError

if TYPE_CHECKING:
    from filelock import BaseFileLock


_REPLACED = ".replaced."
PATIENCE = 10.0  # [s] that a reader waits for a writer that is putting files in place
_STEP = 0.02
Read = TypeVar("Read")


@contextmanager
def staging(at: Destination) -> Iterator[Path]:
    """Give an empty folder for the files to come; it is removed if the block ends with an error."""
    folder = at.staging
    with writing(folder):
        _remove(folder)
        folder.mkdir()
    try:
        yield folder
    except BaseException:
        with suppress(OSError):
            _remove(folder)
        raise


def commit(at: Destination, *, last: str, remove: Collection[str] = (), folders: Collection[str] = ()) -> None:
    """Put all staged files in place."""
    names = sorted((path.name for path in at.staging.iterdir()), key=lambda name: (name == last, name))
    for name in names:
        if (at.folder / name).is_dir():
            raise InputError(f"cannot write {at.folder / name}: it is a folder")
    write_json(at.staging / JOURNAL, {"files": names, "remove": sorted(remove), "folders": sorted(folders)})
    with writing(at.path):
        os.rename(at.staging, at.commit)  # from here on the new files count
        sync_folder(at.folder)
    _finish(at)


def settle(at: Destination) -> None:
    """Put files in place that an interrupted run has committed, before they are read; a run at work is waited for."""
    began = time.monotonic()
    while at.commit.exists():
        try:
            with locked(at):
                clear(at)
        except InputError as error:
            waited = time.monotonic() - began > PATIENCE
            if isinstance(error, InUseError) and waited:
                raise
            noted = holder_text(at.hidden("writer.json")) is not None  # for those who may not write, and see no lock
            if not isinstance(error, InUseError) and (waited or not noted) and at.commit.exists():
                raise InputError(
                    f"{error}; an interrupted run left complete files in {at.commit} that are still to be put in "
                    f"place: read {at.path} once as a user who may write there, or read a copy of {at.folder}"
                ) from error
            time.sleep(_STEP)


def read_settled(at: Destination, read: Callable[[], Read]) -> Read:
    """Read files as one run has left them: once more where another run has put files in place meanwhile."""
    began = time.monotonic()
    while True:
        settle(at)
        before, error = _mark(at), None
        try:
            result = read()
        except InputError as raised:
            error = raised
        undisturbed = _mark(at) == before and not at.commit.exists()
        if undisturbed or time.monotonic() - began > PATIENCE:
            if error is not None:
                raise error
            return result
        time.sleep(_STEP)


def _mark(at: Destination) -> tuple[int, int] | None:
    """Changes whenever files are put in place: of a folder it is that of the manifest, the last of them."""
    try:
        found = os.stat(at.path if at.name else at.folder / MANIFEST)
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns


def clear(at: Destination) -> None:
    """Put committed files in place, and remove what an interrupted run has left of files that were not complete."""
    if at.commit.exists():
        _finish(at)
    if at.staging.exists():
        with writing(at.path):
            _remove(at.staging)


def _finish(at: Destination) -> None:
    """Put committed files in place; every step may have been done before."""
    journal = at.commit / JOURNAL
    if journal.exists():
        content = read_json(journal)
        files, remove, folders = (
            [plain_name(name, journal) for name in content.get(key, ())] for key in ("files", "remove", "folders")
        )
        for name in files:
            with writing(at.folder / name):
                if (at.commit / name).exists():
                    replace_file(at.commit / name, at.folder / name)
        with writing(at.path):
            for name in remove:
                with suppress(FileNotFoundError, IsADirectoryError):
                    (at.folder / name).unlink()
            for name in folders:
                _swap(at, name)
            sync_folder(at.folder)
    with writing(at.path):
        _remove(at.commit)
        sync_folder(at.folder)


def _swap(at: Destination, name: str) -> None:
    """Let a folder in ``.next`` take the place of the one of the same name."""
    new, old = at.folder / NEXT / name, at.folder / name
    if not new.exists():
        return
    if old.exists():
        os.rename(old, at.commit / f"{_REPLACED}{name}")
    os.rename(new, old)
    with suppress(OSError):
        new.parent.rmdir()


def _remove(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)


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
