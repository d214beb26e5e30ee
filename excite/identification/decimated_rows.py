"""Rows of a regressor after a low-pass and decimation, computed in parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.identification.streamed_rows import BLOCK, HELD, RowSource
from excite.signals.low_pass import edge, kept_rows, low_passed
from regressors.samples import Array, Index

_MARGIN = 8  # times the edge of the filter, 16 periods of its cutoff: its memory is then below 1e-16


@dataclass(frozen=True)
class Decimation:
    """The same low-pass and decimation of both sides of ``y = W beta``."""

    rate: float  # of the equations before it [Hz]
    cutoff: float | None  # [Hz]; without one, rows are only decimated
    kept: slice  # which of the instants are left

    @classmethod
    def of(cls, time: Array, cutoff: float | None, every: int | None) -> Decimation:
        """Decimation of equations at uniform instants."""  # time (N,)
        rate = (time.size - 1) / float(time[-1] - time[0])
        kept = slice(0, time.size, every) if cutoff is None else kept_rows(time.size, rate, cutoff, every)
        return cls(rate, cutoff, kept)

    def __call__(self, x: Array) -> Array:
        """Signals at the instants that are left, from shape (N, ...)."""
        return x[self.kept] if self.cutoff is None else low_passed(x, self.rate, self.cutoff)[self.kept]


class DecimatedRows(RowSource):
    """Rows of a source, low-passed and decimated."""

    def __init__(self, source: RowSource, decimation: Decimation) -> None:
        self.source, self.decimation = source, decimation
        self.instants = np.arange(source.shape[0])[decimation.kept]
        self.shape = (self.instants.size, *source.shape[1:])
        self._margin = 0 if decimation.cutoff is None else _MARGIN * edge(decimation.rate, decimation.cutoff)
        small = 8 * np.prod(source.shape) <= HELD
        self._many = self.shape[0] if small else max(BLOCK, -(-2 * self._margin // decimation.kept.step))
        self._known: tuple[int, Array] | None = None

    def part(self, first: int, last: int) -> Array:
        """See `RowSource.part`."""
        if self.decimation.cutoff is None:
            return self.source.at(self.instants[first:last])
        pieces = []
        for number in range(first // self._many, -(-last // self._many)):
            start = number * self._many
            pieces.append(self._filtered(number)[max(first - start, 0) : last - start])
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)

    def _filtered(self, number: int) -> Array:
        """One of the blocks that are filtered at once; the last one is kept, since rows are asked for in sequence."""
        if self._known is None or self._known[0] != number:
            self._known = None
            self._known = number, self._filter(self.instants[number * self._many : (number + 1) * self._many])
        return self._known[1]

    def _filter(self, instants: Index) -> Array:
        """Filtered rows of some instants, from those around them; equation by equation, to hold little at once."""
        assert self.decimation.cutoff is not None
        N, r, b = self.source.shape
        start, stop = max(0, int(instants[0]) - self._margin), min(N, int(instants[-1]) + self._margin + 1)
        W, rows = self.source.part(start, stop), np.zeros((instants.size, r, b))
        for j in range(r):
            used = np.flatnonzero(np.any(W[:, j], axis=0))
            smooth = low_passed(W[:, j, used], self.decimation.rate, self.decimation.cutoff)
            rows[:, j, used] = smooth[instants - start]
        return rows
