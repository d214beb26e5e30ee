"""Writing that is complete or absent: to a temporary name in the same folder, then renamed."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from regressors.errors import InputError
from regressors.input_files import FILE, read_text


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
    """
    with replacing(path) as stream:
        json.dump(content, stream, indent=1, allow_nan=False)
        stream.write("\n")


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises
    ------
    InputError
        Missing, not JSON (with the line), or not an object.
    """
    try:
        content = json.loads(read_text(path, FILE))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except RecursionError as error:
        raise InputError(f"{path}: lists and objects are nested too deeply") from error
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        line = getattr(error, "lineno", None)
        raise InputError(f"{path} is not JSON" + (f" (line {line}: {error})" if line else "")) from error
    if not isinstance(content, dict):
        raise InputError(f"{path} holds no JSON object")
    return content
