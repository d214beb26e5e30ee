"""One recorded motion by joint name, in SI units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from regressors.arguments import checked
from regressors.errors import InputError, check_names
from regressors.samples import Array, Index

if TYPE_CHECKING:
    from excite.logs.event import Saturation
    from excite.logs.frame import FrameLike
    from excite.logs.mapping import LogMapping
    from regressors.robot.robot import Robot

WRENCH = ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")


@dataclass(frozen=True, eq=False)
class Removed:
    """Rows that were recorded and are left out."""

    kind: str  # of the event, see `excite.logs.event.Event`
    numbers: Index  # of the rows, increasing, 1 for the first that was recorded


@dataclass(frozen=True)
class LogReference:
    """A log that a result is from."""

    file: str
    sha256: str
    left_out: tuple[str, ...] = ()  # what of it was left out, and why


@checked
@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """What was recorded at N instants of n joints; a channel that was not recorded is None.

    Every number is finite: a row with a gap is no row of a log. Readers leave such rows out with ``drop=("nan",)``.
    `from_arrays` and `from_frame` make one of what is in memory.

    Parameters
    ----------
    source : str
        File, for messages.
    sha256 : str
        Hash of the file's bytes, or of the columns of a frame; empty for a log that is of neither.
    joints : tuple of str
        Names of the joints, in the order of the columns below.
    time : ndarray, shape (N,)
        Strictly increasing [s].
    q : ndarray, shape (N, n)
        Position [rad or m].
    dq, effort : ndarray, shape (N, n), or None
        Velocity [rad/s or m/s], joint torque [Nm or N].
    wrench : ndarray, shape (N, 6), or None
        Force and torque at the sensor, in its frame [N, Nm].
    temperature : ndarray, shape (N, n), or None
        [deg C]
    command : ndarray, shape (N, n), or None
        Commanded position, the last one that was given at or before each instant [rad or m].
    base : ndarray, shape (N, k), or None
        Channels of a moving base, as a mapping names them, before they become joints.
    left_out : tuple of str
        Rows left out and repairs on reading, each with its count, such as ``3 rows with time repeated``.
    truth : mapping of str to float, optional
        True standard parameters, of a simulated log [SI].
    saturated : tuple of Saturation
        Torques that are known to have been at their limit, and when.
    external_forces : tuple of (float, float)
        First and last instant of each stretch in which something else pushed the robot [s].
    numbers : ndarray of int, shape (N,), or None
        Increasing numbers of the rows in what was recorded, 1 for the first; 1 ... N if not given.
    removed : tuple of Removed
        Rows of what was recorded that are no longer here, and why.

    Raises
    ------
    InputError
        Shapes that do not match, numbers that are not finite, or times that do not increase.
    """

    source: str
    sha256: str
    joints: tuple[str, ...]
    time: Array
    q: Array
    dq: Array | None = None
    effort: Array | None = None
    wrench: Array | None = None
    temperature: Array | None = None
    command: Array | None = None
    base: Array | None = None
    left_out: tuple[str, ...] = ()
    truth: Mapping[str, float] | None = None
    saturated: tuple[Saturation, ...] = ()
    external_forces: tuple[tuple[float, float], ...] = ()
    numbers: Index | None = None
    removed: tuple[Removed, ...] = ()

    def __post_init__(self) -> None:
        if self.time.ndim != 1:
            raise InputError(f"{self.source}: time has shape {self.time.shape}, expected one number per instant")
        for name, channel in {"time": self.time, **channels_of(self)}.items():
            self._check(name, channel)
        if np.any(late := np.diff(self.time) <= 0):
            k = int(np.argmax(late))
            before, after = self.time[k : k + 2]
            raise InputError(
                f"{self.source}: time must increase from row to row, but row {k + 1} has {before:.9g} s "
                f"and row {k + 2} {after:.9g} s"
            )

    def _check(self, name: str, channel: Array) -> None:
        columns = {"time": (), "wrench": (len(WRENCH),), "base": channel.shape[1:]}.get(name, (len(self.joints),))
        if channel.shape != (expected := (self.time.size, *columns)):
            raise InputError(f"{self.source}: {name} has shape {channel.shape}, not {expected}")
        if not np.isfinite(channel).all():
            row = int(np.argmin(np.isfinite(channel).reshape(self.time.size, -1).all(axis=1))) + 1
            raise InputError(f"{self.source}: {name} is not finite in row {row}; leave out the rows with gaps")

    @classmethod
    @checked
    def from_arrays(
        cls,
        time: Array,
        q: Array,
        effort: Array | None = None,
        dq: Array | None = None,
        command: Array | None = None,
        wrench: Array | None = None,
        temperature: Array | None = None,
        *,
        joints: Sequence[str] | None = None,
        robot: Robot | None = None,
        drop: Iterable[str] = (),
        source: str = "arrays",
    ) -> Log:
        """Make a log of arrays, lists, or columns of a frame.

        Parameters
        ----------
        time : array, shape (N,)
            Strictly increasing [s].
        q : array, shape (N, n)
            Position [rad or m].
        effort, dq, command, temperature : array, shape (N, n), optional
            Joint torque [Nm or N], velocity [rad/s or m/s], commanded position [rad or m], and temperature [deg C].
        wrench : array, shape (N, 6), optional
            Force and torque at the sensor, in its frame [N, Nm].
        joints : sequence of str, optional
            Names of the columns; those of the robot, in order, if not given.
        robot : Robot, optional
            Whose joints these are.
        drop : iterable of str
            Faulty rows to leave out, ``nan`` or ``repeated``, see `from_frame`.
        source : str
            Name of the log, in messages and results.

        Raises
        ------
        InputError
            No names of joints, shapes that do not fit, numbers that are not finite, or times that do not increase.
        """
        from excite.logs.layout import columns_by_name  # it knows logs

        names = joints if joints is not None or robot is None else robot.joint_names
        if names is None:
            raise InputError(f"{source}: the joints have no names; give joints=[...], as the columns are, or robot")
        channels = {"q": q, "dq": dq, "effort": effort, "temperature": temperature, "command": command}
        if len(names) == 1:
            channels = {name: x if x is None or x.ndim > 1 else x[:, None] for name, x in channels.items()}
        columns = columns_by_name(source, time, channels | {"wrench": wrench}, names)
        return cls.from_frame(columns, drop=drop, source=source)

    @classmethod
    @checked
    def from_frame(
        cls,
        frame: FrameLike,
        mapping: LogMapping | str | Path | None = None,
        *,
        joints: Sequence[str] | None = None,
        robot: Robot | None = None,
        drop: Iterable[str] = (),
        only: tuple[int, int] | None = None,
        source: str = "frame",
    ) -> Log:
        """Make a log of a frame, such as one of pandas, Polars or PyArrow, or of a mapping of names to columns.

        The columns are found as those of a file, see `excite.read_log`: ``time`` [s], ``NAME.position``,
        ``NAME.velocity``, ``NAME.effort``, ``NAME.temperature``, ``NAME.command`` and ``wrench.force.x`` ...
        ``wrench.torque.z``. An index is no column. The log has the hash of the columns that are read, by which
        `excite.verify` refuses what was identified from.

        Parameters
        ----------
        frame : frame, or mapping of str to array
        mapping : LogMapping or path, optional
            Which columns of other names these are, and their units; files that it names are looked for in the current
            folder.
        joints : sequence of str, optional
            Joints to read, in this order; all that the frame has if not given.
        robot : Robot, optional
            Whose joints these are, for mappings that do not name them or that describe the motors' side.
        drop : iterable of str
            Faulty rows to leave out, not to refuse, counted in `left_out`: ``nan`` (cells that are empty, NaN or
            infinite), ``repeated`` (time of the row before).
        only : (int, int), optional
            First and last row to read, 1 for the first; the others may be faulty.
        source : str
            Name of the log, in messages and results.

        Raises
        ------
        InputError
            Columns that are not there, are of different lengths or hold no numbers, with the row and the column of the
            first fault.
        """
        from excite.logs.frame import log_of_frame  # it makes logs

        return log_of_frame(frame, mapping, joints, robot, drop, only, source)

    @property
    def reference(self) -> LogReference:
        """What a result states of it."""
        return LogReference(self.source, self.sha256, self.left_out)

    @property
    def identity(self) -> str:
        """Hash that identifies the log: of its file, or of its numbers."""
        if self.sha256:
            return self.sha256
        digest = sha256(" ".join(self.joints).encode())
        for name in ("time", *_CHANNELS):
            channel = getattr(self, name)
            if name in _FIRST or channel is not None:  # logs had no others when their identities were first stated
                digest.update(name.encode())
            if channel is not None:
                digest.update(np.ascontiguousarray(channel).tobytes())
        return digest.hexdigest()

    def __repr__(self) -> str:
        """One line."""
        return f"<Log {self.source}: {self.count} instants in {self.duration:g} s, {', '.join(channels_of(self))}>"

    @property
    def count(self) -> int:
        """Number of instants."""
        return self.time.size

    @property
    def duration(self) -> float:
        """From the first instant to the last [s]."""
        return float(self.time[-1] - self.time[0]) if self.time.size else 0.0

    @property
    def rate(self) -> float:
        """Samples per second, from the median sample time [Hz]."""
        return float(1.0 / np.median(np.diff(self.time)))

    @property
    def row_numbers(self) -> Index:
        """Numbers of the rows in what was recorded, 1 for the first, shape (N,)."""
        return np.arange(1, self.count + 1) if self.numbers is None else self.numbers

    def rows(self, part: slice | Index) -> Log:
        """The same log, limited to some of its rows, which keep their numbers."""
        if isinstance(part, slice) and part.indices(self.count) == (0, self.count, 1):
            return self
        cut = {name: x[part] for name, x in channels_of(self).items()}
        return replace(self, time=self.time[part], numbers=self.row_numbers[part], **cut)

    def without(self, kind: str, lost: NDArray[np.bool_]) -> Log:
        """The same log without the rows of an event.

        Parameters
        ----------
        kind : str
            Of the event.
        lost : ndarray of bool, shape (N,)
            Which rows.
        """
        removed = Removed(kind, self.row_numbers[lost])
        return replace(self.rows(np.flatnonzero(~lost)), removed=(*self.removed, removed))

    def of(self, joints: Sequence[str]) -> Log:
        """The same log, limited to some joints, in the order asked for.

        Raises
        ------
        UnknownName
            A joint that the log does not have.
        """
        check_names(f"joint in {self.source}", joints, self.joints)
        if tuple(joints) == self.joints:
            return self
        index = [self.joints.index(name) for name in joints]
        cut = {name: x[:, index] for name, x in channels_of(self).items() if name not in ("wrench", "base")}
        return replace(self, joints=tuple(joints), **cut)


_FIRST = ("time", "q", "dq", "effort", "temperature", "wrench")
_CHANNELS = (*_FIRST[1:], "command", "base")


def channels_of(log: Log) -> dict[str, Any]:
    """Channels that were recorded, by their names."""
    return {name: x for name in _CHANNELS if (x := getattr(log, name)) is not None}


def held_values(time: Array, values: Array, new: Array) -> Array:
    """Values, such as commands, that hold until the next one: the last at or before each new instant."""
    # time (N,); values (N,) or (N, n); new (M,), none before time[0]
    return np.asarray(values[np.searchsorted(time, new, side="right") - 1])


def integrate_rates(time: Array, rates: Array) -> Array:
    """Integrals of rates from the first instant on, by the trapezoidal rule, shape (N, n)."""  # rates (N, n)
    steps = (rates[1:] + rates[:-1]) / 2 * np.diff(time)[:, None]
    return np.vstack([np.zeros(rates.shape[1]), np.cumsum(steps, axis=0)])


def counted(count: int, what: str) -> str:
    """How many there are of something, such as ``1 row`` or ``2 rows``."""
    return f"{count} {what}{'s' * (count != 1)}"
