"""Common interface of designs, whether just optimised or read from a file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from constraints.bounds.certificate import LimitUse
from excite.design.approach import ApproachAndReturn
from excite.design.stated_limits import Unchecked
from excite.storage.manifest import sha256_of
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.sequence import EXCITE, MotionSequence, Piece, WholeRobotMotion
from regressors.robot.robot import Robot


class DesignedMotion(ABC):
    """A designed motion of a robot.

    Attributes
    ----------
    robot : Robot
        The whole robot, as described.
    task : Task
    trajectory : Trajectory
        Motion of the moving robot's joints.
    limits : tuple of LimitUse
        Over continuous time.
    criteria : mapping of str to float
        See `excite.information.metrics.CONVENTIONS`.
    unchecked : tuple of Unchecked
        Kinds of limits that were not checked.
    provenance : mapping
        Date, versions, seed, times.
    folder : Path or None
        Folder that it was read from.
    """

    robot: Robot
    task: Task
    trajectory: Trajectory
    limits: tuple[LimitUse, ...]
    criteria: Mapping[str, float]
    unchecked: tuple[Unchecked, ...]
    provenance: Mapping[str, Any]
    folder: Path | None

    @property
    @abstractmethod
    def moving(self) -> Robot:
        """The robot that the model is written for, with the task's limits."""

    @property
    @abstractmethod
    def transfers(self) -> ApproachAndReturn | None:
        """Approach and return, where the task has a home."""

    @property
    @abstractmethod
    def transfer_limits(self) -> Mapping[str, tuple[LimitUse, ...]]:
        """Limits on approach and return over continuous time, per segment; none without a home."""

    @property
    def feasible(self) -> bool:
        """True if every checked limit holds over continuous time, to 1e-9 of its bound, on approach and return too."""
        return not self.broken

    @property
    def broken(self) -> tuple[str, ...]:
        """Labels of the limits that do not hold, on approach and return too."""
        uses = (use for some in (self.limits, *self.transfer_limits.values()) for use in some)
        return tuple(use.label for use in uses if not use.holds)

    @cached_property
    def sequence(self) -> MotionSequence:
        """The whole motion of every joint: the approach, the exciting motion, the return."""
        robot, transfers = self.task.limits.applied(self.robot), self.transfers
        motion = WholeRobotMotion(self.trajectory, robot, self.moving.joint_names)
        steps = round(self.trajectory.duration * self.task.output.rate)
        if transfers is None:
            return MotionSequence((Piece(EXCITE, motion, steps),))
        return transfers.sequence(motion, steps)

    @property
    @abstractmethod
    def coefficients_sha256(self) -> str:
        """Hash of the motion's coefficients, as ``design.json`` has it."""

    @property
    def file_sha256(self) -> str | None:
        """Hash of the ``design.json`` that it was read from; None for a design that was not read from a folder."""
        return None if self.folder is None else sha256_of(self.folder / "design.json")

    @property
    def condition_number(self) -> float:
        """cond(W) in the left-to-right base, SI, unscaled; infinite where it is not finite."""
        return self.criteria["condition_number"]

    @property
    def name(self) -> str:
        """Folder of the design, or the name of its robot."""
        return str(self.folder) if self.folder is not None else self.robot.name

    def __repr__(self) -> str:
        """One-line summary."""
        place = "" if self.folder is None else f" in {self.folder}"
        return (
            f"<{type(self).__name__} of {self.robot.name}{place}: {self.trajectory.duration:g} s, "
            f"{self.trajectory.family.described}, condition number {self.condition_number:.4g}>"
        )
