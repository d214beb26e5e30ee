"""The information matrix M = W'W / N of a motion as a function of its coefficients, with exact first derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from excite.trajectories.family import Family, Trajectory
from regressors.models.model import Combination
from regressors.models.partial import PartialMotion
from regressors.robot.symbolic.vectorised import VectorisedFunction
from regressors.samples import Array, Index

_CALL = 100_000  # multiplications in the time of a call
_CACHE = 2**17  # numbers that stay in a cache
Item = TypeVar("Item")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """M at one point, with the intermediate results that its derivative needs."""

    x: Array  # the point
    M: Array  # (b, b)
    motion: list[Array]  # (n, T) q, dq, ddq at the instants
    W: Array  # (b, r, N) rows of W divided by their noise: column, scalar equation, instant


class Information:
    """M(x) for one model's columns over one family.

    Where columns are ordered along the chain, the equations of later joints do not depend on the first ones; products
    with W leave these zeros out.
    """  # noise (r,)

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
        self._equations = function.shape[0] if self._integral is None else function.shape[0] // 2
        is_state = function.row < self._equations
        self._states, self._densities = np.flatnonzero(is_state), np.flatnonzero(~is_state)
        self._place = function.column, function.row % self._equations
        self._blocks = _blocks(*self._place, function.shape[1], self._equations, self._count)
        divided = noise is not None and bool(np.any(noise != 1.0))
        self._weights = 1.0 / noise[:, None] if noise is not None and divided else None

    def trajectory(self, x: Array) -> Trajectory:
        """Motion of every joint, from that of the moving coordinates."""
        return Trajectory(self._family, x).carried(self._motion.matrix, self._motion.offset)

    def joint_coefficients(self, x: Array) -> Array:
        """The x of the motion of every joint; for a linear family ``N x + q0``, shape (n, size)."""
        return self.trajectory(x).x

    def evaluate(self, x: Array) -> Evaluation:
        """M of the motion x of the moving coordinates."""
        return self._evaluate([x])[0]

    def evaluations(self, xs: Sequence[Array]) -> list[Evaluation]:
        """M of several motions; each is the same as alone, to the last bit."""
        return [at for some in _groups(xs, self._together) for at in self._evaluate(some)]

    def _evaluate(self, xs: Sequence[Array]) -> list[Evaluation]:
        motions = [self._joints.values(x) for x in xs]
        W = self._rows(self._function(*_beside(motions)), len(xs))
        M = np.zeros((len(xs), W.shape[1], W.shape[1]))
        for columns, equations in self._blocks:
            rows = W[:, columns, equations].reshape(len(xs), W.shape[1] - columns.start, -1)
            M[:, columns, columns] += rows @ rows.transpose(0, 2, 1)
        M /= self._count
        return [Evaluation(*one) for one in zip(xs, M, motions, W, strict=True)]

    def _rows(self, values: Array, motions: int) -> Array:
        """W of each motion, transposed, shape (motions, b, r, N)."""
        W = np.zeros((motions, self._function.shape[1], self._equations, self._count))
        column, equation = self._place
        values = values.reshape(len(values), motions, -1).transpose(1, 0, 2)
        if self._integral is None:
            W[:, column, equation] = values
        else:
            s, d = self._states, self._densities
            for k in range(motions):
                W[k, column[s], equation[s]] = (self._difference @ values[k, s].T).T
                W[k, column[d], equation[d]] += (self._integral @ values[k, d].T).T
        return W if self._weights is None else W * self._weights

    def gradient(self, at: Evaluation, G: Array) -> Array:
        """Gradient of a function of M with respect to x, from its gradient G = df/dM.

        ``df = <G, dM> = sum_k <2/N S_k^-1 W_k G, dW_k>``: one reverse sweep with the seeds ``2/N S_k^-1 W_k G``.
        """
        return self._gradients([(at, G)])[0]

    def gradients(self, evaluations: Sequence[Evaluation], Gs: Sequence[Array]) -> list[Array]:
        """The `gradient` at several motions; each is the same as alone, to the last bit."""
        pairs = list(zip(evaluations, Gs, strict=True))
        return [g for some in _groups(pairs, self._together) for g in self._gradients(some)]

    def _gradients(self, pairs: Sequence[tuple[Evaluation, Array]]) -> list[Array]:
        seeds = _stacked([self._seeds(at.W, G) for at, G in pairs])
        motions = [at.motion for at, _ in pairs]
        slopes = self._function.pullback(_beside(motions), seeds)
        each = zip(*(np.split(slope, len(pairs), axis=1) for slope in slopes), strict=True)
        return [self._joints.pullback(at.x, some) for (at, _), some in zip(pairs, each, strict=True)]

    def _seeds(self, W: Array, G: Array) -> Array:
        """Derivatives of the function of M with respect to the values, shape (nnz, T)."""
        slope = np.empty_like(W)  # used where W has entries
        scaled = 2.0 / self._count * G
        for columns, equations in self._blocks:
            rows = W[columns, equations]
            product = scaled[columns, columns] @ rows.reshape(len(rows), -1)
            slope[columns, equations] = product.reshape(rows.shape)
        column, equation = self._place
        used = slope[column, equation]
        if self._weights is not None:
            used *= self._weights[equation]
        if self._integral is None:
            return np.asarray(used)
        s, d = self._states, self._densities
        seeds = np.empty((column.size, self._integral.shape[1]))
        seeds[s] = (self._difference.T @ used[s].T).T
        seeds[d] = (self._integral.T @ used[d].T).T
        return seeds

    @property
    def _together(self) -> int:
        """Motions whose W fit into a processor's cache together."""
        numbers: int = self._function.shape[1] * self._equations * self._count
        return max(1, _CACHE // numbers)


def _groups(items: Sequence[Item], most: int) -> Iterator[Sequence[Item]]:
    return (items[first : first + most] for first in range(0, len(items), most))


def _beside(motions: Sequence[list[Array]]) -> list[Array]:
    """Inputs of several motions, one after the other."""
    return [_stacked(parts) for parts in zip(*motions, strict=True)]


def _stacked(parts: Sequence[Array]) -> Array:
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


def _blocks(column: Index, equation: Index, b: int, equations: int, instants: int) -> list[tuple[slice, slice]]:
    """Trailing columns and consecutive equations that together contain every entry of W, for few and small products."""
    blocks: list[tuple[int, int, int]] = []
    for k in range(equations):
        block = int(column[equation == k].min(initial=b - 1)), k, k + 1
        if blocks:
            joined = min(blocks[-1][0], block[0]), blocks[-1][1], k + 1
            apart, together = (
                sum(_operations(one, b, instants) for one in some) for some in ((blocks[-1], block), (joined,))
            )
            if together <= apart:
                blocks[-1] = joined
                continue
        blocks.append(block)
    return [(slice(first, b), slice(begin, end)) for first, begin, end in blocks]


def _operations(block: tuple[int, int, int], b: int, instants: int) -> int:
    """Operations of a product with a block, and those that its call is worth."""
    first, begin, end = block
    return (b - first) ** 2 * (end - begin) * instants + _CALL
