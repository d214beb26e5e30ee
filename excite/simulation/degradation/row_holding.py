"""Rows that a recorder repeats because nothing new had arrived."""

from __future__ import annotations

import numpy as np

from excite.logs.log import Log
from excite.simulation.degradation.channels import with_rows


def held_rows(log: Log, share: float, rng: np.random.Generator) -> Log:
    """The same log, some of whose rows repeat the numbers of the row before under their own stamps."""
    last = np.arange(log.count)
    last[1 + rng.choice(log.count - 1, round(share * (log.count - 1)), replace=False)] = 0
    last = np.maximum.accumulate(last)
    return with_rows(log, log.time, last)
