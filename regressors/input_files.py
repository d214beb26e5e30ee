"""Files of others, opened in one place: what is no file, has no end or is too large is refused before it is read.

A pipe, such as the shell's ``<(...)``, is read too: up to the same size, and as long as it does not stay silent.
"""

from __future__ import annotations

import errno
import io
import logging
import os
import select
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

DOCUMENT = 16 * 2**20  # bytes of a text that is written by hand, such as a YAML
FILE = 64 * 2**20  # bytes of any other file
LOG = 4 * 10**9  # bytes of a log, which is not held in memory
SILENCE = 10.0  # seconds without a byte after which a pipe is given up
_BLOCK = 2**20
_LOGGER = logging.getLogger(__name__)
_KINDS = {stat.S_IFCHR: "device", stat.S_IFBLK: "device", stat.S_IFSOCK: "socket"}


class UnreadableFile(OSError):
    """A file that is not opened, or not read to its end; `strerror` says why."""

    def __init__(self, why: str) -> None:
        super().__init__(errno.EINVAL, why)


@contextmanager
def opened(path: str | Path, most: int = FILE) -> Iterator[BinaryIO]:
    """Open a file for reading; its content can be sought in, that of a pipe too."""
    handle = _handle(path)
    _LOGGER.debug("reading %s ...", path)
    try:
        status = os.fstat(handle)
        _check(status, most)
        if stat.S_ISFIFO(status.st_mode):
            with io.BytesIO(_piped(handle, most)) as content:
                yield content
            return
        with open(handle, "rb", closefd=False) as stream:
            yield stream
    finally:
        os.close(handle)


def read_bytes(path: str | Path, most: int = FILE) -> bytes:
    """Content of a file; see `opened`."""
    with opened(path, most) as stream:
        content = stream.read(most + 1)
    if len(content) > most:  # files of /proc and such have no size before they are read
        raise UnreadableFile(_larger(most))
    return content


def regular_size(path: str | Path) -> int:
    """Size of a file [bytes] that another library opens by its name: no pipe, no device; see `opened`."""
    status = os.stat(path)
    _check(status, FILE)
    if stat.S_ISFIFO(status.st_mode):
        raise UnreadableFile("it is a pipe, expected a file")
    return status.st_size


def read_text(path: str | Path, most: int = DOCUMENT, encoding: str = "utf-8") -> str:
    """Text of a file, whose lines all end as on Unix; see `opened`."""
    text = read_bytes(path, most).decode(encoding)
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _handle(path: str | Path) -> int:
    """Descriptor of a file; opening a pipe that nobody writes does not block."""
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | getattr(os, "O_BINARY", 0)
    try:
        return os.open(path, flags | getattr(os, "O_CLOEXEC", 0))
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise UnreadableFile("it is a socket, expected a file") from error
        raise
    except ValueError as error:
        raise UnreadableFile("its name has a null character") from error


def _check(status: os.stat_result, most: int) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if (kind := _KINDS.get(stat.S_IFMT(status.st_mode))) is not None:
        raise UnreadableFile(f"it is a {kind}, expected a file")
    if status.st_size > most:
        raise UnreadableFile(
            f"it has {in_bytes(status.st_size)}, more than the {in_bytes(most)} that a file of this kind may have"
        )


def _piped(handle: int, most: int) -> bytes:
    """All that comes through a pipe."""
    content = bytearray()
    while block := _block(handle):
        content += block
        if len(content) > most:
            raise UnreadableFile(_larger(most))
    return bytes(content)


def _block(handle: int) -> bytes:
    """What comes next through a pipe, empty at its end."""
    watch, end = select.poll(), time.monotonic() + SILENCE
    watch.register(handle, select.POLLIN)
    while (left := end - time.monotonic()) > 0:
        if watch.poll(1e3 * left):
            try:
                return os.read(handle, _BLOCK)
            except BlockingIOError:
                continue
    raise UnreadableFile(f"it is a pipe, and nothing came through it for {SILENCE:g} s")


def _larger(most: int) -> str:
    return f"it is larger than {in_bytes(most)}, the most that a file of this kind may have"


def in_bytes(size: float) -> str:
    """A size in words, such as ``5.3 GB``."""
    for unit, scale in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= 0.9995 * scale:
            return f"{size / scale:.3g} {unit}" if size < 1e15 else f"{size / scale:.1e} {unit}"
    return f"{size:.0f} bytes"
