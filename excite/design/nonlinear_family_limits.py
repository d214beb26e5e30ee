"""Limits on a grid of a family that is not linear in x: all of them are curved there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.design.grid_limits import BEND, RESERVE, CurvedLimit, Tangent
from excite.trajectories.nonlinear import CurvedFamily, CurvedGrid
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index, Samples


@dataclass(frozen=True, eq=False)
class BentTangent(Tangent):
    """Slopes of k functions by derivatives of the motion, and of those by x.

    Parameters
    ----------
    slopes : ndarray, shape (T, k, orders, n)
    jacobians : sequence of ndarray, shape (T, n, x.size)
        One for each order of derivative.
    """

    slopes: Array
    jacobians: Sequence[Array]

    def changes(self, d: Array) -> Array:
        """Changes by a step d, shape (k, T)."""
        motion = np.stack([J @ d for J in self.jacobians], axis=1)
        return np.asarray(np.einsum("tkon,ton->kt", self.slopes, motion))

    def rows(self, function: Index, place: Index) -> Array:
        """Derivatives by x of one function each at one instant each, shape (rows, x.size)."""
        found = np.zeros((function.size, self.jacobians[0].shape[2]))
        for order, J in enumerate(self.jacobians):
            found += (self.slopes[place, function, order][:, None, :] @ J[place])[:, 0]
        return found


@dataclass(frozen=True, eq=False)
class BentLimit(CurvedLimit):
    """A constraint that is linear in the motion.

    Parameters
    ----------
    matrix : ndarray, shape (k, n)
        ``A`` of ``lower <= A y^(d) <= upper``.
    derivative : int
        d.
    grid : CurvedGrid
    lower, upper : ndarray, shape (k,)
        Tightened bounds, less the constraint's offset.
    """

    matrix: Array
    derivative: int
    grid: CurvedGrid
    lower: Array
    upper: Array

    @classmethod
    def of(cls, constraint: LinearConstraint, family: CurvedFamily, count: int) -> BentLimit:
        """Constraint on a grid of ``count`` instants or more."""
        factor = family.grid_factor(count, constraint.derivative)
        half = 0.5 * (constraint.upper - constraint.lower) * factor
        centre = 0.5 * (constraint.lower + constraint.upper) - constraint.offset
        grid = CurvedGrid(family, count)
        return cls(constraint.matrix, constraint.derivative, grid, centre - half, centre + half)

    @property
    def scale(self) -> Array:
        """Half the range, shape (k,)."""
        return np.asarray(0.5 * (self.upper - self.lower))

    @property
    def reserve(self) -> Array:
        """None: what a step's curvature breaks is drawn inside."""
        return np.zeros_like(self.lower)

    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""
        return np.asarray(self.matrix @ self.grid.values(x, self.derivative).T)

    def tangent(self, x: Array, instants: Index) -> BentTangent:
        """The functions at some instants, linear about x."""
        slopes = np.broadcast_to(self.matrix[:, None, :], (instants.size, len(self.matrix), 1, self.matrix.shape[1]))
        return BentTangent(slopes, [self.grid.jacobian(x, self.derivative, instants)])


@dataclass(frozen=True, eq=False)
class BentNonlinear(CurvedLimit):
    """A constraint on torques, the tool or distances.

    Parameters
    ----------
    constraint : NonlinearConstraint
        k functions of all joints.
    motion : PartialMotion
        From the moving coordinates to the joints.
    grid : CurvedGrid
    lower, upper : ndarray, shape (k,)
        Bounds with the reserve.
    """

    constraint: NonlinearConstraint
    motion: PartialMotion
    grid: CurvedGrid
    lower: Array
    upper: Array

    @classmethod
    def of(
        cls, constraint: NonlinearConstraint, family: CurvedFamily, motion: PartialMotion, count: int
    ) -> BentNonlinear:
        """Constraint on a grid of ``count`` instants or more."""
        kept = RESERVE * constraint.scale
        return cls(constraint, motion, CurvedGrid(family, count), constraint.lower + kept, constraint.upper - kept)

    @property
    def scale(self) -> Array:
        """Size of each function, shape (k,)."""
        return self.constraint.scale

    @property
    def reserve(self) -> Array:
        """A part of the scale."""
        return BEND * self.constraint.scale

    def _samples(self, x: Array, instants: Index | None = None) -> Samples:
        q, dq, ddq = (self.grid.values(x, d, instants) @ self.motion.matrix.T for d in range(3))
        return Samples(np.arange(float(len(q))), q + self.motion.offset, dq, ddq, np.zeros_like(q))

    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""
        return self.constraint.values(self._samples(x)).T

    def tangent(self, x: Array, instants: Index) -> BentTangent:
        """The functions at some instants, linear about x."""
        slopes = self.constraint.slopes(self._samples(x, instants))
        parts = slopes.reshape(instants.size, slopes.shape[1], 3, self.constraint.joints) @ self.motion.matrix
        return BentTangent(parts, [self.grid.jacobian(x, d, instants) for d in range(3)])
