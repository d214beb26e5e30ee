"""The information matrix M = W'W / N of a motion as a function of its coefficients, with exact first derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.trajectories.family import LinearFamily
from regressors.lanes import LaneFunction
from regressors.samples import Array


@dataclass(frozen=True, eq=False)
class Evaluation:
    """M at one point, with what its derivative needs.

    Parameters
    ----------
    M : ndarray, shape (b, b)
    motion : list of ndarray, shape (n, N)
        q, dq, ddq on the sample grid.
    values : ndarray, shape (nnz, N)
        Nonzeros of the regressor.
    """

    M: Array
    motion: list[Array]
    values: Array


class Information:
    """M(x) for one model's columns over one family.

    Parameters
    ----------
    function : LaneFunction
        Regressor of one instant in the base columns, of (q, dq, ddq).
    family : LinearFamily
    samples : int
        Number of equal time steps over the duration.
    """

    def __init__(self, function: LaneFunction, family: LinearFamily, samples: int) -> None:
        self._function = function
        self._basis = [family.basis(family.grid(samples), d) for d in range(3)]
        self._count = samples
        self._rows = [np.flatnonzero(function.row == r) for r in range(function.shape[0])]
        self._blocks = [np.ix_(function.column[rows], function.column[rows]) for rows in self._rows]

    def evaluate(self, x: Array) -> Evaluation:
        """M of the motion with coefficients x, shape (n, size)."""
        motion = [np.ascontiguousarray(x @ B.T) for B in self._basis]
        values = self._function(*motion)
        b = self._function.shape[1]
        M = np.zeros((b, b))
        for rows, block in zip(self._rows, self._blocks, strict=True):
            A = values[rows]
            M[block] += A @ A.T
        return Evaluation(M / self._count, motion, values)

    def gradient(self, at: Evaluation, G: Array) -> Array:
        """Gradient of a function of M with respect to x, from its gradient G = df/dM.

        ``df = <G, dM> = sum_k <2/N W_k G, dW_k>``: one reverse sweep with the seeds ``2/N W_k G``.

        Returns
        -------
        ndarray, shape (n, size)
        """
        seeds = np.empty_like(at.values)
        for rows, block in zip(self._rows, self._blocks, strict=True):
            seeds[rows] = (2.0 / self._count) * (G[block] @ at.values[rows])
        slopes = self._function.pullback(at.motion, seeds)
        return np.asarray(sum(s @ B for s, B in zip(slopes, self._basis, strict=True)))
