"""Limits that are curved in x, on a grid, as a solver sees them: values, and tangents where they come near a bound."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from constraints.nonlinear import NonlinearConstraint
from excite.trajectories.family import LinearFamily
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index, Samples

RESERVE = 0.005  # of a function's scale, kept for what happens between the instants of the grid
BEND = 0.01  # of the scale: what the curvature of a step may take


class Tangent(ABC):
    """k functions at some instants, linear about one x."""

    @abstractmethod
    def changes(self, d: Array) -> Array:
        """Changes by a flat step d, shape (k, instants)."""

    @abstractmethod
    def rows(self, function: Index, place: Index) -> Array:
        """Derivatives by the flat x of one function each at one of the instants each, shape (rows, x.size)."""


class CurvedLimit(ABC):
    """Bounds on k functions of x at the N instants of a grid.

    Attributes
    ----------
    lower, upper : ndarray, shape (k,)
        Bounds with what is kept for the instants between.
    """

    lower: Array
    upper: Array

    @property
    @abstractmethod
    def scale(self) -> Array:
        """Size of each function, shape (k,)."""

    @property
    @abstractmethod
    def reserve(self) -> Array:
        """What a tangent's programme leaves to the curvature of its step, shape (k,)."""

    @abstractmethod
    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""

    @abstractmethod
    def tangent(self, x: Array, instants: Index) -> Tangent:
        """The functions at some instants, linear about x."""

    def uses(self, values: Array) -> Array:
        """How much of the room each value uses, shape (k, N): 1 at a bound, more beyond, 0 a scale away from both."""
        scale = self.scale[:, None]
        above, below = self.upper[:, None] - values, values - self.lower[:, None]
        return np.asarray(1.0 - np.minimum(above, below) / scale)

    def holds(self, x: Array) -> bool:
        """True if every value is within the bounds with the reserve."""
        values = self.values(x)
        return bool(np.all(values <= self.upper[:, None]) and np.all(values >= self.lower[:, None]))


@dataclass(frozen=True, eq=False)
class NonlinearGrid(CurvedLimit):
    """One nonlinear constraint at the N instants of a linear family's grid.

    Parameters
    ----------
    constraint : NonlinearConstraint
        k functions of all joints.
    motion : PartialMotion
        From the moving coordinates to the joints.
    basis : tuple of ndarray, shape (N, size)
        Of position, velocity and acceleration.
    lower, upper : ndarray, shape (k,)
        Bounds with the reserve.
    """

    constraint: NonlinearConstraint
    motion: PartialMotion
    basis: tuple[Array, Array, Array]
    lower: Array
    upper: Array

    @classmethod
    def of(
        cls, constraint: NonlinearConstraint, family: LinearFamily, motion: PartialMotion, count: int
    ) -> NonlinearGrid:
        """Constraint on a family's grid of ``count`` instants."""
        time = family.grid(count)
        position, velocity, acceleration = (family.basis(time, d) for d in range(3))
        reserve = RESERVE * constraint.scale
        basis = (position, velocity, acceleration)
        return cls(constraint, motion, basis, constraint.lower + reserve, constraint.upper - reserve)

    @property
    def scale(self) -> Array:
        """Size of each function, shape (k,)."""
        return self.constraint.scale

    @property
    def reserve(self) -> Array:
        """A part of the scale."""
        return BEND * self.constraint.scale

    def samples(self, x: Array, instants: Index | None = None) -> Samples:
        """Motion of the joints with coefficients x of the moving coordinates, at all instants or at some."""
        motion = [(B if instants is None else B[instants]) @ x.T @ self.motion.matrix.T for B in self.basis]
        motion[0] = motion[0] + self.motion.offset
        q, dq, ddq = motion
        return Samples(np.arange(float(len(q))), q, dq, ddq, np.zeros_like(q))

    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""
        return self.constraint.values(self.samples(x)).T

    def tangent(self, x: Array, instants: Index) -> Tangent:
        """The functions at some instants, linear about x."""
        return _GridTangent(self, self.motion_slopes(x, instants), instants, x.shape)

    def motion_slopes(self, x: Array, instants: Index) -> Array:
        """Derivatives with respect to position, velocity and acceleration of the n moving coordinates at some instants.

        Shape (len(instants), k, 3, n).
        """
        slopes = self.constraint.slopes(self.samples(x, instants))
        parts = slopes.reshape(instants.size, slopes.shape[1], 3, self.constraint.joints)
        return parts if self.motion.complete else np.asarray(parts @ self.motion.matrix)

    def changes(self, motion_slopes: Array, d: Array, instants: Index) -> Array:
        """Linear change of the functions at some instants by a step d of the coefficients, shape (k, len(instants))."""
        motion = np.stack([B[instants] @ d.T for B in self.basis], axis=1)
        size = 3 * motion_slopes.shape[3]
        flat = motion_slopes.reshape(*motion_slopes.shape[:2], size)
        return np.asarray((flat @ motion.reshape(instants.size, size, 1))[:, :, 0].T)

    def rows(self, motion_slopes: Array, instants: Index) -> Array:
        """Derivatives with respect to the flat x of one function each at some instants, shape (len(instants), n size).

        Parameters
        ----------
        motion_slopes : ndarray, shape (len(instants), 3, n)
        instants : ndarray of int
        """
        rows = sum(motion_slopes[:, order, :, None] * B[instants][:, None, :] for order, B in enumerate(self.basis))
        return np.asarray(rows).reshape(instants.size, motion_slopes.shape[2] * self.basis[0].shape[1])


@dataclass(frozen=True, eq=False)
class _GridTangent(Tangent):
    """Slopes by the motion, which the basis turns into those by x where they are asked for."""

    grid: NonlinearGrid
    slopes: Array
    instants: Index
    shape: tuple[int, ...]

    def changes(self, d: Array) -> Array:
        return self.grid.changes(self.slopes, d.reshape(self.shape), self.instants)

    def rows(self, function: Index, place: Index) -> Array:
        return self.grid.rows(self.slopes[place, function], self.instants[place])
