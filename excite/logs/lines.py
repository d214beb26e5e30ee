"""Lines of a file, read when they are needed: what is held is where each begins and ends."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import BinaryIO, overload

import numpy as np
from numpy.typing import NDArray

from regressors.input_files import UnreadableFile
from regressors.samples import Index

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
    def __getitem__(self, place: slice) -> Lines: ...

    def __getitem__(self, place: int | slice) -> str | Lines:
        """One line, or some as `Lines`."""
        if isinstance(place, slice):
            return Lines(self._stream, self._starts[place], self._ends[place])
        return _decoded(self._bytes(int(self._starts[place]), int(self._ends[place])))

    def __iter__(self) -> Iterator[str]:
        """Read the lines one after the other."""
        for first in range(0, len(self), _AT_ONCE):
            yield from self._some(slice(first, first + _AT_ONCE))

    def where(self, keep: NDArray[np.bool_]) -> Lines:
        """Those of the lines that are kept."""
        return Lines(self._stream, self._starts[keep], self._ends[keep])

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
        end = block.rfind(b"\n") + 1
        if not end:
            rest += block
            if len(rest) >= longest:
                yield rest
                rest = b""
            continue
        yield rest + block[:end]
        rest = block[end:]
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
