"""Which part of a plan a log has recorded: its windows and its ramps.

In its windows a plan asks for ``s(t) = first + speed (t - start)``. The log's path z(t) is compared with it at every
shift d on a grid, ``sum over windows of s(t)^2 - (z(t + d) - s(t))^2`` with both measured from the plan's pose, by one
correlation; the largest sum is where most of the plan lies in the log. The shift is then refined: along a window the
misfit is linear in d, and the median window gives the error of d.

A plan's ramps rise at rates of their own, ``a(t) = rate (t - start)``, until the drive breaks loose. The torque m(t) of
a drive, less its mean, is compared with their first parts, an eighth to all of each, at every shift d on a grid: the
share ``1 - sum (m(t + d) - a(t))^2 / sum a(t)^2`` is near one for the drive whose ramps they are, where it had not
broken loose by then, and smaller for all others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy

from excite.design.friction_runs.friction_plan import FrictionPlan
from excite.design.friction_runs.schedule import Ramp
from excite.friction.constant_speed_windows import (
    ConstantWindow,
    Found,
    WindowSearch,
    constant_window,
    longest_step,
    position_noise,
    unbroken,
)
from excite.friction.points import DriveLog, RigidModel
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


@dataclass(frozen=True, eq=False)
class PlannedRuns:
    """Planned runs of one drive."""

    plan: str  # where the plan is, for messages
    drive: str
    pose: Mapping[str, float]  # middle of every run, and how the joints move per rad or m of the coordinate
    direction: Mapping[str, float]
    gravity: str  # its effect over whole windows, see `excite.design.friction_runs.pose`
    windows: tuple[PlannedWindow, ...]
    # begin and end of the creeping runs out of the pose, in which it breaks away [s]
    creeps: tuple[tuple[float, float], ...] = ()
    ramps: tuple[Ramp, ...] = ()  # of the drive's torque, in the plan's other file
    creep: float = 0.0  # speed of the creeping runs; zero if it is not known [rad/s or m/s]

    def cancels(self, *, whole: bool) -> bool:
        """Whether gravity cancels over the windows, whole ones or parts of them, according to the plan."""
        return self.gravity == "none" or (whole and self.gravity in ("cancels", "stated"))

    def path(self, measured: DriveLog) -> tuple[Array, float]:
        """Displacement of the drive from the pose in a log, shape (N,), and its ratio to that of the coordinate."""
        k = measured.names.index(self.drive)
        pose, slope = (
            float(measured.rows[k] @ [of[name] for name in measured.log.joints]) for of in (self.pose, self.direction)
        )
        return measured.z[:, k] - pose, slope


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
        rises = () if c.ramps is None else c.ramps.ramps
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
    moved = (replace(w, start=w.start + shift, end=w.end + shift) for w in windows)
    inside = (w for w in moved if time[0] - step <= w.start and w.end <= time[-1] + step)
    return tuple(w for w in inside if np.any((time >= w.start) & (time <= w.end)))


def _ahead(time: Array, z: Array, window: PlannedWindow) -> Array:
    """How far the path is ahead of the plan's at the instants of a window."""
    rows = slice(int(np.searchsorted(time, window.start)), int(np.searchsorted(time, window.end, side="right")))
    return np.asarray(z[rows] - window.first - window.speed * (time[rows] - window.start))


_TRIMMED = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)  # of the path, cut off at both ends
_FEWEST = 8
_RECORDED = 0.7  # least share of the samples that are expected
_LATE = 0.1  # of a window: its largest error in time
_OTHER_SPEED = 0.1  # of the planned speed: the largest deviation from it


def windows_of_plan(
    time: Array, z: Array, others: Array, planned: Sequence[PlannedWindow], middle: float, search: WindowSearch
) -> Found:
    """Windows of a plan, whole or trimmed alike at both ends, by up to two fifths, so that the speed changes least."""
    # time (N,); z (N,); others (N, k)
    columns = np.column_stack([z, others])
    noise = position_noise(time, columns)
    steadiest = [_steadiest(time, columns, noise, w, middle, search) for w in planned]
    windows = tuple(sorted((w for w in steadiest if isinstance(w, ConstantWindow)), key=lambda w: w.start))
    missing = steadiest.count("missing")
    return Found(windows, len(planned) - len(windows) - missing, 0, missing)


def _steadiest(
    time: Array, columns: Array, noise: Array, planned: PlannedWindow, middle: float, search: WindowSearch
) -> ConstantWindow | Literal["changing", "missing"]:
    centre = middle + 0.5 * (planned.first + planned.last)
    late = _LATE * (planned.end - planned.start)
    begin, end = np.searchsorted(time - time[0], [planned.start - late, planned.end + late])
    away = np.abs(columns[begin:end, 0] - centre)
    at = int(np.searchsorted(time[begin:end] - time[0], 0.5 * (planned.start + planned.end)))
    candidates: list[tuple[float, ConstantWindow]] = []
    recorded, longest = False, longest_step(time)
    for trimmed in _TRIMMED:
        a, b = _stretch(away, at, (1.0 - trimmed) * 0.5 * abs(planned.last - planned.first))
        if not _recorded(time[begin + a : begin + b], longest):
            continue
        recorded = True
        window = constant_window(time, columns, noise, int(begin) + a, int(begin) + b, search, margin=0.0)
        if window is not None and abs(window[1].speed - planned.speed) <= _OTHER_SPEED * abs(planned.speed):
            candidates.append(window)
    if candidates:
        return min(candidates, key=lambda one: one[0])[1]
    return "changing" if recorded else "missing"


def _stretch(away: Array, at: int, half: float) -> tuple[int, int]:
    """Rows about one, no further from the middle than half the path and than the nearer of their two ends."""
    a, b = _about(away, at, half)
    return _about(away, at, min(half, float(away[a]), float(away[b - 1]))) if b > a else (0, 0)


def _about(away: Array, at: int, half: float) -> tuple[int, int]:
    out = np.flatnonzero(away > half)
    k = int(np.searchsorted(out, at))
    return (int(out[k - 1]) + 1 if k > 0 else 0), (int(out[k]) if k < out.size else away.size)


def _recorded(time: Array, longest: float) -> bool:
    """Whether there are enough samples, without a gap."""
    if time.size < _FEWEST or not unbroken(time, longest):
        return False
    step = np.diff(time)
    return bool((time.size - 1) * float(np.median(step)) >= _RECORDED * float(time[-1] - time[0]))


_PARTS_OF_RAMP = (1.0, 0.5, 0.25, 0.125)  # of each ramp
_SHARE = 0.8
_NEAR = 0.05  # rad or m, from the pose
_AFTER = 0.2  # [s], largest lag of a robot behind the plan


Spans = tuple[tuple[float, float], ...]  # begin and end, since a log's first sample [s]


def match_ramps(measured: DriveLog, plan: Mapping[str, PlannedRuns]) -> tuple[str, Spans] | None:
    """The drive whose planned ramps a log contains, and where they are; None where it contains those of no drive."""
    matches = [
        (name, *_ramps_of(measured, runs))
        for name, runs in plan.items()
        if name in measured.names and runs.ramps and _near(measured, runs)
    ]
    name, share, spans = max(matches, key=lambda each: each[1], default=("", 0.0, ()))
    return (name, spans) if share > _SHARE else None


def _near(measured: DriveLog, runs: PlannedRuns) -> bool:
    """Whether the robot rests near the pose."""
    pose = [runs.pose[name] for name in measured.log.joints]
    return bool(np.all(np.abs(np.median(measured.log.q, axis=0) - pose) <= _NEAR))


def _ramps_of(measured: DriveLog, runs: PlannedRuns) -> tuple[float, Spans]:
    """Share of the planned torque that the log contains, at most one, and the ramps where it is largest."""
    log = measured.log
    assert log.effort is not None
    since = log.time - log.time[0]
    torque = measured.torque(log.effort)[:, measured.names.index(runs.drive)]
    grid = np.arange(0.0, since[-1] + _GRID, _GRID)
    m = np.interp(grid, since, torque - np.median(torque))
    share, shift = max(_largest_share(m, runs, part) for part in _PARTS_OF_RAMP)
    return share, tuple((r.start + shift, r.end + shift + _AFTER) for r in runs.ramps)


def _largest_share(m: Array, runs: PlannedRuns, part: float) -> tuple[float, float]:
    """Largest share of the first part of each ramp, and the shift at which it is [s]."""
    at = np.arange(0.0, max(ramp.end for ramp in runs.ramps) + _GRID, _GRID)
    asked, within = np.zeros((2, at.size))
    for ramp in runs.ramps:
        rows = (at >= ramp.start) & (at <= ramp.start + part * (ramp.end - ramp.start))
        asked[rows], within[rows] = ramp.rate * (at[rows] - ramp.start), 1.0
    power = float(asked @ asked)
    mean = scipy.signal.correlate(m, within) / within.sum()
    left = scipy.signal.correlate(m**2, within) - within.sum() * mean**2
    share = (2.0 * scipy.signal.correlate(m, asked) - left) / power
    k = int(np.argmax(share))
    return float(share[k]), float((k - (at.size - 1)) * _GRID)


@dataclass(frozen=True, eq=False)
class Source:
    """A log in which a drive moves."""

    measured: DriveLog
    model: RigidModel | None  # without friction
    unknown: InputError | None = None  # why there is no model
    # where it has the runs of a plan; with a plan but no runs, only break-aways are evaluated
    plan_match: PlanMatch | None = None
    ramped: Spans | None = None  # where it has the drive's torque ramps of a plan
