"""How motion is obtained from sampled positions: the interface of its methods, and uniform instants."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
import scipy

from excite.logs.event import LONGEST, Gap, gaps
from excite.logs.log import Log, channels_of, held_values
from excite.registry import SIGNALS, built_in
from regressors.errors import InputError, check_names
from regressors.samples import Array, Samples
from regressors.work_prediction import FLOAT, check_memory


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


def cut_motion(time: Array, state: Sequence[Array], edge: int, assumed: str) -> FilteredMotion:
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
        parts = ((position, position.samples.q), (velocity, velocity.samples.q), (velocity, velocity.samples.dq))
        state = tuple(np.full_like(q, np.nan) for _ in parts)
        for whole, (motion, part) in zip(state, parts, strict=True):
            whole[motion.kept] = part
        assumed = f"measured velocities; positions: {position.assumed}; velocities: {velocity.assumed}"
        return cut_motion(time, state, edge, assumed)


def signal_method(name: str, *, measured_velocity: bool = False, **options: Any) -> Method:
    """Create a signal method by name."""
    check_names("method of signals", [name], SIGNALS)
    kind = built_in("signals", name)
    check_names(f"setting of {name}", options, [field.name for field in fields(kind)])
    method: Method = kind(**options)
    return MeasuredVelocity(method) if measured_velocity else method


_UNIFORM = 1e-6
_EVEN = 0.01  # of a step
_COPIES = 3.0
_SMOOTH = ("q", "dq")


@dataclass(frozen=True, eq=False)
class Resampled:
    """A log on uniform instants."""

    log: Log
    note: str  # unevenness of the time stamps, and how they were resampled


def resample(log: Log) -> Resampled:
    """Log on uniform instants from its first to its last.

    Positions and velocities by cubic splines, torques, wrenches and temperatures linearly; commands hold. A log whose
    instants are uniform to 1e-6 of its sample time is left as it is. Where rows are missing, the others keep their
    instants; gaps of up to a second are bridged by polynomials, see `excite.logs.signals.method`.
    """
    if log.count < 4:
        raise InputError(f"{log.source}: resampling needs 4 rows or more, given {log.count}")
    intervals = gaps(log)
    if long := [gap for gap in intervals if gap.length > LONGEST]:
        raise InputError(f"{log.source}: not resampled across gaps of {', '.join(map(str, long))}; split the log")
    rate, step = _own_rate(log), np.diff(log.time)
    if float(np.abs(step - 1 / rate).max()) <= _UNIFORM / rate:
        return Resampled(log, f"time stamps are uniform, {rate:.6g} Hz")
    _check_memory(log, log.duration * rate)
    time = log.time[0] + np.arange(int(np.floor(log.duration * rate + 1e-9)) + 1) / rate
    time = np.minimum(time, log.time[-1])
    channels: dict[str, Any] = {
        name: _smooth(log.time, x, intervals, time) if name in _SMOOTH else interpolated(time, log.time, x)
        for name, x in channels_of(log).items()
    }
    if log.command is not None:
        channels["command"] = held_values(log.time, log.command, time)
    new = Log(log.source, log.sha256, log.joints, time, **channels, left_out=log.left_out)
    return Resampled(
        new,
        f"time stamps {1e3 * step.min():.3g} to {1e3 * step.max():.3g} ms apart (standard deviation "
        f"{1e3 * step.std():.2g} ms) taken as true; resampled at {rate:.6g} Hz, positions and velocities by cubic "
        "splines, the rest linearly",
    )


def _check_memory(log: Log, instants: float) -> None:
    """Refuse many instants, which time stamps in another unit, or a few close together, make of a log."""
    columns = 1 + sum(x.shape[1] for x in channels_of(log).values())
    remedy = f"check the unit of the time stamps, which last {log.duration:.3g} s, or choose fewer rows with `rows`"
    size = FLOAT * _COPIES * instants * columns
    check_memory(f"{log.source}: resampling", size, f"{instants:.3g} instants", remedy)


def _own_rate(log: Log) -> float:
    """Rate at which all rows are samples, where some are missing between others at even steps, else the mean [Hz]."""
    step = np.diff(log.time)
    usual = float(np.median(step))
    steps = np.round(step / usual)
    total = float(steps.sum())
    if total > step.size and steps.min() >= 1 and np.abs(step / steps - log.duration / total).max() <= _EVEN * usual:
        return total / log.duration
    return float(step.size / log.duration)


def _smooth(time: Array, x: Array, intervals: tuple[Gap, ...], new: Array) -> Array:
    if intervals:
        time, x = bridged(time, x, intervals, float(np.median(np.diff(time))))
    return np.asarray(scipy.interpolate.CubicSpline(time, x, axis=0)(new))


def interpolated(new: Array, time: Array, x: Array) -> Array:
    """Values linear between their instants, at new ones, shape (N, r)."""
    return x if np.array_equal(new, time) else np.column_stack([np.interp(new, time, column) for column in x.T])


_DEGREE = 5
_BESIDE = 0.05  # least length of the fit on either side of a gap [s]
_FEWEST = 5  # rows on either side


def bridged(time: Array, x: Array, gaps: tuple[Gap, ...], step: float) -> tuple[Array, Array]:
    """Samples with further ones in the gaps, on polynomials of degree 5 through both sides."""
    # time (N,); x (N, n); result (M,); result (M, n)
    rows = [_bridge(time, x, gap, step) for gap in gaps]
    after = np.concatenate([np.full(t.size, gap.row + 1) for gap, (t, _) in zip(gaps, rows, strict=True)])
    times = np.concatenate([t for t, _ in rows])
    values = np.concatenate([values for _, values in rows])
    return np.insert(time, after, times), np.insert(x, after, values, axis=0)


def _bridge(time: Array, x: Array, gap: Gap, step: float) -> tuple[Array, Array]:
    """Times and values in one gap."""
    count = max(1, round(gap.length / step) - 1)
    inside = gap.time + gap.length * np.arange(1, count + 1) / (count + 1)
    length = max(gap.length, _BESIDE)
    first = min(int(np.searchsorted(time, gap.time - length)), gap.row + 1 - _FEWEST)
    last = max(int(np.searchsorted(time, gap.time + gap.length + length)), gap.row + 1 + _FEWEST)
    near = slice(max(0, first), min(time.size, last))
    middle, scale = gap.time + gap.length / 2, length + gap.length / 2
    powers = ((time[near] - middle) / scale)[:, None] ** np.arange(_DEGREE + 1)
    coefficients = np.linalg.lstsq(powers, x[near], rcond=None)[0]
    return inside, ((inside - middle) / scale)[:, None] ** np.arange(_DEGREE + 1) @ coefficients


_QUANTITIES = ("q", "dq", "ddq", "dddq")
_STRETCH = 2**16  # instants of a long motion whose splines are held at once
_FORGOTTEN = 64  # instants after which a cubic spline does not depend on its end, to 1e-16


def delayed(samples: Samples, delay: float) -> Samples:
    """Motion as it was some time before each instant.

    A torque that is recorded at t, but acted at ``t - delay``, belongs to the motion at ``t - delay``. The motion is
    smooth, so it is what is interpolated, by cubic splines, and not the torque.
    """
    if delay == 0.0:
        return samples
    if samples.time.size <= _STRETCH:
        return DelayedMotion(samples).by(delay)
    moved = {name: np.empty_like(samples.q) for name in _QUANTITIES}
    beside = _FORGOTTEN + int(np.ceil(abs(delay) / float(samples.time[1] - samples.time[0])))
    for first in range(0, samples.time.size, _STRETCH):
        begin, stop = max(first - beside, 0), first + _STRETCH
        part = DelayedMotion(samples.rows(slice(begin, stop + beside))).by(delay)
        for name in _QUANTITIES:
            moved[name][first:stop] = getattr(part, name)[first - begin : stop - begin]
    return Samples(samples.time, **moved)


class DelayedMotion:
    """Motion to be delayed by one time after another, see `delayed`."""

    def __init__(self, samples: Samples) -> None:
        self.samples = samples

    @cached_property
    def _splines(self) -> list[scipy.interpolate.CubicSpline | None]:
        """Of the quantities that are known."""
        values = (getattr(self.samples, name) for name in _QUANTITIES)
        return [scipy.interpolate.CubicSpline(self.samples.time, x) if np.all(np.isfinite(x)) else None for x in values]

    def by(self, delay: float) -> Samples:
        """The motion as it was some time before [s]; see `delayed`."""
        samples = self.samples
        if delay == 0.0:
            return samples
        at = np.clip(samples.time - delay, samples.time[0], samples.time[-1])
        unknown = np.full_like(samples.q, np.nan)
        return Samples(samples.time, *(unknown if spline is None else spline(at) for spline in self._splines))
