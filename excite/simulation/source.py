"""Source of a simulated motion: a design, or a file of a friction plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from excite.simulation.ramps import GivenTorque
from excite.simulation.reference import Reference
from excite.tasks.task import Task
from regressors.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class MotionSource:
    """A motion and its origin.

    Parameters
    ----------
    robot : Robot
        The whole robot.
    task : Task
        Gives the moving joints.
    motion : Reference
    ramps : GivenTorque or None
    file : Path or None
        File of the motion, where it is not the design's own.
    origin : mapping
        Design or friction plan, for the sidecar of a log.
    """

    robot: Robot
    task: Task
    motion: Reference
    ramps: GivenTorque | None
    file: Path | None
    origin: Mapping[str, Any]

    @property
    def planned(self) -> bool:
        """True if the motion is from a friction plan."""
        return self.origin["friction_plan"] is not None
