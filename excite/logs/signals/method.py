"""How motion is obtained from sampled positions: one interface, one file per method."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, ClassVar

import numpy as np

from excite.registry import SIGNALS, built_in
from regressors.errors import InputError, UnknownName
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


def cut_motion(time: Array, state: tuple[Array, Array, Array], edge: int, assumed: str) -> FilteredMotion:
    """Motion without some samples at both ends."""  # time (N,); state (N, n)
    if time.size <= 2 * edge:
        raise InputError(f"{time.size} samples are too few: {edge} are cut from each end ({assumed})")
    kept = slice(edge, time.size - edge)
    q, dq, ddq = (part[kept] for part in state)
    return FilteredMotion(Samples(time[kept], q, dq, ddq, np.broadcast_to(np.nan, q.shape)), kept, assumed)


def check_positive(method: str, **settings: float | None) -> None:
    """Raise `InputError` for settings that are not positive numbers; None means not given."""
    for name, value in settings.items():
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(f"{method}: {name} must be a positive number, given {value:g}")


@dataclass(frozen=True)
class MeasuredVelocity(Method):
    """Another method, applied to positions and to measured velocities on their own.

    The method obtains position from the positions, velocity from the velocities in place of positions, and acceleration
    as the first derivative of these; both with the settings that it chooses for the positions.
    """

    method: Method

    name: ClassVar[str] = "measured velocity"

    def motion(self, time: Array, q: Array, dq: Array | None = None) -> FilteredMotion:
        """Position and velocity of the method, see `Method.motion`; InputError where no velocity was measured."""
        if dq is None:
            raise InputError("no velocity was measured; leave it to the method to find it from the positions")
        method = self.method.settled(time, q)
        position, velocity = method.motion(time, q), method.motion(time, dq)
        edge = max(position.kept.start, velocity.kept.start)
        state = (
            _whole(position.samples.q, position.kept, q),
            _whole(velocity.samples.q, velocity.kept, q),
            _whole(velocity.samples.dq, velocity.kept, q),
        )
        assumed = f"measured velocities; positions: {position.assumed}; velocities: {velocity.assumed}"
        return cut_motion(time, state, edge, assumed)


def _whole(part: Array, kept: slice, like: Array) -> Array:
    whole = np.full_like(like, np.nan)
    whole[kept] = part
    return whole


def signal_method(name: str, *, measured_velocity: bool = False, **options: Any) -> Method:
    """Create a signal method by name."""
    if name not in SIGNALS:
        raise UnknownName("method of signals", name, SIGNALS)
    kind = built_in("signals", name)
    settings = [field.name for field in fields(kind)]
    for option in options:
        if option not in settings:
            raise UnknownName(f"setting of {name}", option, settings)
    method: Method = kind(**options)
    return MeasuredVelocity(method) if measured_velocity else method
