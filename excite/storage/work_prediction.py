"""What a piece of work is predicted to take, in memory and time, before it starts."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

from regressors.errors import TooLargeError
from regressors.input_files import in_bytes
from regressors.memory_cap import CAP_VARIABLE, memory_cap, value_cap

FLOAT = 8  # bytes
BASE = 1.4e8  # bytes of the programs themselves


@dataclass(frozen=True)
class MemoryPart:
    """Memory of one part of the work, ``bytes ~ value^power``."""

    what: str  # what is held, such as ``rows of the regressor``
    rows: float  # of the largest table of it
    columns: float
    bytes: float  # of all that is held at the same time
    option: str = ""  # name of the option that makes it large
    value: float = 0.0  # what is given for it
    power: float = 1.0  # how the memory grows with it
    remedy: str = ""  # what else to change, where no option makes it large

    @property
    def values(self) -> float:
        """Numbers in the table."""
        return self.rows * self.columns

    def cure(self, left: float) -> str:
        """What to change so that no more than ``left`` bytes are taken."""
        if not self.option:
            return self.remedy
        fits = self.fitting(left)
        enough = f"a lower `{self.option}` is needed" if fits is None else f"`{self.option}={fits:.12g}` would do"
        return f"it is `{self.option}={self.value:.12g}` that makes it large, {enough}"

    def fitting(self, left: float) -> float | None:
        """Value of the option, with two digits, that takes at most ``left`` bytes; None if there is none."""
        if left <= 0.0:
            return None
        value = self.value * (left / self.bytes) ** (1.0 / self.power)
        step = 10.0 ** (math.floor(math.log10(value)) - 1)
        rounded = math.floor(value / step * (1.0 + 1e-12)) * step
        if isinstance(self.value, int):
            rounded = math.floor(rounded + 1e-9)
        return rounded if rounded > 0 else None


@dataclass(frozen=True)
class WorkPrediction:
    """What a piece of work is predicted to take."""

    work: str  # such as ``the simulation``
    parts: Sequence[MemoryPart]  # at least one
    seconds: float | None = None  # time on one core; None where it is not known

    @property
    def bytes(self) -> float:
        """Memory of all parts, and of the programs [bytes]."""
        return BASE + sum(part.bytes for part in self.parts)

    @property
    def largest(self) -> MemoryPart:
        """The part that takes the most memory."""
        return max(self.parts, key=lambda part: part.bytes)

    def check(self) -> None:
        """Refuse work that takes more memory than the cap, or a table with more numbers than the cap of these."""
        cap, most = memory_cap(), value_cap()
        if self.bytes > cap:
            self._refuse(self.largest, f"about {in_bytes(self.bytes)} of memory", in_bytes(cap))
        if (part := max(self.parts, key=lambda part: part.values)).values > most:
            self._refuse(part, f"{part.values:.2g} numbers in one table", f"{most:.2g}")

    def _left(self, part: MemoryPart) -> float:
        """Bytes that a part may take under both caps, beside the others."""
        others = sum(other.bytes for other in self.parts if other is not part)
        of_numbers = part.bytes * value_cap() / part.values if part.values else math.inf
        return min(memory_cap() - BASE - others, of_numbers)

    def _refuse(self, part: MemoryPart, taken: str, cap: str) -> NoReturn:
        time = "" if self.seconds is None else f" and {in_time(self.seconds)}"
        raise TooLargeError(
            f"{self.work} would take {taken}{time}, more than the cap of {cap}: {part.rows:.3g} {part.what} of "
            f"{part.columns:.3g} numbers; {part.cure(self._left(part))}, or raise the cap with {CAP_VARIABLE} [GB]"
        )


def in_time(seconds: float) -> str:
    """A time in words, such as ``3 h``."""
    for unit, scale in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * scale:
            return f"{seconds / scale:.2g} {unit}"
    return f"{seconds:.2g} s"


LONG = 30.0  # [s]
_log = logging.getLogger("excite.storage")


def announce(work: str, seconds: float, remedy: str = "") -> None:
    """Log how long work will take, at level INFO, where that is more than `LONG`; the command line prints it."""
    if seconds > LONG:
        _log.info(f"{work} will take about {in_time(seconds)}{'; ' * bool(remedy)}{remedy}")
