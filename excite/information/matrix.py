"""The information matrix M = W'W / N of a motion as a function of its coefficients, with exact first derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.trajectories.family import Family, Trajectory
from regressors.models.model import Combination
from regressors.models.partial import PartialMotion
from regressors.samples import Array, Index
from regressors.symbolic.vectorised import VectorisedFunction


@dataclass(frozen=True, eq=False)
class Evaluation:
    """M at one point, with the intermediate results that its derivative needs.

    Parameters
    ----------
    x : ndarray
        The point.
    M : ndarray, shape (b, b)
    motion : list of ndarray, shape (n, T)
        q, dq, ddq at the instants.
    blocks : list of ndarray, shape (columns, N)
        Rows of W before they are divided by their noise, one block per scalar equation, transposed.
    """

    x: Array
    M: Array
    motion: list[Array]
    blocks: list[Array]


@dataclass(frozen=True, eq=False)
class _Equation:
    """Values of the expression that form one scalar equation's rows of W, and the columns they go into.

    Parameters
    ----------
    state, density : ndarray of int
        Indices of the values that enter through the combination's difference, and through its integral.
    state_place, density_place : ndarray of int
        Their places among `columns`.
    columns : ndarray of int
        Columns of W that are not zero.
    """

    state: Index
    density: Index
    state_place: Index
    density_place: Index
    columns: Index


class Information:
    """M(x) for one model's columns over one family.

    Parameters
    ----------
    function : VectorisedFunction
        The model's expression in the base columns, of (q, dq, ddq): r states, above r densities where there are any.
    family : Family
    combination : Combination
        Map from values to rows of W.
    motion : PartialMotion
        Map from the moving coordinates to the joints.
    noise : ndarray, shape (r,), optional
        Divisor of the rows of each equation; 1 if not given.
    """

    def __init__(
        self,
        function: VectorisedFunction,
        family: Family,
        combination: Combination,
        motion: PartialMotion,
        noise: Array | None = None,
    ) -> None:
        self._function = function
        self._family, self._motion = family, motion
        self._joints = family.joints(combination.time, motion)
        self._difference, self._integral = combination.difference, combination.integral
        self._count = combination.difference.shape[0]
        self._plain = combination.integral is None
        self._equations = _equations(function, densities=not self._plain)
        self._weights = np.ones(len(self._equations)) if noise is None else 1.0 / noise

    def trajectory(self, x: Array) -> Trajectory:
        """Motion of every joint, from that of the moving coordinates."""
        return Trajectory(self._family, x).carried(self._motion.matrix, self._motion.offset)

    def joint_coefficients(self, x: Array) -> Array:
        """The x of the motion of every joint; for a linear family ``N x + q0``, shape (n, size)."""
        return self.trajectory(x).x

    def evaluate(self, x: Array) -> Evaluation:
        """M of the motion x of the moving coordinates."""
        motion = self._joints.values(x)
        values = self._function(*motion)
        b = self._function.shape[1]
        M = np.zeros((b, b))
        blocks = [self._block(values, equation) for equation in self._equations]
        for A, equation, weight in zip(blocks, self._equations, self._weights, strict=True):
            M[np.ix_(equation.columns, equation.columns)] += weight**2 * (A @ A.T)
        return Evaluation(x, M / self._count, motion, blocks)

    def _block(self, values: Array, equation: _Equation) -> Array:
        if self._plain:
            return values[equation.state]
        assert self._integral is not None
        A = np.zeros((equation.columns.size, self._count))
        A[equation.state_place] += (self._difference @ values[equation.state].T).T
        A[equation.density_place] += (self._integral @ values[equation.density].T).T
        return A

    def gradient(self, at: Evaluation, G: Array) -> Array:
        """Gradient of a function of M with respect to x, from its gradient G = df/dM.

        ``df = <G, dM> = sum_k <2/N S_k^-1 W_k G, dW_k>``: one reverse sweep with the seeds ``2/N S_k^-1 W_k G``.

        Returns
        -------
        ndarray, of the shape of x
        """
        seeds = np.zeros((self._function.row.size, at.motion[0].shape[1]))
        for A, equation, weight in zip(at.blocks, self._equations, self._weights, strict=True):
            slope = (2.0 / self._count * weight**2) * (G[np.ix_(equation.columns, equation.columns)] @ A)
            if self._plain:
                seeds[equation.state] = slope
                continue
            assert self._integral is not None
            seeds[equation.state] = (self._difference.T @ slope[equation.state_place].T).T
            seeds[equation.density] = (self._integral.T @ slope[equation.density_place].T).T
        return self._joints.pullback(at.x, self._function.pullback(at.motion, seeds))


def _equations(function: VectorisedFunction, *, densities: bool) -> list[_Equation]:
    r = function.shape[0] // 2 if densities else function.shape[0]
    blocks = []
    for row in range(r):
        state = np.flatnonzero(function.row == row)
        density = np.flatnonzero(function.row == row + r)
        both = np.concatenate([function.column[state], function.column[density]])
        columns = function.column[state] if not densities else np.unique(both)
        place = {int(column): k for k, column in enumerate(columns)}
        state_place, density_place = (
            np.array([place[int(c)] for c in function.column[part]], dtype=np.intp) for part in (state, density)
        )
        blocks.append(_Equation(state, density, state_place, density_place, columns))
    return blocks
