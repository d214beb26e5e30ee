"""Memory of estimates at many instants and of many repetitions, predicted before the first simulation."""

from __future__ import annotations

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction

_FEWEST = 10  # parameters: how many there are is not known yet
_COPIES = 6.0


def study_prediction(points: int, repeats: int) -> WorkPrediction:
    """Memory of a study."""
    option, value = ("points", points) if points >= repeats else ("repeats", repeats)
    rows = points * (1 + repeats)
    return WorkPrediction(
        "the study", (MemoryPart("estimates", rows, _FEWEST, FLOAT * _COPIES * _FEWEST * rows, option, value),)
    )
