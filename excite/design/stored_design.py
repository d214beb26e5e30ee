"""A design read back from its file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from excite.design.designed_motion import DesignedMotion
from excite.design.stored_sequence import stored_sequence
from excite.design.unchecked import Unchecked
from excite.information.target import moving_robot
from excite.storage.content_hash import entry_sha256
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.sequence import MotionSequence, WholeRobotMotion
from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class StoredDesign(DesignedMotion):
    """A design read from its folder: the robot, the task and the motion, to be played or judged again.

    Parameters
    ----------
    folder : Path
    robot : Robot
        The whole robot.
    task : Task
    trajectory : Trajectory
    content : dict
        The whole file.
    """

    folder: Path
    robot: Robot
    task: Task
    trajectory: Trajectory
    content: dict[str, Any]

    @cached_property
    def moving(self) -> Robot:
        """The robot that the model is written for, with the task's limits."""
        return moving_robot(self.robot, self.task)

    @cached_property
    def sequence(self) -> MotionSequence:
        """The whole motion of every joint: the approach, the exciting motion, the return."""
        robot = self.task.limits.applied(self.robot)
        return stored_sequence(
            self.content["played"], WholeRobotMotion(self.trajectory, robot, self.moving.joint_names)
        )

    @property
    def coefficients_sha256(self) -> str:
        """Hash of the motion's coefficients, as ``design.json`` has it."""
        stated = self.content.get("sha256", {}).get("trajectory")
        return str(stated or entry_sha256(self.content["trajectory"]))

    @property
    def broken(self) -> tuple[str, ...]:
        """Labels of the limits that did not hold when it was designed, on approach and return too."""
        played = self.content.get("played", {})
        uses = [
            *self.content["limits"],
            *(use for way in ("approach", "return") if way in played for use in played[way]["limits"]),
        ]
        return tuple(str(use["label"]) for use in uses if not use["holds"])

    @property
    def unchecked(self) -> tuple[Unchecked, ...]:  # type: ignore[override]
        """Kinds of limits that were not checked."""
        if "unchecked" in self.content:
            return tuple(Unchecked(each["limit"], each["reason"]) for each in self.content["unchecked"])
        torques = any(use["label"].endswith("torque") for use in self.content["limits"])
        checked = {"torque": torques, "collision": self.task.limits.world is not None}
        return tuple(Unchecked(limit, "not asked for") for limit, done in checked.items() if not done)

    @property
    def condition_number(self) -> float:
        """cond(W) in the left-to-right base, SI, unscaled; infinite where it is not finite."""
        value = self.content["criteria"]["condition_number"]
        return math.inf if value is None else float(value)

    @property
    def provenance(self) -> Mapping[str, Any]:  # type: ignore[override]
        """Date, versions, seed, times."""
        provenance: Mapping[str, Any] = self.content["provenance"]
        return provenance
