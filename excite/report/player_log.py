"""The measured motion of logs in the 3D player, with measured and predicted torques along it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

import numpy as np

from constraints.collision.collision_limits import Collisions
from constraints.collision.geometry import World
from constraints.linear import linear_limits
from excite.report.player_data import (
    LimitCourse,
    PlayedMotion,
    bodies_of,
    linear_courses,
    matches,
    nearest_pairs,
    nonlinear_courses,
    player_data,
    tightest,
)
from excite.tasks.task import Task
from excite.trajectories.sequence import whole_pose
from regressors.errors import ExciteError
from regressors.models.partial import of_joints
from regressors.robot.robot import Robot
from regressors.samples import Array, Index, Samples

_FRAMES = 500  # of each log
_MOST = 2000  # of all logs
_PAUSE = 0.2  # between two logs [s]
_ABOUT = (
    "Positions, and torques over time, are those of the log after its preparation; predicted ones are those of the "
    "result. Velocities are differences of the positions shown. Values between samples are interpolated."
)


@dataclass(frozen=True, eq=False)
class LoggedMotion:
    """Measured motion of some joints, and both sides of the equations along it."""

    joints: tuple[str, ...]
    logs: tuple[str, ...]  # files
    time: Array  # (K,) instants [s], and the log of each
    log: Index  # (K,)
    q: Array  # (K, n) [rad or m]
    equations: tuple[tuple[str, str], ...]  # names and units
    # of each equation: log and time of its rows, measured and predicted values
    rows: tuple[tuple[Index, Array, Array, Array], ...]


@dataclass(frozen=True)
class Appearance:
    """What the robot looks like, beside what its result says."""

    robot_file: str | None = None  # URDF, whose meshes are shown where it describes the robot
    shapes: Mapping[str, World] = field(default_factory=dict)  # shapes of robots by the hashes of their descriptions


def played(
    logged: LoggedMotion, robot: Robot, task: Task, looks: Appearance
) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
    """All that the player of a page needs of a measured motion, as plain values; a note where it cannot be had."""
    try:
        return _motion(logged, robot, task, looks), ()
    except ExciteError as error:
        return None, (f"the 3D player is left out: {error}",)


def _motion(logged: LoggedMotion, robot: Robot, task: Task, looks: Appearance) -> dict[str, Any]:
    whole = task.limits.applied(robot)
    kept = _kept(logged)
    own, at = logged.time[kept], logged.log[kept]
    time, segments = _in_sequence(own, at, logged.logs)
    q = whole_pose(whole, logged.joints, logged.q[kept])
    dq = np.zeros_like(q)
    for k in np.unique(at):
        one = at == k
        if one.sum() > 1:
            dq[one] = np.gradient(q[one], own[one], axis=0)
    known = looks.shapes.get(robot.sha256())
    samples = Samples(time, q, dq, np.zeros_like(q), np.zeros_like(q))
    courses = [*_courses(whole, task, known, logged.joints, samples), *_torques(logged, own, at, whole)]
    file = looks.robot_file
    shown = file if file is not None and matches(robot, task, file) else None
    return player_data(PlayedMotion(time, q, dq, segments, courses, _ABOUT), whole, task, known, shown)


def _kept(logged: LoggedMotion) -> Index:
    """Instants that are shown, of each log as many."""
    numbers = np.unique(logged.log)
    most = max(2, min(_FRAMES, _MOST // numbers.size))
    parts = [np.flatnonzero(logged.log == k) for k in numbers]
    return np.concatenate(
        [p[np.unique(np.linspace(0, p.size - 1, min(p.size, most)).round().astype(int))] for p in parts]
    )


def _in_sequence(own: Array, log: Index, names: Sequence[str]) -> tuple[Array, tuple[tuple[str, float], ...]]:
    """Instants of logs one after the other, and the end of each."""
    time, segments, end = np.zeros_like(own), [], -_PAUSE
    for k in np.unique(log):
        begin = end + _PAUSE
        time[log == k] = own[log == k] - own[log == k][0] + begin
        end = float(time[log == k][-1])
        segments.append((PurePath(names[k]).name, end))
    return time, tuple(segments)


def _courses(
    robot: Robot, task: Task, shape: World | None, joints: tuple[str, ...], samples: Samples
) -> Iterator[LimitCourse]:
    """Positions and velocities of joints and drives, and distances where shapes are known."""
    index = [robot.joint_names.index(name) for name in joints]
    moving = np.isin(np.arange(robot.n), index)
    linear = [limit for limit in linear_limits(robot) if limit.derivative < 2]
    bodies = bodies_of(robot, robot.joint_names, linear)
    touched = {
        label for limit in linear for label, row in zip(limit.labels, limit.matrix, strict=True) if row[moving].any()
    }
    courses = [course for limit in linear for course in linear_courses(limit, samples, bodies)]
    yield from tightest([course for course in courses if f"{course.owner} {course.quantity}" in touched])
    world = task.limits.known_world if task.limits.known_world is not None else shape
    if world is None:
        return
    part = Samples(samples.time, *(x[:, index] for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))
    distances = Collisions(world).imposed(robot, of_joints(robot, index))
    yield from nearest_pairs([course for limit in distances for course in nonlinear_courses(limit, part, bodies)])


def _torques(logged: LoggedMotion, own: Array, log: Index, robot: Robot) -> Iterator[LimitCourse]:
    """Measured and predicted values of each equation; limits of torques where they are those of a joint or a drive."""
    largest = {f"joint {name}": float(x) for name, x in zip(robot.joint_names, robot.limits.torque, strict=True)}
    links = {f"joint {j.name}": (link.name,) for j, link in zip(robot.joints, robot.links, strict=True)}
    for (name, unit), (logs, times, *sides) in zip(logged.equations, logged.rows, strict=True):
        owner = f"joint {name}" if name in robot.joint_names else name
        bound = largest.get(owner, np.inf) if unit in ("Nm", "N") else np.inf
        for quantity, values in zip(("measured", "predicted"), sides, strict=True):
            shown = np.full(own.size, np.nan)
            for k in np.unique(logs):
                one, rows = log == k, logs == k
                shown[one] = np.interp(own[one], times[rows], values[rows], left=np.nan, right=np.nan)
            if np.isfinite(shown).any():
                limit = bound if quantity == "measured" else np.inf
                yield LimitCourse(owner, quantity, unit, -limit, limit, shown, links.get(owner, ()))
