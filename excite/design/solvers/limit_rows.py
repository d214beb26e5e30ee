"""Limits as rows of a quadratic programme: those linear in x, and tangents of the others.

All of them are one array ``-1 <= u(x) <= 1`` over functions and instants of the grid, so that a search handles them at
once; a programme contains only the rows near their bounds.

Only functions near a bound are linearised, where a search looks at them, see `excite.design.grid_limits`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import daqp
import numpy as np
from numpy.typing import NDArray

from excite.design.grid_limits import GridConstraint, LinearFunction
from regressors.samples import Array, Index

_SMALL = 100**2  # numbers in a matrix, up to which one product is faster than several with less
_STRIDE = 4  # instants from one to the next where peaks are looked for first
_BETWEEN = 0.02  # of a bound: more than a function exceeds its values there


class LinearRows:
    """Functions ``u = (A y^(d) - middle) / half`` of the motion on the grid; every bound is 1."""

    def __init__(self, limits: Sequence[GridConstraint], shape: tuple[int, int]) -> None:
        functions = [limit.function for limit in limits if isinstance(limit.function, LinearFunction)]
        assert len(functions) == len(limits)
        half = [0.5 * (limit.upper - limit.lower)[:, None] for limit in limits]
        middle = [0.5 * (limit.upper + limit.lower)[:, None] for limit in limits]
        derivatives = [function.constraint.derivative for function in functions]
        known = sorted(set(derivatives))
        self._weights = np.concatenate([f.constraint.matrix / h for f, h in zip(functions, half, strict=True)])
        self._middle = np.concatenate([m / h for m, h in zip(middle, half, strict=True)])
        counts = [len(h) for h in half]
        self._parts = [
            (slice(end - count, end), known.index(d))
            for end, count, d in zip(np.cumsum(counts).tolist(), counts, derivatives, strict=True)
        ]
        one = np.eye(shape[1])
        self._basis = [np.ascontiguousarray(limits[derivatives.index(d)].grid.values(one, d)) for d in known]
        self._instants = len(self._basis[0])
        self._every = np.concatenate(self._basis)
        self._first = np.repeat([known.index(d) for d in derivatives], counts) * self._instants
        self._stride = _STRIDE if self._instants % _STRIDE == 0 else 1
        self._few = [np.ascontiguousarray(basis[:: self._stride].T) for basis in self._basis]
        self._around = np.arange(1 - self._stride, self._stride)
        self._shape = shape
        self.count = len(self._middle) * self._instants

    def values(self, x: Array) -> Array:
        """``u`` at x, shape (functions, N)."""
        return np.asarray(self.changes(x.ravel()) - self._middle)

    def changes(self, steps: Array) -> Array:
        """Change of u by steps of the flat x, shape (..., n size), each alone: shape (..., functions, N)."""
        joints = self._weights @ steps.reshape(*steps.shape[:-1], *self._shape)
        changes = np.empty((*joints.shape[:-1], self._instants))
        for functions, derivative in self._parts:
            np.matmul(joints[..., functions, :], self._basis[derivative].T, out=changes[..., functions, :])
        return changes

    def peaks(self, xs: Array, threshold: float) -> tuple[Index, Index, Mask]:
        """Where ``|u|`` has local maxima over (periodic) time beyond a threshold, at several x."""  # xs (k, n size)
        joints = self._weights @ xs.reshape(len(xs), *self._shape)
        use = np.empty((*joints.shape[:-1], self._instants // self._stride))
        for functions, derivative in self._parts:
            np.matmul(joints[:, functions], self._few[derivative], out=use[:, functions])
        use -= self._middle
        np.abs(use, out=use)
        series, instant = np.divmod(local_maxima(use, threshold - _BETWEEN), use.shape[-1])
        which, function = np.divmod(series, len(self._middle))
        near = (self._stride * instant[:, None] + self._around) % self._instants
        of_basis = self._every[self._first[function][:, None] + near]
        u = (of_basis @ joints[which, function, :, None])[..., 0] - self._middle[function]
        np.abs(u, out=u)
        highest = u.argmax(axis=1)
        every = np.arange(highest.size)
        peak = u[every, highest]
        beyond = np.flatnonzero(peak > threshold)
        flat = function * self._instants + near[every, highest]
        return which[beyond], flat[beyond], peak[beyond] > 1.0

    def rows(self, flat: Index) -> Array:
        """Derivatives of u with respect to the flat x, for flat indices of functions and instants."""
        function, of_basis = self._of_basis(flat)
        rows = self._weights[function][:, :, None] * of_basis[:, None, :]
        return np.asarray(rows.reshape(flat.size, self._shape[0] * self._shape[1]))

    def _of_basis(self, flat: Index) -> tuple[Index, Array]:
        function, instant = np.divmod(flat, self._instants)
        return function, self._every[self._first[function] + instant]

    def products(self, flat: Index, rows: Array, J: Array) -> Array:
        """The `rows` times a matrix; most contain one coordinate only."""
        n, size = self._shape
        if J.size <= _SMALL:
            return np.asarray(rows @ J)
        function, of_basis = self._of_basis(flat)
        weights = self._weights[function]
        products = np.zeros((flat.size, J.shape[1]))
        for coordinate in range(n):
            some = np.flatnonzero(weights[:, coordinate])
            weighted = weights[some, coordinate, None] * of_basis[some]
            products[some] += weighted @ J[coordinate * size : (coordinate + 1) * size]
        return products

    def bounded(self, xs: Array, flat: Index, bound: float) -> tuple[Array, Array, Array]:
        """The `rows`, and how far each may change from a flat x of its own, for ``|u| <= bound``."""
        rows = self.rows(flat)
        here = np.einsum("ri,ri->r", rows, xs) - self._middle[flat // self._instants, 0]
        return rows, np.minimum(-bound - here, 0.0), np.maximum(bound - here, 0.0)


def local_maxima(use: Array, threshold: float) -> Index:
    """Flat indices of local maxima over (periodic) time that exceed a threshold."""  # use (..., N)
    flat = use.ravel()
    beyond = np.flatnonzero(flat > threshold)
    last = use.shape[-1] - 1
    instant = beyond % use.shape[-1]
    before = np.where(instant == 0, beyond + last, beyond - 1)
    after = np.where(instant == last, beyond - last, beyond + 1)
    here = flat[beyond]
    return beyond[(here >= flat[before]) & (here >= flat[after])]


def largest_part(at: Array, change: Array) -> float:
    """Largest part of a change, at most 1, that leaves ``|u| <= 1``, from where u has the values ``at``."""
    room = np.where(change > 0, 1.0 - at, -1.0 - at)
    part = np.divide(room, change, out=np.ones_like(room), where=change != 0)
    return float(np.clip(part.min(), 0.0, 1.0))


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


def _telling(use: Array, instants: Index) -> Index:
    """Numbers of instants at which a programme looks: those of a coarse grid, and around peaks near a bound."""
    peak = np.greater(use, _ROW)
    peak[:, 1:] &= use[:, 1:] >= use[:, :-1]
    peak[:, :-1] &= use[:, :-1] >= use[:, 1:]
    at_peaks = np.flatnonzero(peak.any(axis=0))
    told = instants % _STRIDE == 0
    for step in (-1, 0, 1):
        told[np.clip(at_peaks + step, 0, instants.size - 1)] = True
    return np.flatnonzero(told)


def _near(limit: GridConstraint, x: Array) -> tuple[Array, Index, Array]:
    """Value, bounds, scale and reserve of each function near a bound at an instant; its number; its row."""
    instants, values, use = limit.sampled(x)
    some = _telling(use, instants)
    instants, values, use = instants[some], values[:, some], use[:, some]
    near = use > _LINEARISED
    near[~limit.function.varies] = False
    function, place = np.nonzero(near)
    needed = np.flatnonzero(near.any(axis=0))
    rows = limit.tangent(x, instants[needed])(function, np.searchsorted(needed, place))
    of_functions = np.array([limit.lower, limit.upper, limit.scale, limit.reserve])
    number = (instants.size + 1) * function + place  # those of neighbouring instants follow each other
    return np.vstack([values[function, place], of_functions[:, function]]), number, rows


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
