"""Time that an identification takes, predicted once its logs are read."""

from __future__ import annotations

from collections.abc import Sequence

from excite.logs.log import Log

_CHOICES = 0.015  # seconds of choosing settings on the instants of a trial, for each joint to the third power
_FURTHER = 0.4  # of that, for each log after the first
_TRIED, _MOST_TRIED = 2.5e-6, 1e5  # seconds of choosing for each row and pair of joints, and rows that count
_ROWS = 5e-7  # seconds of the estimate for each row and pair of joints


def identification_seconds(logs: Sequence[Log], *, chosen: bool) -> float:
    """Time of an identification on one core, without figures [s]; right within a factor of three.

    The unit that it grows with is a number of the regressor: rows times joints times joints, as there are about ten
    parameters to a joint. Measured with 800 to 2,000,000 rows, 5 to 7 joints and up to 5 logs by the estimators
    ``weighted`` and ``physical``; others take more.
    """
    rows, joints = sum(log.count for log in logs), max(len(log.joints) for log in logs)
    seconds = 0.1 + _ROWS * rows * joints**2
    if chosen:
        seconds += _CHOICES * joints**3 * (1.0 + _FURTHER * (len(logs) - 1))
        seconds += _TRIED * min(rows, _MOST_TRIED) * joints**2
    return float(seconds)
