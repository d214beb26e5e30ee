"""Messages of bags as they were serialised; records of MCAP and of ROS 1 are read by rosbags, in order of the file.

rosbags' own loops over messages need an index, and a file that was closed. Its readers of records are therefore led
along the file, as far as that goes. In front of them stand the checks that rosbags lacks: of the sizes that a file
declares, and of what a chunk unpacks to.
"""

from __future__ import annotations

import bz2
import struct
import zlib
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias

from excite.logs.recordings.recording import check_bytes, foreign_reader, optional_package
from excite.logs.text import log_opened
from regressors.errors import InputError, cut, reading

MCAP = b"\x89MCAP0\r\n"
_LATEST = 2**63 - 1  # [ns]
_MESSAGE, _BAG_HEADER, _CHUNK, _CONNECTION = 2, 3, 5, 7  # records of ROS 1
_SCHEMA, _CHANNEL, _MCAP_CHUNK, _DATA_END, _FOOTER = 0x03, 0x04, 0x06, 0x0F, b"\x02"  # records of MCAP
_MCAP_HEAD = struct.Struct("<BQ")
_SCHEMAS = ("ros2msg", "ros2idl", "omgidl", "")
_MCAP_KINDS, _ROS1_KINDS = ("zstd", "lz4"), ("bz2", "lz4")  # of compression


@dataclass(frozen=True)
class Topic:
    """A topic, as far as the bag describes it."""

    name: str
    kind: str  # type of its messages, with the folder: sensor_msgs/msg/JointState
    form: str = ""  # msg or idl, of the definition; empty where there is none
    text: str = ""  # definition
    ros1: bool = False  # whether its messages are serialised as in ROS 1, else in CDR
    unread: str = ""  # why its messages cannot be read; empty if they can


Message: TypeAlias = tuple[Topic, int, bytes]  # with the time at which it was recorded [ns], as it was serialised


# Messages of the topics of a file or folder that are wanted, those of each in recorded order; asked of every topic that
# has some. Notes are complete when all were read. A bag that is damaged, encrypted, or compressed in a way that is not
# read is an `InputError`.
BagReader: TypeAlias = Callable[[Path, Callable[[Topic], bool], list[str]], Iterator[Message]]


def state_of(path: Path, files: Iterable[Path]) -> Hashable:
    """What changes when the files of a bag do."""
    with reading(str(path)):
        statuses = [file.stat() for file in files]
    return tuple((status.st_size, status.st_mtime_ns, status.st_ino) for status in statuses)


def mcap_messages(path: Path, wanted: Callable[[Topic], bool], notes: list[str]) -> Iterator[Message]:
    """Messages of an MCAP file, up to its last whole one; index and summary are not needed."""
    mcap = optional_package("rosbags.rosbag2.storage_mcap", "ros", path)
    end, closed, summary, rest = _checked_mcap(path, state_of(path, [path]))
    count, read = 0, dict[int, Topic | None]()
    with bag_opened(path, "MCAP") as stream:
        reader = mcap.McapReader(path)
        reader.bio, reader.data_end = BytesIO(summary), 0
        reader.read_index()
        indexed = bool(reader.connections)
        for source, first, last in ((stream, len(MCAP), end), (BytesIO(rest), 0, len(rest))):
            reader.bio, reader.data_start, reader.data_end = source, first, last
            if not indexed:
                reader.meta_scan()
            topics = topics_of(reader.connections)
            for connection, time, raw in reader.messages_scan(reader.connections, 0, 2**64):
                number = connection.id
                if number not in read:
                    read[number] = topics[number] if wanted(topics[number]) else None
                if (topic := read[number]) is not None:
                    count += 1
                    yield topic, min(time, _LATEST), raw
    if not closed:
        notes.append(f"the file was not closed; the {count} messages that are whole were read")


@lru_cache(maxsize=4)
def _checked_mcap(path: Path, state: Hashable) -> tuple[int, bool, bytes, bytes]:
    """End of the whole records of a file, whether it was closed, its summary, and what is left of a chunk cut off.

    The sizes that records and chunks declare are checked. Of the summary schemas and channels are kept, without the
    schemas that rosbags does not parse.
    """
    at, closed, summary, rest = len(MCAP), 0, b"", b""
    with bag_opened(path, "MCAP") as stream:
        end = stream.seek(0, 2)
        stream.seek(at)
        while len(head := stream.read(_MCAP_HEAD.size)) == _MCAP_HEAD.size:
            code, size = _MCAP_HEAD.unpack(head)
            if size > end - stream.tell():
                rest = _cut_chunk(path, stream.read()) if code == _MCAP_CHUNK and not closed else b""
                break
            if code == _MCAP_CHUNK:
                check_bytes(path, size)
                _check_chunk(path, stream.read(size), at)
            elif code == _DATA_END:
                closed = at
            elif closed and code in (_SCHEMA, _CHANNEL):
                content = stream.read(size).replace(b"\7\0\0\0ros1msg", b"\7\0\0\0ros2msg", 1)  # parsed alike
                if code == _CHANNEL or _text(content, _text(content, 2)[1])[0] in _SCHEMAS:
                    summary += head + content
            at = stream.seek(at + len(head) + size)
    return closed or at, bool(closed), summary + _FOOTER, rest


def _check_chunk(path: Path, content: bytes, at: int) -> None:
    """Refuse a chunk that unpacks to more than it declares, or to other bytes, or whose last record is cut off."""
    size, crc = struct.unpack_from("<QI", content, 16)
    raw, chunk, wrong = _chunk_records(path, content), f"the chunk at byte {at}", ""
    if len(raw) != size or _end_of_records(raw) != size:
        wrong = f"{chunk} is damaged"
    elif crc and zlib.crc32(raw) != crc:
        wrong = f"the checksum of {chunk} does not match"
    if wrong:
        raise InputError(f"{path}: {wrong}; recover what is left, such as with `mcap recover`")


def _cut_chunk(path: Path, content: bytes) -> bytes:
    """Whole records of a chunk that is cut off."""
    try:
        raw = _chunk_records(path, content)
    except (struct.error, UnicodeDecodeError):  # it ends within its head
        return b""
    return raw[: _end_of_records(raw)]


def _end_of_records(raw: bytes) -> int:
    """Where the last whole record ends."""
    end, following = 0, 0
    while following <= len(raw):
        end = following
        if end + _MCAP_HEAD.size > len(raw):
            break
        following = end + _MCAP_HEAD.size + _MCAP_HEAD.unpack_from(raw, end)[1]
    return end


def _chunk_records(path: Path, content: bytes) -> bytes:
    """What a chunk unpacks to."""
    (size,) = struct.unpack_from("<Q", content, 16)
    kind, start = _text(content, 28)
    (length,) = struct.unpack_from("<Q", content, start)
    return _unpacked(path, kind, content[start + 8 : start + 8 + length], size, _MCAP_KINDS)


def _text(content: bytes, at: int) -> tuple[str, int]:
    """A text with its length before it, and where it ends."""
    (length,) = struct.unpack_from("<I", content, at)
    return content[at + 4 : at + 4 + length].decode(), at + 4 + length


def ros1_messages(path: Path, wanted: Callable[[Topic], bool], notes: list[str]) -> Iterator[Message]:
    """Messages of a file of ROS 1; its index is not needed."""
    kit = optional_package("rosbags.rosbag1.reader", "ros", path)
    topics, same, read, count = dict[int, Topic](), dict[Topic, Topic](), dict[int, bool](), 0
    with bag_opened(path, "bag of ROS 1") as stream:
        end = stream.seek(0, 2)
        stream.seek(0)
        if not stream.readline(20).endswith(b" V2.0\n"):
            raise InputError(f"{path}: only bags of version 2.0 are read; `rosbag fix` or `rosbag migrate` helps")
        for at, header, data in _ros1_records(path, kit, stream, end):
            code = header.get_uint8("op")
            if code == _BAG_HEADER and header.get("encryptor"):
                raise InputError(f"{path} is encrypted by {cut(_decoded(header['encryptor']))}")
            if code == _CONNECTION:
                own = kit.Header.read(BytesIO(len(data).to_bytes(4, "little") + data))
                kind, text = _decoded(own.get("type", b"")), _decoded(own.get("message_definition", b""))
                topic = Topic(_decoded(header.get("topic", b"")), _full_name(kind), "msg" if text else "", text, True)
                topics[header.get_uint32("conn")] = same.setdefault(topic, topic)
            if code != _MESSAGE:
                continue
            if (number := header.get_uint32("conn")) not in topics:
                raise _damaged(path, at)
            if number not in read:
                read[number] = wanted(topics[number])
            if read[number]:
                count += 1
                yield topics[number], header.get_time("time"), data
        if (at := stream.tell()) < end:
            notes.append(f"the bag ends early, in the record at byte {at}; {count} messages were read")


def _ros1_records(path: Path, kit: Any, stream: BinaryIO, end: int) -> Iterator[tuple[int, Any, bytes]]:
    """Where each whole record is, its header and its data, those in chunks instead of these; leads to what follows."""
    while (at := stream.tell()) < end:
        header = kit.Header.read(stream) if _fits(path, stream, end) else None
        if header is None or not _fits(path, stream, end):
            stream.seek(at)
            return
        data = kit.read_bytes(stream, kit.read_uint32(stream))
        if header.get_uint8("op") != _CHUNK:
            yield at, header, data
            continue
        size, kind = header.get_uint32("size"), _decoded(header.get("compression", b"none"))
        if len(raw := _unpacked(path, kind, data, size, _ROS1_KINDS)) != size:
            raise _damaged(path, at)
        chunk = BytesIO(raw)
        while chunk.tell() < size:
            yield at, kit.Header.read(chunk), kit.read_bytes(chunk, kit.read_uint32(chunk))


def _fits(path: Path, stream: BinaryIO, end: int) -> bool:
    """Whether what comes next, behind its size, is whole."""
    head = stream.read(4)
    size = int.from_bytes(head, "little")
    fits = len(head) == 4 and size <= end - stream.tell()
    check_bytes(path, size if fits else 0)
    stream.seek(-len(head), 1)
    return fits


def _damaged(path: Path, at: int) -> InputError:
    return InputError(f"{path}: the record at byte {at} is damaged; `rosbag fix` recovers what is left")


@contextmanager
def bag_opened(path: Path, form: str) -> Iterator[BinaryIO]:
    """A file; that it is not readable, and what rosbags says of a damaged one, is one line."""
    with foreign_reader(path, form), log_opened(path) as stream:
        yield stream


def topics_of(connections: Iterable[Any]) -> dict[int, Topic]:
    """Topics of the connections of rosbags by their numbers; equal ones are one object."""
    topics, same = dict[int, Topic](), dict[Topic, Topic]()
    for one in connections:
        encoding, text = one.ext.serialization_format, one.msgdef.data
        form = one.msgdef.format.name.lower() if text else ""
        unread = f"its messages are encoded as {cut(encoding) or 'nothing known'}, not as CDR"
        known = encoding in ("ros1", "cdr")
        topic = Topic(one.topic, _full_name(one.msgtype), form, text, encoding == "ros1", "" if known else unread)
        topics[one.id] = same.setdefault(topic, topic)
    return topics


def _full_name(name: str) -> str:
    """Name of a type with its folder: ``sensor_msgs/JointState`` of ROS 1 is ``sensor_msgs/msg/JointState``."""
    package, _, rest = name.partition("/")
    return name if not rest or "/" in rest else f"{package}/msg/{rest}"


def _unpacked(path: Path, kind: str, packed: bytes, size: int, known: tuple[str, str]) -> bytes:
    """A chunk, of which hardly more is unpacked than it declares; nothing where it is damaged."""
    check_bytes(path, size)
    if kind in ("", "none"):
        return packed
    if kind not in known:
        remedy = ", convert it, such as with `mcap convert`" if known is _MCAP_KINDS else ""
        raise InputError(
            f"{path}: its chunks are compressed or encrypted as {cut(kind)!r}; only {known[0]} and {known[1]} are read"
            f"{remedy}"
        )
    if kind == "bz2":
        decompressor: Any = bz2.BZ2Decompressor()
    elif kind == "lz4":
        decompressor = optional_package("lz4.frame", "ros", path).LZ4FrameDecompressor()
    else:
        decompressor = zstandard(path).ZstdDecompressor()
    try:
        unpacked: bytes = decompressor.decompress(packed, max_length=size + 1) if size else b""
    except MemoryError:
        raise
    except Exception:  # each library has its own
        return b""
    return unpacked


def zstandard(path: Path) -> Any:
    """Module for zstd: of the standard library since Python 3.14, before that of rosbags' dependency."""
    try:
        return optional_package("compression.zstd", "ros", path)
    except InputError:
        return optional_package("backports.zstd", "ros", path)


def _decoded(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")
