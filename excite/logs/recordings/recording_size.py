"""Sizes that a file declares, checked before anything of that size is allocated."""

from __future__ import annotations

from pathlib import Path

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction

_COPIES = 2.0  # what was read, and what it becomes
LARGEST_ARRAY = 100  # elements of one row; what has more, such as an image, is no measurement of joints


def check_table(source: Path, rows: float, columns: float, copies: float = _COPIES) -> None:
    """Refuse a table that takes more memory than it may."""
    held = FLOAT * copies * rows * columns
    part = MemoryPart("rows", rows, columns, held, remedy="cut the recording, or map fewer columns")
    WorkPrediction(f"reading {source}", (part,)).check()


def check_bytes(source: Path, size: float) -> None:
    """Refuse to unpack more bytes than may be held in memory."""
    check_table(source, size / FLOAT, 1.0, copies=1.0)
