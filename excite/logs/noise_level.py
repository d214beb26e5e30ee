"""Noise level of a sampled signal, from its higher differences, in which smooth motion vanishes."""

from __future__ import annotations

import math

import numpy as np

from regressors.samples import Array

_ORDERS = range(2, 9)


def noise_deviation(x: Array) -> Array:
    """Standard deviation of white noise on smooth signals.

    White noise of deviation s has k-th differences of deviation ``s sqrt((2 k)! / (k!)^2)``, and motion only adds to
    them: the least estimate over k = 2 ... 8 is taken, no less than that of rounding, ``quantum / sqrt(12)``.
    """  # x (N, n)
    orders = [k for k in _ORDERS if k < x.shape[0]]
    estimates = [np.sqrt(np.mean(np.diff(x, k, axis=0) ** 2, axis=0) / math.comb(2 * k, k)) for k in orders]
    return np.asarray(np.maximum(np.min(estimates, axis=0), quantum(x) / np.sqrt(12)))


def quietest_deviation(x: Array, block: int) -> Array:
    """Standard deviation of noise in the quietest tenth of the blocks of a signal."""  # x (N, n)
    squares = np.diff(x, 2, axis=0) ** 2 / math.comb(4, 2)
    count = squares.shape[0] // block
    if count == 0:
        return np.zeros(x.shape[1])
    blocks = squares[: count * block].reshape(count, block, -1).mean(axis=1)
    return np.asarray(np.sqrt(np.quantile(blocks, 0.1, axis=0)))


def quantum(x: Array) -> Array:
    """Least difference of two different values, shape (n,); zero where all are equal."""  # x (N, n)
    steps = (np.diff(np.unique(column)) for column in x.T)
    return np.array([step.min() if step.size else 0.0 for step in steps])
