"""The motion of a design in the 3D player, with every limit along it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from constraints.collision.collision_limits import Clearance
from constraints.linear import LinearConstraint, linear_limits
from constraints.nonlinear import NonlinearConstraint
from excite.design.design import Design
from excite.design.imposed_limits import nonlinear_limits
from excite.design.stated_limits import StatedWorld, stated_limits
from excite.report.player_data import LimitCourse, PlayedMotion, player_data, tightest
from regressors.robot.robot import Robot
from regressors.samples import Samples

FRAMES = 600  # of the motion in a page; between them it is interpolated
_PAIRS = 12  # nearest pairs of bodies whose distance is shown
_TORQUE = " torque"
_ABOUT = (
    "Torques are computed from the description's parameters; their limits are less the reserve and friction. Values "
    "between samples are interpolated; the certified extremes are in the table of margins."
)


def player_motion(design: Design, robot_file: str | None = None) -> dict[str, Any]:
    """Everything that the player of a page needs of a design, as plain values."""
    robot = design.task.limits.applied(design.robot)
    samples, _ = design.sequence.sampled()
    shown = _some(samples)
    ends = tuple((name, end) for name, (_, end) in design.sequence.spans().items())
    courses = limit_courses(design, robot, shown)
    motion = PlayedMotion(shown.time, shown.q, shown.dq, ends, courses, _ABOUT)
    return player_data(motion, robot, design.task, design.shape, robot_file)


def _some(samples: Samples) -> Samples:
    """At most `FRAMES` of the samples, both ends among them."""
    count = samples.time.size
    index = np.unique(np.linspace(0, count - 1, min(count, FRAMES)).round().astype(int))
    motion = (samples.q, samples.dq, samples.ddq, samples.dddq)
    return Samples(samples.time[index], *(each[index] for each in motion))


def limit_courses(design: Design, robot: Robot, samples: Samples) -> list[LimitCourse]:
    """Every limit of joints, drives, torques, the tool and distances along a motion.

    Where the motion begins and ends at home, limits of every joint, since all of them move on the way; else those of
    the joints that the design moves.
    """
    whole = design.approach_and_return is not None
    joints = robot.joint_names if whole else design.moving.joint_names
    index = [robot.joint_names.index(name) for name in joints]
    motion = Samples(samples.time, *(x[:, index] for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))
    linear = linear_limits(robot if whole else design.moving)
    bodies = bodies_of(robot, joints, linear)
    courses = [course for limit in linear for course in linear_courses(limit, motion, bodies)]
    distances: list[LimitCourse] = []
    for constraint in _nonlinear(design, joints) if whole else design.nonlinear:
        near = isinstance(constraint, Clearance)
        (distances if near else courses).extend(nonlinear_courses(constraint, motion, bodies))
    return [*tightest(courses), *nearest_pairs(distances)]


def nearest_pairs(distances: Sequence[LimitCourse]) -> list[LimitCourse]:
    """The nearest pairs of bodies, those that come nearest first."""
    return sorted(tightest(distances), key=lambda course: course.nearest)[:_PAIRS]


def _nonlinear(design: Design, joints: tuple[str, ...]) -> tuple[NonlinearConstraint, ...]:
    stated = stated_limits(design.robot, joints, design.task, StatedWorld(design.shape))
    return (*nonlinear_limits(design.robot, joints, design.task), *stated.constraints)


def bodies_of(robot: Robot, joints: Sequence[str], linear: Sequence[LinearConstraint]) -> dict[str, tuple[str, ...]]:
    """Links whose joints a joint or a drive moves, by its name in labels."""
    link = {joint.name: body.name for joint, body in zip(robot.joints, robot.links, strict=True)}
    owners: dict[str, tuple[str, ...]] = {f"joint {name}": (link[name],) for name in joints}
    for limit in linear:
        for label, row in zip(limit.labels, limit.matrix, strict=True):
            moved = tuple(link[name] for name, factor in zip(joints, row, strict=True) if factor != 0.0)
            owners.setdefault(label.removesuffix(f" {limit.quantity}"), moved)
    return owners


def linear_courses(
    limit: LinearConstraint, samples: Samples, bodies: Mapping[str, tuple[str, ...]]
) -> Iterator[LimitCourse]:
    """Functions that are limited linearly, along a motion."""
    motion = (samples.q, samples.dq, samples.ddq, samples.dddq)[limit.derivative]
    values = motion @ limit.matrix.T + limit.offset
    for k, label in enumerate(limit.labels):
        owner = label.removesuffix(f" {limit.quantity}")
        bounds = float(limit.lower[k]), float(limit.upper[k])
        yield LimitCourse(owner, limit.quantity, limit.units[k], *bounds, values[:, k], bodies.get(owner, ()))


def nonlinear_courses(
    limit: NonlinearConstraint, samples: Samples, bodies: Mapping[str, tuple[str, ...]]
) -> Iterator[LimitCourse]:
    """Functions that are limited otherwise, along a motion."""
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
