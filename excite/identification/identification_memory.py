"""Memory that the rows of logs take in an identification or a verification, predicted once the logs are read."""

from __future__ import annotations

from collections.abc import Sequence

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction
from excite.identification.streamed_rows import HELD
from excite.logs.log import Log

_OF_ANY, _OF_JOINT = 20.0, 13.0  # numbers of each row, and of each of its joints
_COPIES = 2.0  # of the regressor that is held; beyond `HELD` it is computed when it is asked for


def rows_prediction(work: str, logs: Sequence[Log]) -> WorkPrediction:
    """Memory of work with the rows of some logs; the factors are measured."""
    rows, joints = sum(log.count for log in logs), max(len(log.joints) for log in logs)
    numbers = _OF_ANY + _OF_JOINT * joints
    equations = min(_COPIES * HELD, FLOAT * rows * 10.0 * joints**2)
    held = FLOAT * rows * numbers + equations
    return WorkPrediction(
        work, (MemoryPart("rows", rows, 1 + 3 * joints, held, remedy="choose fewer rows with `rows`"),)
    )
