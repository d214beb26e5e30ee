"""Files that replace others all at once: prepared in a hidden folder, renamed, then put in place.

A crash before the rename leaves everything as it was; one after it is made good by whoever opens the folder next.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

from excite.operating_system import replace_file, sync_folder
from excite.storage.atomic import JOURNAL, MANIFEST, NEXT, Destination, plain_name, read_json, write_json, writing
from excite.storage.lock import InUseError, is_noted, locked
from regressors.errors import InputError

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
    """Put files in place that an interrupted run has committed; to be called before files of a folder are read.

    A process that is putting files in place is waited for.
    """
    began = time.monotonic()
    while at.commit.exists():
        try:
            with locked(at):
                clear(at)
        except InputError as error:
            waited = time.monotonic() - began > PATIENCE
            if isinstance(error, InUseError) and waited:
                raise
            if not isinstance(error, InUseError) and (waited or not is_noted(at)) and at.commit.exists():
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
