"""Rows of numbers as text."""

from __future__ import annotations

from collections.abc import Iterator

from regressors.samples import Array

EXACT = "%.17g"


def rows_of(table: Array, separator: str = ",", form: str = EXACT) -> Iterator[str]:
    """Text of each row.

    Parameters
    ----------
    table : ndarray, shape (N, k)
    separator : str
    form : str
        Of one number; the default reads back exactly.
    """
    row_form = separator.join([form] * table.shape[1])
    return (row_form % tuple(row) for row in table.tolist())
