"""Files that are written whole: a temporary name, synced, then renamed."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any
from uuid import uuid4

import numpy as np
from numpy.typing import ArrayLike

from excite.operating_system import replace_file, sync_folder
from regressors.errors import InputError, NumericalError
from regressors.input_files import FILE, read_text

_DIGITS = 30  # of a whole number in JSON


@contextmanager
def replacing(path: Path, mode: str = "w") -> Iterator[IO[Any]]:
    """Open a temporary file that is put on the disk, and becomes ``path``, when the block ends without an error."""
    how: dict[str, Any] = {} if "b" in mode else {"encoding": "utf-8", "newline": "\n"}
    temporary = path.parent / f".{path.name[:40]}.{uuid4().hex[:12]}"
    with writing(path):
        try:
            with open(temporary, mode.replace("w", "x"), **how) as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            replace_file(temporary, path)
        except BaseException:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
        sync_folder(path.parent)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an error of the operating system into one that names the file or folder that the user asked for."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot write {shown(path)}: {error.strerror or error}") from error


def write_json(path: Path, content: object) -> None:
    """Write JSON with floats that read back to the same bits; infinities and NaN are refused."""
    check_content(path, content)
    with replacing(path) as stream:
        json.dump(content, stream, indent=1, allow_nan=False)
        stream.write("\n")


def _whole(text: str) -> int:
    if len(text) > _DIGITS:
        raise ValueError(f"{text[:20]}... is a whole number of {len(text)} digits")
    return int(text)


def _finite(text: str) -> float:
    if math.isinf(number := float(text)):
        raise ValueError(f"{text[:40]} is too large for a number")
    return number


def _none(text: str) -> float:
    raise ValueError(f"{text} is not a finite number")


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object."""
    try:
        content = json.loads(read_text(path, FILE), parse_int=_whole, parse_float=_finite, parse_constant=_none)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except RecursionError as error:
        raise InputError(f"{path}: lists and objects are nested too deeply") from error
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        line = getattr(error, "lineno", None)
        raise InputError(f"{path} is not JSON" + (f" (line {line}: {error})" if line else "")) from error
    except ValueError as error:  # a number that no file of this project has
        raise InputError(f"{path}: {error}") from error
    if not isinstance(content, dict):
        raise InputError(f"{path} holds no JSON object")
    return content


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all."""
    with replacing(path, "wb") as stream:
        stream.write(content)


def check_table(path: Path, header: Sequence[str], table: ArrayLike) -> None:
    """Raise `NumericalError` that names the first column with a number that is not finite."""  # table (N, len(header)
    finite = np.isfinite(np.asarray(table, dtype=float))
    if not finite.all():
        column = int(np.argmin(finite.all(axis=0)))
        row = int(np.argmin(finite[:, column]))
        raise _not_written(path, f"{header[column]} is not finite in row {row + 1}")


def check_content(path: Path, content: object) -> None:
    """Raise `NumericalError` that names the first number of a content for JSON that is not finite."""
    if (place := _not_finite(content)) is not None:
        raise _not_written(path, f"{place or 'it'} is not finite")


def _not_written(path: Path, why: str) -> NumericalError:
    return NumericalError(f"{path.name} is not written: {why}; values of very different sizes are the likely cause")


def _not_finite(content: object) -> str | None:
    """Place of the first number that is not finite, such as ``.fit[3]``, without the leading dot."""
    if isinstance(content, float):
        return None if math.isfinite(content) else ""
    if isinstance(content, dict):
        parts = ((str(key), value) for key, value in content.items())
    elif isinstance(content, list | tuple):
        parts = ((f"[{k + 1}]", value) for k, value in enumerate(content))
    else:
        return None
    for name, value in parts:
        if (below := _not_finite(value)) is not None:
            return f"{name}{'.' if below and not below.startswith('[') else ''}{below}"
    return None


NEXT = ".next"  # folders of a result that is not complete yet, while the folder holds another one
JOURNAL = ".journal"
MANIFEST = "manifest.json"
_HIDDEN = re.compile(r"\.(?:(.+)\.)?(?:staging|commit|lock|writer\.json)|\.next|\.journal")


@dataclass(frozen=True)
class Destination:
    """A folder that one process writes to at a time, or a file name in it."""

    folder: Path
    name: str = ""  # of the file; empty where the whole folder is meant

    def hidden(self, what: str) -> Path:
        """Path of a hidden file or folder of this destination."""
        return self.folder / (f".{self.name}.{what}" if self.name else f".{what}")

    @property
    def path(self) -> Path:
        """What the user asked for."""
        return self.folder / self.name

    @property
    def staging(self) -> Path:
        """Folder where files are written until all of them are complete."""
        return self.hidden("staging")

    @property
    def commit(self) -> Path:
        """The staging folder's name from when all of its files are complete until they are in place."""
        return self.hidden("commit")


def shown(path: Path) -> Path:
    """The path that a user knows: without hidden folders; of a hidden file, such as a lock, that of its result."""
    known = Path(*(part for part in path.parts if not _HIDDEN.fullmatch(part)))
    hidden = _HIDDEN.fullmatch(path.name)
    return known / hidden[1] if hidden and hidden[1] else known


def plain_name(name: object, source: Path) -> str:
    """A name that stays in its folder, as read from a file."""
    if not isinstance(name, str) or name in ("", ".", "..") or re.search(r"[/\\\0]", name):
        raise InputError(f"{source}: expected names of files without a folder")
    return name
