"""Data of the 3D player: bodies and their joints, the motion, and every limit along it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from constraints.collision.collision_limits import Clearance
from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.design import Design
from excite.design.imposed_limits import nonlinear_limits
from excite.design.stated_limits import stated_limits
from excite.report.player_shapes import player_shapes
from excite.report.sections import raised
from regressors.robot.robot import BASE, Robot
from regressors.samples import Array, Samples

FRAMES = 600  # of the motion in a page; between them it is interpolated
_PAIRS = 12  # nearest pairs of bodies whose distance is shown
_JOINT_SIZE = 0.035  # of the robot's reach
_TORQUE = " torque"


@dataclass(frozen=True, eq=False)
class LimitCourse:
    """One limited function along a motion.

    Parameters
    ----------
    owner : str
        Such as ``joint q1``, or a pair of bodies.
    quantity, unit : str
    lower, upper : float
        Infinite where there is no bound.
    values : ndarray, shape (N,)
    bodies : tuple of str
        Links that the function belongs to.
    """

    owner: str
    quantity: str
    unit: str
    lower: float
    upper: float
    values: Array
    bodies: tuple[str, ...] = ()

    @property
    def nearest(self) -> float:
        """Least distance from a bound."""
        return float(np.minimum(self.values - self.lower, self.upper - self.values).min())


def player_motion(design: Design, robot_file: str | None = None) -> dict[str, Any]:
    """Everything that the player of a page needs, as plain values.

    Parameters
    ----------
    design : Design
    robot_file : str, optional
        URDF of the robot, whose meshes are shown.

    Raises
    ------
    InputError
        A file that cannot be read.
    """
    robot = design.task.limits.applied(design.robot)
    samples, _ = design.sequence.sampled()
    shown = _some(samples)
    number = {BASE: 0, **{body.name: k for k, body in enumerate(robot.bodies, 1)}}
    courses = limit_courses(design, robot, shown)
    return {
        "bodies": _bodies(robot, number),
        "time": _short(shown.time, 9),
        "q": _short(shown.q, 9),
        "dq": _short(shown.dq, 7),
        "segments": [{"name": name, "end": end} for name, (_, end) in design.sequence.spans().items()],
        "limits": [_limit(course, number) for course in courses],
        "values": _short(np.column_stack([course.values for course in courses]), 5) if courses else [[]] * len(shown.q),
        "tip": robot.n - 1,
        "tool": list(design.task.limits.tool_point),
        "joint_size": _JOINT_SIZE * max(0.1, sum(float(np.linalg.norm(j.translation)) for j in robot.joints)),
        **player_shapes(design, robot, number, robot_file),
    }


def _some(samples: Samples) -> Samples:
    """At most `FRAMES` of the samples, both ends among them."""
    count = samples.time.size
    index = np.unique(np.linspace(0, count - 1, min(count, FRAMES)).round().astype(int))
    motion = (samples.q, samples.dq, samples.ddq, samples.dddq)
    return Samples(samples.time[index], *(each[index] for each in motion))


def _short(values: Array, digits: int) -> Any:
    """Nested lists of numbers with so many significant digits, None where a number is not known."""
    if values.ndim > 1:
        return [_short(row, digits) for row in values]
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in values.tolist()]


def _bodies(robot: Robot, number: Mapping[str, int]) -> list[dict[str, Any]]:
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


def limit_courses(design: Design, robot: Robot, samples: Samples) -> list[LimitCourse]:
    """Every limit of joints, drives, torques, the tool and distances along a motion.

    Where the motion begins and ends at home, limits of every joint, since all of them move on the way; else those of
    the joints that the design moves.

    Parameters
    ----------
    design : Design
    robot : Robot
        The whole robot, with the task's limits.
    samples : Samples
        Motion of every joint.
    """
    whole = design.approach_and_return is not None
    joints = robot.joint_names if whole else design.moving.joint_names
    index = [robot.joint_names.index(name) for name in joints]
    motion = Samples(samples.time, *(x[:, index] for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))
    linear = linear_limits(robot if whole else design.moving)
    bodies = _bodies_of(robot, joints, linear)
    courses = [course for limit in linear for course in _linear_courses(limit, motion, bodies)]
    distances: list[LimitCourse] = []
    for constraint in _nonlinear(design, joints) if whole else design.nonlinear:
        near = isinstance(constraint, Clearance)
        (distances if near else courses).extend(_nonlinear_courses(constraint, motion, bodies))
    return [*_tightest(courses), *sorted(_tightest(distances), key=lambda course: course.nearest)[:_PAIRS]]


def _nonlinear(design: Design, joints: tuple[str, ...]) -> tuple[NonlinearConstraint, ...]:
    stated = stated_limits(design.robot, joints, design.task, design.shape)
    return (*nonlinear_limits(design.robot, joints, design.task), *stated.constraints)


def _bodies_of(robot: Robot, joints: Sequence[str], linear: Sequence[LinearConstraint]) -> dict[str, tuple[str, ...]]:
    """Links whose joints a joint or a drive moves, by its name in labels."""
    link = {joint.name: body.name for joint, body in zip(robot.joints, robot.links, strict=True)}
    owners: dict[str, tuple[str, ...]] = {f"joint {name}": (link[name],) for name in joints}
    for limit in linear:
        for label, row in zip(limit.labels, limit.matrix, strict=True):
            moved = tuple(link[name] for name, factor in zip(joints, row, strict=True) if factor != 0.0)
            owners.setdefault(label.removesuffix(f" {limit.quantity}"), moved)
    return owners


def _linear_courses(
    limit: LinearConstraint, samples: Samples, bodies: Mapping[str, tuple[str, ...]]
) -> Iterator[LimitCourse]:
    motion = (samples.q, samples.dq, samples.ddq, samples.dddq)[limit.derivative]
    values = motion @ limit.matrix.T + limit.offset
    for k, label in enumerate(limit.labels):
        owner = label.removesuffix(f" {limit.quantity}")
        bounds = float(limit.lower[k]), float(limit.upper[k])
        yield LimitCourse(owner, limit.quantity, limit.units[k], *bounds, values[:, k], bodies.get(owner, ()))


def _nonlinear_courses(
    limit: NonlinearConstraint, samples: Samples, bodies: Mapping[str, tuple[str, ...]]
) -> Iterator[LimitCourse]:
    values = limit.shown(limit.values(samples))
    pairs = {pair.label: pair for pair in limit.pairs} if isinstance(limit, Clearance) else {}
    for k, label in enumerate(limit.labels):
        bounds = float(limit.lower[k]), float(limit.upper[k])
        names: tuple[str, ...] = ()
        owner, quantity = label, "tool"
        if label in pairs:
            names, quantity = (pairs[label].link, pairs[label].other), "distance"
        elif label.endswith(_TORQUE):
            owner, quantity = label.removesuffix(_TORQUE), "torque"
            names = bodies.get(owner, ())
        yield LimitCourse(owner, quantity, limit.units[k], *bounds, values[:, k], names)


def _tightest(courses: Sequence[LimitCourse]) -> list[LimitCourse]:
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
