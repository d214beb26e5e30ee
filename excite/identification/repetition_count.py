"""Memory of what is kept of every repetition of an experiment, predicted before the first one."""

from __future__ import annotations

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction

_FEWEST = 10  # parameters, as long as it is not known how many there are


def repetition_prediction(count: int, parameters: int = _FEWEST, option: str = "repeat") -> WorkPrediction:
    """Memory of the estimates of repetitions, each with its covariance."""
    numbers = parameters * (parameters + 3)
    return WorkPrediction(
        "the repetition", (MemoryPart("repetitions", count, numbers, FLOAT * count * numbers, option, count),)
    )
