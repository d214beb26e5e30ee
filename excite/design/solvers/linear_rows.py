"""Limits that are linear in x, as rows of a quadratic programme.

All of them are one array ``-1 <= u(x) <= 1`` over functions and instants of the grid, so that a search handles them at
once; a programme contains only the rows near their bounds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from excite.design.grid_constraint import GridConstraint
from excite.design.grid_functions import LinearFunction
from regressors.samples import Array, Index

_SMALL = 100**2  # numbers in a matrix, up to which one product is faster than several with less


class LinearRows:
    """Functions ``u = (A y^(d) - middle) / half`` of the motion on the grid; every bound is 1.

    Parameters
    ----------
    limits : sequence of GridConstraint
        Linear in x, on one grid of N instants, at least one.
    shape : tuple of int
        Shape (n, size) of x.
    """

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
        self._shape = shape
        self.count = len(self._middle) * self._instants

    def values(self, x: Array) -> Array:
        """``u`` at x, shape (functions, N)."""
        return np.asarray(self.changes(x) - self._middle)

    def changes(self, step: Array) -> Array:
        """Change of u by a step of x, shape (functions, N)."""
        joints = self._weights @ step.reshape(self._shape)
        changes = np.empty((len(joints), self._instants))
        for functions, derivative in self._parts:
            np.matmul(joints[functions], self._basis[derivative].T, out=changes[functions])
        return changes

    def uses(self, at: Array, step: Array) -> Array:
        """``|u|`` after a step from where u has the values ``at``."""
        use = self.changes(step)
        use += at
        return np.abs(use, out=use)

    def rows(self, flat: Index) -> Array:
        """Derivatives of u with respect to the flat x, for flat indices of functions and instants."""
        function, of_basis = self._of_basis(flat)
        rows = self._weights[function][:, :, None] * of_basis[:, None, :]
        return np.asarray(rows.reshape(flat.size, self._shape[0] * self._shape[1]))

    def _of_basis(self, flat: Index) -> tuple[Index, Array]:
        function, instant = np.divmod(flat, self._instants)
        return function, self._every[self._first[function] + instant]

    def products(self, flat: Index, J: Array) -> Array:
        """The `rows` times a matrix; most contain one coordinate only."""
        n, size = self._shape
        if J.size <= _SMALL:
            return np.asarray(self.rows(flat) @ J)
        function, of_basis = self._of_basis(flat)
        weights = self._weights[function]
        products = np.zeros((flat.size, J.shape[1]))
        for coordinate in range(n):
            some = np.flatnonzero(weights[:, coordinate])
            weighted = weights[some, coordinate, None] * of_basis[some]
            products[some] += weighted @ J[coordinate * size : (coordinate + 1) * size]
        return products

    def bounded(self, at: Array, flat: Index, J: Array, bound: float) -> tuple[Array, Array, Array]:
        """Rows times J, and how far they may change where u has the values ``at``, for ``|u| <= bound``."""
        here = at.ravel()[flat]
        return self.products(flat, J), np.minimum(-bound - here, 0.0), np.maximum(bound - here, 0.0)


def peaks(use: Array, threshold: float) -> Index:
    """Flat indices of local maxima over (periodic) time that exceed a threshold.

    Parameters
    ----------
    use : ndarray, shape (functions, N)
    threshold : float
    """
    flat = use.ravel()
    beyond = np.flatnonzero(flat > threshold)
    last = use.shape[1] - 1
    instant = beyond % use.shape[1]
    before = np.where(instant == 0, beyond + last, beyond - 1)
    after = np.where(instant == last, beyond - last, beyond + 1)
    here = flat[beyond]
    return beyond[(here >= flat[before]) & (here >= flat[after])]
