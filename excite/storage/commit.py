"""Files that replace others all at once: prepared in a hidden folder, renamed, then put in place.

A crash before the rename leaves everything as it was; one after it is made good by whoever opens the folder next.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from excite.operating_system import sync_folder
from excite.storage.atomic import read_json, write_json, writing
from excite.storage.destination import JOURNAL, NEXT, Destination, plain_name
from excite.storage.lock import InUseError, locked
from regressors.errors import InputError

_REPLACED = ".replaced."
_PATIENCE = 10.0  # [s] that a reader waits for a writer that is putting files in place


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
    """Put all staged files in place.

    Parameters
    ----------
    at : Destination
        Locked by this process.
    last : str
        File that is put in place after the others.
    remove : collection of str
        Files of the folder that leave.
    folders : collection of str
        Folders in ``.next`` that take the place of those of the same name.

    Raises
    ------
    InputError
        A file is in the way, or the folder cannot be written to.
    """
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

    Raises
    ------
    InputError
        Another process is putting files in place for long, or this one may not write there.
    """
    began = time.monotonic()
    while at.commit.exists():
        try:
            with locked(at):
                clear(at)
        except InUseError:
            if time.monotonic() - began > _PATIENCE:
                raise
            time.sleep(0.05)
        except InputError as error:
            raise InputError(
                f"{error}; an interrupted run left complete files in {at.commit} to put in place"
            ) from error


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
                    os.replace(at.commit / name, at.folder / name)
        with writing(at.path):
            for name in remove:
                _unlink(at.folder / name)
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


def _unlink(path: Path) -> None:
    with suppress(FileNotFoundError, IsADirectoryError):
        path.unlink()


def _remove(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)
