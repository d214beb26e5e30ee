"""What operating systems do differently: renames onto open files, folders on disk, locks, processes.

Every function asks whether the system has what it needs, and not for its name, so that a missing call can be simulated.
"""

from __future__ import annotations

import errno
import os
import sys
import threading
import time
from importlib import import_module
from pathlib import Path
from typing import Any

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")  # variables: of libraries for linear algebra
_RENAME_SECONDS = 2.0  # a virus scanner or an indexer holds a file for less
_RENAME_STEP = 0.02
_NO_FOLDER_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.EBADF, errno.EACCES)
_SYNCHRONIZE, _STILL_RUNNING = 0x00100000, 0x102  # of the Windows API


def replace_file(source: str | Path, destination: str | Path) -> None:
    """Rename a file onto another; where another program has that open, which Windows refuses, try for two seconds."""
    until = time.monotonic() + _RENAME_SECONDS
    while True:
        try:
            os.replace(source, destination)
        except PermissionError:
            # elsewhere the folder is what cannot be written to, and waiting does not help
            if not _refuses_open_files() or time.monotonic() > until:
                raise
            time.sleep(_RENAME_STEP)
        else:
            return


def _refuses_open_files() -> bool:
    return sys.platform == "win32" or not hasattr(os, "fork")


def sync_folder(folder: Path) -> None:
    """Put the names in a folder on disk; nothing where the system or the file system has no call for it."""
    try:
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as error:
        if error.errno not in _NO_FOLDER_SYNC:
            raise


class ForkSafeThread(threading.Thread):
    """A thread that may be at work when another one forks: the new process needs nothing that it may hold."""


def can_fork() -> bool:
    """True if a forked copy of this process works: this is Linux, in the main thread, and no other thread is at work.

    A thread of another may hold a lock, which nobody would release in the copy. OpenBLAS ends its threads before a
    fork. macOS has ``fork``, but not all of its own libraries survive it.
    """
    threads = threading.enumerate()
    if not sys.platform.startswith("linux") or not hasattr(os, "fork"):
        return False
    if threading.current_thread() is not threading.main_thread():
        return False
    if not all(isinstance(each, ForkSafeThread) for each in threads if each is not threading.main_thread()):
        return False
    try:
        at_work = len(os.listdir("/proc/self/task"))
    except OSError:
        return False
    return at_work <= len(threads) + _threads_of_openblas()


def _threads_of_openblas() -> int:
    from threadpoolctl import threadpool_info

    pools = [pool for pool in threadpool_info() if pool.get("internal_api") == "openblas"]
    return sum(pool["num_threads"] - 1 for pool in pools if pool.get("threading_layer") == "pthreads")


def is_running(process: int) -> bool:
    """True if a process exists; `os.kill` with 0, which asks that elsewhere, ends the process on Windows."""
    if sys.platform == "win32":
        return _runs_on_windows(process)
    try:
        os.kill(process, 0)
    except PermissionError:  # it is another user's
        return True
    except (ProcessLookupError, OverflowError):
        return False
    return True


def _runs_on_windows(process: int) -> bool:
    kernel: Any = getattr(import_module("ctypes"), "windll").kernel32  # noqa: B009 - known on Windows only
    handle = kernel.OpenProcess(_SYNCHRONIZE, False, process)
    if not handle:
        return False
    try:
        return bool(kernel.WaitForSingleObject(handle, 0) == _STILL_RUNNING)
    finally:
        kernel.CloseHandle(handle)
