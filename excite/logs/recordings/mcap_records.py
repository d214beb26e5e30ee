"""Records of an MCAP file, read in order and as far as the file goes.

Source: the MCAP file format specification, version 0 (mcap.dev/spec): a record is an opcode, its length and its
content. Index and summary at the end are not needed, so that a file whose recorder was stopped is read too.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from excite.logs.recordings.optional_package import optional_package
from excite.logs.recordings.recording_size import check_bytes
from excite.logs.recordings.ros_definitions import full_name
from excite.logs.recordings.ros_messages import BagFile, Bytes, Messages, Topic
from regressors.errors import InputError
from regressors.input_files import LOG, opened
from regressors.quoting import cut

MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F
_FORMS = {"ros2msg": "msg", "ros1msg": "msg", "ros2idl": "idl", "omgidl": "idl", "": ""}
_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_LATEST = 2**63 - 1
_ALIKE = _HEAD.size + 2  # bytes of opcode, length and channel
_TIME, _CONTENT = _HEAD.size + 6, _HEAD.size + _MESSAGE_HEAD.size
_SHORTEST_RUN, _LONGEST_RUN = 16, 4096  # messages


class McapFile(BagFile):
    """An MCAP file."""

    def messages(self, wanted: Callable[[Topic], bool]) -> Iterator[Messages]:
        """See `BagFile.messages`."""
        self.notes, self._wanted = [], wanted
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._topics: dict[int, Topic] = {}
        self._read: dict[int, bool] = {}
        try:
            with opened(self.path, LOG) as stream:
                yield from self._top_level(stream)
        except OSError as error:
            raise InputError(f"cannot read {self.path}: {error.strerror}") from error

    def _top_level(self, stream: BinaryIO) -> Iterator[Messages]:
        end = stream.seek(0, 2)
        at, count = stream.seek(len(MAGIC)), 0
        while at < end:
            head = stream.read(_HEAD.size)
            code, size = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, 0)
            whole = len(head) == _HEAD.size and size <= end - at - _HEAD.size
            if code == _DATA_END and whole:
                return
            if not whole and code != _CHUNK:
                break
            if code in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK):
                check_bytes(self.path, min(size, end - at))
                content = stream.read(size) if whole else stream.read()
                for some in self._chunk(content, at, whole) if code == _CHUNK else self._record(code, content, at):
                    count += len(some.times)
                    yield some
            if not whole:
                break
            at = stream.seek(at + _HEAD.size + size)
        self.notes.append(f"the file was not closed; the {count} messages that are whole were read")

    def _chunk(self, content: bytes, at: int, whole: bool) -> Iterator[Messages]:
        """Messages of a chunk; of one that is cut off those that are whole."""
        try:
            size, crc = struct.unpack_from("<QI", content, 16)
            kind, start = _text(content, 28)
            (length,) = struct.unpack_from("<Q", content, start)
        except (struct.error, IndexError, UnicodeDecodeError) as error:
            if not whole:
                return
            raise self._damaged("chunk", at) from error
        check_bytes(self.path, size)
        packed = content[start + 8 : start + 8 + length]
        raw = self._unpacked(kind, packed, size, at, whole)
        if whole and (len(raw) != size or len(packed) != length):
            raise self._damaged("chunk", at)
        if whole and crc and zlib.crc32(raw) != crc:
            raise InputError(
                f"{self.path}: the checksum of the chunk at byte {at} does not match; recover what is left, such as "
                "with `mcap recover`"
            )
        yield from self._records(raw, at, whole)

    def _unpacked(self, kind: str, packed: bytes, size: int, at: int, whole: bool) -> bytes:
        if not kind:
            return packed
        try:
            return _decompressor(kind, self.path).decompress(packed, max_length=size + 1) if size else b""
        except (InputError, MemoryError):
            raise
        except Exception as error:  # each library has its own
            if not whole:
                return b""
            raise self._damaged("chunk", at) from error

    def _records(self, raw: bytes, at: int, whole: bool) -> Iterator[Messages]:
        """Messages of an unpacked chunk; runs of equally long ones of a topic are not looked at one by one."""
        k, end = 0, len(raw)
        single: dict[int, tuple[list[int], list[bytes]]] = {}
        before = b""
        while k + _HEAD.size <= end:
            code, size = _HEAD.unpack_from(raw, k)
            start, k = k, k + _HEAD.size + size
            if k > end:
                break
            if code != _MESSAGE or size < _MESSAGE_HEAD.size:
                yield from self._record(code, raw[start + _HEAD.size : k], at)
                continue
            number, _, time, _ = _MESSAGE_HEAD.unpack_from(raw, start + _HEAD.size)
            if not self._is_read(number, at):
                continue
            if raw[start : start + _ALIKE] == before and (run := _run(raw, start, k - start)) is not None:
                if number in single:
                    yield Messages(self._topics[number], *single.pop(number))
                yield Messages(self._topics[number], *run)
                k = start + len(run[0]) * (k - start)
                continue
            before = raw[start : start + _ALIKE]
            times, raws = single.get(number) or single.setdefault(number, ([], []))
            times.append(min(time, _LATEST))
            raws.append(raw[start + _CONTENT : k])
        yield from (Messages(self._topics[number], *several) for number, several in single.items())
        if whole and k != end:
            raise self._damaged("chunk", at)

    def _is_read(self, number: int, at: int) -> bool:
        """Whether messages of a channel are wanted."""
        if number not in self._read:
            if number not in self._topics:
                raise self._damaged("message", at)
            self._read[number] = self._wanted(self._topics[number])
        return self._read[number]

    def _record(self, code: int, content: bytes, at: int) -> Iterator[Messages]:
        try:
            if code == _SCHEMA:
                self._schema(content)
            elif code == _CHANNEL:
                self._channel(content)
            elif code == _MESSAGE:
                number, _, time, _ = _MESSAGE_HEAD.unpack_from(content)
                if self._is_read(number, at):
                    yield Messages(self._topics[number], [min(time, _LATEST)], [content[_MESSAGE_HEAD.size :]])
        except (struct.error, IndexError, UnicodeDecodeError) as error:
            raise self._damaged("record", at) from error

    def _schema(self, content: bytes) -> None:
        (number,) = struct.unpack_from("<H", content)
        name, at = _text(content, 2)
        form, at = _text(content, at)
        (length,) = struct.unpack_from("<I", content, at)
        self._schemas[number] = name, form, content[at + 4 : at + 4 + length].decode("utf-8", "replace")

    def _channel(self, content: bytes) -> None:
        number, schema = struct.unpack_from("<HH", content)
        name, at = _text(content, 4)
        encoding, _ = _text(content, at)
        kind, form, text = self._schemas.get(schema, ("", "", ""))
        unread = ""
        if encoding not in ("cdr", "ros1"):
            unread = f"its messages are encoded as {cut(encoding) or 'nothing known'}, not as CDR"
        elif form not in _FORMS:
            unread = f"its messages are defined in {cut(form)}"
        topic = Topic(name, full_name(kind), _FORMS.get(form, ""), text, encoding == "ros1", unread)
        if self._topics.get(number, topic) != topic:
            raise InputError(f"{self.path}: channel {number} is defined twice")
        self._topics[number] = topic

    def _damaged(self, what: str, at: int) -> InputError:
        return InputError(
            f"{self.path}: the {what} at byte {at} is damaged; recover what is left, such as with `mcap recover`"
        )


def _run(raw: bytes, start: int, stride: int) -> tuple[NDArray[np.int64], Bytes] | None:
    """Times and contents of the messages from a place on that are of one channel and equally long; None if few are."""
    count = min((len(raw) - start) // stride, _LONGEST_RUN)
    head, last = raw[start : start + _ALIKE], start + (_SHORTEST_RUN - 1) * stride
    if count < _SHORTEST_RUN or raw[last : last + _ALIKE] != head:
        return None
    table = np.frombuffer(raw, np.uint8, count * stride, start).reshape(count, stride)
    alike = (table[:, :_ALIKE] == table[0, :_ALIKE]).all(axis=1)
    length = count if alike.all() else int(np.argmin(alike))
    if length < _SHORTEST_RUN:
        return None
    times = table[:length, _TIME : _TIME + 8].copy().view("<u8")[:, 0]
    return np.minimum(times, _LATEST).astype(np.int64), table[:length, _CONTENT:]


def _text(content: bytes, at: int) -> tuple[str, int]:
    """A text with its length before it, and where it ends."""
    (length,) = struct.unpack_from("<I", content, at)
    end = at + 4 + length
    if end > len(content):
        raise IndexError("text ends early")
    return content[at + 4 : end].decode(), end


def _decompressor(kind: str, path: Path) -> Any:
    if kind == "lz4":
        return optional_package("lz4.frame", "ros", path).LZ4FrameDecompressor()
    if kind == "zstd":
        return zstandard(path).ZstdDecompressor()
    raise InputError(
        f"{path}: its chunks are compressed or encrypted as {cut(kind)!r}; only zstd and lz4 are read, convert it, "
        "such as with `mcap convert`"
    )


def zstandard(path: Path) -> Any:
    """Module for zstd: of the standard library since Python 3.14, before that of rosbags' dependency."""
    try:
        return optional_package("compression.zstd", "ros", path)
    except InputError:
        return optional_package("backports.zstd", "ros", path)
