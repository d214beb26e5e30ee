"""Rows of a regressor with one more column."""

from __future__ import annotations

import numpy as np

from excite.identification.streamed_rows import Rows, RowSource, StreamedRows
from regressors.samples import Array, Index


def widened(rows: Rows, column: Array) -> Rows:
    """Rows with one more column at the end, streamed where they are."""  # rows (m, p); column (m,)
    return WidenedRows(rows, column) if isinstance(rows, StreamedRows) else np.column_stack([rows, column])


class WidenedRows(StreamedRows):
    """Streamed rows with one more column at the end."""  # rows (m, p); column (m,)

    def __init__(self, rows: StreamedRows, column: Array) -> None:
        super().__init__((_Beside(rows, column),), (None,))
        self.rows, self.column = rows, column

    def __matmul__(self, values: Array) -> Array:
        """See `StreamedRows`; the product of the rows without the column is often known."""
        return np.asarray(self.rows @ values[:-1] + values[-1] * self.column)


class _Beside(RowSource):
    """Single rows, and the column beside them."""

    def __init__(self, rows: StreamedRows, column: Array) -> None:
        self.rows, self.column, self.shape = rows, column, (len(rows), 1, rows.shape[1] + 1)

    def part(self, first: int, last: int) -> Array:
        """See `RowSource.part`."""
        return np.column_stack([self.rows[first:last], self.column[first:last]])[:, None]

    def at(self, instants: Index) -> Array:
        """See `RowSource.at`."""
        return np.column_stack([self.rows[instants], self.column[instants]])[:, None]
