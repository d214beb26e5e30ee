"""Data of the 3D player: bodies and their joints, the motion, and limited functions along it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from constraints.collision.geometry import World
from excite.report.player_shapes import player_shapes
from excite.report.sections import raised
from excite.tasks.task import Task
from regressors.robot.robot import BASE, Robot
from regressors.samples import Array

_JOINT_SIZE = 0.035  # of the robot's reach


@dataclass(frozen=True, eq=False)
class LimitCourse:
    """One limited function along a motion."""

    owner: str  # such as ``joint q1``, or a pair of bodies
    quantity: str
    unit: str
    lower: float  # infinite where there is no bound
    upper: float
    values: Array  # (N,)
    bodies: tuple[str, ...] = ()  # links that the function belongs to

    @property
    def nearest(self) -> float:
        """Least distance from a bound."""
        return float(np.minimum(self.values - self.lower, self.upper - self.values).min())


@dataclass(frozen=True, eq=False)
class PlayedMotion:
    """A motion of every joint, and functions along it."""

    time: Array  # (N,) [s]
    q: Array  # (N, n) [rad, rad/s, or with m]
    dq: Array  # (N, n)
    segments: tuple[tuple[str, float], ...]  # names and ends [s]
    courses: Sequence[LimitCourse]
    about: str  # what the reader must know of the functions


def player_data(
    motion: PlayedMotion, robot: Robot, task: Task, shape: World | None, robot_file: str | None = None
) -> dict[str, Any]:
    """Everything that the player of a page needs, as plain values."""
    number = {BASE: 0, **{body.name: k for k, body in enumerate(robot.bodies, 1)}}
    courses = motion.courses
    return {
        "bodies": body_data(robot, number),
        "time": _short(motion.time, 9),
        "q": _short(motion.q, 9),
        "dq": _short(motion.dq, 7),
        "segments": [{"name": name, "end": end} for name, end in motion.segments],
        "limits": [_limit(course, number) for course in courses],
        "values": _short(np.column_stack([course.values for course in courses]), 5)
        if courses
        else [[]] * len(motion.q),
        "tip": robot.n - 1,
        "tool": list(task.limits.tool_point),
        "joint_size": _JOINT_SIZE * max(0.1, sum(float(np.linalg.norm(j.translation)) for j in robot.joints)),
        "about": motion.about,
        **player_shapes(robot, task, shape, number, robot_file),
    }


def _short(values: Array, digits: int) -> Any:
    """Nested lists of numbers with so many significant digits, None where a number is not known."""
    if values.ndim > 1:
        return [_short(row, digits) for row in values]
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in values.tolist()]


def body_data(robot: Robot, number: Mapping[str, int]) -> list[dict[str, Any]]:
    """Links, then branches, each with the joint that carries it."""
    bodies, before = [], 0
    for k, (joint, link) in enumerate(zip(robot.joints, robot.links, strict=True)):
        bodies.append({"name": link.name, "parent": before, "row": np.eye(robot.n)[k].tolist(), "offset": 0.0})
        before = number[link.name]
        bodies[-1] |= _joint(joint)
    for branch in robot.branches:
        row, parent = branch.coupling.tolist(), number[branch.parent]
        bodies.append({"name": branch.name, "parent": parent, "row": row, "offset": branch.offset})
        bodies[-1] |= _joint(branch.joint)
    return bodies


def _joint(joint: Any) -> dict[str, Any]:
    placed = {name: getattr(joint, name).tolist() for name in ("rotation", "translation", "axis")}
    return {"kind": joint.kind, **placed}


def _limit(course: LimitCourse, number: Mapping[str, int]) -> dict[str, Any]:
    return {
        "owner": course.owner,
        "quantity": course.quantity,
        "unit": raised(course.unit),
        "lower": course.lower if np.isfinite(course.lower) else None,
        "upper": course.upper if np.isfinite(course.upper) else None,
        "most": max(float(np.nanmax(np.abs(course.values))), 1e-12),
        "bodies": [number[name] for name in course.bodies if name in number],
    }


def tightest(courses: Sequence[LimitCourse]) -> list[LimitCourse]:
    """One course per function: of several with the same name, as of many pieces of two bodies, the nearest ones."""
    same: dict[tuple[str, str], list[LimitCourse]] = {}
    for course in courses:
        same.setdefault((course.owner, course.quantity), []).append(course)
    return [_nearest(group) for group in same.values()]


def _nearest(group: Sequence[LimitCourse]) -> LimitCourse:
    """Several functions with the same bounds as one, at every instant the one nearest to a bound."""
    if len(group) == 1:
        return group[0]
    alike = [course for course in group if (course.lower, course.upper) == (group[0].lower, group[0].upper)]
    values = np.array([course.values for course in alike])
    room = np.minimum(values - group[0].lower, group[0].upper - values)
    return replace(group[0], values=values[room.argmin(axis=0), np.arange(values.shape[1])])
