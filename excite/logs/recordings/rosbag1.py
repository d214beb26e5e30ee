"""Bags of ROS 1.

Source: the ROS bag format 2.0 (wiki.ros.org/Bags/Format/2.0): records of a header of named fields and of data. They are
read in order, so that a bag without its index is read too.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, ClassVar

from excite.logs.recordings.optional_package import optional_package
from excite.logs.recordings.recording import Contents, Recording
from excite.logs.recordings.recording_format import RecordingFormat
from excite.logs.recordings.recording_size import check_bytes
from excite.logs.recordings.ros_definitions import full_name
from excite.logs.recordings.ros_messages import BagFile, Messages, Topic
from excite.logs.recordings.ros_streams import bag_columns, bag_contents
from regressors.errors import InputError
from regressors.input_files import LOG, opened
from regressors.quoting import cut

_MAGIC = b"#ROSBAG V"
_VERSION = b"2.0\n"
_MESSAGE, _BAG_HEADER, _CHUNK, _CONNECTION = 2, 3, 5, 7
_SIZE = struct.Struct("<I")


class Rosbag1(RecordingFormat):
    """A bag of ROS 1."""

    name: ClassVar[str] = "bag of ROS 1"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return head.startswith(_MAGIC)

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        return bag_contents(BagOfRos1(path), self.name)

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        return bag_columns(BagOfRos1(path), self.name, wanted)


class BagOfRos1(BagFile):
    """A file of ROS 1."""

    def messages(self, wanted: Callable[[Topic], bool]) -> Iterator[Messages]:
        """See `BagFile.messages`."""
        self.notes, self._wanted = [], wanted
        self._topics: dict[int, Topic] = {}
        self._read: dict[int, bool] = {}
        try:
            with opened(self.path, LOG) as stream:
                yield from self._records(stream)
        except OSError as error:
            raise InputError(f"cannot read {self.path}: {error.strerror}") from error

    def _records(self, stream: BinaryIO) -> Iterator[Messages]:
        end = stream.seek(0, 2)
        stream.seek(0)
        if not stream.readline(20).endswith(b" V" + _VERSION):
            raise InputError(f"{self.path}: only bags of version 2.0 are read; `rosbag fix` or `rosbag migrate` helps")
        count = 0
        while (at := stream.tell()) < end:
            parts = [self._part(stream, end), self._part(stream, end)]
            if parts[0] is None or parts[1] is None:
                self.notes.append(f"the bag ends early, in the record at byte {at}; {count} messages were read")
                return
            for message in self._record(parts[0], parts[1], at):
                count += 1
                yield message

    def _part(self, stream: BinaryIO, end: int) -> bytes | None:
        """A header, or data; None where the file ends within."""
        head = stream.read(_SIZE.size)
        if len(head) < _SIZE.size:
            return None
        (size,) = _SIZE.unpack(head)
        if size > end - stream.tell():
            return None
        check_bytes(self.path, size)
        return stream.read(size)

    def _record(self, header: bytes, data: bytes, at: int) -> Iterator[Messages]:
        fields = self._fields(header, at)
        code = fields.get(b"op", b"\0")[0]
        if code == _BAG_HEADER and fields.get(b"encryptor"):
            raise InputError(f"{self.path} is encrypted by {cut(fields[b'encryptor'].decode('utf-8', 'replace'))}")
        if code == _CONNECTION:
            self._connection(fields, data, at)
        elif code == _MESSAGE:
            yield from self._message(fields, data, at)
        elif code == _CHUNK:
            yield from self._chunk(fields, data, at)

    def _chunk(self, fields: Mapping[bytes, bytes], data: bytes, at: int) -> Iterator[Messages]:
        size, kind = self._number(fields, b"size", at), fields.get(b"compression", b"none")
        check_bytes(self.path, size)
        raw = data if kind == b"none" else self._unpacked(kind, data, size, at)
        if len(raw) != size:
            raise self._damaged(at)
        k = 0
        while k < size:
            header, k = self._inner(raw, k, at)
            content, k = self._inner(raw, k, at)
            if self._fields(header, at).get(b"op") != bytes([_CHUNK]):  # chunks are not nested
                yield from self._record(header, content, at)

    def _inner(self, raw: bytes, k: int, at: int) -> tuple[bytes, int]:
        """A header, or data, within a chunk, and where it ends."""
        if k + _SIZE.size > len(raw):
            raise self._damaged(at)
        end = k + _SIZE.size + int(_SIZE.unpack_from(raw, k)[0])
        if end > len(raw):
            raise self._damaged(at)
        return raw[k + _SIZE.size : end], end

    def _unpacked(self, kind: bytes, data: bytes, size: int, at: int) -> bytes:
        if kind == b"bz2":
            decompressor = bz2.BZ2Decompressor()
        elif kind == b"lz4":
            decompressor = optional_package("lz4.frame", "ros", self.path).LZ4FrameDecompressor()
        else:
            name = cut(kind.decode("utf-8", "replace"))
            raise InputError(
                f"{self.path}: its chunks are compressed or encrypted as {name!r}; only bz2 and lz4 are read"
            )
        try:
            return bytes(decompressor.decompress(data, max_length=size + 1)) if size else b""
        except MemoryError:
            raise
        except Exception as error:  # each library has its own
            raise self._damaged(at) from error

    def _message(self, fields: Mapping[bytes, bytes], data: bytes, at: int) -> Iterator[Messages]:
        number = self._number(fields, b"conn", at)
        if number not in self._topics:
            raise self._damaged(at)
        if number not in self._read:
            self._read[number] = self._wanted(self._topics[number])
        if self._read[number]:
            if len(fields.get(b"time", b"")) != 8:
                raise self._damaged(at)
            seconds, nanoseconds = struct.unpack("<II", fields[b"time"])
            yield Messages(self._topics[number], [1_000_000_000 * seconds + nanoseconds], [data])

    def _connection(self, fields: Mapping[bytes, bytes], data: bytes, at: int) -> None:
        own = self._fields(data, at)
        name, kind, text = (
            value.decode("utf-8", "replace")
            for value in (fields.get(b"topic", b""), own.get(b"type", b""), own.get(b"message_definition", b""))
        )
        self._topics[self._number(fields, b"conn", at)] = Topic(
            name, full_name(kind), "msg" if text else "", text, True
        )

    def _fields(self, header: bytes, at: int) -> dict[bytes, bytes]:
        fields, k = {}, 0
        while k < len(header):
            if k + _SIZE.size > len(header):
                raise self._damaged(at)
            (size,) = _SIZE.unpack_from(header, k)
            name, equal, value = header[k + _SIZE.size : k + _SIZE.size + size].partition(b"=")
            k += _SIZE.size + size
            if k > len(header) or not equal:
                raise self._damaged(at)
            fields[name] = value
        return fields

    def _number(self, fields: Mapping[bytes, bytes], name: bytes, at: int) -> int:
        if len(fields.get(name, b"")) != _SIZE.size:
            raise self._damaged(at)
        return int(_SIZE.unpack(fields[name])[0])

    def _damaged(self, at: int) -> InputError:
        return InputError(f"{self.path}: the record at byte {at} is damaged; `rosbag fix` recovers what is left")
