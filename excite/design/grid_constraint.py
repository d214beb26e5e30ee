"""One constraint on the grid of a family, as solvers see it: values, and tangents where they come near a bound.

Bounds are tightened so that what holds on the grid holds at all times: for functions that are linear in the motion by
the family's factor, exactly; for the others by a reserve, which the certificate of a design judges afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.design.grid_functions import GridFunction, JointFunction, LinearFunction
from excite.trajectories.motion_at_instants import GridMotion, MotionTangent
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index

_RESERVE = 0.005  # of a function's scale, kept for what happens between the instants of the grid
_CURVATURE = 0.01  # of the scale: what the curvature of a step may take


@dataclass(frozen=True, eq=False)
class ConstraintTangent:
    """k functions at T instants of a grid, linear about one x.

    Parameters
    ----------
    slopes : ndarray, shape (T, k, derivatives, n)
        Derivatives by the motion of the n coordinates.
    motion : MotionTangent
        The motion, linear about x.
    """

    slopes: Array
    motion: MotionTangent

    def changes(self, step: Array) -> Array:
        """Changes by a flat step of x, shape (k, T)."""
        return np.asarray(np.einsum("tkdn,tdn->kt", self.slopes, self.motion.changes(step)))

    def rows(self, function: Index, place: Index) -> Array:
        """Derivatives by the flat x of one function each at one of the instants each, shape (rows, x.size)."""
        return self.motion.rows(self.slopes[place, function], place)


@dataclass(frozen=True, eq=False)
class GridConstraint:
    """``lower <= g <= upper`` for k functions of the motion at the N instants of a grid.

    Parameters
    ----------
    function : GridFunction
        g.
    grid : GridMotion
        The motion at the instants as a function of x.
    lower, upper : ndarray, shape (k,)
        Bounds with what is kept for the instants between.
    scale : ndarray, shape (k,)
        Size of each function.
    reserve : ndarray, shape (k,)
        What a programme on tangents leaves to the curvature of its step.
    """

    function: GridFunction
    grid: GridMotion
    lower: Array
    upper: Array
    scale: Array
    reserve: Array

    @classmethod
    def on_coordinates(cls, constraint: LinearConstraint, grid: GridMotion) -> GridConstraint:
        """A constraint that is linear in the motion of the coordinates, which it is a function of."""
        middle = 0.5 * (constraint.lower + constraint.upper)
        half = 0.5 * (constraint.upper - constraint.lower) * grid.factor(constraint.derivative)
        centre = middle - constraint.offset
        lower, upper = centre - half, centre + half
        scale = np.asarray(0.5 * (upper - lower))
        return cls(LinearFunction(constraint), grid, lower, upper, scale, np.zeros_like(lower))

    @classmethod
    def on_joints(cls, constraint: NonlinearConstraint, grid: GridMotion, motion: PartialMotion) -> GridConstraint:
        """A constraint on torques, the tool or distances, a function of all joints."""
        scale, kept = constraint.scale, _RESERVE * constraint.scale
        lower, upper = constraint.lower + kept, constraint.upper - kept
        return cls(JointFunction(constraint, motion), grid, lower, upper, scale, _CURVATURE * scale)

    @property
    def linear(self) -> bool:
        """Whether its functions are linear in x: then one tangent holds everywhere, and exactly."""
        return self.function.linear and self.grid.linear

    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""
        return self.function.values(x, self.grid)

    def tangent(self, x: Array, instants: Index | None = None) -> ConstraintTangent:
        """The functions at all instants or at some, linear about x."""
        if instants is None:
            instants = np.arange(self.values(x).shape[1])
        slopes = self.function.slopes(x, self.grid, instants)
        return ConstraintTangent(slopes, self.grid.tangent(x, self.function.derivatives, instants))

    def uses(self, values: Array) -> Array:
        """How much of the room each value uses, shape (k, N): 1 at a bound, more beyond, 0 a scale away from both."""
        above, below = self.upper[:, None] - values, values - self.lower[:, None]
        return np.asarray(1.0 - np.minimum(above, below) / self.scale[:, None])

    def excess(self, values: Array) -> float:
        """Largest excess over a bound, as part of the scale; <= 0 inside."""
        beyond = np.maximum(values - self.upper[:, None], self.lower[:, None] - values) / self.scale[:, None]
        return float(beyond.max(initial=-np.inf))

    def holds(self, x: Array) -> bool:
        """True if every value is within the bounds."""
        values = self.values(x)
        return bool(np.all(values <= self.upper[:, None]) and np.all(values >= self.lower[:, None]))

    def change(self, value: Array, step: Array, end: Array) -> Array:
        """What a step that leaves the shape as it is adds to the values, shape (k, N).

        Parameters
        ----------
        value : ndarray, shape (k, N)
            Values where it begins.
        step : ndarray
            Of x: it tells the change where the functions are linear in x.
        end : ndarray
            The x where it ends: it tells the change elsewhere.
        """
        return self.values(step) if self.linear else self.values(end) - value

    def largest_part(self, value: Array, change: Array) -> float:
        """Largest s for which ``value + s change`` stays within the bounds, each of shape (k, N); infinite if any."""
        room = np.where(change > 0, self.upper[:, None] - value, self.lower[:, None] - value)
        ratio = np.divide(room, change, out=np.full_like(room, np.inf), where=change != 0)
        return float(ratio.min(initial=np.inf))
