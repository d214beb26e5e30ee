"""Rows that never reach the file."""

from __future__ import annotations

import numpy as np

from excite.logs.log import Log
from excite.simulation.degradation.channels import with_rows


def dropped_rows(log: Log, share: float, rng: np.random.Generator) -> Log:
    """The same log without some of its rows."""
    lost = 1 + rng.choice(log.count - 2, round(share * (log.count - 2)), replace=False)
    kept = np.setdiff1d(np.arange(log.count), lost)
    return with_rows(log, log.time[kept], kept)
