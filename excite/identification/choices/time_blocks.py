"""Blocks of time that are left out one after the other, with gaps between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regressors.samples import Array, Index

COUNT = 5
_GAP = 0.2  # of a block
_LONGEST_GAP = 0.5  # [s]


def time_blocks(times: Sequence[Array], count: int = COUNT) -> list[Index]:
    """Number of the block that each instant lies in; -1 in the gaps.

    Neighbouring instants have nearly the same motion and noise; a block that is predicted from its neighbours across a
    gap shows more honestly how well another motion would be predicted [Roberts et al. 2017].
    """  # times (N,)
    each = max(2, -(-count // len(times)))
    numbers = []
    for k, time in enumerate(times):
        if not time.size:
            numbers.append(np.empty(0, dtype=np.intp))
            continue
        edges = np.linspace(time[0], time[-1], each + 1)
        half = min(_GAP * (edges[1] - edges[0]), _LONGEST_GAP) / 2
        block = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, each - 1)
        inner = block > 0
        near = (np.abs(time - edges[block]) < half) & inner
        near |= (np.abs(time - edges[block + 1]) < half) & (block < each - 1)
        numbers.append(np.where(near, -1, block + k * each))
    return numbers
