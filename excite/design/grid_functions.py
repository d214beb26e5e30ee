"""Limited functions of the moving coordinates' motion on a grid: linear ones, and those of the joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.trajectories.motion_at_instants import GridMotion
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index, Samples


class GridFunction(ABC):
    """k functions of the motion y of n coordinates at one instant.

    Attributes
    ----------
    constraint : LinearConstraint or NonlinearConstraint
        Constraint that they belong to.
    linear : bool
        Whether they are linear in the motion.
    """

    constraint: LinearConstraint | NonlinearConstraint
    linear: bool

    @property
    @abstractmethod
    def derivatives(self) -> tuple[int, ...]:
        """Derivatives of y that they depend on, 0 for position to 3 for jerk."""

    @abstractmethod
    def values(self, x: Array, grid: GridMotion) -> Array:
        """Values at all N instants, shape (k, N)."""

    @abstractmethod
    def slopes(self, x: Array, grid: GridMotion, instants: Index) -> Array:
        """Derivatives with respect to the `derivatives` of y at some instants, shape (T, k, derivatives, n)."""


@dataclass(frozen=True, eq=False)
class LinearFunction(GridFunction):
    """``A y^(d)`` of a constraint on the moving coordinates; its offset is part of the bounds.

    Parameters
    ----------
    constraint : LinearConstraint
    """

    constraint: LinearConstraint
    linear = True

    @property
    def derivatives(self) -> tuple[int, ...]:
        """The limited derivative."""
        return (self.constraint.derivative,)

    def values(self, x: Array, grid: GridMotion) -> Array:
        """Values at all N instants, shape (k, N)."""
        return grid.combined(x, self.constraint.matrix, self.constraint.derivative)

    def slopes(self, x: Array, grid: GridMotion, instants: Index) -> Array:
        """The matrix, for every instant."""
        A = self.constraint.matrix
        return np.broadcast_to(A[:, None, :], (instants.size, len(A), 1, A.shape[1]))


@dataclass(frozen=True, eq=False)
class JointFunction(GridFunction):
    """``g(q, dq, ddq)`` of torques, the tool or distances.

    Parameters
    ----------
    constraint : NonlinearConstraint
        k functions of all joints.
    motion : PartialMotion
        Map from the moving coordinates to the joints.
    """

    constraint: NonlinearConstraint
    motion: PartialMotion
    linear = False

    @property
    def derivatives(self) -> tuple[int, ...]:
        """Position, velocity and acceleration."""
        return (0, 1, 2)

    def _samples(self, x: Array, grid: GridMotion, instants: Index | None = None) -> Samples:
        q, dq, ddq = (grid.values(x, d, instants) @ self.motion.matrix.T for d in self.derivatives)
        return Samples(np.arange(float(len(q))), q + self.motion.offset, dq, ddq, np.zeros_like(q))

    def values(self, x: Array, grid: GridMotion) -> Array:
        """Values at all N instants, shape (k, N)."""
        return self.constraint.values(self._samples(x, grid)).T

    def slopes(self, x: Array, grid: GridMotion, instants: Index) -> Array:
        """Derivatives with respect to position, velocity and acceleration of the moving coordinates."""
        slopes = self.constraint.slopes(self._samples(x, grid, instants))
        parts = slopes.reshape(instants.size, slopes.shape[1], 3, self.constraint.joints)
        return parts if self.motion.complete else np.asarray(parts @ self.motion.matrix)
