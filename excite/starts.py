"""Random feasible motions to start an optimisation from."""

from __future__ import annotations

import numpy as np

from excite.problem import Problem
from regressors.samples import Array

_UNBOUNDED = 1.0


def random_motion(problem: Problem, rng: np.random.Generator) -> Array:
    """Coefficients of a random motion strictly inside the limits.

    A random direction from the resting pose, taken joint by joint to a random part of what the limits allow, so that
    joints with much room use it.

    Parameters
    ----------
    problem : Problem
    rng : numpy Generator

    Returns
    -------
    ndarray, shape (n, size)
    """
    n, size = problem.shape
    x = problem.rest.copy()
    for joint in rng.permutation(n):
        direction = np.zeros((n, size))
        direction[joint] = rng.normal(size=size)
        step = problem.longest_step(x, direction)
        x = x + rng.uniform(0.6, 0.95) * (step if np.isfinite(step) else _UNBOUNDED) * direction
    return x


def promising_motion(problem: Problem, rng: np.random.Generator, trials: int = 6) -> Array:
    """Best of a few random motions in the smoothest stage of the criterion."""
    motions = [random_motion(problem, rng) for _ in range(trials)]
    return min(motions, key=lambda x: problem.point(x, problem.criterion.stages[0]).value)
