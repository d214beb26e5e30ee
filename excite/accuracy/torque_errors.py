"""Errors of an estimate by noise of the torques: linear, by random samples of the noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from excite.accuracy.linear_equations import linear_equations
from excite.accuracy.torque_noise import TorqueNoise
from excite.identification.equations import right_sides
from excite.identification.identification import Identification
from regressors.samples import Array

_NUMBERS = 2**23  # of noise that is held at once


def torque_errors(
    result: Identification,
    noise: TorqueNoise,
    count: int,
    seed: int,
    found: frozenset[str] = frozenset(),
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Array:
    """Errors ``(W' V W)^-1 W' V F n`` of an estimate, shape (count, p).

    F brings torques to the rows of the equations: their low-pass and decimation, and the windows of the model.
    """
    (part,), target, recipe = result.prepared, result.target, result.recipe
    N, n = part.measured.shape
    linear = linear_equations(result, part, found)
    rng, errors = np.random.default_rng([seed, 0]), []
    block = max(1, min(count, _NUMBERS // (N * n)))
    for first in range(0, count, block):
        samples = [noise.draw(part.samples.time, n, rng) for _ in range(min(block, count - first))]
        errors.append(linear.errors(right_sides(target, part, recipe, np.array(samples))))
        progress(min(first + block, count), count)
    return np.concatenate(errors)
