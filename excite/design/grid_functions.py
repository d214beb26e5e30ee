"""Limited functions of a motion on a grid: linear ones of the moving coordinates, and those of the joints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.design.grid_joints import GridJoints
from excite.trajectories.motion_at_instants import GridMotion
from regressors.samples import Array, Index

#: Derivatives of one function at one of the instants per row, shape (rows, derivatives, n), from the numbers of both.
Slopes = Callable[[Index, Index], Array]


class GridFunction(ABC):
    """k functions of the motion y of n coordinates at each of N instants."""

    constraint: LinearConstraint | NonlinearConstraint  # constraint that they belong to
    linear: bool  # whether they are linear in the motion

    @property
    @abstractmethod
    def derivatives(self) -> tuple[int, ...]:
        """Derivatives of y that they depend on, 0 for position to 3 for jerk."""

    @property
    @abstractmethod
    def varies(self) -> NDArray[np.bool_]:
        """Which of them depend on the motion at all, shape (k,)."""

    @abstractmethod
    def values(self, x: Array, instants: Index | slice | None = None) -> Array:
        """Values at all N instants or some, shape (k, N)."""

    @abstractmethod
    def slopes(self, x: Array, instants: Index) -> Slopes:
        """Derivatives with respect to the `derivatives` of y at some instants."""


@dataclass(frozen=True, eq=False)
class LinearFunction(GridFunction):
    """``A y^(d)`` of a constraint on the moving coordinates; its offset is part of the bounds."""

    constraint: LinearConstraint
    grid: GridMotion
    linear = True

    @property
    def derivatives(self) -> tuple[int, ...]:
        """The limited derivative."""
        return (self.constraint.derivative,)

    @property
    def varies(self) -> NDArray[np.bool_]:
        """All with an entry in A."""
        return np.asarray(self.constraint.matrix.any(axis=1))

    def values(self, x: Array, instants: Index | slice | None = None) -> Array:
        """Values at all N instants or some, shape (k, N)."""
        values = self.grid.combined(x, self.constraint.matrix, self.constraint.derivative)
        return values if instants is None else values[:, instants]

    def slopes(self, x: Array, instants: Index) -> Slopes:
        """Rows of the matrix, for every instant."""
        return lambda function, _: self.constraint.matrix[function][:, None, :]


@dataclass(frozen=True, eq=False)
class JointFunction(GridFunction):
    """``g(q, dq, ddq)`` of torques, the tool or distances."""

    constraint: NonlinearConstraint  # k functions of all joints
    joints: GridJoints  # motion of all joints on the grid
    linear = False

    @property
    def derivatives(self) -> tuple[int, ...]:
        """Those of position, velocity and acceleration that they depend on."""
        return self.constraint.derivatives

    @property
    def varies(self) -> NDArray[np.bool_]:
        """Those with a nonzero in the Jacobian."""
        return self.constraint.varies

    def values(self, x: Array, instants: Index | slice | None = None) -> Array:
        """Values at all N instants or some, shape (k, N)."""
        return self.constraint.at_instants(self.joints(x, instants))

    def slopes(self, x: Array, instants: Index) -> Slopes:
        """Derivatives with respect to the moving coordinates' position, velocity and acceleration, where used."""
        of_joints = self.constraint.slopes_at_instants(self.joints(x, instants))
        n, motion = self.constraint.joints, self.joints.motion
        orders = np.array(self.derivatives)

        def slopes(function: Index, place: Index) -> Array:
            columns = (orders[:, None] * n + np.arange(n)).ravel()
            parts = of_joints(function, place, columns).reshape(function.size, orders.size, n)
            return parts if motion.complete else np.asarray(parts @ motion.matrix)

        return slopes
