"""One constraint on the grid of a family, for solvers: values, and linearisations near its bounds.

Bounds are tightened so that constraints that hold on the grid hold at all times: rigorously, by the family's factor,
for functions that are linear in the motion; by a reserve, which the design's certificate checks, for the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.design.grid_functions import GridFunction, JointFunction, LinearFunction, Slopes
from excite.design.grid_joints import GridJoints, LastResult
from excite.design.sampled_use import BoundsCheck, SampledUse, sampled_use
from excite.trajectories.motion_at_instants import GridMotion, MotionTangent
from regressors.samples import Array, Index

_RESERVE = 0.005  # of a function's scale, kept in reserve for the time between the instants of the grid
_CURVATURE = 0.01  # of the scale: reserve for the curvature along a step


@dataclass(frozen=True, eq=False)
class ConstraintTangent:
    """Functions at T instants of a grid, linearised about one x."""

    slopes: Slopes  # derivatives with respect to the motion, see `excite.design.grid_functions.Slopes`
    motion: MotionTangent  # the motion, linearised about x

    def rows(self, function: Index, place: Index) -> Array:
        """Derivatives with respect to the flat x, one function at one of the instants per row, shape (rows, x.size)."""
        return self.motion.rows(self.slopes(function, place), place)


@dataclass(frozen=True, eq=False)
class GridConstraint:
    """``lower <= g <= upper`` for k functions of the motion at the N instants of a grid."""

    function: GridFunction  # g
    grid: GridMotion  # the motion at the instants as a function of x
    lower: Array  # (k,) bounds, tightened for the time between the instants
    upper: Array  # (k,)
    scale: Array  # (k,) magnitude of each function
    reserve: Array  # (k,) reserve that a programme on tangents keeps for the curvature of its step

    @classmethod
    def on_coordinates(cls, constraint: LinearConstraint, grid: GridMotion) -> GridConstraint:
        """Make one from a constraint that is linear in the motion of the moving coordinates."""
        middle = 0.5 * (constraint.lower + constraint.upper)
        half = 0.5 * (constraint.upper - constraint.lower) * grid.factor(constraint.derivative)
        centre = middle - constraint.offset
        lower, upper = centre - half, centre + half
        scale = np.asarray(0.5 * (upper - lower))
        return cls(LinearFunction(constraint, grid), grid, lower, upper, scale, np.zeros_like(lower))

    @classmethod
    def on_joints(cls, constraint: NonlinearConstraint, joints: GridJoints) -> GridConstraint:
        """Make one from a constraint on torques, the tool or distances, as a function of all joints."""
        scale, kept = constraint.scale, _RESERVE * constraint.scale
        lower, upper = constraint.lower + kept, constraint.upper - kept
        return cls(JointFunction(constraint, joints), joints.grid, lower, upper, scale, _CURVATURE * scale)

    @property
    def linear(self) -> bool:
        """Whether its functions are linear in x, so that one tangent is exact everywhere."""
        return self.function.linear and self.grid.linear

    @cached_property
    def sampled(self) -> LastResult[SampledUse]:
        """The functions at the instants that a search looks at, as a function of x, see `sampled_use`."""
        return LastResult(lambda x: sampled_use(self, x))

    def values(self, x: Array) -> Array:
        """Values of the k functions at the N instants, shape (k, N)."""
        return self.function.values(x)

    def tangent(self, x: Array, instants: Index | None = None) -> ConstraintTangent:
        """The functions at all or some instants, linearised about x."""
        if instants is None:
            instants = np.arange(self.values(x).shape[1])
        slopes = self.function.slopes(x, instants)
        return ConstraintTangent(slopes, self.grid.tangent(x, self.function.derivatives, instants))

    def uses(self, values: Array) -> Array:
        """Use of the bounds by each value, shape (k, N): 1 at a bound, more beyond, 0 one scale away from both."""
        room = self.upper[:, None] - values
        np.minimum(room, values - self.lower[:, None], out=room)
        room /= self.scale[:, None]
        return np.asarray(np.subtract(1.0, room, out=room))

    def excess(self, values: Array) -> float:
        """Largest excess over a bound, relative to the scale; <= 0 inside."""
        beyond = np.maximum(values - self.upper[:, None], self.lower[:, None] - values) / self.scale[:, None]
        return float(beyond.max(initial=-np.inf))

    def holds(self, x: Array) -> bool:
        """True if every value is within the bounds, as far as a search looks, see `sampled_use`."""
        return self._check(x)

    @cached_property
    def _check(self) -> BoundsCheck:
        return BoundsCheck(self)

    def change(self, value: Array, step: Array, end: Array) -> Array:
        """Change of the values by a step that leaves the shape unchanged, shape (k, N)."""  # value (k, N)
        return self.values(step) if self.linear else self.values(end) - value

    def largest_part(self, value: Array, change: Array) -> float:
        """Largest s for which ``value + s change`` stays within the bounds, each of shape (k, N); infinite if any."""
        room = np.where(change > 0, self.upper[:, None] - value, self.lower[:, None] - value)
        ratio = np.divide(room, change, out=np.full_like(room, np.inf), where=change != 0)
        return float(ratio.min(initial=np.inf))
