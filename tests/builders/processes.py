"""Processes of a command and of Dask, looked at, ended, or started as on a system without what POSIX has."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from commands import ENVIRONMENT, MODULE


def until(condition: Callable[[], object], seconds: float = 90.0) -> None:
    """Wait for a condition."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def alive(group: int) -> dict[int, int]:
    """Processes of a group that have not ended, each with its parent."""
    found = {}
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError, IndexError):
            state, parent, its_group = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
            if int(its_group) == group and state not in "ZX":
                found[int(entry.name)] = int(parent)
    return found


def workers(leader: int) -> list[int]:
    """Worker processes of a group's leader, forked from it or started anew."""
    found = []
    for pid, parent in alive(leader).items():
        with suppress(OSError):
            command = Path(f"/proc/{pid}/cmdline").read_bytes()
            forked = command == Path(f"/proc/{leader}/cmdline").read_bytes()
            if parent == leader and (forked or b"spawn_main" in command):
                found.append(pid)
    return found


@contextmanager
def running(cwd: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
    """``excite WORDS`` at work, the leader of its own group of processes, with files ``stdout`` and ``stderr``."""
    with (cwd / "stdout").open("w") as out, (cwd / "stderr").open("w") as err:
        process = subprocess.Popen(
            [*MODULE, *words], cwd=cwd, env=ENVIRONMENT, stdout=out, stderr=err, start_new_session=True, text=True
        )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def stderr_of(cwd: Path) -> str:
    """What a command has printed beside its result, which is no traceback."""
    text = (cwd / "stderr").read_text()
    assert "Traceback" not in text
    return text


class DaskProcesses:
    """A scheduler with workers, of one thread each, without nannies that would replace them.

    Parameters
    ----------
    folder : Path
        For the scheduler's file and what the processes print.
    count : int
        Number of workers.
    """

    def __init__(self, folder: Path, count: int = 2) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.file = folder, folder / "scheduler.json"
        self.scheduler = self._process(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(self.file)
        )
        until(self._is_up)
        self.workers = [
            self._process("worker", "--scheduler-file", str(self.file), "--nthreads", "1", "--no-nanny")
            for _ in range(count)
        ]

    @property
    def address(self) -> str:
        """As ``--executor`` takes it."""
        address: str = json.loads(self.file.read_text())["address"]
        return address.replace("tcp:", "dask:")

    def __enter__(self) -> DaskProcesses:
        return self

    def __exit__(self, *_: object) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _is_up(self) -> bool:
        assert self.scheduler.poll() is None, (self.folder / "scheduler.log").read_text()
        return self.file.exists() and bool(self.file.read_text())

    def _process(self, kind: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *arguments, "--no-dashboard"]
        with (self.folder / f"{kind}.log").open("ab") as log:
            return subprocess.Popen(command, cwd=self.folder, env=ENVIRONMENT, stdout=log, stderr=log)


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a process, and wait until it has gone."""
    os.kill(process.pid, signal.SIGKILL)
    process.wait()


def dies(common: tuple[str, int], unit: int) -> int:
    """Return the unit, but for unit 2 end the process a number of times first."""
    folder, times = common
    marks = Path(folder)
    if unit == 2 and len(list(marks.iterdir())) < times:
        (marks / str(os.getpid())).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return unit


SITE = '''
import os, signal, sys, warnings
for name in ("fcntl", "resource", "termios", "pwd", "grp", "pty", "tty"):
    sys.modules[name] = None  # importing it fails
for name in ("fork", "forkpty", "getuid", "geteuid", "getgid", "getegid", "killpg", "setsid", "getpgid", "getpgrp",
             "O_DIRECTORY", "O_NOFOLLOW", "sched_getaffinity", "getloadavg", "fchmod", "mkfifo", "sysconf", "sync"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGHUP", "SIGQUIT", "SIGALRM", "SIGUSR1", "SIGUSR2", "SIGCHLD", "SIGPIPE", "SIGSTOP", "SIGCONT",
             "SIGKILL", "pthread_sigmask", "sigwait", "setitimer", "alarm", "siginterrupt", "pthread_kill"):
    if hasattr(signal, name):
        delattr(signal, name)
_replace, _open, _kill, _refused = os.replace, os.open, os.kill, set()
def replace(source, destination, **more):
    """Refuse once, as where another program has the destination open."""
    if os.path.exists(destination) and str(destination) not in _refused:
        _refused.add(str(destination))
        raise PermissionError(13, "Permission denied", str(destination))
    return _replace(source, destination, **more)
def open_file(path, *more, **named):
    """Refuse folders."""
    if not isinstance(path, int) and os.path.isdir(path):
        raise PermissionError(13, "Permission denied", str(path))
    return _open(path, *more, **named)
def kill(process, number):
    """Whatever the signal, the process ends."""
    return _kill(process, 9)
os.replace, os.rename, os.open, os.kill = replace, replace, open_file, kill
import shutil
shutil._use_fd_functions = False  # there are no descriptors of folders
warnings.filterwarnings("error", category=EncodingWarning, module=r"(excite|constraints|regressors)(\\.|$)")
'''


def environment_of(folder: Path) -> dict[str, str]:
    """Variables with which Python starts as on such a system, and with a console of Windows-1252.

    Parameters
    ----------
    folder : Path
        Empty.
    """
    (folder / "sitecustomize.py").write_text(SITE, encoding="utf-8")
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {"PYTHONPATH": path, "PYTHONIOENCODING": "cp1252", "PYTHONWARNDEFAULTENCODING": "1"}
