"""Synthetic equations in blocks, for the tests of choices by left-out blocks."""

from __future__ import annotations

import numpy as np

from excite.identification.choices.block_statistics import BlockStatistics
from regressors.samples import Array


def random_blocks(
    seed: int, columns: int = 4, equations: int = 3, instants: int = 300, blocks: int = 5, noise: float = 0.1
) -> tuple[Array, Array, Array, Array]:
    """W, y, block of each instant, and the true parameters; the equations differ in size and in noise."""
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(instants, equations, columns)) * 10.0 ** rng.uniform(-2, 2, columns)
    beta = rng.normal(size=columns) / np.abs(W).mean(axis=(0, 1))
    sizes = 3.0 ** np.arange(equations)
    W *= sizes[:, None]
    y = W @ beta + noise * sizes * rng.uniform(0.3, 1.0, equations) * rng.normal(size=(instants, equations))
    block = np.repeat(np.arange(blocks), -(-instants // blocks))[:instants]
    return W, y, np.where(rng.random(instants) < 0.1, -1, block), beta


def statistics_of(W: Array, y: Array, block: Array) -> BlockStatistics:
    """Of one log."""
    return BlockStatistics.of([W], [y], [block])


def slow_squares(W: Array, y: Array, block: Array, weights: Array) -> Array:
    """Squared errors in each block of the weighted least squares of the others' rows, shape (B, r)."""
    squares = []
    for number in sorted(set(block[block >= 0].tolist())):
        others = (block >= 0) & (block != number)
        root = np.sqrt(weights)
        rows = (W[others] * root[:, None]).reshape(-1, W.shape[2])
        length = np.linalg.norm(rows, axis=0)
        length[length == 0] = 1.0
        beta = np.linalg.lstsq(rows / length, (y[others] * root).reshape(-1), rcond=None)[0] / length
        squares.append(np.sum((y[block == number] - W[block == number] @ beta) ** 2, axis=0))
    return np.array(squares)
