"""What is written is finite: a number that is not is named by its place, and nothing is written."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from regressors.errors import NumericalError


def check_table(path: Path, header: Sequence[str], table: ArrayLike) -> None:
    """Raise `NumericalError` that names the first column with a number that is not finite."""  # table (N, len(header)
    finite = np.isfinite(np.asarray(table, dtype=float))
    if not finite.all():
        column = int(np.argmin(finite.all(axis=0)))
        row = int(np.argmin(finite[:, column]))
        raise NumericalError(
            f"{path.name} is not written: {header[column]} is not finite in row {row + 1}; values of very different "
            "sizes are the likely cause"
        )


def check_content(path: Path, content: object) -> None:
    """Raise `NumericalError` that names the first number of a content for JSON that is not finite."""
    place = _not_finite(content)
    if place is not None:
        raise NumericalError(
            f"{path.name} is not written: {place or 'it'} is not finite; values of very different sizes are the "
            "likely cause"
        )


def _not_finite(content: object) -> str | None:
    """Place of the first number that is not finite, such as ``.fit[3]``, without the leading dot."""
    if isinstance(content, float):
        return None if math.isfinite(content) else ""
    if isinstance(content, dict):
        parts = ((str(key), value) for key, value in content.items())
    elif isinstance(content, list | tuple):
        parts = ((f"[{k + 1}]", value) for k, value in enumerate(content))
    else:
        return None
    for name, value in parts:
        if (below := _not_finite(value)) is not None:
            return f"{name}{'.' if below and not below.startswith('[') else ''}{below}"
    return None
