"""A disk that fails at a chosen call: the process ends there, as by a kill or a loss of power, or the call reports it.

Every call that changes files below a folder is counted: making, opening, writing, syncing, renaming and removing.
"""

from __future__ import annotations

import builtins
import errno
import io
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

CRASHED = 77  # exit status of a process that ended at its call
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
_ONE_PATH = ("mkdir", "unlink", "remove", "rmdir", "truncate")
_TWO_PATHS = ("replace", "rename", "link", "symlink")
_FREEING = ("unlink", "remove", "rmdir", "open folder")


@dataclass
class Disk:
    """Counts the calls, and fails at one of them.

    Parameters
    ----------
    root : Path
        Folder whose files count.
    at : int, optional
        Number of the call that fails; none if not given.
    how : {"killed", "power", "full", "fault"}
        The process ends, after half of what the call was to write; the same, and what was not synced is lost; no space
        from this call on; an input/output error at this call alone.
    """

    root: Path
    at: int | None = None
    how: str = "killed"
    calls: list[str] = field(default_factory=list)
    paths: dict[int, str] = field(default_factory=dict)
    unsynced: set[str] = field(default_factory=set)

    def counted(self, what: str, path: str, torn: Callable[[], object] = lambda: None) -> None:
        """Count a call, and fail if it is the one."""
        self.calls.append(f"{what} {os.path.relpath(path, self.root)}")
        number = len(self.calls) - 1
        if self.at is None or number < self.at:
            return
        if self.how in ("killed", "power") and number == self.at:
            torn()
            self.end()
        if self.how == "full" and what not in _FREEING:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)
        if self.how == "fault" and number == self.at:
            raise OSError(errno.EIO, os.strerror(errno.EIO), path)

    def end(self) -> None:
        """End the process; on a loss of power without what was not synced."""
        if self.how == "power":
            for path in self.unsynced:
                if os.path.exists(path):
                    REAL["truncate"](path, 0)
        os._exit(CRASHED)

    def inside(self, path: Any) -> bool:
        """True for paths below the folder."""
        return isinstance(path, str | os.PathLike) and Path(os.path.abspath(path)).is_relative_to(self.root)

    def moved(self, old: str, new: str) -> None:
        """Remember what was not synced by its new name."""
        self.unsynced = {new + path.removeprefix(old) if path.startswith(old) else path for path in self.unsynced}


REAL: dict[str, Callable[..., Any]] = {
    name: getattr(os, name) for name in (*_ONE_PATH, *_TWO_PATHS, "open", "write", "fsync", "close")
}
_open = io.open


@contextmanager
def failing(disk: Disk) -> Iterator[Disk]:
    """Let the calls of the block go through the disk."""
    wrapped = {name: _of_path(disk, name) for name in (*_ONE_PATH, *_TWO_PATHS)}
    wrapped |= {"open": _opening(disk), "write": _writing(disk), "fsync": _syncing(disk), "close": _closing(disk)}
    stream, before = _stream_opening(disk), {name: getattr(os, name) for name in wrapped}
    try:
        for name, function in wrapped.items():
            setattr(os, name, function)
        builtins.open = io.open = stream  # type: ignore[assignment]
        yield disk
    finally:
        for name, function in before.items():
            setattr(os, name, function)
        builtins.open = io.open = _open


def _of_path(disk: Disk, name: str) -> Callable[..., Any]:
    def call(path: Any, *rest: Any, **options: Any) -> Any:
        folder = disk.paths.get(options.get("dir_fd", -1))
        full = path if folder is None else os.path.join(folder, path)
        if disk.inside(full):
            disk.counted(name, os.path.abspath(full))
        done = REAL[name](path, *rest, **options)
        if name in ("replace", "rename"):
            disk.moved(os.path.abspath(path), os.path.abspath(rest[0]))
        return done

    return call


def _opening(disk: Disk) -> Callable[..., int]:
    def call(path: Any, flags: int, *rest: Any, **options: Any) -> int:
        folder = disk.paths.get(options.get("dir_fd") or -1)
        full = path if folder is None else os.path.join(folder, path)
        known = disk.inside(full)
        if known and flags & _WRITES:
            disk.counted("open", os.path.abspath(full))
        handle: int = REAL["open"](path, flags, *rest, **options)
        if known:
            disk.paths[handle] = os.path.abspath(full)
        return handle

    return call


def _writing(disk: Disk) -> Callable[[int, Any], int]:
    def call(handle: int, content: Any) -> int:
        if handle in disk.paths:
            path = disk.paths[handle]
            disk.unsynced.add(path)
            disk.counted("write", path, lambda: REAL["write"](handle, bytes(content)[: len(content) // 2]))
        return int(REAL["write"](handle, content))

    return call


def _syncing(disk: Disk) -> Callable[[int], None]:
    def call(handle: int) -> None:
        if handle in disk.paths:
            disk.counted("fsync", disk.paths[handle])
            disk.unsynced.discard(disk.paths[handle])  # which is all that matters here, and the disk is slow

    return call


def _closing(disk: Disk) -> Callable[[int], None]:
    def call(handle: int) -> None:
        disk.paths.pop(handle, None)
        REAL["close"](handle)

    return call


def _stream_opening(disk: Disk) -> Callable[..., Any]:
    class Counted(io.FileIO):
        """A file whose writes are counted."""

        def __init__(self, path: Any, mode: str) -> None:
            disk.counted("open", os.path.abspath(path))
            super().__init__(path, mode)
            self.path = disk.paths[self.fileno()] = os.path.abspath(path)

        def write(self, content: Any) -> int:
            disk.unsynced.add(self.path)
            disk.counted("write", self.path, lambda: io.FileIO.write(self, bytes(content)[: len(content) // 2]))
            return super().write(content)

        def close(self) -> None:
            if not self.closed:
                disk.paths.pop(self.fileno(), None)
            super().close()

    def call(
        path: Any, mode: str = "r", buffering: int = -1, encoding: Any = None, errors: Any = None, newline: Any = None,
        *rest: Any, **options: Any,
    ) -> Any:  # fmt: skip
        if not disk.inside(path) or not set(mode) & set("wxa+"):
            return _open(path, mode, buffering, encoding, errors, newline, *rest, **options)
        buffered = io.BufferedWriter(Counted(path, mode.replace("b", "").replace("t", "")))
        return buffered if "b" in mode else io.TextIOWrapper(buffered, encoding, errors, newline)

    return call


def run_failing(disk: Disk, command: Callable[[], int]) -> int:
    """Exit status of a command on a disk; one that is to end at its call runs in a process of its own."""
    if disk.at is None or disk.how not in ("killed", "power"):
        with failing(disk):
            return command()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the fork of a process with threads, whose locks these commands do not need
        child = os.fork()
    if child == 0:
        try:
            with failing(disk):
                command()
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
