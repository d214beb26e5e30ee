"""Logs given as objects, files or simulations, as they are read for one identification."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from excite.identification.allowances import PRESLIDING
from excite.identification.biases import without_standstill
from excite.identification.known_friction import beside_curves, check_for_curves, check_joint_torques
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.presliding import with_presliding, with_whole_window
from excite.identification.recipe import Recipe
from excite.information.target import IdentificationTarget, friction_of_moving, target_of
from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import LogMapping, read_mapping
from excite.logs.sidecar import with_sidecar
from excite.storage.result_folder import read_settled_files
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot


class Measured(Protocol):
    """What has a log, such as a simulation."""

    @property
    def measured(self) -> Log:
        """The log."""


LogLike = Log | str | Path | Measured


def read_logs(
    given: LogLike | Sequence[LogLike],
    robot: Robot,
    mapping: LogMapping | str | Path | None,
    drop: tuple[str, ...],
    progress: Callable[[str], None],
    only: tuple[int, int] | None = None,
) -> list[Log]:
    """Read logs and refuse duplicates; simulated ones keep their true parameters."""
    layout = read_mapping(Path(mapping)) if isinstance(mapping, str | Path) else mapping
    logs: dict[str, Log] = {}
    for item in given if isinstance(given, list | tuple) else (given,):
        if isinstance(item, str | Path):
            progress(f"reading {item}")
        log = log_of(item, robot, layout, drop, only)
        if log.sha256 in logs:
            raise InputError(f"{log.source} has the same content as {logs[log.sha256].source}; give each log once")
        logs[log.sha256] = log
    return list(logs.values())


def log_of(
    given: LogLike,
    robot: Robot | None,
    mapping: LogMapping | None = None,
    drop: tuple[str, ...] = (),
    only: tuple[int, int] | None = None,
) -> Log:
    """Log with its hash, from a log, its file, or a simulation."""
    if isinstance(given, str | Path):
        path = Path(given)
        return read_settled_files(path, lambda: _read(path, robot, mapping, drop, only))
    measured = getattr(given, "measured", given)
    if not isinstance(measured, Log):
        raise InputError(f"expected a log, the name of its file, or a simulation; given {type(given).__name__}")
    return replace(measured, sha256=measured.identity)


def _read(
    path: Path,
    robot: Robot | None,
    mapping: LogMapping | None,
    drop: tuple[str, ...],
    only: tuple[int, int] | None,
) -> Log:
    log = read_log(path, None, mapping, drop, only, robot)
    return log if robot is None else with_sidecar(log, robot)


@dataclass(frozen=True, eq=False)
class MeasuredLogs:
    """What the equations of an identification are built from."""

    task: Task  # without friction columns of drives whose friction is known, its windows a whole number of samples
    target: IdentificationTarget
    recipe: Recipe  # with the presliding of friction
    parts: tuple[PreparedLog, ...]  # as measured, known friction not subtracted
    friction: FrictionCurves | None  # known friction of the moving drives
    # which settings of the recipe were found from the same logs, see `excite.identification.allowances`
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
