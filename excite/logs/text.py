"""Lines of a recorded text file; any other file is refused with the reason."""

from __future__ import annotations

import codecs
import hashlib
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from excite.estimates.long_work import announce
from excite.logs.lines import Lines, blocks_of, places_of_lines
from regressors.errors import InputError
from regressors.input_files import LOG, in_bytes, opened
from regressors.samples import Index

_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
LONGEST_LINE = 8 * 2**20  # bytes


@dataclass(frozen=True)
class Text:
    """Lines of a text file."""

    source: str  # name of the file, for messages
    sha256: str  # hash of its bytes
    lines: Lines  # without their ends, and without empty lines at the end of the file
    complete: bool  # whether the last line has its end
    mended: tuple[str, ...]  # what was repaired to get the lines


@contextmanager
def text_of(path: Path) -> Iterator[Text]:
    """Text of a file in UTF-8, which stays open as long as its lines are read."""
    source = str(path)
    try:
        with opened(path, LOG) as stream:
            yield _text(source, stream)
    except OSError as error:
        raise InputError(f"cannot read log {source}: {error.strerror}") from error


@dataclass(frozen=True)
class _Scan:
    """Lines of a file that was read through."""

    sha256: str
    starts: Index
    ends: Index
    complete: bool
    marked: bool


_SECONDS = 3e-8  # of each byte of a table that is read, to its numbers
_SETTLED = 2.0  # seconds since the last change, after which another one has another time
_last: dict[tuple[int, ...], _Scan] = {}  # of the file that was read last: what recognises it reads it several times


def _text(source: str, stream: BinaryIO) -> Text:
    identity = _identity(stream)
    scan = None if identity is None else _last.get(identity)
    if scan is None:
        scan = _scanned(source, stream)
        _last.clear()
        if identity is not None:
            _last[identity] = scan
    mended = ("the file starts with a byte order mark, which is ignored",) * scan.marked
    return Text(source, scan.sha256, Lines(stream, scan.starts, scan.ends), scan.complete, mended)


def _identity(stream: BinaryIO) -> tuple[int, ...] | None:
    """What tells a file and its content from others; None for a pipe, and for a file that has just been changed."""
    try:
        status = os.fstat(stream.fileno())
    except OSError:  # io.UnsupportedOperation too
        return None
    if time.time() - max(status.st_mtime, status.st_ctime) < _SETTLED:
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _scanned(source: str, stream: BinaryIO) -> _Scan:
    if (start := stream.read(3)).startswith(_UTF16):
        raise InputError(f"{source} is written in UTF-16; save it as UTF-8")
    marked = start == codecs.BOM_UTF8
    stream.seek(0)
    announce(f"reading {source}", _SECONDS * _size(stream))
    digest = hashlib.sha256()
    places = places_of_lines(_checked(source, stream, digest), first=len(codecs.BOM_UTF8) * marked)
    if places is None:
        raise InputError(f"{source} is empty")
    starts, ends, complete = places
    return _Scan(digest.hexdigest(), starts, ends, complete, marked)


def _size(stream: BinaryIO) -> int:
    """Bytes of a file; 0 where they are not known, as of a pipe."""
    try:
        return os.fstat(stream.fileno()).st_size
    except OSError:  # io.UnsupportedOperation too
        return 0


def _checked(source: str, stream: BinaryIO, digest: hashlib._Hash) -> Iterator[bytes]:
    """Whole lines, many at a time, all of them text."""
    before = 0
    for block in blocks_of(stream, LONGEST_LINE):
        digest.update(block)
        if b"\0" in block:
            line = before + _line(block, block.index(0))
            raise InputError(f"{source} is not a text file: it has a zero byte in line {line}")
        try:
            block.decode("utf-8")
        except UnicodeDecodeError as error:
            line = before + _line(block, error.start)
            raise InputError(f"{source} is not UTF-8: byte 0x{block[error.start]:02x} in line {line}") from error
        yield block
        before += block.count(b"\n")
        if not block.endswith(b"\n") and len(block) >= LONGEST_LINE:
            raise InputError(f"{source} has a line of more than {in_bytes(LONGEST_LINE)}, line {before + 1}")


def _line(data: bytes, place: int) -> int:
    return data.count(b"\n", 0, place) + 1
