"""Bags of ROS 1 and ROS 2, and MCAP; bags of ROS 2 are folders of MCAP files or of databases, or one database.

Databases are read by rosbags, behind a check of ours: views and virtual tables would compute for ever.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from functools import cached_property
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from excite.logs.recordings.bag_records import (
    MCAP,
    BagFile,
    BagOfRos1,
    McapFile,
    Message,
    Topic,
    bag_opened,
    topics_of,
    zstandard,
)
from excite.logs.recordings.recording import Contents, Recording, RecordingFormat, optional_package
from excite.logs.recordings.ros_streams import LARGEST_MESSAGE, bag_columns, bag_contents
from regressors.errors import InputError, cut, listed_names
from regressors.input_files import LOG, in_bytes, opened, read_text
from regressors.memory_cap import memory_cap

_ROS1, _SQLITE, _ZSTD = b"#ROSBAG V", b"SQLite format 3\0", b"\x28\xb5\x2f\xfd"
_ROSBAG2, _METADATA = "rosbag2", "metadata.yaml"
_REINDEX = "is not the metadata of a bag; `ros2 bag reindex` writes it again"
_BLOCK = 2**20
_LONGEST = 2**31 - 1  # bytes of a value in a database, SQLite's own limit


class BagFormat(RecordingFormat):
    """A format of bags: how it is recognised, and what reads the messages of a file or folder."""

    def __init__(self, name: str, recognises: Callable[[bytes, Path], bool], bag: Callable[[Path], BagFile]) -> None:
        self.name, self._recognises, self._bag = name, recognises, bag

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return self._recognises(head, path)

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        return bag_contents(self._bag(path), self.name)

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        return bag_columns(self._bag(path), self.name, wanted)


class BagFolder(BagFile):
    """All files of a bag of ROS 2, one after the other."""

    @cached_property
    def metadata(self) -> Mapping[str, Any]:
        """Content of ``metadata.yaml``; empty if there is none."""
        path = self.path / _METADATA
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

    @property
    def files(self) -> tuple[Path, ...]:
        """See `BagFile.files`."""
        named = self.metadata.get("relative_file_paths")
        if not isinstance(named, list) or not named:
            return tuple(_bags_in(self.path))
        files = tuple(self.path / PurePosixPath(str(name)).name for name in named)
        if missing := [file.name for file in files if not file.is_file()]:
            raise InputError(f"{self.path}: files of the bag are missing: {listed_names(missing)}")
        return files

    @property
    def packed(self) -> str:
        """What is compressed beside the storage's own chunks: ``message``, ``file`` or nothing."""
        mode = str(self.metadata.get("compression_mode") or "").lower()
        form = str(self.metadata.get("compression_format") or "")
        if mode in ("", "none"):
            return ""
        if form != "zstd" or mode not in ("message", "file"):
            raise InputError(
                f"{self.path}: its {cut(mode)}s are compressed or encrypted as {cut(form)!r}; only zstd is read, "
                "convert the bag with `ros2 bag convert`"
            )
        return mode

    def messages(self, wanted: Callable[[Topic], bool]) -> Iterator[Message]:
        """See `BagFile.messages`."""
        self.notes = [] if self.metadata else [f"{self.path} has no {_METADATA}; its files were read in order of names"]
        packed = self.packed
        for file in self.files:
            with ExitStack() as stack:
                if packed == "file" or _head(file).startswith(_ZSTD):
                    file = _unpacked_file(file, Path(stack.enter_context(TemporaryDirectory())))
                bag = _bag_of(file)
                messages = bag.messages(wanted)
                yield from _unpacked_messages(messages, self.path) if packed == "message" else messages
                self.notes += bag.notes


def _bags_in(folder: Path) -> list[Path]:
    """Files of a folder that may be bags, in the order of the numbers in their names."""
    files = [file for file in folder.iterdir() if file.is_file() and file.suffix in (".mcap", ".db3", ".zstd")]
    return sorted(files, key=lambda file: (len(file.name), file.name))


def _bag_of(file: Path) -> BagFile:
    head = _head(file)
    if head.startswith(MCAP[:6]):
        return McapFile(file)
    if head.startswith(_SQLITE[:6]):
        return SqliteBag(file)
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


class SqliteBag(BagFile):
    """A database of rosbag2 (``.db3``)."""

    def messages(self, wanted: Callable[[Topic], bool]) -> Iterator[Message]:
        """See `BagFile.messages`."""
        sqlite = optional_package("rosbags.rosbag2.storage_sqlite3", "ros", self.path)
        self.notes, count = [], 0
        with bag_opened(self.path, _ROSBAG2):  # not a device or a pipe
            self._check_tables()
            reader = sqlite.Sqlite3Reader(Path(quote(str(self.path.absolute()))))
            reader.open()
            with closing(reader):
                reader.dbconn.limit(sqlite.apsw.SQLITE_LIMIT_LENGTH, int(min(memory_cap(), _LONGEST)))
                topics = topics_of(reader.connections)
                read = [one for one in reader.connections if wanted(topics[one.id])]
                journal = self.path.with_name(f"{self.path.name}-wal")
                if journal.is_file() and journal.stat().st_size:
                    self.notes.append(
                        f"messages that are still in {journal.name} were not read; `sqlite3 {self.path.name} .tables` "
                        "puts them into the bag"
                    )
                try:
                    for connection, time, raw in reader.messages(read):
                        if not isinstance(time, int) or not isinstance(raw, bytes):
                            raise InputError(f"{self.path}: a message of {cut(connection.topic)} is no row of bytes")
                        count += 1
                        yield topics[connection.id], time, raw
                except sqlite.apsw.Error:
                    if not count:
                        raise
                    self.notes.append(
                        f"the database {self.path.name} is damaged; the {count} messages before were read"
                    )

    def _check_tables(self) -> None:
        """Refuse what is no bag; views and virtual tables of a database could compute for ever."""
        with closing(sqlite3.connect(f"{self.path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
            base.text_factory = lambda text: text.decode("utf-8", "replace")
            made = {str(name): str(text) for name, text in base.execute("SELECT name, sql FROM sqlite_master")}
        for name in ("topics", "messages"):
            if name not in made:
                raise InputError(f"{self.path}: a database without the table {name!r} is no bag of rosbag2")
        for name in made.keys() & {"topics", "messages", "message_definitions", "schema"}:
            if not made[name].upper().startswith("CREATE TABLE"):
                raise InputError(f"{self.path}: {name!r} is no plain table; this is no bag of rosbag2")


def _is_rosbag2(head: bytes, path: Path) -> bool:
    """Whether it is a folder with ``metadata.yaml`` or files in MCAP or SQLite, or one such SQLite file."""
    if head:
        return head.startswith(_SQLITE)
    return path.is_dir() and ((path / _METADATA).is_file() or bool(_bags_in(path)))


MCAP_BAG = BagFormat("MCAP", lambda head, _: head.startswith(MCAP[:6]), McapFile)
ROSBAG1 = BagFormat("bag of ROS 1", lambda head, _: head.startswith(_ROS1), BagOfRos1)
ROSBAG2 = BagFormat(_ROSBAG2, _is_rosbag2, lambda path: BagFolder(path) if path.is_dir() else SqliteBag(path))
