"""Nonlinear limits on a grid, as a solver sees them: values, and exact derivatives where they come near a bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from constraints.nonlinear import NonlinearConstraint
from excite.trajectories.family import LinearFamily
from regressors.partial import PartialMotion
from regressors.samples import Array, Index, Samples

RESERVE = 0.005  # of a function's scale, kept for what happens between the instants of the grid


@dataclass(frozen=True, eq=False)
class NonlinearGrid:
    """One nonlinear constraint at the N instants of a grid.

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

    def samples(self, x: Array, instants: Index | None = None) -> Samples:
        """Motion of the joints with coefficients x of the moving coordinates, at all instants or at some."""
        motion = [(B if instants is None else B[instants]) @ x.T @ self.motion.matrix.T for B in self.basis]
        motion[0] = motion[0] + self.motion.offset
        q, dq, ddq = motion
        return Samples(np.arange(float(len(q))), q, dq, ddq, np.zeros_like(q))

    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""
        return self.constraint.values(self.samples(x)).T

    def uses(self, values: Array) -> Array:
        """How much of the room each value uses, shape (k, N): 1 at a bound, more beyond, 0 a scale away from both."""
        scale = self.constraint.scale[:, None]
        above, below = self.upper[:, None] - values, values - self.lower[:, None]
        return np.asarray(1.0 - np.minimum(above, below) / scale)

    def slopes(self, x: Array, instants: Index) -> Array:
        """Derivatives with respect to the flat x at some instants, shape (len(instants), k, n size)."""
        slopes = self.constraint.slopes(self.samples(x, instants))
        n, N = self.constraint.joints, self.motion.matrix
        found = np.zeros((instants.size, slopes.shape[1], *x.shape))
        for order, B in enumerate(self.basis):
            part = slopes[:, :, order * n : (order + 1) * n] @ N
            found += part[:, :, :, None] * B[instants][:, None, None, :]
        return found.reshape(instants.size, slopes.shape[1], x.size)

    def holds(self, x: Array) -> bool:
        """True if every value is within the bounds with the reserve."""
        values = self.values(x)
        return bool(np.all(values <= self.upper[:, None]) and np.all(values >= self.lower[:, None]))
