"""Bags of ROS 1 and ROS 2, and MCAP; bags of ROS 2 are folders of MCAP files or of databases, or one database.

Databases are read by rosbags, behind a check of ours: views and virtual tables would compute for ever.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import ExitStack, closing
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from excite.logs.recordings.bag_records import (
    MCAP,
    BagReader,
    Message,
    Topic,
    bag_opened,
    mcap_messages,
    ros1_messages,
    state_of,
    topics_of,
    zstandard,
)
from excite.logs.recordings.recording import Contents, Recording, RecordingFormat, Wanted, optional_package
from excite.logs.recordings.ros_streams import LARGEST_MESSAGE, bag_columns, bag_contents
from regressors.errors import InputError, cut, listed_names
from regressors.input_files import LOG, in_bytes, opened, read_text
from regressors.work_prediction import memory_cap

_ROS1, _SQLITE, _ZSTD = b"#ROSBAG V", b"SQLite format 3\0", b"\x28\xb5\x2f\xfd"
_ROSBAG2, _METADATA = "rosbag2", "metadata.yaml"
_REINDEX = "is not the metadata of a bag; `ros2 bag reindex` writes it again"
_BLOCK = 2**20
_LONGEST = 2**31 - 1  # bytes of a value in a database, SQLite's own limit


def bag_format(name: str, recognises: Callable[[bytes, Path], bool], messages: BagReader) -> RecordingFormat:
    """A format of bags: how it is recognised, and what reads the messages of a file or folder."""

    def contents(path: Path) -> Contents:
        return bag_contents(messages, path, _state(path), name)

    def read(path: Path, wanted: Wanted) -> Recording:
        return bag_columns(messages, path, _state(path), name, wanted)

    return RecordingFormat(name, recognises, contents, read)


def _state(path: Path) -> Hashable:
    return state_of(path, _files(path, _metadata(path)) if path.is_dir() else [path])


def _metadata(folder: Path) -> Mapping[str, Any]:
    """Content of ``metadata.yaml``; empty if there is none."""
    path = folder / _METADATA
    if not path.exists():
        return {}
    try:
        own = YAML(typ="safe", pure=True).load(read_text(path))["rosbag2_bagfile_information"]
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except (YAMLError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{path} {_REINDEX}") from error
    if not isinstance(own, dict):
        raise InputError(f"{path} {_REINDEX}")
    return own


def _files(folder: Path, metadata: Mapping[str, Any]) -> list[Path]:
    """All files of a bag of ROS 2, in their order."""
    named = metadata.get("relative_file_paths")
    if not isinstance(named, list) or not named:
        return _bags_in(folder)
    files = [folder / PurePosixPath(str(name)).name for name in named]
    if missing := [file.name for file in files if not file.is_file()]:
        raise InputError(f"{folder}: files of the bag are missing: {listed_names(missing)}")
    return files


def _packed(folder: Path, metadata: Mapping[str, Any]) -> str:
    """What is compressed beside the storage's own chunks: ``message``, ``file`` or nothing."""
    mode = str(metadata.get("compression_mode") or "").lower()
    form = str(metadata.get("compression_format") or "")
    if mode in ("", "none"):
        return ""
    if form != "zstd" or mode not in ("message", "file"):
        raise InputError(
            f"{folder}: its {cut(mode)}s are compressed or encrypted as {cut(form)!r}; only zstd is read, "
            "convert the bag with `ros2 bag convert`"
        )
    return mode


def _ros2_messages(path: Path, wanted: Callable[[Topic], bool], notes: list[str]) -> Iterator[Message]:
    """Messages of a database, or of all files of a folder, one after the other."""
    if not path.is_dir():
        yield from _sqlite_messages(path, wanted, notes)
        return
    metadata = _metadata(path)
    if not metadata:
        notes.append(f"{path} has no {_METADATA}; its files were read in order of names")
    packed = _packed(path, metadata)
    for file in _files(path, metadata):
        with ExitStack() as stack:
            if packed == "file" or _head(file).startswith(_ZSTD):
                file = _unpacked_file(file, Path(stack.enter_context(TemporaryDirectory())))
            messages = _reader_of(file)(file, wanted, notes)
            yield from _unpacked_messages(messages, path) if packed == "message" else messages


def _bags_in(folder: Path) -> list[Path]:
    """Files of a folder that may be bags, in the order of the numbers in their names."""
    files = [file for file in folder.iterdir() if file.is_file() and file.suffix in (".mcap", ".db3", ".zstd")]
    return sorted(files, key=lambda file: (len(file.name), file.name))


def _reader_of(file: Path) -> BagReader:
    head = _head(file)
    if head.startswith(MCAP[:6]):
        return mcap_messages
    if head.startswith(_SQLITE[:6]):
        return _sqlite_messages
    raise InputError(f"{file} is neither MCAP nor a database; it may be encrypted" if head else f"{file} is empty")


def _head(file: Path) -> bytes:
    with bag_opened(file, _ROSBAG2) as stream:
        return stream.read(16)


def _unpacked_file(file: Path, folder: Path) -> Path:
    """A file that was compressed as a whole, unpacked into a folder."""
    unpacked, size = folder / file.stem, 0
    zstd = zstandard(file)
    try:
        with opened(file, LOG) as packed, zstd.open(packed) as stream, unpacked.open("xb") as content:
            while block := stream.read(_BLOCK):
                size += content.write(block)
                if size > LOG:
                    raise InputError(f"{file} holds more than the {in_bytes(LOG)} that a log may have")
    except OSError as error:
        raise InputError(f"cannot unpack {file}: {error.strerror}") from error
    except EOFError as error:
        raise InputError(f"{file} ends early: it was not written to its end") from error
    except zstd.ZstdError as error:
        raise InputError(f"{file} cannot be unpacked: it is damaged or encrypted") from error
    return unpacked


def _unpacked_messages(messages: Iterator[Message], source: Path) -> Iterator[Message]:
    """Messages that were compressed one by one."""
    zstd = zstandard(source)
    for topic, time, packed in messages:
        try:
            raw = zstd.ZstdDecompressor().decompress(packed, max_length=LARGEST_MESSAGE + 1)
        except zstd.ZstdError as error:
            raise InputError(f"{source}: a message of {cut(topic.name)} cannot be unpacked: damaged") from error
        yield topic, time, raw


def _sqlite_messages(path: Path, wanted: Callable[[Topic], bool], notes: list[str]) -> Iterator[Message]:
    """Messages of a database of rosbag2 (``.db3``)."""
    sqlite, count = optional_package("rosbags.rosbag2.storage_sqlite3", "ros", path), 0
    with bag_opened(path, _ROSBAG2):  # not a device or a pipe
        _check_tables(path)
        reader = sqlite.Sqlite3Reader(Path(quote(str(path.absolute()))))
        reader.open()
        with closing(reader):
            reader.dbconn.limit(sqlite.apsw.SQLITE_LIMIT_LENGTH, int(min(memory_cap(), _LONGEST)))
            topics = topics_of(reader.connections)
            read = [one for one in reader.connections if wanted(topics[one.id])]
            journal = path.with_name(f"{path.name}-wal")
            if journal.is_file() and journal.stat().st_size:
                notes.append(
                    f"messages that are still in {journal.name} were not read; `sqlite3 {path.name} .tables` "
                    "puts them into the bag"
                )
            try:
                for connection, time, raw in reader.messages(read):
                    if not isinstance(time, int) or not isinstance(raw, bytes):
                        raise InputError(f"{path}: a message of {cut(connection.topic)} is no row of bytes")
                    count += 1
                    yield topics[connection.id], time, raw
            except sqlite.apsw.Error:
                if not count:
                    raise
                notes.append(f"the database {path.name} is damaged; the {count} messages before were read")


def _check_tables(path: Path) -> None:
    """Refuse what is no bag; views and virtual tables of a database could compute for ever."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
        base.text_factory = lambda text: text.decode("utf-8", "replace")
        made = {str(name): str(text) for name, text in base.execute("SELECT name, sql FROM sqlite_master")}
    for name in ("topics", "messages"):
        if name not in made:
            raise InputError(f"{path}: a database without the table {name!r} is no bag of rosbag2")
    for name in made.keys() & {"topics", "messages", "message_definitions", "schema"}:
        if not made[name].upper().startswith("CREATE TABLE"):
            raise InputError(f"{path}: {name!r} is no plain table; this is no bag of rosbag2")


def _is_rosbag2(head: bytes, path: Path) -> bool:
    """Whether it is a folder with ``metadata.yaml`` or files in MCAP or SQLite, or one such SQLite file."""
    if head:
        return head.startswith(_SQLITE)
    return path.is_dir() and ((path / _METADATA).is_file() or bool(_bags_in(path)))


MCAP_BAG = bag_format("MCAP", lambda head, _: head.startswith(MCAP[:6]), mcap_messages)
ROSBAG1 = bag_format("bag of ROS 1", lambda head, _: head.startswith(_ROS1), ros1_messages)
ROSBAG2 = bag_format(_ROSBAG2, _is_rosbag2, _ros2_messages)
