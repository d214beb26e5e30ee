"""A Dask scheduler and its workers, each a process of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

from commands import ENVIRONMENT
from processes import until


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
