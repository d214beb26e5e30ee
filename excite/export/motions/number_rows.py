"""Rows of numbers as text."""

from __future__ import annotations

from collections.abc import Iterator

from regressors.samples import Array


def rows_of(table: Array, separator: str = ",") -> Iterator[str]:
    """Text of each row, from which the numbers are read back exactly."""  # table (N, k)
    row_form = separator.join(["%.17g"] * table.shape[1])
    return (row_form % tuple(row) for row in table.tolist())
