"""Common interface of designs, whether just optimised or read from a file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from excite.design.unchecked import Unchecked
from excite.storage.content_hash import sha256_of
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from excite.trajectories.sequence import MotionSequence
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
    unchecked: tuple[Unchecked, ...]
    provenance: Mapping[str, Any]
    folder: Path | None

    @property
    @abstractmethod
    def moving(self) -> Robot:
        """The robot that the model is written for, with the task's limits."""

    @property
    @abstractmethod
    def sequence(self) -> MotionSequence:
        """The whole motion of every joint: the approach, the exciting motion, the return."""

    @property
    @abstractmethod
    def broken(self) -> tuple[str, ...]:
        """Labels of the limits that did not hold when it was designed, on approach and return too."""

    @property
    @abstractmethod
    def coefficients_sha256(self) -> str:
        """Hash of the motion's coefficients, as ``design.json`` has it."""

    @property
    def file_sha256(self) -> str | None:
        """Hash of the ``design.json`` that it was read from; None for a design that was not read from a folder."""
        return None if self.folder is None else sha256_of(self.folder / "design.json")

    @property
    @abstractmethod
    def condition_number(self) -> float:
        """cond(W) in the left-to-right base, SI, unscaled; infinite where it is not finite."""

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
