"""Lines of a recorded text file; any other file is refused with the reason."""

from __future__ import annotations

import codecs
import hashlib
from dataclasses import dataclass
from pathlib import Path

from regressors.errors import InputError

_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


@dataclass(frozen=True)
class Text:
    """Lines of a text file.

    Parameters
    ----------
    source : str
        Name of the file, for messages.
    sha256 : str
        Hash of its bytes.
    lines : tuple of str
        Without their ends, and without empty lines at the end of the file.
    complete : bool
        Whether the last line has its end.
    mended : tuple of str
        What was repaired to get the lines.
    """

    source: str
    sha256: str
    lines: tuple[str, ...]
    complete: bool
    mended: tuple[str, ...]


def text_of(path: Path) -> Text:
    """Text of a file in UTF-8.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        Cannot be read, empty, or not a text file in UTF-8.
    """
    source = str(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read log {source}: {error.strerror}") from error
    sha256 = hashlib.sha256(data).hexdigest()
    if data.startswith(_UTF16):
        raise InputError(f"{source} is written in UTF-16; save it as UTF-8")
    if b"\0" in data:
        raise InputError(f"{source} is not a text file: it has a zero byte in line {_line(data, data.index(0))}")
    marked = data.startswith(codecs.BOM_UTF8)
    data = data.removeprefix(codecs.BOM_UTF8)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        byte = data[error.start]
        raise InputError(f"{source} is not UTF-8: byte 0x{byte:02x} in line {_line(data, error.start)}") from error
    del data  # a long file is held once, not three times
    body = text.rstrip()
    if not body:
        raise InputError(f"{source} is empty")
    complete = "\n" in text[len(body) :]
    del text
    lines = (body.replace("\r\n", "\n") if "\r" in body else body).split("\n")
    return Text(
        source, sha256, tuple(lines), complete, ("the file starts with a byte order mark, which is ignored",) * marked
    )


def _line(data: bytes, place: int) -> int:
    return data.count(b"\n", 0, place) + 1
