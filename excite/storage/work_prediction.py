"""How long a piece of work will take, said before it starts."""

from __future__ import annotations

import logging
from collections.abc import Callable

Steps = Callable[[int, int], None]  # takes what is done of a piece of work, and the total


def in_time(seconds: float) -> str:
    """A time in words, such as ``3 h``."""
    for unit, scale in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * scale:
            return f"{seconds / scale:.2g} {unit}"
    return f"{float(f'{seconds:.2g}'):g} s"


LONG = 30.0  # [s]
_log = logging.getLogger("excite.storage")


def announce(work: str, seconds: float, remedy: str = "") -> None:
    """Log how long work will take, at level INFO, where that is more than `LONG`; the command line prints it."""
    if seconds > LONG:
        _log.info(f"{work} will take about {in_time(seconds)}{'; ' * bool(remedy)}{remedy}")
