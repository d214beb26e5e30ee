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
        order = np.repeat([known.index(d) for d in derivatives], [len(h) for h in half])
        self._groups = [(np.flatnonzero(order == d), d) for d in range(len(known))]
        one = np.eye(shape[1])
        self._basis = [np.ascontiguousarray(limits[derivatives.index(d)].grid.values(one, d)) for d in known]
        self._instants = len(self._basis[0])
        self._every = np.concatenate(self._basis)
        self._first = order * self._instants
        self._shape = shape

    def values(self, x: Array) -> Array:
        """``u`` at x, shape (functions, N)."""
        return np.asarray(self.changes(x) - self._middle)

    def changes(self, step: Array) -> Array:
        """Change of u by a step of x, shape (functions, N)."""
        joints = self._weights @ step.reshape(self._shape)
        if len(self._groups) == 1:
            return np.asarray(joints @ self._basis[0].T)
        changes = np.empty((len(joints), self._instants))
        for rows, group in self._groups:
            changes[rows] = joints[rows] @ self._basis[group].T
        return changes

    def rows(self, flat: Index) -> Array:
        """Derivatives of u with respect to the flat x, for flat indices of functions and instants."""
        function, instant = np.divmod(flat, self._instants)
        of_basis = self._every[self._first[function] + instant]
        rows = self._weights[function][:, :, None] * of_basis[:, None, :]
        return np.asarray(rows.reshape(flat.size, self._shape[0] * self._shape[1]))


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
