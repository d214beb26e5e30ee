"""Stretches of the rows of long logs that stand for all of them, where a method holds what it reads."""

from __future__ import annotations

import numpy as np

from excite.identification.observations import Observations

MOST = 2**17  # rows
_STRETCHES = 8


def row_stretches(observations: Observations) -> list[slice]:
    """All rows, or, of more than `MOST`, that many in contiguous stretches evenly spread over each log."""
    m, r = observations.y.size, len(observations.equations)
    if m <= MOST:
        return [slice(0, m)]
    stretches, first = [], 0
    for rows in np.bincount(observations.log):
        number = max(1, round(_STRETCHES * rows / m))
        length = max(1, int(MOST * rows / (m * number * r)))
        for k in range(number):
            middle = int((k + 0.5) * rows / (number * r))
            start = first + r * max(0, middle - length // 2)
            stretches.append(slice(start, min(start + r * length, first + rows)))
        first += rows
    return [stretch for stretch in stretches if stretch.start < stretch.stop]
