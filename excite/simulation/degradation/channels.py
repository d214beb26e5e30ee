"""All that was recorded in a row of a log."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from excite.logs.log import Log
from regressors.samples import Array

_RECORDED = ("q", "dq", "effort", "temperature", "wrench")


def with_rows(log: Log, time: Array, rows: NDArray[np.integer[Any]]) -> Log:
    """The log with the numbers of other rows under given stamps."""  # time (N,); rows (N,)
    recorded: dict[str, Any] = {
        name: channel[rows] for name in _RECORDED if (channel := getattr(log, name)) is not None
    }
    return replace(log, time=time, **recorded)
