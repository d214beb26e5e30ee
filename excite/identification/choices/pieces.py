"""Stretches of the logs on which settings are tried."""

from __future__ import annotations

from dataclasses import dataclass

from excite.identification.preparation import PreparedLog
from excite.logs.log import Log
from excite.logs.saturation import Spans

_LONGEST = 50_000  # rows of a log that are tried
_PIECES = 5


@dataclass(frozen=True, eq=False)
class LogPiece:
    """A stretch of a log without faulty rows."""

    log: Log
    left_out: Spans  # first and last instant of what makes no equations [s]


def pieces_of(part: PreparedLog) -> list[LogPiece]:
    """The exciting stretch of a log, or evenly spaced pieces of a very long one."""
    log = part.log
    if log.count <= _LONGEST:
        return [LogPiece(log, part.left_out)]
    length = _LONGEST // _PIECES
    spacing = (log.count - length) // (_PIECES - 1)
    starts = (k * spacing for k in range(_PIECES))
    return [LogPiece(log.rows(slice(first, first + length)), part.left_out) for first in starts]
