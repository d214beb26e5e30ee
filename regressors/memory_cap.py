"""The caps on the memory of a command, and on the numbers in its largest table."""

from __future__ import annotations

import math
import os

from regressors.errors import InputError, TooLargeError, shortened
from regressors.input_files import in_bytes

MEMORY_CAP = 4.0  # GB
CAP_VARIABLE = "EXCITE_MEMORY_CAP"
BYTES_PER_VALUE = 40.0  # 10^8 values at the default cap


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


def value_cap() -> float:
    """Numbers that the largest table of a piece of work may have, 10^8 by default; it rises with `memory_cap`."""
    return memory_cap() / BYTES_PER_VALUE


def check_memory(source: str, size: float, what: str, remedy: str) -> None:
    """Refuse to read what would take more memory than it may."""
    cap = memory_cap()
    if size > cap:
        raise TooLargeError(
            f"{source}: it would take about {in_bytes(size)} of memory, more than the cap of {in_bytes(cap)}: {what}; "
            f"{remedy}, or raise the cap with {CAP_VARIABLE} [GB]"
        )
