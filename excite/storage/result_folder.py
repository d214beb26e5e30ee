"""Folders of results that are replaced as one."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import replace as changed
from functools import partial
from pathlib import Path
from uuid import uuid4

from excite.registry import FIGURE_FORMATS
from excite.storage.atomic import MANIFEST, NEXT, Destination, write_bytes, writing
from excite.storage.commit import Read, clear, commit, locked, read_settled, settle, staging
from excite.storage.manifest import (
    Entry,
    FileHash,
    is_foreign,
    read_manifest,
    write_manifest,
)
from regressors.errors import InputError, TakenError
from regressors.quantities import shown


@contextmanager
def result_folder(folder: Path) -> Iterator[str]:
    """Be the only writer of a folder, which is made, or cleared of what an interrupted run has left, in the block."""
    with _sole_writer(Destination(folder)):
        yield uuid4().hex


@contextmanager
def _sole_writer(at: Destination) -> Iterator[None]:
    with _new_folder(at.folder), locked(at):
        clear(at)
        yield


@contextmanager
def _new_folder(folder: Path) -> Iterator[None]:
    """Make a folder; where the block ends with an error, remove what was made of it, if it is still empty."""
    missing: list[Path] = []
    try:
        try:
            if folder.is_file():
                raise InputError(f"cannot write to {folder}: it is a file, not a folder")
            missing = [path for path in (folder, *folder.parents) if not path.exists()]
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot write to {folder}: {error.strerror}") from error
        if not os.access(folder, os.W_OK | os.X_OK):
            raise InputError(f"cannot write to {folder}: Permission denied")
        yield
    except BaseException:
        for path in missing:
            with suppress(OSError):
                path.rmdir()
        raise


@contextmanager
def replace_result(
    folder: Path,
    kind: str,
    *,
    run: str | None = None,
    older: Collection[str] = (),
    folders: Collection[str] = (),
    figures: Collection[str] | None = None,
) -> Iterator[Path]:
    """Write a result in place of the one of the same kind; at every instant the folder holds one of them, whole."""
    at = Destination(folder)
    with staging(at) as staged:
        yield staged
        manifest, files = read_manifest(folder), _hashes(staged)
        old = manifest[kind].files if kind in manifest else older
        others = {name for other, entry in manifest.items() if other != kind for name in entry.files}
        remove = {name for name in old if "/" not in name} - {*files, *others, MANIFEST}
        formats = None if figures is None else tuple(figures)
        entry = Entry(run or uuid4().hex, files, formats)
        _write(staged, folder, {**{of: each.without(files) for of, each in manifest.items()}, kind: entry})
        new = [name for name in folders if (folder / NEXT / name).exists()]
        commit(at, last=MANIFEST, remove=remove, folders=new)


@contextmanager
def amend_result(folder: Path, kind: str) -> Iterator[Path]:
    """Add or replace files of a result, all at once; a folder without a result of the kind gets the files alone."""
    at = Destination(folder)
    with staging(at) as staged:
        yield staged
        manifest = read_manifest(folder)
        if kind in manifest:
            files = _hashes(staged)
            others = {of: each.without(files) for of, each in manifest.items()}
            _write(staged, folder, {**others, kind: changed(manifest[kind], files={**manifest[kind].files, **files})})
        commit(at, last=MANIFEST)


def _write(staged: Path, folder: Path, manifest: dict[str, Entry]) -> None:
    if not is_foreign(folder):
        write_manifest(staged / MANIFEST, manifest)


def _hashes(folder: Path) -> dict[str, FileHash]:
    """Files of a folder by name; hidden ones are about to be written, and not complete."""
    with writing(folder):
        return {path.name: FileHash.of(path) for path in sorted(folder.glob("[!.]*"))}


def check_not_taken(folder: Path, mark: str, what: str, names: Collection[str] = (), *, replace: bool) -> None:
    """Check that no file would be overwritten that the user has not asked to replace."""
    if replace:
        return
    if (folder / mark).exists():
        raise TakenError(f"{folder} already holds {what}")
    owned = {name for entry in read_manifest(folder).values() for name in entry.files}
    for name in names:
        if (folder / name).exists() and name not in owned:
            raise TakenError(f"{folder / name} is already there, and is not of {what}")


def result_file(path: Path) -> AbstractContextManager[None]:
    """Be the only writer of a file in the block, whose folder is made if it does not exist; see `result_folder`."""
    return _sole_writer(Destination(path.parent, path.name))


def write_file(path: Path, content: bytes, *, replace: bool) -> None:
    """Write one file; one that is there is replaced only where that is asked for."""
    with result_file(path):
        check_free(path, replace=replace)
        with replace_files(path) as staged:
            write_bytes(staged / path.name, content)


def check_free(*paths: Path, replace: bool) -> None:
    """Raise `TakenError` where files are there that are not to be replaced, `InputError` where one is a folder."""
    there = [path for path in paths if path.exists()]
    if folder := next((path for path in there if path.is_dir()), None):
        raise InputError(f"cannot write {str(folder)!r}: it is a folder; name a file in it")
    if there and not replace:
        raise TakenError(f"{', '.join(map(str, there))} already there", "name")


@contextmanager
def replace_files(path: Path, *, remove: Collection[str] = ()) -> Iterator[Path]:
    """Write a file and those beside it in place of older ones, all at once."""
    at = Destination(path.parent, path.name)
    with staging(at) as staged:
        yield staged
        commit(at, last=path.name, remove=set(remove) - {each.name for each in staged.iterdir()})


def settle_files(path: Path) -> None:
    """Put files in place that an interrupted run has committed, before a file of a result is read."""
    for at in _writers(path):
        settle(at)


def read_settled_files(path: Path, read: Callable[[], Read]) -> Read:
    """Read a file of a result, and those beside it, as one run has left them."""
    for at in _writers(path):
        read = partial(read_settled, at, read)
    return read()


def _writers(path: Path) -> set[Destination]:
    """What is locked by whoever writes a file: itself, or the joint log that a wrench log belongs to."""
    return {Destination(path.parent, name) for name in (path.name, path.name.replace(".wrench.", "."))}


def figure_names(stems: Iterable[str], formats: Iterable[str] = FIGURE_FORMATS) -> list[str]:
    """File of every figure in every format, such as ``motion.pdf``."""
    kinds = list(formats)
    return [f"{stem}.{kind}" for stem in stems for kind in kinds]


def check_formats(formats: str | Sequence[str]) -> tuple[str, ...]:
    """Formats as a tuple, each once; one name alone will do."""
    given = (formats,) if isinstance(formats, str) else tuple(formats)
    wrong = [each for each in given if each not in FIGURE_FORMATS]
    if wrong or not given:
        what = shown(wrong[0]) if wrong else "none"
        raise InputError(f"expected `formats` to be some of {', '.join(FIGURE_FORMATS)}; given {what}")
    return tuple(dict.fromkeys(given))
