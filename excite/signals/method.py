"""How motion is obtained from sampled positions: one interface, one file per method."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from regressors.errors import InputError
from regressors.samples import Array, Samples


@dataclass(frozen=True, eq=False)
class FilteredMotion:
    """Motion obtained from a log."""

    samples: Samples  # position, velocity, acceleration at the instants that are left; jerk is not estimated (NaN)
    kept: slice  # which of the given instants they are: ends where the method is not valid are cut
    assumed: str  # assumptions of the method, with numbers and units


class Method(ABC):
    """Method that obtains velocity and acceleration from sampled positions."""

    name: ClassVar[str]  # as on the command line

    @property
    def table_width(self) -> int:
        """Columns of the tables that the method makes for a motion, of one number per instant; for predicted memory."""
        return 0

    @abstractmethod
    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Motion at the sample times."""  # time (N,); q (N, n); dq (N, n)

    def settled(self, time: Array, q: Array) -> Method:
        """The same method, with the settings that it would choose for these positions; itself if it chooses none."""
        return self

    def operator(self, time: Array, q: Array) -> Callable[[Array], FilteredMotion]:
        """`motion` with the settings that it would choose for these positions, for many others at the same times."""
        return partial(self.settled(time, q).motion, time)


def spacing(time: Array, what: str, least: int) -> float:
    """Sample time of uniform samples [s]."""  # time (N,)
    if time.size < least:
        raise InputError(f"{what} needs {least} samples or more, given {time.size}")
    step = float(time[-1] - time[0]) / (time.size - 1)
    uneven = float(np.abs(np.diff(time) - step).max())
    if not step > 0 or uneven > 1e-6 * step:
        raise InputError(f"{what} needs uniform samples; sample times differ by {uneven:.3g} s: resample first")
    return step
