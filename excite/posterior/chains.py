"""Chains of paths: a warm-up that learns the shape of what is possible, then samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from excite.errors import ConicSolverError
from excite.identification.estimators.possible_set import PossibleSet
from excite.posterior.posterior_coordinates import PosteriorCoordinates
from excite.posterior.reflected_paths import STEP, next_points
from regressors.samples import Array

CHAINS = 32
_STAGES = (20, 25, 25, 10)  # paths of every chain, after each of which but the last the shape is taken anew
_THIN = 3  # paths from one sample to the next
_ALONE = 0.2  # share of the deviations alone in a shape, without correlations: the draws are few
_ENOUGH, _SHORTER = 0.5, 0.8  # accepted paths of the warm-up, below which drifts are made shorter, and by how much
_LEAST = 0.05  # accepted paths, below which samples are not believed


def path_count(samples: int) -> int:
    """Paths that each of the chains computes for a number of samples."""
    return sum(_STAGES) + _THIN * -(-samples // CHAINS)


def draws(
    coordinates: PosteriorCoordinates,
    possible: PossibleSet,
    start: Array,
    count: int,
    seed: int,
    progress: Callable[[int, int], None] = lambda _, __: None,
) -> Array:
    """Coordinates of every chain after the warm-up, shape (rounds, chains, d), at least as many as asked for."""
    # start (d,)
    rng, z, done, total = np.random.default_rng(seed), np.tile(start, (CHAINS, 1)), 0, path_count(count)
    shape, length = np.eye(coordinates.size), STEP
    for stage, paths in enumerate(_STAGES):
        seen = []
        for _ in range(paths):
            z, moved = next_points(coordinates, possible, z, rng, shape, length)
            length *= _SHORTER if moved.mean() < _ENOUGH else 1.0
            seen.append(z)
            done += 1
            progress(done, total)
        if stage < len(_STAGES) - 1:
            shape, length = _shape(np.concatenate(seen[paths // 3 :])), STEP
    kept, accepted = [], 0.0
    while done < total:
        z, moved = next_points(coordinates, possible, z, rng, shape, length)
        accepted += float(moved.mean()) / (total - sum(_STAGES))
        done += 1
        if (total - done) % _THIN == 0:
            kept.append(z)
        progress(done, total)
    if accepted < _LEAST:
        raise ConicSolverError(
            "the posterior leaves hardly any room for possible robots: the data contradict the description; give a "
            "larger `prior`, or correct the description"
        )
    return np.array(kept)


def _shape(z: Array) -> Array:
    """A factor of the covariance of points, shape (d, d)."""
    covariance = np.atleast_2d(np.cov(z, rowvar=False))
    alone = np.diag(np.diag(covariance) + 1e-12)
    return np.asarray(np.linalg.cholesky((1 - _ALONE) * covariance + _ALONE * alone))
