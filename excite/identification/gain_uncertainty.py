"""Uncertainty of drive gains whose residuals are correlated in time: the jackknife over blocks of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from excite.identification.drive_gains import DriveGains
from excite.identification.observations import Observations
from regressors.samples import Array, Index

BLOCKS = 40  # of all logs together; long against the correlation of residuals, short against the motion


@dataclass(frozen=True, eq=False)
class _Block:
    """Sums over the rows of one block, in the free parameters: ``J' V J`` and ``J' V e``."""

    normal: Array
    score: Array


def block_deviation(observations: Observations, load: Array, gains: DriveGains, *, common: bool) -> Array:
    """Standard deviation of each gain, from estimates that leave out one block of time each.

    ``sum_b (B - 1)/B d_b d_b'`` with the step ``d_b = (A - A_b)^-1 s_b`` of the Gauss-Newton method without block b
    [Efron, Tibshirani 1993, ch. 11].
    """  # load (m, 10)
    h, x = 1.0 / gains.factor, np.concatenate([gains.beta, gains.load])
    weight = _weights(observations, load, h, x)
    count = 1 if common else h.size
    free = np.delete(np.arange(count + x.size), count + gains.beta.size)  # all but the known mass
    blocks = [_block(observations, load, rows, h, x, weight, common, free) for rows in _blocks(observations)]
    whole = np.sum([block.normal for block in blocks], axis=0)
    scale = np.sqrt(np.diag(whole))
    steps = [
        np.linalg.solve((whole - block.normal) / np.outer(scale, scale), block.score / scale) / scale
        for block in blocks
    ]
    variance = (1 - 1 / len(blocks)) * np.sum(np.array(steps) ** 2, axis=0)
    spread = np.sqrt(variance[:count])
    return np.asarray(np.broadcast_to(spread, h.shape) / h**2)


def _weights(observations: Observations, load: Array, h: Array, x: Array) -> Array:
    """One over the squared size of each equation's residuals."""
    equation = observations.equation
    e = observations.y - h[equation] * (np.hstack([observations.matrix, load]) @ x)
    return np.array([1.0 / np.mean(e[equation == j] ** 2) for j in range(h.size)])


def _blocks(observations: Observations) -> list[Index]:
    """Rows of each block: every log is cut into blocks of equal length, in proportion to its rows."""
    share = np.bincount(observations.log) / observations.log.size
    blocks = []
    for log, part in enumerate(share):
        rows = np.flatnonzero(observations.log == log)
        blocks += np.array_split(rows, max(2, round(BLOCKS * float(part))))
    return blocks


def _block(
    observations: Observations, load: Array, rows: Index, h: Array, x: Array, weight: Array, common: bool, free: Index
) -> _Block:
    equation = observations.equation[rows]
    A = np.hstack([observations.W[rows], load[rows]])
    torque = A @ x
    first = np.zeros((rows.size, 1 if common else h.size))
    first[np.arange(rows.size), 0 if common else equation] = torque
    J = np.hstack([first, h[equation, None] * A])[:, free]
    e = observations.y[rows] - h[equation] * torque
    return _Block(J.T @ (weight[equation, None] * J), J.T @ (weight[equation] * e))
