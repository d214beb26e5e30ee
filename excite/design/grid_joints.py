"""The joints' motion on a grid, which all limits of a problem share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from excite.trajectories.motion_at_instants import GridMotion
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index

T = TypeVar("T")


class LastResult(Generic[T]):
    """A function of x that keeps its last result: a search asks several times for the values at one iterate."""

    def __init__(self, function: Callable[[Array], T]) -> None:
        self._function = function
        self._x: Array | None = None
        self._result: T

    def __call__(self, x: Array) -> T:
        """The result at x."""
        if self._x is None or not np.array_equal(x, self._x):
            self._result, self._x = self._function(x), x.copy()
        return self._result


class GridJoints:
    """Position, velocity and acceleration of all joints on a grid of N instants, as functions of x."""

    def __init__(self, grid: GridMotion, motion: PartialMotion) -> None:
        self.grid, self.motion = grid, motion
        self._last = LastResult(self._all)

    def __call__(self, x: Array, instants: Index | slice | None = None) -> list[Array]:
        """Three arrays of shape (n, N), at all instants or some; not to be changed."""
        motion = self._last(x)
        return motion if instants is None else [part[:, instants] for part in motion]

    def _all(self, x: Array) -> list[Array]:
        q, dq, ddq = (self.grid.combined(x, self.motion.matrix, derivative) for derivative in range(3))
        return [q + self.motion.offset[:, None], dq, ddq]
