"""Writing that is complete or absent: to a temporary name in the same folder, then renamed."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from excite.storage.finite import check_content
from regressors.errors import InputError

_DIGITS = 30  # of a whole number in JSON


@contextmanager
def replacing(path: Path, mode: str = "w") -> Iterator[IO[Any]]:
    """Open a temporary file that becomes ``path`` when the block ends without an error.

    Parameters
    ----------
    path : Path
    mode : {"w", "wb"}

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error
    try:
        text = "b" not in mode
        with open(handle, mode, encoding="utf-8" if text else None, newline="\n" if text else None) as stream:
            yield stream
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_json(path: Path, content: object) -> None:
    """Write JSON with floats that read back to the same bits; infinities and NaN are refused.

    Parameters
    ----------
    path : Path
    content : object
        Dictionaries, lists, strings, numbers.

    Raises
    ------
    NumericalError
        A number that is not finite, named by its place.
    """
    check_content(path, content)
    with replacing(path) as stream:
        json.dump(content, stream, indent=1, allow_nan=False)
        stream.write("\n")


class _Unreadable(Exception):
    """A number that no file of this project has."""


def _whole(text: str) -> int:
    if len(text) > _DIGITS:
        raise _Unreadable(f"{text[:20]}... is a whole number of {len(text)} digits")
    return int(text)


def _finite(text: str) -> float:
    if math.isinf(number := float(text)):
        raise _Unreadable(f"{text[:40]} is too large for a number")
    return number


def _none(text: str) -> float:
    raise _Unreadable(f"{text} is not a finite number")


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises
    ------
    InputError
        Missing, not JSON (with the line), or not an object.
    """
    try:
        content = json.loads(
            path.read_text(encoding="utf-8"), parse_int=_whole, parse_float=_finite, parse_constant=_none
        )
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except _Unreadable as error:
        raise InputError(f"{path}: {error}") from error
    except RecursionError as error:
        raise InputError(f"{path}: lists and objects are nested too deeply") from error
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        line = getattr(error, "lineno", None)
        raise InputError(f"{path} is not JSON" + (f" (line {line}: {error})" if line else "")) from error
    if not isinstance(content, dict):
        raise InputError(f"{path} holds no JSON object")
    return content
