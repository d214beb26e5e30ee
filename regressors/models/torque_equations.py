"""Equations that are joint torques along the coordinates of a motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regressors.models.partial import PartialMotion
from regressors.samples import Array

if TYPE_CHECKING:
    from regressors.models.model import RegressorModel


@dataclass(frozen=True, eq=False)
class TorqueEquations:
    """Torques of moving coordinates, ``N' tau`` with ``q = N s + q0``, from which equations of motion are built.

    Parameters
    ----------
    model : RegressorModel
        Model of the torques of all joints, one row each.
    motion : PartialMotion
        N and q0.
    used : tuple of int
        Moving coordinates whose torques are equations.
    """

    model: RegressorModel
    motion: PartialMotion
    used: tuple[int, ...]

    @property
    def directions(self) -> Array:
        """Columns of N that are used, shape (n, r)."""
        return self.motion.matrix[:, self.used]

    @property
    def every_joint(self) -> bool:
        """True if the equations are the torques of all joints themselves."""
        return np.array_equal(self.directions, np.eye(len(self.motion.offset)))

    @property
    def unused(self) -> tuple[str, ...]:
        """Moving coordinates without an equation; if there are any, the torques do not determine the motion."""
        return tuple(label for k, label in enumerate(self.motion.labels) if k not in self.used)

    def speeds(self, dq: Array) -> Array:
        """Velocity of each equation's coordinate, shape (N, r), from the joints', shape (N, n) [rad/s or m/s]."""
        if self.motion.complete:
            return dq[:, self.used]
        return np.asarray(dq @ np.linalg.pinv(self.motion.matrix)[list(self.used)].T)
