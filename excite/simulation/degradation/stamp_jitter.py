"""Time stamps of a host that looks at its clock late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.logs.log import Log
from regressors.errors import InputError

_LOAD = 0.5  # of the long waits that the host could just catch up with


def late_stamps(log: Log, between: tuple[float, float], rng: np.random.Generator) -> Log:
    """The same rows, stamped late: ``t_k + w_k``, with ``w_k = max(w_{k-1} - (step - shortest), e_k)``.

    A host reads rows that were sampled regularly from a buffer. Most rows wait a little, ``e_k`` uniform up to
    ``step - shortest``; a few wait until ``longest`` after the one before, and the rows behind them are read at the
    host's fastest, ``shortest`` apart, until it has caught up.
    """
    shortest, longest = between
    step = log.duration / max(log.count - 1, 1)
    if not 0 < shortest < step < longest:
        raise InputError(
            f"`clock_jitter`: rows are sampled every {step:g} s; expected a shortest time between stamps below that "
            f"and a longest above, given {shortest:g} and {longest:g} s"
        )
    gain, late = step - shortest, longest - step
    share = _LOAD * gain / (gain + late / 2)
    waits = np.where(rng.random(log.count) < share, rng.uniform(0, late, log.count), rng.uniform(0, gain, log.count))
    row = np.arange(log.count) * gain
    return replace(log, time=log.time + np.maximum.accumulate(waits + row) - row)
