"""The cap on the memory of one piece of work."""

from __future__ import annotations

import math
import os

from regressors.errors import InputError, TooLargeError, shortened
from regressors.input_files import in_bytes

MEMORY_CAP = 4.0  # GB
CAP_VARIABLE = "EXCITE_MEMORY_CAP"
FLOAT = 8  # bytes of a number


def memory_cap() -> float:
    """Memory that one piece of work may take [bytes]: that of the environment variable, else 4 GB."""
    text = os.environ.get(CAP_VARIABLE, "")
    if not text.strip():
        return 1e9 * MEMORY_CAP
    try:
        cap = float(text)
    except ValueError:
        cap = math.nan
    if not cap > 0.0 or math.isinf(cap):
        raise InputError(
            f"{CAP_VARIABLE}: expected a number of GB greater than zero, such as 8, given {shortened(text)}"
        )
    return 1e9 * cap


def check_memory(work: str, size: float, what: str, remedy: str) -> None:
    """Refuse work that would take more memory than it may, by about how many bytes it holds at the same time."""
    cap = memory_cap()
    if size > cap:
        raise TooLargeError(
            f"{work} would take about {in_bytes(size)} of memory, more than the cap of {in_bytes(cap)}: {what}; "
            f"{remedy}, or raise the cap with {CAP_VARIABLE} [GB]"
        )
