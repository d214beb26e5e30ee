"""Processor and wall time of a command with all its children, in a fresh process."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Measured:
    """What a command took and printed.

    Parameters
    ----------
    cpu : float
        User and system time of the command and its children [s].
    wall : float
        [s]
    output : str
    """

    cpu: float
    wall: float
    output: str

    @property
    def result(self) -> Any:
        """The last line that was printed, as JSON."""
        return json.loads(self.output.splitlines()[-1])


def _children_cpu() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def measured(arguments: Sequence[str], threads: int | None = None) -> Measured:
    """Run a command to its end.

    Parameters
    ----------
    arguments : sequence of str
    threads : int, optional
        Of BLAS; its own default, as for any user, if not given.

    Raises
    ------
    subprocess.CalledProcessError
        It failed.
    """
    environment = {key: value for key, value in os.environ.items() if key not in _THREADS}
    if threads is not None:
        environment |= dict.fromkeys(_THREADS, str(threads))
    cpu, wall = _children_cpu(), time.monotonic()
    done = subprocess.run(arguments, check=True, stdout=subprocess.PIPE, text=True, env=environment)
    return Measured(_children_cpu() - cpu, time.monotonic() - wall, done.stdout)


def script(name: str, specification: Mapping[str, Any], threads: int | None = None) -> Measured:
    """Run a script beside this file with a specification in JSON as its argument."""
    return measured([sys.executable, str(HERE / name), json.dumps(specification)], threads)
