"""Logs with and without a load, made ready: the robot's model from those without, or from an earlier result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from excite.identification.estimation import estimate_parameters
from excite.identification.given_logs import LogLike, read_logs
from excite.identification.identification import Identification
from excite.identification.preparation import PreparedLog, prepare
from excite.identification.recipe import Recipe
from excite.identification.torque_factors import drives_of_torques
from excite.logs.mapping import LogMapping
from excite.tasks.installation import Installation
from excite.tasks.robot_of_task import robot_and_task
from excite.tasks.task import Task
from regressors.arguments import checked
from regressors.errors import InputError
from regressors.robot.robot import Robot

if TYPE_CHECKING:
    from excite.logs.log import Log


_LOW_PASS = 15.0  # Hz
_FAST = 8.0  # times as many rows per second


@checked
@dataclass(frozen=True)
class LogChoice:
    """How the logs of a payload are read.

    Parameters
    ----------
    mapping : LogMapping or path, optional
        How foreign files are laid out.
    drop : tuple of str
        Faulty rows to leave out, see `excite.logs.log_reading.read_log`.
    rows, without_rows : str
        Rows of the logs with and without the load: ``auto``, ``all``, or ``FIRST:LAST``.
    cutoff : float, optional
        Of the low-pass of positions [Hz]; that of `low_pass` if not given.
    low_pass : float, optional
        Cutoff of a low-pass on both sides of the equations [Hz]; for logs of a high rate 15 Hz if not given, above
        which loads show nothing but noise.
    """

    mapping: LogMapping | str | Path | None = None
    drop: tuple[str, ...] = ()
    rows: str = "auto"
    without_rows: str = "auto"
    cutoff: float | None = None
    low_pass: float | None = None

    def recipe(self, logs: Sequence[Log], rows: str) -> Recipe:
        """Settings for some logs.

        Parameters
        ----------
        logs : sequence of Log
        rows : str
        """
        fast = min((log.rate for log in logs), default=0.0) >= _FAST * _LOW_PASS
        low_pass = _LOW_PASS if self.low_pass is None and fast else self.low_pass
        return Recipe(rows=rows, cutoff=low_pass if self.cutoff is None else self.cutoff, low_pass=low_pass)

    def read(self, given: LogLike | Sequence[LogLike], robot: Robot, rows: str, progress: Callable[[str], None]) -> Any:
        """The logs, with hashes."""
        only = Recipe(rows=rows).row_numbers
        return read_logs(given, robot, self.mapping, tuple(self.drop), progress, only)


def described(
    robot: Robot | str,
    base_link: str | None,
    tip: str | None,
    installation: Installation | None,
    snap_angles: bool,
    xacro: bool,
) -> tuple[Robot, Task]:
    """The robot, and the task of its model: bodies, rotors of the joints, friction and its offsets.

    Friction also grows with the carried torque, where the bodies' parameters are described.
    """
    robot, task = robot_and_task(robot, base_link, tip, installation, snap_angles, xacro)
    known = all(link.theta is not None for link in robot.bodies)
    return robot, task.changed(joint_rotors=True, offset=True, load_share=known)


def without_load(
    robot: Robot, task: Task, logs: Sequence[Log], recipe: Recipe, progress: Callable[[str], None]
) -> Identification:
    """The robot's parameters from the logs without the load."""
    try:
        return estimate_parameters(robot, task, logs, recipe, progress=progress)
    except InputError:
        if task.model.load_share is False:
            raise
    return estimate_parameters(robot, task.changed(load_share=False), logs, recipe, progress=progress)


def loaded_parts(bare: Identification, logs: Sequence[Log], rows: str) -> list[PreparedLog]:
    """The logs with the load, for the model of those without."""
    recipe = replace(bare.recipe, rows=rows)
    return [replace(prepare(log, bare.robot, bare.target, recipe), standing=()) for log in logs]


def drives_of(bare_robot: Robot) -> tuple[str, ...]:
    """Drives, or joints where these do not determine the torques of the drives."""
    return drives_of_torques(bare_robot, each=False)[0]


def check_different(without: Sequence[Log], loaded: Sequence[Log]) -> None:
    """Raise `InputError` where a log is given both with and without the load."""
    if twice := {log.sha256 for log in without} & {log.sha256 for log in loaded}:
        names = ", ".join(log.source for log in loaded if log.sha256 in twice)
        raise InputError(f"{names}: the same log is given with and without the load")


def check_same_joints(without: Sequence[Log], loaded: Sequence[Log]) -> None:
    """Raise `InputError` where the logs of a pair are of different robots."""
    if not without:
        return
    first = without[0]
    for log in loaded:
        if set(log.joints) != set(first.joints):
            raise InputError(
                f"the pair is of different robots: {log.source} has the joints {', '.join(log.joints)}, "
                f"{first.source} has {', '.join(first.joints)}"
            )


def size_of(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
