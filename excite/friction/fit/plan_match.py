"""Where a log contains the runs of a friction plan: recordings begin before the motion, or after, at any sample rate.

In its windows a plan asks for ``s(t) = first + speed (t - start)``. The log's path z(t) is compared with it at every
shift d on a grid, ``sum over windows of s(t)^2 - (z(t + d) - s(t))^2`` with both measured from the plan's pose, by one
correlation; the largest sum is where most of the plan lies in the log. The shift is then refined: along a window the
misfit is linear in d, and the median window gives the error of d.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.signal

from excite.friction.fit.points import DriveLog
from excite.friction.plan.friction_plan import FrictionPlan
from regressors.errors import InputError
from regressors.samples import Array

FAR = 0.2  # of the windows' path: a log that deviates more did not follow the plan
_GRID = 0.02  # [s]
_PARTS = 4  # least number of grid steps in the shortest window
_ROUNDS = 4


@dataclass(frozen=True)
class PlannedWindow:
    """A stretch of constant speed: begin and end [s], and the distance from the plan's pose at both ends [rad or m]."""

    start: float
    end: float
    first: float
    last: float

    @property
    def speed(self) -> float:
        """Speed with its sign [rad/s or m/s]."""
        return (self.last - self.first) / (self.end - self.start)

    def moved(self, seconds: float) -> PlannedWindow:
        """The same window, shifted in time."""
        return PlannedWindow(self.start + seconds, self.end + seconds, self.first, self.last)


@dataclass(frozen=True)
class PlannedRamp:
    """A rise of the drive's torque, ``rate (t - start)``: begin and end [s], and the rate with its sign [Nm/s, N/s]."""

    start: float
    end: float
    rate: float

    @property
    def torque(self) -> float:
        """Size at its end [Nm or N]."""
        return abs(self.rate) * (self.end - self.start)


@dataclass(frozen=True, eq=False)
class PlannedRuns:
    """Planned runs of one drive."""

    plan: str  # where the plan is, for messages
    drive: str
    pose: Mapping[str, float]  # middle of every run, and how the joints move per rad or m of the coordinate
    direction: Mapping[str, float]
    gravity: str  # its effect over whole windows, see `excite.friction.plan.pose`
    windows: tuple[PlannedWindow, ...]
    # begin and end of the creeping runs out of the pose, in which it breaks away [s]
    creeps: tuple[tuple[float, float], ...] = ()
    ramps: tuple[PlannedRamp, ...] = ()  # of the drive's torque, in the plan's other file
    creep: float = 0.0  # speed of the creeping runs; zero if it is not known [rad/s or m/s]

    def cancels(self, *, whole: bool) -> bool:
        """Whether gravity cancels over the windows, whole ones or parts of them, according to the plan."""
        return self.gravity == "none" or (whole and self.gravity in ("cancels", "stated"))

    def path(self, measured: DriveLog) -> tuple[Array, float]:
        """Displacement of the drive from the pose in a log, shape (N,), and its ratio to that of the coordinate."""
        joints = measured.log.joints
        row = measured.rows[measured.names.index(self.drive)]
        return (
            measured.z[:, measured.names.index(self.drive)] - float(row @ [self.pose[name] for name in joints]),
            float(row @ [self.direction[name] for name in joints]),
        )


@dataclass(frozen=True)
class PlanMatch:
    """Runs of a plan in a log."""

    seconds: float  # when the plan begins, since the log's first sample; negative where the recording began later [s]
    # those that the log contains, in time since its first sample, as displacements of the drive
    windows: tuple[PlannedWindow, ...]
    middle: float  # position of the drive in the plan's pose [rad or m]
    missing: int  # number of windows that it does not contain
    # root mean square of the difference, relative to that of the path, in the median window; infinite where the log
    # contains none
    astray: float

    @property
    def holds(self) -> bool:
        """Whether the log contains the motion."""
        return self.astray <= FAR


def planned_runs(plan: FrictionPlan, name: str) -> dict[str, PlannedRuns]:
    """Runs of every drive of a plan, which has this name in messages."""
    runs_of = {}
    for c in plan.coordinates:
        drive, *more = c.turns
        if more:
            raise InputError(
                f"{name}: {c.label} moves the drives {', '.join(c.turns)} together, so the friction of each cannot be "
                "separated; give `plan_friction` the `drives`"
            )
        windows = tuple(PlannedWindow(w.start, w.end, w.first - c.centre, w.last - c.centre) for w in c.windows)
        creeps = tuple((test["start"], test["end"]) for test in c.tests)
        ramps = () if c.ramps is None else c.ramps.ramps
        rises = tuple(PlannedRamp(ramp.start, ramp.end, ramp.rate) for ramp in ramps)
        creep = c.schedule.creep / 100.0 * c.pace.velocity
        runs_of[drive] = PlannedRuns(name, drive, c.pose, c.direction, c.gravity, windows, creeps, rises, creep)
    return runs_of


def match_plan(measured: DriveLog, runs: PlannedRuns) -> PlanMatch:
    """Find the runs of a drive in a log."""
    z, scale = runs.path(measured)
    middle = float(measured.z[0, measured.names.index(runs.drive)] - z[0])
    time = measured.log.time - measured.log.time[0]
    windows = tuple(PlannedWindow(w.start, w.end, scale * w.first, scale * w.last) for w in runs.windows)
    shift = _coarse(time, z, windows)
    for _ in range(_ROUNDS):
        inside = _contained(time, windows, shift)
        if not inside:
            break
        shift += float(np.median([-np.mean(_ahead(time, z, w)) / w.speed for w in inside]))
    inside = _contained(time, windows, shift)
    sizes = [np.sqrt((w.first**2 + w.first * w.last + w.last**2) / 3) for w in inside]
    errors = [np.sqrt(np.mean(_ahead(time, z, w) ** 2)) for w in inside]
    astray = float(np.median(np.divide(errors, sizes))) if inside else np.inf
    return PlanMatch(shift, inside, middle, len(windows) - len(inside), astray)


def _coarse(time: Array, z: Array, windows: Sequence[PlannedWindow]) -> float:
    """Shift on a grid at which the log contains most of the plan."""
    step = min(_GRID, min(w.end - w.start for w in windows) / _PARTS)
    measured = np.interp(np.arange(0.0, time[-1] + step, step), time, z)
    at = np.arange(0.0, max(w.end for w in windows) + step, step)
    asked, within = np.zeros((2, at.size))
    for w in windows:
        rows = (at >= w.start) & (at <= w.end)
        asked[rows], within[rows] = w.first + w.speed * (at[rows] - w.start), 1.0
    score = 2 * scipy.signal.correlate(measured, asked) - scipy.signal.correlate(measured**2, within)
    return float((int(np.argmax(score)) - (at.size - 1)) * step)


def _contained(time: Array, windows: Sequence[PlannedWindow], shift: float) -> tuple[PlannedWindow, ...]:
    """Windows within the recording, moved by the shift."""
    step = float(np.median(np.diff(time)))
    moved = [w.moved(shift) for w in windows if time[0] - step <= w.start + shift and w.end + shift <= time[-1] + step]
    return tuple(w for w in moved if np.any((time >= w.start) & (time <= w.end)))


def _ahead(time: Array, z: Array, window: PlannedWindow) -> Array:
    """How far the path is ahead of the plan's at the instants of a window."""
    rows = slice(int(np.searchsorted(time, window.start)), int(np.searchsorted(time, window.end, side="right")))
    return np.asarray(z[rows] - window.first - window.speed * (time[rows] - window.start))
