"""Motions of logs in the 3D player, with measured and predicted torques along them, and those of friction plans."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from constraints.collision_limits import SelfCollisions
from constraints.geometry import World
from constraints.linear import linear_limits
from excite.design.friction_runs.friction_plan import CoordinatePlan, FrictionPlan
from excite.simulation.simulation_files import read_source
from excite.storage.records import chosen
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.reference import MotionSource, SampledMotion, played_uses
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from excite.trajectories.sequence import whole_pose
from excite.views.player_data import (
    LimitCourse,
    bodies_of,
    courses_of,
    matches,
    nearest_pairs,
    of_some_joints,
    player_data,
    tightest,
)
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

    def file_of(self, robot: Robot, task: Task) -> str | None:
        """The URDF, where it describes a robot."""
        return self.robot_file if self.robot_file is not None and matches(robot, task, self.robot_file) else None


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
    world = known if task.limits.known_world is None else task.limits.known_world
    moving = np.array([name in logged.joints for name in whole.joint_names])
    samples = Samples(time, q, dq, np.zeros_like(q), np.zeros_like(q))
    courses = [*_courses(whole, world, moving, samples), *_torques(logged, own, at, whole)]
    return player_data(samples, segments, courses, whole, task, known, looks.file_of(robot, task), _ABOUT)


def _kept(logged: LoggedMotion) -> Index:
    """Instants that are shown, of each log as many."""
    numbers = np.unique(logged.log)
    most = max(2, min(_FRAMES, _MOST // numbers.size))
    parts = (np.flatnonzero(logged.log == k) for k in numbers)
    return np.concatenate([part[chosen(part.size, most)] for part in parts])


def _in_sequence(own: Array, log: Index, names: Sequence[str]) -> tuple[Array, tuple[tuple[str, float], ...]]:
    """Instants of logs one after the other, and the end of each."""
    time, segments, end = np.zeros_like(own), [], -_PAUSE
    for k in np.unique(log):
        begin = end + _PAUSE
        time[log == k] = own[log == k] - own[log == k][0] + begin
        end = float(time[log == k][-1])
        segments.append((PurePath(names[k]).name, end))
    return time, tuple(segments)


def _courses(robot: Robot, world: World | None, moving: NDArray[np.bool_], samples: Samples) -> Iterator[LimitCourse]:
    """Positions and velocities of the joints that move and their drives, and distances where shapes are known."""
    linear = [limit for limit in linear_limits(robot) if limit.derivative < 2]
    bodies = bodies_of(robot, robot.joint_names, linear)
    touched = {label for x in linear for label, row in zip(x.labels, x.matrix, strict=True) if row[moving].any()}
    courses = [course for limit in linear for course in courses_of(limit, samples, bodies)]
    yield from tightest([course for course in courses if f"{course.owner} {course.quantity}" in touched])
    if world is None:
        return
    index = np.flatnonzero(moving).tolist()
    part = of_some_joints(samples, robot, [robot.joint_names[k] for k in index])
    distances = SelfCollisions(world).imposed(robot, of_joints(robot, index))
    yield from nearest_pairs([course for limit in distances for course in courses_of(limit, part, bodies)])


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


_MOVED = 0.5  # from one pose to the next [s]
_ABOUT_PLAN = (
    "The runs of the coordinates follow each other; you move the robot from one pose to the next. Torques are not "
    "shown: they are what is to be measured. Values between samples are interpolated; the certified extremes are in "
    "the table."
)


def source_of(plan: FrictionPlan, c: CoordinatePlan, path: Path | None) -> MotionSource:
    """Runs of a coordinate, as its file has them where the plan is stored."""
    return plan.motion(c.label) if path is None else read_source(path.with_name(c.file))


def looked_at(plan: FrictionPlan, c: CoordinatePlan, source: MotionSource) -> CoordinatePlan:
    """The coordinate with limits of joints and drives as the samples of its file keep them."""
    sampled = {label for limit in linear_limits(plan.robot) if limit.derivative < 3 for label in limit.labels}
    uses, broken = played_uses(source)
    computed = [use for use in uses if use.label in sampled]  # what interpolation between samples adds is no excess
    kept = (use if use in broken else replace(use, margin=max(use.margin, 0.0)) for use in computed)
    return replace(c, limits=(*kept, *(use for use in c.limits if use.label not in sampled)))


def motion_of_plan(
    plan: FrictionPlan, runs: Sequence[tuple[CoordinatePlan, MotionSource]], looks: Appearance
) -> dict[str, Any]:
    """Runs of all coordinates, one after the other."""
    robot, known = plan.robot, plan.world
    task = Task(StoredRobot(robot.name, robot), limits=LimitChoice() if known is None else LimitChoice(world=known))
    samples, segments = _joined(runs)
    courses = [*_courses(robot, known, np.ptp(samples.q, axis=0) > 0.0, samples)]
    shape = looks.shapes.get(robot.sha256())
    return player_data(samples, segments, courses, robot, task, shape, looks.file_of(robot, task), _ABOUT_PLAN)


def _frames(runs: Samples, most: int) -> Index:
    """Instants that are shown: most of them where the speed changes, some wherever it moves, few at rest."""
    step = np.diff(runs.time)
    turn, speed = (np.linalg.norm(each, axis=1) for each in (np.diff(runs.dq, axis=0), runs.dq[1:]))
    change = turn / max(float(turn.sum()), 1e-12)
    moves = speed * step / max(float((speed * step).sum()), 1e-12)
    weight = np.concatenate([[0.0], np.cumsum(0.6 * change + 0.2 * moves + 0.2 * step / step.sum())])
    found = np.searchsorted(weight, np.linspace(0.0, weight[-1], most))
    return np.unique(np.concatenate([[0], found.clip(0, runs.time.size - 1), [runs.time.size - 1]]))


def _joined(runs: Sequence[tuple[CoordinatePlan, MotionSource]]) -> tuple[Samples, list[tuple[str, float]]]:
    parts, segments, end = [], [], -_MOVED
    for c, source in runs:
        assert isinstance(source.motion, SampledMotion)
        each = source.motion.given
        kept = each.rows(_frames(each, _FRAMES))
        parts.append(replace(kept, time=kept.time - each.time[0] + (end + _MOVED)))
        end = float(parts[-1].time[-1])
        segments.append((c.label, end))
    return Samples.joined(parts), segments
