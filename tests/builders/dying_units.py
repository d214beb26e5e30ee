"""A unit of work that ends its process, in a module that other processes find."""

from __future__ import annotations

import os
import signal
from pathlib import Path


def dies(common: tuple[str, int], unit: int) -> int:
    """Return the unit, but for unit 2 end the process a number of times first."""
    folder, times = common
    marks = Path(folder)
    if unit == 2 and len(list(marks.iterdir())) < times:
        (marks / str(os.getpid())).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return unit
