"""How long work will take, said once before it starts where it is long; nothing is refused for its time."""

from __future__ import annotations

import logging

from excite.estimates.work_prediction import in_time

LONG = 30.0  # [s]
_log = logging.getLogger("excite.estimates")


def announce(work: str, seconds: float, remedy: str = "") -> None:
    """Log how long work will take, at level INFO, where that is more than `LONG`; the command line prints it."""
    if seconds > LONG:
        _log.info(f"{work} will take about {in_time(seconds)}{'; ' * bool(remedy)}{remedy}")
