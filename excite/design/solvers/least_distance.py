"""Quadratic programmes in coordinates where their Hessian is the identity, by DAQP."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import daqp
import numpy as np
from numpy.typing import NDArray

from regressors.samples import Array

Sides = NDArray[np.int32]
Mask = NDArray[np.bool_]
Rows = tuple[Array, Array, Array]
FREE, AT_UPPER, AT_LOWER = 0, 1, 3  # DAQP's marks of the rows that its working set begins with
_TOUCH = 1e-6


@cache
def _identity(n: int) -> Array:
    return np.eye(n)


class LeastDistance:
    """``min c'w + w'w/2`` within ``lower <= A w <= upper``, to which rows are added; w = 0 is inside.

    There is nothing to factorise, and the working set begins with rows that are expected to be active.
    """  # c (n,)

    def __init__(self, c: Array) -> None:
        self._c = c
        self._rows: Rows = (np.zeros((0, c.size)), np.zeros(0), np.zeros(0))
        self._w = np.zeros_like(c)
        self.sides: Sides = np.zeros(0, dtype=np.int32)

    def add(self, rows: Rows, sides: Sides) -> None:
        """Add rows ``(A, lower, upper)``, and where they are expected to be active."""
        self._rows = _stacked([self._rows, rows]) if self.sides.size else rows
        self.sides = np.concatenate([self.sides, sides])

    def solve(self, others: Sequence[Rows] = ()) -> Array | None:
        """The solution within the rows that were added and others, shape (n,); None if DAQP fails."""
        (A, lower, upper), expected = self._rows, self.sides
        if others:
            A, lower, upper = _stacked([self._rows, *others])
            expected = np.concatenate([self.sides, *(self._touched(rows) for rows in others)])
        c = self._c
        w, _, flag, info = daqp.solve(_identity(c.size), c, A, upper, lower, expected)
        if flag < 0 and np.any(expected):
            w, _, flag, info = daqp.solve(_identity(c.size), c, A, upper, lower, np.zeros_like(expected))
        if flag < 0:
            return None
        multipliers = info["lam"][: self.sides.size]
        self.sides = _sides(multipliers > 0, multipliers < 0)
        self._w = np.asarray(w)
        return self._w

    def _touched(self, rows: Rows) -> Sides:
        """Where the last solution is at a bound."""
        A, lower, upper = rows
        value = A @ self._w
        return _sides(value >= upper - _TOUCH, value <= lower + _TOUCH)


def _sides(at_upper: Mask, at_lower: Mask) -> Sides:
    return np.where(at_upper, AT_UPPER, AT_LOWER * at_lower).astype(np.int32)


def _stacked(parts: Sequence[Rows]) -> Rows:
    A, lower, upper = zip(*parts, strict=True)
    return np.concatenate(A), np.concatenate(lower), np.concatenate(upper)
