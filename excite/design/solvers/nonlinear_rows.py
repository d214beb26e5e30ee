"""Limits that are not linear in x, as rows of a quadratic programme about one iterate.

Only functions near a bound are linearised, where a search looks at them, see `excite.design.sampled_use`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from excite.design.grid_constraint import GridConstraint
from regressors.samples import Array, Index

_LINEARISED = 0.6  # use of a bound beyond which a function is linearised
_ROW = 0.9  # peaks over time beyond it are rows of the programme at once
_SLACK = 1e-6


class NearRows:
    """Linearised functions near their bounds, of which those that are needed are rows of the programme."""

    def __init__(self, limits: Sequence[GridConstraint], x: Array) -> None:
        parts = [_near(limit, x) for limit in limits]
        of_entries, of_numbers, of_rows = zip(*parts, strict=True)
        self._value, self._lower, self._upper, self._scale, self._reserve = np.concatenate(of_entries, axis=1)
        self._rows = np.concatenate(of_rows)
        self._adjacent = np.diff(np.concatenate(of_numbers)) == 1
        self._chosen = self._peaks(self._value, _ROW)

    def broken(self, d: Array) -> bool:
        """Whether a step violates a limit where no row of the programme forbids it; if so, add rows."""  # d (x.size,)
        more = self._peaks(self._value + self._rows @ d, 1.0 + _SLACK)
        fresh = bool(np.any(more & ~self._chosen))
        self._chosen |= more
        return fresh

    def rows(self) -> tuple[Array, Array, Array]:
        """Rows of the programme with their lower and upper bounds."""
        k = self._chosen
        value, reserve = self._value[k], self._reserve[k]
        upper = np.maximum(self._upper[k] - reserve - value, 0.0)
        lower = np.minimum(self._lower[k] + reserve - value, 0.0)
        return self._rows[k], lower, upper

    def _peaks(self, value: Array, threshold: float) -> NDArray[np.bool_]:
        """Which are local maxima of the use over neighbouring instants, beyond a threshold."""
        use = 1.0 - np.minimum(self._upper - value, value - self._lower) / self._scale
        peak: NDArray[np.bool_] = use > threshold
        peak[1:] &= ~self._adjacent | (use[1:] >= use[:-1])
        peak[:-1] &= ~self._adjacent | (use[:-1] >= use[1:])
        return peak


def _near(limit: GridConstraint, x: Array) -> tuple[Array, Index, Array]:
    """Value, bounds, scale and reserve of each function near a bound at an instant; its number; its row."""
    sampled = limit.sampled(x)
    near = sampled.use > _LINEARISED
    near[~limit.function.varies] = False
    function, place = np.nonzero(near)
    needed = np.flatnonzero(near.any(axis=0))
    rows = limit.tangent(x, sampled.instants[needed]).rows(function, np.searchsorted(needed, place))
    of_functions = np.array([limit.lower, limit.upper, limit.scale, limit.reserve])
    number = (sampled.instants.size + 1) * function + place  # those of neighbouring instants follow each other
    return np.vstack([sampled.values[function, place], of_functions[:, function]]), number, rows
