"""Memory that a piece of work would take, refused beyond a cap, and its time, said before it starts."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable

from regressors.errors import InputError, TooLargeError, shortened
from regressors.input_files import in_bytes

MEMORY_CAP = 4.0  # GB
CAP_VARIABLE = "EXCITE_MEMORY_CAP"
FLOAT = 8  # bytes of a number
Steps = Callable[[int, int], None]  # takes what is done of a piece of work, and the total


def memory_cap() -> float:
    """Memory that one piece of work may take [bytes]: that of the environment variable, else 4 GB."""
    text = os.environ.get(CAP_VARIABLE, "")
    if not text.strip():
        return 1e9 * MEMORY_CAP
    try:
        cap = float(text)
    except ValueError:
        cap = math.nan
    if not cap > 0.0 or math.isinf(cap):
        raise InputError(
            f"{CAP_VARIABLE}: expected a number of GB greater than zero, such as 8, given {shortened(text)}"
        )
    return 1e9 * cap


def check_memory(work: str, size: float, what: str, remedy: str) -> None:
    """Refuse work that would take more memory than it may, by about how many bytes it holds at the same time."""
    cap = memory_cap()
    if size > cap:
        raise TooLargeError(
            f"{work} would take about {in_bytes(size)} of memory, more than the cap of {in_bytes(cap)}: {what}; "
            f"{remedy}, or raise the cap with {CAP_VARIABLE} [GB]"
        )


def in_time(seconds: float) -> str:
    """A time in words, such as ``3 h``."""
    for unit, scale in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * scale:
            return f"{seconds / scale:.2g} {unit}"
    return f"{float(f'{seconds:.2g}'):g} s"


LONG = 30.0  # [s]
_log = logging.getLogger("excite.work")


def announce(work: str, seconds: float, remedy: str = "") -> None:
    """Log how long work will take, at level INFO, where that is more than `LONG`; the command line prints it."""
    if seconds > LONG:
        _log.info(f"{work} will take about {in_time(seconds)}{'; ' * bool(remedy)}{remedy}")
