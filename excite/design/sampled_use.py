"""Use of nonlinear limits along a motion: at instants of a coarse grid, and at all others where a bound is near.

The grid of a family is fine enough to impose limits on; most of it is far from every bound, and a search need not look
there. Between two coarse instants it looks at every one where the larger use, and what a parabola through three of them
may rise above it, comes near the bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regressors.samples import Array, Index

if TYPE_CHECKING:
    from excite.design.grid_constraint import GridConstraint

_COARSE = 4  # every so many instants of the grid
_FEW = 8  # instants that are asked first
_NEAR = 0.95  # of a bound
_RISE = 0.25  # of the second difference: twice what a parabola rises above the larger one of its values


@dataclass(frozen=True, eq=False)
class SampledUse:
    """k functions at T of a grid's instants."""

    instants: Index  # (T,) in order
    values: Array  # (k, T)
    use: Array  # (k, T) of the bounds, see `GridConstraint.uses`


class BoundsCheck:
    """Whether a limit holds, asked first where it was last broken: a search shortens a step until none is."""

    def __init__(self, limit: GridConstraint) -> None:
        self._limit = limit
        self._broken: Index = np.zeros(0, dtype=np.intp)

    def __call__(self, x: Array) -> bool:
        """True if every value is within the bounds."""
        limit = self._limit
        if self._broken.size and np.any(limit.uses(limit.function.values(x, self._broken)) > 1.0):
            return False
        sampled = limit.sampled(x)
        use = sampled.use.max(axis=0, initial=-np.inf)
        if not np.any(use > 1.0):
            return True
        self._broken = sampled.instants[np.argsort(-use)[: min(_FEW, int(np.sum(use > 1.0)))]]
        return False


def sampled_use(limit: GridConstraint, x: Array) -> SampledUse:
    """Values and uses where a search looks at them; at all instants where the grid itself depends on x."""
    count = len(limit.grid.values(x, 0))
    if not limit.grid.linear or count <= 2 * _COARSE:
        values = limit.values(x)
        return SampledUse(np.arange(count), values, limit.uses(values))
    coarse = limit.function.values(x, slice(0, None, _COARSE))
    use = limit.uses(coarse)
    between = _between(use[limit.function.varies], count)
    instants = np.arange(0, count, _COARSE)
    if not between.size:
        return SampledUse(instants, coarse, use)
    fine = limit.function.values(x, between)
    instants = np.concatenate([instants, between])
    order = np.argsort(instants)
    values, uses = np.concatenate([coarse, fine], axis=1), np.concatenate([use, limit.uses(fine)], axis=1)
    return SampledUse(instants[order], values[:, order], uses[:, order])


def _between(use: Array, count: int) -> Index:
    """Instants between coarse ones at which a bound may be near."""
    second = np.abs(use[:, 2:] - 2.0 * use[:, 1:-1] + use[:, :-2])
    rise = np.empty_like(use)
    rise[:, 1:-1], rise[:, 0], rise[:, -1] = second, second[:, 0], second[:, -1]
    highest = (use + _RISE * rise).max(axis=0) > _NEAR
    near = highest.copy()  # the part of the grid that begins at each coarse instant
    near[:-1] |= highest[1:]
    first = _COARSE * np.flatnonzero(near)
    between = (first[:, None] + np.arange(1, _COARSE)).ravel()
    return np.asarray(between[between < count])
