"""Errors of predicted torques in the blocks that an estimate was made without."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from excite.identification.choices.block_statistics import BlockStatistics
from regressors.samples import Array

NEGLIGIBLE = 1e-4  # of an equation's torque: smaller errors count as that
_SMALLEST = 1e-8  # squared size of an equation that counts, of that of the largest
_RIDGE = 1e-9  # of a column's length: what the other blocks do not determine stays small
_ROUNDS = 3

Estimate = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class LeftOut:
    """Squared errors in left-out blocks."""

    squares: Array  # (B, r) sums over the rows of each block and equation, errors below `NEGLIGIBLE` counted as that
    instants: int  # of all blocks
    sizes: Array  # (r,) sums of the squared measurements

    @property
    def score(self) -> float:
        """``(1/r) sum_j log(rms_j)``: an equation counts by the ratio of its errors, whatever its size."""
        return float(np.mean(np.log(self.squares.sum(axis=0) / self.instants)) / 2)

    @property
    def error(self) -> float:
        """Relative error over all equations."""
        return float(np.sqrt(self.squares.sum() / self.sizes.sum()))

    @property
    def weights(self) -> Array:
        """Inverse mean squares of the equations, shape (r,)."""
        return np.asarray(self.instants / self.squares.sum(axis=0))

    def gain_over(self, other: LeftOut) -> tuple[float, float]:
        """By how much the score is better than another, and the standard error of that (jackknife over the blocks)."""
        mine, theirs = (each.squares.sum(axis=0) - each.squares for each in (self, other))
        gains = np.log(theirs / mine).mean(axis=1) / 2  # without one block after the other
        deviation = np.sqrt((gains.size - 1) / gains.size * np.sum((gains - gains.mean()) ** 2))
        return other.score - self.score, float(deviation)


def left_out(
    statistics: BlockStatistics,
    estimate: Estimate | None = None,
    weights: Array | None = None,
    *,
    judged: BlockStatistics | None = None,
) -> LeftOut:
    """Predict every block from the others."""  # estimate (p,); weights (r,)
    judged = statistics if judged is None else judged
    sizes = np.maximum(judged.sizes, _SMALLEST * (judged.sizes.max() or 1.0))
    floor = NEGLIGIBLE**2 * sizes[None, :] * (statistics.counts / statistics.counts.sum())[:, None]
    weights = statistics.counts.sum() / sizes if weights is None else weights
    result = None
    for _ in range(_ROUNDS):
        x = np.ones((statistics.counts.size, judged.products.shape[-1]))
        x[:, :-1] = -_estimates(statistics, estimate, weights)
        squares = ((judged.products @ x[:, None, :, None])[..., 0] @ x[:, :, None])[..., 0]
        result = LeftOut(np.maximum(squares, 0.0) + floor, int(statistics.counts.sum()), sizes)
        if np.all(np.abs(np.log(result.weights / weights)) < 0.1):
            break
        weights = result.weights
    assert result is not None
    return result


def least_squares_of_products(products: Array, weights: Array) -> Array:
    """Weighted least squares from sums of products."""  # products (r, p + 1, p + 1); weights (r,)
    return _solutions(np.tensordot(weights, products, axes=1))


def _estimates(statistics: BlockStatistics, estimate: Estimate | None, weights: Array) -> Array:
    """Estimates without one block after the other, shape (B, p)."""
    blocks = range(statistics.counts.size)
    if estimate is not None:
        return np.array([estimate(statistics.without(block), weights) for block in blocks])
    B, r, width, _ = statistics.products.shape
    weighted = (weights @ statistics.products.reshape(B, r, -1)).reshape(B, width, width)
    return _solutions(weighted.sum(axis=0) - weighted)


def _solutions(both: Array) -> Array:
    """Least squares from each ``[W y]' [W y]``, shape (..., p + 1, p + 1)."""
    length = np.sqrt(np.maximum(np.diagonal(both, axis1=-2, axis2=-1)[..., :-1], 0.0))
    length = np.where(length > 0, length, 1.0)
    normal = both[..., :-1, :-1] / (length[..., :, None] * length[..., None, :])
    along = np.arange(length.shape[-1])
    normal[..., along, along] += _RIDGE
    right = both[..., :-1, -1] / length
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0] / length)
