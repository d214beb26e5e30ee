"""Logs as they are read for one identification: the motion in each, and the task and the recipe completed from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from excite.identification.adjustment import with_presliding, with_whole_window
from excite.identification.known_friction import beside_curves, check_for_curves, check_joint_torques
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.recipe import Recipe
from excite.identification.standstill import without_standstill
from excite.identification.stated_uncertainty import PRESLIDING
from excite.information.target import IdentificationTarget, friction_of_moving, target_of

if TYPE_CHECKING:
    from excite.logs.log import Log
    from excite.tasks.task import Task
    from regressors.friction.curves import FrictionCurves
    from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class MeasuredLogs:
    """What the equations of an identification are built from."""

    task: Task  # without friction columns of drives whose friction is known, its windows a whole number of samples
    target: IdentificationTarget
    recipe: Recipe  # with the presliding of friction
    parts: tuple[PreparedLog, ...]  # as measured, known friction not subtracted
    friction: FrictionCurves | None  # known friction of the moving drives
    # which settings of the recipe were found from the same logs, see `excite.identification.stated_uncertainty`
    found: frozenset[str]


def measured_logs(
    robot: Robot,
    task: Task,
    logs: Sequence[Log],
    recipe: Recipe,
    friction: FrictionCurves | None,
    found: frozenset[str],
    progress: Callable[[str], None],
) -> MeasuredLogs:
    """Read the motion of each log, and complete task and recipe from them."""
    own, friction = friction is None, task.known_friction if friction is None else friction
    if friction is not None and (recipe.friction_scale or not own):
        task = beside_curves(task, robot, friction)
    made_for = task, recipe.common_width
    target = target_of(robot, *made_for)
    if friction is not None:
        check_joint_torques(target)
        friction = friction_of_moving(friction, robot, target.robot)
        task = task if task.known_friction is None else task.changed(friction_curves=friction)
    else:
        check_for_curves(recipe)
    parts = []
    for log in logs:
        progress(f"reading the motion of {log.source}")
        parts.append(prepare(log, robot, target, recipe))
    task = with_whole_window(task, target, parts[0])
    if recipe.sign_width is None and not recipe.breakaway:
        found |= {PRESLIDING}
    recipe = with_presliding(recipe, target, parts, friction)
    if (task, recipe.common_width) != made_for:
        target = target_of(robot, task, recipe.common_width)
    moving = tuple(without_standstill(part, target, recipe.standstill) for part in parts)
    return MeasuredLogs(task, target, recipe, moving, friction, found if friction is None else found - {PRESLIDING})
