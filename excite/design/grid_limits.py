"""All limits of a motion on the grid of its family: those linear in the motion, and those of torques and distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint, StackedConstraint
from excite.design.grid_constraint import GridConstraint
from excite.design.grid_functions import JointFunction
from excite.design.grid_joints import GridJoints
from excite.trajectories.motion_at_instants import GridMotion
from regressors.models.partial import PartialMotion
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class GridLimits:
    """Limits of a design problem."""

    linear: tuple[GridConstraint, ...]  # on positions and their derivatives: linear in the motion, not necessarily in x
    nonlinear: tuple[GridConstraint, ...] = ()  # on torques, the tool and distances
    stated: tuple[GridConstraint, ...] = ()  # on torques and distances by default, left out until a motion breaks them
    # the nonlinear ones as a search evaluates them: those that were asked for as one
    together: tuple[GridConstraint, ...] = ()

    @classmethod
    def imposed(
        cls,
        grid: GridMotion,
        linear: Sequence[LinearConstraint],
        nonlinear: Sequence[NonlinearConstraint],
        motion: PartialMotion,
        stated: Sequence[NonlinearConstraint] = (),
    ) -> GridLimits:
        """Build the constraints on a grid."""
        joints = GridJoints(grid, motion)
        each = tuple(GridConstraint.on_joints(limit, joints) for limit in nonlinear)
        return cls(
            tuple(GridConstraint.on_coordinates(limit, grid) for limit in linear),
            each,
            tuple(GridConstraint.on_joints(limit, joints) for limit in stated),
            each if len(each) < 2 else (GridConstraint.on_joints(StackedConstraint(nonlinear), joints),),
        )

    def with_broken(self, x: Array) -> GridLimits:
        """With those that hold by default, but not for this x, among the others; itself if there are none."""
        broken = tuple(limit for limit in self.stated if not limit.holds(x))
        if not broken:
            return self
        kept = tuple(limit for limit in self.stated if limit not in broken)
        return GridLimits(self.linear, (*self.nonlinear, *broken), kept, (*self.together, *broken))

    def with_expected(self, motions: Sequence[Array]) -> GridLimits:
        """With those that hold by default, but not for all of some motions, among the others, evaluated as one."""
        expected = tuple(limit for limit in self.stated if not all(limit.holds(x) for x in motions))
        if not expected:
            return self
        kept = tuple(limit for limit in self.stated if limit not in expected)
        imposed = (*self.nonlinear, *expected)
        functions = [limit.function for limit in imposed if isinstance(limit.function, JointFunction)]
        stacked = StackedConstraint([function.constraint for function in functions])
        return GridLimits(self.linear, imposed, kept, (GridConstraint.on_joints(stacked, functions[0].joints),))

    @property
    def linear_in_x(self) -> tuple[GridConstraint, ...]:
        """Constraints whose rows are the same at every x."""
        return tuple(limit for limit in (*self.linear, *self.nonlinear) if limit.linear)

    @property
    def nonlinear_in_x(self) -> tuple[GridConstraint, ...]:
        """Constraints that enter a programme as tangents."""
        return tuple(limit for limit in (*self.linear, *self.together) if not limit.linear)

    def linear_values(self, x: Array) -> list[Array]:
        """Values of the linear limits' functions on the grid."""
        return [limit.values(x) for limit in self.linear]

    def largest_part(self, values: list[Array], step: Array, end: Array) -> float:
        """Largest fraction >= 0 of a step that stays within the linear limits; see `GridConstraint.change`."""
        parts = (
            limit.largest_part(value, limit.change(value, step, end))
            for limit, value in zip(self.linear, values, strict=True)
        )
        return max(min(parts, default=np.inf), 0.0)

    def nonlinear_hold(self, x: Array) -> bool:
        """True if every nonlinear limit holds on the grid."""
        return all(limit.holds(x) for limit in self.together)

    def violation(self, x: Array) -> float:
        """Largest excess over a linear limit, relative to half its range; <= 0 inside."""
        return max((limit.excess(limit.values(x)) for limit in self.linear), default=-np.inf)
