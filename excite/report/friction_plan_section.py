"""The section of a plan of friction measurements."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from constraints.bounds.certificate import LimitUse
from constraints.collision.collision_limits import Collisions
from constraints.linear import linear_limits
from excite.files.motion_source import read_source
from excite.friction.plan.friction_plan import CoordinatePlan, FrictionPlan
from excite.report.drawings import drawn
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
from excite.report.player_log import Appearance
from excite.report.sections import ReportSection
from excite.report.view_section import section_of
from excite.simulation.played_limits import played_uses
from excite.simulation.reference import MotionSource, SampledMotion
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.stored_files import StoredRobot
from excite.tasks.task import Task
from excite.views.friction_plan_view import friction_plan_view
from regressors.models.partial import of_joints
from regressors.samples import Array, Index, Samples

_FRAMES = 500  # of each coordinate
_ABOUT = (
    "The runs of the coordinates follow each other; you move the robot from one pose to the next. Torques are not "
    "shown: they are what is to be measured. Values between samples are interpolated; the certified extremes are in "
    "the table."
)
_LOOKED_AT = (
    "limits of joints and drives are looked at in the samples of the files; jerks, torques, distances and passages "
    "between poses are as plan.json states them"
)


def friction_plan_section(
    plan: FrictionPlan, prefix: str, looks: Appearance, path: Path | None = None
) -> ReportSection:
    """Everything that a page says of a plan of friction measurements."""
    runs = [(c, _source(plan, c, path)) for c in plan.coordinates]
    if path is not None:
        plan = replace(plan, coordinates=tuple(_looked_at(plan, c, source) for c, source in runs))
    view = friction_plan_view(plan)
    section = section_of(view, "friction plan", *drawn(view.figures, prefix))
    folder = "friction/this" if path is None else str(path.parent)
    return replace(
        section,
        title=section.title if path is None else folder,
        assumed=(*([] if path is None else [_LOOKED_AT]), *view.summary, *view.remarks),
        motion=_motion(plan, [(c.label, _samples(source)) for c, source in runs], looks),
        commands=_commands(plan, folder),
    )


def _source(plan: FrictionPlan, c: CoordinatePlan, path: Path | None) -> MotionSource:
    return plan.motion(c.label) if path is None else read_source(path.with_name(c.file))


def _samples(source: MotionSource) -> Samples:
    motion = source.motion
    assert isinstance(motion, SampledMotion)
    return motion.given


def _looked_at(plan: FrictionPlan, c: CoordinatePlan, source: MotionSource) -> CoordinatePlan:
    """The coordinate with limits of joints and drives as the samples of its file keep them."""
    sampled = {label for limit in linear_limits(plan.robot) if limit.derivative < 3 for label in limit.labels}
    uses, broken = played_uses(source)
    computed = (use if use in broken else _within(use) for use in uses if use.label in sampled)
    return replace(c, limits=(*computed, *(use for use in c.limits if use.label not in sampled)))


def _within(use: LimitUse) -> LimitUse:
    """What interpolation between samples adds is no excess."""
    return replace(use, margin=max(use.margin, 0.0))


def _frames(runs: Samples, most: int) -> Index:
    """Instants that are shown: most of them where the speed changes, some wherever it moves, few at rest."""
    step = np.diff(runs.time)
    turn, speed = (np.linalg.norm(each, axis=1) for each in (np.diff(runs.dq, axis=0), runs.dq[1:]))
    change = turn / max(float(turn.sum()), 1e-12)
    moves = speed * step / max(float((speed * step).sum()), 1e-12)
    weight = np.concatenate([[0.0], np.cumsum(0.6 * change + 0.2 * moves + 0.2 * step / step.sum())])
    found = np.searchsorted(weight, np.linspace(0.0, weight[-1], most))
    return np.unique(np.concatenate([[0], found.clip(0, runs.time.size - 1), [runs.time.size - 1]]))


def _motion(plan: FrictionPlan, runs: Sequence[tuple[str, Samples]], looks: Appearance) -> dict[str, Any]:
    """Runs of all coordinates, one after the other."""
    robot, known = plan.robot, plan.world
    limits = LimitChoice() if known is None else LimitChoice(world=known)
    task = Task(StoredRobot(robot.name, robot), limits=limits)
    time, q, dq, segments = _joined(runs)
    samples = Samples(time, q, dq, np.zeros_like(q), np.zeros_like(q))
    linear = [limit for limit in linear_limits(robot) if limit.derivative < 2]
    bodies = bodies_of(robot, robot.joint_names, linear)
    moving = np.ptp(q, axis=0) > 0.0
    courses: list[LimitCourse] = []
    for limit in linear:
        labels = {label for label, row in zip(limit.labels, limit.matrix, strict=True) if row[moving].any()}
        courses += [c for c in linear_courses(limit, samples, bodies) if f"{c.owner} {c.quantity}" in labels]
    courses = tightest(courses)
    if known is not None:
        distances = Collisions(known).imposed(robot, of_joints(robot, list(range(robot.n))))
        courses += nearest_pairs([c for limit in distances for c in nonlinear_courses(limit, samples, bodies)])
    file = looks.robot_file
    shown = file if file is not None and matches(robot, task, file) else None
    shape = looks.shapes.get(robot.sha256())
    return player_data(PlayedMotion(time, q, dq, segments, courses, _ABOUT), robot, task, shape, shown)


def _joined(runs: Sequence[tuple[str, Samples]]) -> tuple[Array, Array, Array, tuple[tuple[str, float], ...]]:
    times, positions, velocities, segments, end = [], [], [], [], 0.0
    for label, each in runs:
        kept = _frames(each, _FRAMES)
        times.append(each.time[kept] - each.time[0] + end)
        positions.append(each.q[kept])
        velocities.append(each.dq[kept])
        end = float(times[-1][-1])
        segments.append((label, end))
        end += 0.5  # from one pose to the next
    return np.concatenate(times), np.concatenate(positions), np.concatenate(velocities), tuple(segments)


def _commands(plan: FrictionPlan, folder: str) -> tuple[str, ...]:
    robot, drives = plan.robot.name, ",".join(c.label for c in plan.coordinates)
    return (
        shlex.join(["excite", "friction", "plan", robot, "--drives", drives, "--out", f"{folder}-again"]),
        shlex.join(["excite", "friction", "fit", robot, "LOG.csv", "--plan", folder, "--out", "friction/this"]),
    )
