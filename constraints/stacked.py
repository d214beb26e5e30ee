"""Several nonlinear limits as one, so that a search evaluates them together: they share the robot's kinematics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from constraints.nonlinear import NonlinearConstraint
from regressors.samples import Array, Index


class StackedConstraint(NonlinearConstraint):
    """The functions of several constraints on the same coordinates, one below the other.

    Parameters
    ----------
    parts : sequence of NonlinearConstraint
        At least one.
    """

    def __init__(self, parts: Sequence[NonlinearConstraint]) -> None:
        self.parts = tuple(parts)
        self._first = np.cumsum([0, *(len(part.lower) for part in parts)])
        super().__init__(
            parts[0].joints,
            lambda q, dq, ddq: ca.vertcat(*(part.expression(q, dq, ddq) for part in parts)),
            np.concatenate([part.lower for part in parts]),
            np.concatenate([part.upper for part in parts]),
            np.concatenate([part.scale for part in parts]),
            tuple(label for part in parts for label in part.labels),
            tuple(unit for part in parts for unit in part.units),
            self._shown,
        )

    def _shown(self, values: Array) -> Array:
        split = np.split(values, self._first[1:-1], axis=-1)
        return np.concatenate([part.shown(own) for part, own in zip(self.parts, split, strict=True)], axis=-1)

    @cached_property
    def derivatives(self) -> tuple[int, ...]:
        """Those that a part depends on."""
        return tuple(sorted({order for part in self.parts for order in part.derivatives}))

    @cached_property
    def varies(self) -> NDArray[np.bool_]:
        """Which functions depend on the motion, shape (k,)."""
        return np.concatenate([part.varies for part in self.parts])

    def slopes_at_instants(self, motion: Sequence[Array]) -> Callable[[Index, Index, Index], Array]:
        """The same of each part, at those of the instants that its functions are asked for."""

        def slopes(function: Index, instant: Index, columns: Index) -> Array:
            found = np.zeros((function.size, columns.size))
            owner = np.searchsorted(self._first, function, side="right") - 1
            for k in np.flatnonzero(np.bincount(owner, minlength=len(self.parts))):
                (rows,) = np.nonzero(owner == k)
                used, place = np.unique(instant[rows], return_inverse=True)
                of_part = self.parts[k].slopes_at_instants([part[:, used] for part in motion])
                found[rows] = of_part(function[rows] - self._first[k], place, columns)
            return found

        return slopes
