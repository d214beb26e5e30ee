"""Rows of a regressor that are computed block by block when they are needed."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from excite.logs.signals.filters import edge, kept_rows, low_passed
from regressors.errors import InputError
from regressors.samples import Array, Index

HELD = 2**26  # bytes of a regressor that is computed once and kept
JOINED = 2**25  # bytes of a regressor that is copied to be widened
MOST = 2**31  # bytes of a regressor that a method may ask for as a whole
BLOCK = 2048  # instants


class RowSource:
    """Equations of a motion at N instants, r at each, for b parameters: shape (N, r, b).

    `part` gives the rows of a stretch of instants, or of some in ascending order, shape (k, r, b).
    """

    def __init__(self, shape: tuple[int, ...], part: Callable[[slice | Index], Array]) -> None:
        self.shape, self.part = shape, part

    def at(self, instants: Index) -> RowSource:
        """Equations of some of the instants."""
        return RowSource((instants.size, *self.shape[1:]), lambda which: self.part(instants[which]))


def held_rows(rows: Array) -> RowSource:
    """Rows that are an array already."""  # rows (N, r, b)
    return RowSource(rows.shape, rows.__getitem__)


class StreamedRows:
    """Rows of a regressor W that are computed whenever they are asked for.

    It stands in for an array where rows are read in slices, ``W[a:b]``, or multiplied, ``W @ values``; the last
    product is kept, since the residuals are needed by the covariance, the summary and the figures.
    """

    def __init__(self, sources: Sequence[RowSource], product: Callable[[Array], Array] | None = None) -> None:
        self.sources, self._multiplied = tuple(sources), product
        ends: list[int] = np.cumsum([s.shape[0] * s.shape[1] for s in self.sources]).tolist()
        self._parts = list(zip(self.sources, [0, *ends], ends, strict=False))  # where the rows of each begin and end
        self.shape = (ends[-1], self.sources[0].shape[2])
        self._product: tuple[Array, Array] | None = None

    @property
    def nbytes(self) -> int:
        """Memory of all rows as an array [bytes]."""
        return 8 * self.shape[0] * self.shape[1]

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice | Index) -> Array:
        """Some of the rows, shape (k, b)."""
        if isinstance(rows, slice):
            first, last, step = rows.indices(self.shape[0])
            if step == 1:
                return self._stretch(first, max(first, last))
            rows = np.arange(first, last, step)
        return self._gathered(np.asarray(rows))

    def __matmul__(self, values: Array) -> Array:
        """``W @ values``, shape (m,) for values of shape (b,)."""
        if self._multiplied is not None:
            return self._multiplied(values)
        if self._product is None or not np.array_equal(self._product[0], values):
            product = np.empty(self.shape[0])
            for block in self._blocks():
                product[block] = self[block] @ values
            product.flags.writeable = False
            self._product = np.array(values), product
        return self._product[1]

    def whole(self) -> Array:
        """All rows as an array, shape (m, b)."""
        if self.nbytes > MOST:
            every = -(-self.nbytes // MOST)
            raise InputError(
                f"{self.shape[0]} equations for {self.shape[1]} parameters take {self.nbytes / 1e9:.1f} GB if they are "
                f"held at once, and this method needs them so; at most {MOST / 1e9:.1f} GB are used: decimate the "
                f"equations (`every={every}`, best with `low_pass`), or use a method that reads them in pieces "
                "(weighted, least-squares, physical)"
            )
        rows = np.empty(self.shape)
        for block in self._blocks():
            rows[block] = self[block]
        return rows

    def _blocks(self) -> Iterator[slice]:
        for source, start, end in self._parts:
            edges = [*range(start, end, BLOCK * source.shape[1]), end]
            yield from itertools.starmap(slice, itertools.pairwise(edges))

    def _stretch(self, first: int, last: int) -> Array:
        """Rows from `first` to before `last`."""
        pieces = []
        for source, start, end in self._parts:
            a, b, r = max(first, start) - start, min(last, end) - start, source.shape[1]
            if a < b:
                rows = source.part(slice(a // r, -(-b // r)))
                pieces.append(rows.reshape(-1, self.shape[1])[a % r : a % r + b - a])
        return pieces[0] if len(pieces) == 1 else np.concatenate([np.empty((0, self.shape[1])), *pieces])

    def _gathered(self, rows: Index) -> Array:
        gathered = np.empty((rows.size, self.shape[1]))
        for source, start, end in self._parts:
            wanted = np.flatnonzero((rows >= start) & (rows < end))
            if wanted.size:
                instant, equation = np.divmod(rows[wanted] - start, source.shape[1])
                each, place = np.unique(instant, return_inverse=True)
                gathered[wanted] = source.part(each)[place, equation]
        return gathered


Rows = Array | StreamedRows


def joined_rows(parts: Sequence[Rows]) -> Rows:
    """Rows of several motions, one after the other: an array where all of them are."""
    arrays = [part for part in parts if isinstance(part, np.ndarray)]
    if len(arrays) == len(parts):
        return np.concatenate(arrays)
    sources = ([held_rows(x[:, None])] if isinstance(x, np.ndarray) else x.sources for x in parts)
    return StreamedRows(list(itertools.chain.from_iterable(sources)))


def widened(rows: Rows, columns: Array) -> Rows:
    """Rows with more columns at the end, joined when they are read where they are streamed or many."""
    # rows (m, p); columns (m, k)
    if not isinstance(rows, StreamedRows) and rows.nbytes <= JOINED:
        return np.column_stack([rows, columns])
    own = rows if isinstance(rows, StreamedRows) else StreamedRows([held_rows(rows[:, None])])
    p, k = own.shape[1], columns.shape[1]
    beside = RowSource((len(own), 1, p + k), lambda which: np.column_stack([own[which], columns[which]])[:, None])
    # the first product is often known
    return StreamedRows([beside], lambda values: np.asarray(own @ values[:p] + columns @ values[p:]))


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

    def rows(self, source: RowSource) -> RowSource:
        """Rows of a source at the instants that are left."""
        instants = np.arange(source.shape[0])[self.kept]
        if self.cutoff is None:
            return source.at(instants)
        margin, small = _MARGIN * edge(self.rate, self.cutoff), 8 * np.prod(source.shape) <= HELD
        many = instants.size if small else max(BLOCK, -(-2 * margin // self.kept.step))
        blocks = _FilteredBlocks(
            source, instants, margin, many, partial(low_passed, rate=self.rate, cutoff=self.cutoff)
        )
        return RowSource((instants.size, *source.shape[1:]), blocks.part)


class _FilteredBlocks:
    """Low-passed rows of a source at some instants, in blocks of many instants that are filtered at once."""

    def __init__(
        self, source: RowSource, instants: Index, margin: int, many: int, smooth: Callable[[Array], Array]
    ) -> None:
        self.source, self.instants, self.margin, self.many, self.smooth = source, instants, margin, many, smooth
        self._known: tuple[int, Array] | None = None

    def part(self, which: slice | Index) -> Array:
        """See `RowSource`."""
        if isinstance(which, slice):
            return self._stretch(which.start, which.stop)
        runs = np.split(which, np.flatnonzero(np.diff(which) > BLOCK) + 1)  # gaps too long to be computed along
        return np.concatenate([self._stretch(int(run[0]), int(run[-1]) + 1)[run - run[0]] for run in runs])

    def _stretch(self, first: int, last: int) -> Array:
        pieces = []
        for number in range(first // self.many, -(-last // self.many)):
            start = number * self.many
            pieces.append(self._filtered(number)[max(first - start, 0) : last - start])
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)

    def _filtered(self, number: int) -> Array:
        """One of the blocks that are filtered at once; the last one is kept, since rows are asked for in sequence."""
        if self._known is None or self._known[0] != number:
            self._known = None
            self._known = number, self._filter(self.instants[number * self.many : (number + 1) * self.many])
        return self._known[1]

    def _filter(self, instants: Index) -> Array:
        """Filtered rows of some instants, from those around them; equation by equation, to hold little at once."""
        N, r, b = self.source.shape
        start, stop = max(0, int(instants[0]) - self.margin), min(N, int(instants[-1]) + self.margin + 1)
        W, rows = self.source.part(slice(start, stop)), np.zeros((instants.size, r, b))
        for j in range(r):
            used = np.flatnonzero(np.any(W[:, j], axis=0))
            rows[:, j, used] = self.smooth(W[:, j, used])[instants - start]
        return rows
