"""Rows of a regressor after a low-pass and decimation, computed in parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.identification.streamed_rows import HELD, RowSource
from excite.signals.low_pass import edge, kept_rows, low_passed
from regressors.samples import Array, Index

_MARGIN = 8  # times the edge of the filter, 16 periods of its cutoff: its memory is then below 1e-16
_PART = 8192  # instants


@dataclass(frozen=True)
class Decimation:
    """The same low-pass and decimation of both sides of ``y = W beta``.

    Parameters
    ----------
    rate : float
        Of the equations before it [Hz].
    cutoff : float or None
        [Hz]; without one, rows are only decimated.
    kept : slice
        Which of the instants are left.
    """

    rate: float
    cutoff: float | None
    kept: slice

    @classmethod
    def of(cls, time: Array, cutoff: float | None, every: int | None) -> Decimation:
        """Decimation of equations at uniform instants.

        Parameters
        ----------
        time : ndarray, shape (N,)
            [s]
        cutoff : float, optional
            [Hz]
        every : int, optional
            Decimation factor; the largest that the low-pass allows if not given.

        Raises
        ------
        InputError
            See `excite.signals.low_pass.kept_rows`.
        """
        rate = (time.size - 1) / float(time[-1] - time[0])
        kept = slice(0, time.size, every) if cutoff is None else kept_rows(time.size, rate, cutoff, every)
        return cls(rate, cutoff, kept)

    def __call__(self, x: Array) -> Array:
        """Signals at the instants that are left, from shape (N, ...)."""
        return x[self.kept] if self.cutoff is None else low_passed(x, self.rate, self.cutoff)[self.kept]


class DecimatedRows(RowSource):
    """Rows of a source, low-passed and decimated.

    Parameters
    ----------
    source : RowSource
    decimation : Decimation
    """

    def __init__(self, source: RowSource, decimation: Decimation) -> None:
        self.source, self.decimation = source, decimation
        self.instants = np.arange(source.shape[0])[decimation.kept]
        self.shape = (self.instants.size, *source.shape[1:])

    def part(self, first: int, last: int) -> Array:
        """See `RowSource.part`."""
        if self.decimation.cutoff is None:
            return self.source.at(self.instants[first:last])
        N, r, b = self.source.shape
        margin = _MARGIN * edge(self.decimation.rate, self.decimation.cutoff)
        length = N if 8 * N * r * b <= HELD else max(_PART, 2 * margin)
        rows = np.empty((last - first, r, b))
        done = first
        while done < last:
            begin = int(self.instants[done])
            many = int(np.searchsorted(self.instants[done:last], begin + length))
            self._filter(self.instants[done : done + many], margin, rows[done - first : done - first + many])
            done += many
        return rows

    def _filter(self, instants: Index, margin: int, rows: Array) -> None:
        """Filtered rows of some instants, from those around them; equation by equation, to hold little at once."""
        assert self.decimation.cutoff is not None
        start, stop = max(0, int(instants[0]) - margin), min(self.source.shape[0], int(instants[-1]) + margin + 1)
        W = self.source.part(start, stop)
        for j in range(W.shape[1]):
            rows[:, j] = low_passed(W[:, j], self.decimation.rate, self.decimation.cutoff)[instants - start]
