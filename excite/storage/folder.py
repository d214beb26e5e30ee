"""A folder to write to, made before any work is done, and gone again if the work fails."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from regressors.errors import InputError


@contextmanager
def new_folder(folder: Path) -> Iterator[None]:
    """Make a folder; where the block ends with an error, remove what was made of it, if it is still empty."""
    missing = _missing(folder)
    try:
        _make(folder)
        yield
    except BaseException:
        for path in missing:
            with suppress(OSError):
                path.rmdir()
        raise


def _missing(folder: Path) -> list[Path]:
    """The folder and those above it that do not exist yet."""
    try:
        if folder.is_file():
            raise InputError(f"cannot write to {folder}: it is a file, not a folder")
        return [path for path in (folder, *folder.parents) if not path.exists()]
    except OSError as error:
        raise InputError(f"cannot write to {folder}: {error.strerror}") from error


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write to {folder}: {error.strerror}") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"cannot write to {folder}: Permission denied")
