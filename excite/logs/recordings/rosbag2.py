"""Bags of ROS 2: a folder with ``metadata.yaml`` and files in MCAP or SQLite, or one such SQLite file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from excite.logs.recordings.mcap_records import MAGIC, McapFile, zstandard
from excite.logs.recordings.recording import Contents, Recording
from excite.logs.recordings.recording_format import RecordingFormat
from excite.logs.recordings.ros_messages import LARGEST_MESSAGE, BagFile, Messages, Topic
from excite.logs.recordings.ros_streams import bag_columns, bag_contents
from excite.logs.recordings.sqlite_bag import SQLITE, SqliteBag
from regressors.errors import InputError
from regressors.input_files import LOG, in_bytes, opened, read_text
from regressors.quoting import cut, listed_names

_METADATA = "metadata.yaml"
_KINDS = {MAGIC[:6]: McapFile, SQLITE[:6]: SqliteBag}
_ZSTD = b"\x28\xb5\x2f\xfd"
_BLOCK = 2**20


class Rosbag2(RecordingFormat):
    """A bag of ROS 2."""

    name: ClassVar[str] = "rosbag2"

    def recognises(self, head: bytes, path: Path) -> bool:
        """See `RecordingFormat.recognises`."""
        return head.startswith(SQLITE) if head else path.is_dir() and (_metadata(path) or bool(_bags_in(path)))

    def contents(self, path: Path) -> Contents:
        """See `RecordingFormat.contents`."""
        return bag_contents(_bag(path), self.name)

    def read(self, path: Path, wanted: Mapping[str, Sequence[str]]) -> Recording:
        """See `RecordingFormat.read`."""
        return bag_columns(_bag(path), self.name, wanted)


class BagFolder(BagFile):
    """All files of a bag, one after the other."""

    @cached_property
    def metadata(self) -> Mapping[str, Any]:
        """Content of ``metadata.yaml``; empty if there is none."""
        path = self.path / _METADATA
        if not path.exists():
            return {}
        try:
            content = YAML(typ="safe", pure=True).load(read_text(path))
            own = content["rosbag2_bagfile_information"]
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror}") from error
        except (YAMLError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(f"{path} is not the metadata of a bag; `ros2 bag reindex` writes it again") from error
        if not isinstance(own, dict):
            raise InputError(f"{path} is not the metadata of a bag; `ros2 bag reindex` writes it again")
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

    def messages(self, wanted: Callable[[Topic], bool]) -> Iterator[Messages]:
        """See `BagFile.messages`."""
        self.notes = [] if self.metadata else [f"{self.path} has no {_METADATA}; its files were read in order of names"]
        packed = self.packed
        with ExitStack() as stack:
            for file in self.files:
                if packed == "file" or _head(file).startswith(_ZSTD):
                    folder = stack.enter_context(TemporaryDirectory())
                    file = _unpacked(file, Path(folder))
                bag = _bag_of(file)
                for some in bag.messages(wanted):
                    yield _opened_messages(some, self.path) if packed == "message" else some
                self.notes += bag.notes
                stack.close()


def _bag(path: Path) -> BagFile:
    return BagFolder(path) if path.is_dir() else SqliteBag(path)


def _metadata(folder: Path) -> bool:
    return (folder / _METADATA).is_file()


def _bags_in(folder: Path) -> list[Path]:
    """Files of a folder that are bags by their content, in the order of the numbers in their names."""
    files = [file for file in folder.iterdir() if file.is_file() and file.suffix in (".mcap", ".db3", ".zstd")]
    return sorted(files, key=lambda file: (len(file.name), file.name))


def _head(file: Path) -> bytes:
    try:
        with opened(file, LOG) as stream:
            return stream.read(16)
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror}") from error


def _bag_of(file: Path) -> BagFile:
    head = _head(file)
    for magic, kind in _KINDS.items():
        if head.startswith(magic):
            return kind(file)
    raise InputError(f"{file} is empty" if not head else f"{file} is neither MCAP nor a database; it may be encrypted")


def _unpacked(file: Path, folder: Path) -> Path:
    """A file that was compressed as a whole, unpacked into a folder."""
    unpacked = folder / file.stem
    decompressor, size = zstandard(file).ZstdDecompressor(), 0
    try:
        with opened(file, LOG) as packed, unpacked.open("xb") as content:
            block = packed.read(_BLOCK)
            while not decompressor.eof:
                part = decompressor.decompress(block, max_length=_BLOCK)
                size += content.write(part)
                if size > LOG:
                    raise InputError(f"{file} holds more than the {in_bytes(LOG)} that a log may have")
                block = packed.read(_BLOCK) if decompressor.needs_input else b""
                if decompressor.needs_input and not block and not decompressor.eof:
                    raise InputError(f"{file} ends early: it was not written to its end")
    except OSError as error:
        raise InputError(f"cannot unpack {file}: {error.strerror}") from error
    except zstandard(file).ZstdError as error:
        raise InputError(f"{file} cannot be unpacked: it is damaged or encrypted") from error
    return unpacked


def _opened_messages(some: Messages, source: Path) -> Messages:
    """Messages that were compressed one by one."""
    zstd = zstandard(source)
    packed = [raw if isinstance(raw, bytes) else raw.tobytes() for raw in some.raws]
    try:
        raws = [zstd.ZstdDecompressor().decompress(raw, max_length=LARGEST_MESSAGE + 1) for raw in packed]
    except zstd.ZstdError as error:
        raise InputError(f"{source}: a message of {cut(some.topic.name)} cannot be unpacked: damaged") from error
    return Messages(some.topic, some.times, raws)
