"""A log with the robot that it should belong to, and findings about it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from excite.logs.excitation import mean_speed, moves
from excite.logs.log import Log
from regressors.robot.robot import Limits, Robot
from regressors.samples import Array

_SHORTEST_PATH = 0.01  # [rad or m]


@dataclass(frozen=True)
class Finding:
    """One finding about a log; the log is refused if it is `wrong`, else the finding becomes a note."""

    wrong: bool
    text: str


@dataclass(frozen=True, eq=False)
class Case:
    """A log with the robot's limits, in the log's order of joints."""

    log: Log
    robot: Robot
    should_move: tuple[str, ...] | None

    @cached_property
    def limits(self) -> Limits:
        """Limits of the log's joints."""
        return self.robot.limits.take([self.robot.joint_names.index(name) for name in self.log.joints])

    @cached_property
    def revolute(self) -> NDArray[np.bool_]:
        """Which of the log's joints are revolute."""
        kinds = {joint.name: joint.kind for joint in self.robot.joints}
        return np.array([kinds[name] == "revolute" for name in self.log.joints])

    @cached_property
    def _moves(self) -> NDArray[np.bool_]:
        return moves(self.log)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Instants at which some joint moves, shape (N,)."""
        return np.asarray(np.any(self._moves, axis=1))

    @cached_property
    def moved(self) -> NDArray[np.bool_]:
        """Which joints move far enough to be judged, shape (n,)."""
        return np.asarray(np.any(self._moves, axis=0) & (np.ptp(self.log.q, axis=0) > _SHORTEST_PATH))

    @cached_property
    def speed(self) -> Array:
        """Mean speed over short spans, shape (N, n)."""
        return mean_speed(self.log)
