"""Lines of a recorded text file, read when they are needed."""

from __future__ import annotations

import codecs
import hashlib
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeAlias, overload

import numpy as np

from regressors.errors import InputError
from regressors.input_files import LOG, UnreadableFile, in_bytes, opened
from regressors.samples import Index
from regressors.work_prediction import announce

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
    with log_opened(path) as stream:
        identity = _identity(stream)
        if (scan := _last.get(identity)) is None:
            scan = _scanned(source, stream)
            _last.clear()
            if identity is not None:
                _last[identity] = scan
        sha256, starts, ends, complete, marked = scan
        mended = ("the file starts with a byte order mark, which is ignored",) * marked
        yield Text(source, sha256, Lines(stream, starts, ends), complete, mended)


@contextmanager
def log_opened(path: Path) -> Iterator[BinaryIO]:
    """The file of a log; that it cannot be read is one line."""
    try:
        with opened(path, LOG) as stream:
            yield stream
    except OSError as error:
        raise InputError(f"cannot read log {path}: {error.strerror}") from error


_SECONDS = 3e-8  # of each byte of a table that is read, to its numbers
_SETTLED = 2.0  # seconds since the last change, after which another one has another time
_Scan: TypeAlias = tuple[str, Index, Index, bool, bool]  # hash, lines' starts and ends, whether complete, with a mark
# Of the file that was read last: what recognises it reads it several times
_last: dict[tuple[int, ...] | None, _Scan] = {}


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
    with suppress(OSError):  # io.UnsupportedOperation too, as of a pipe
        announce(f"reading {source}", _SECONDS * os.fstat(stream.fileno()).st_size)
    digest = hashlib.sha256()
    places = places_of_lines(_checked(source, stream, digest), first=len(codecs.BOM_UTF8) * marked)
    if places is None:
        raise InputError(f"{source} is empty")
    return digest.hexdigest(), *places, marked


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


_BLOCK = 2**20  # bytes read at once
_AT_ONCE = 4096  # lines
_NEWLINE = 10
_SPACES = b" \t\n\r\x0b\x0c\x1c\x1d\x1e\x1f"  # those of `str.rstrip`


class Lines(Sequence[str]):
    """Lines of a file in UTF-8, or some of them."""  # starts, ends (N,)

    def __init__(self, stream: BinaryIO, starts: Index, ends: Index) -> None:
        self._stream, self._starts, self._ends = stream, starts, ends

    def __len__(self) -> int:
        """Number of lines."""
        return self._starts.size

    @overload
    def __getitem__(self, place: int) -> str: ...

    @overload
    def __getitem__(self, place: slice | Index) -> Lines: ...

    def __getitem__(self, place: int | slice | Index) -> str | Lines:
        """One line, or some as `Lines`."""
        if isinstance(place, slice | np.ndarray):
            return Lines(self._stream, self._starts[place], self._ends[place])
        return _decoded(self._bytes(int(self._starts[place]), int(self._ends[place])))

    def __iter__(self) -> Iterator[str]:
        """Read the lines one after the other."""
        for first in range(0, len(self), _AT_ONCE):
            yield from self._some(slice(first, first + _AT_ONCE))

    def _some(self, part: slice) -> Iterator[str]:
        starts, ends = self._starts[part].tolist(), self._ends[part].tolist()
        if ends[-1] - starts[0] > 4 * _BLOCK:  # long lines, or far apart: one by one
            yield from (self[k] for k in range(part.start, part.start + len(starts)))
            return
        first = starts[0]
        data = self._bytes(first, ends[-1])
        if data.count(b"\n") == len(starts) - 1:  # no line between them is left out
            yield from (line.removesuffix("\r") for line in data.decode("utf-8").split("\n"))
            return
        for start, end in zip(starts, ends, strict=True):
            yield _decoded(data[start - first : end - first])

    def _bytes(self, start: int, end: int) -> bytes:
        self._stream.seek(start)
        data = self._stream.read(end - start)
        if len(data) < end - start:
            raise UnreadableFile("it became shorter while it was read")
        return data


def _content(block: bytes) -> int:
    """Length without the white space at the end."""
    block = block.rstrip(_SPACES)
    if block and block[-1] > 127:  # it may be a space that is not of ASCII
        return len(block.decode("utf-8").rstrip().encode())
    return len(block)


def _decoded(line: bytes) -> str:
    return line.removesuffix(b"\r").decode("utf-8")


def blocks_of(stream: BinaryIO, longest: int) -> Iterator[bytes]:
    """Content of a file in blocks that end where a line ends, but for the last one and one longer than ``longest``."""
    rest = b""
    while block := stream.read(_BLOCK):
        rest += block
        if end := rest.rfind(b"\n") + 1 or len(rest) * (len(rest) >= longest):
            yield rest[:end]
            rest = rest[end:]
    if rest:
        yield rest


def places_of_lines(blocks: Iterable[bytes], first: int = 0) -> tuple[Index, Index, bool] | None:
    """Where the lines of a text begin and end, without blank lines and white space at its end."""  # result (N,)
    newlines: list[Index] = []
    size, last = 0, -1
    for block in blocks:
        found = np.flatnonzero(np.frombuffer(block, np.uint8) == _NEWLINE) + size
        newlines.append(found)
        skipped = 0 if size else first
        if content := _content(block[skipped:]):
            last = size + skipped + content
        size += len(block)
    if last < 0:
        return None
    ends = np.concatenate(newlines)
    lines = int(np.searchsorted(ends, last))  # line ends before the last character
    starts = np.concatenate([[first], ends[:lines] + 1]).astype(np.intp)
    return starts, np.concatenate([ends[:lines], [last]]).astype(np.intp), ends.size > lines
