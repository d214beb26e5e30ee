"""Memory of the partial motions that a campaign chooses from, predicted before they are enumerated."""

from __future__ import annotations

from math import comb

from excite.estimates.work_prediction import BASE, FLOAT, MemoryPart, WorkPrediction
from regressors.memory_cap import memory_cap, value_cap


def campaign_prediction(drives: int, at_once: int, columns: int) -> WorkPrediction:
    """Memory of a triangular factor of every selection of drives."""
    factor, selections = FLOAT * columns**2, selections_of(drives, at_once)
    most = min((memory_cap() - BASE) / factor, value_cap() / columns**2)  # selections
    fits = next((k for k in range(at_once - 1, 0, -1) if selections_of(drives, k) <= most), None)
    remedy = "a lower `at_once` is needed" if fits is None else f"`at_once={fits}` would do"
    part = MemoryPart("rows of selections of drives", selections * columns, columns, factor * selections, remedy=remedy)
    return WorkPrediction("the campaign", (part,))


def selections_of(drives: int, at_once: int) -> float:
    """Number of selections of drives, at most so many at a time."""
    return float(sum(comb(drives, k) for k in range(1, at_once + 1)))
