"""Paths with reflections: they stay inside, keep their speed, can be walked back, and leave the density as it is."""

from __future__ import annotations

import numpy as np
import pytest

from excite.identification.estimators.possible_set import PossibleSet
from excite.study.chains import PosteriorCoordinates, ReflectedPaths, next_points

SIZE, CHAINS = 6, 400


def small_set(width: float = 1.0) -> PossibleSet:
    """Two bodies and a positive parameter about the origin, with walls at distances of about the width."""
    rng = np.random.default_rng(0)
    B = rng.normal(size=(2, 4, 4, SIZE))
    return PossibleSet(
        np.array([width * np.eye(4)] * 2), B + B.swapaxes(1, 2), np.array([width]), rng.normal(size=(1, SIZE))
    )


def isotropic(freedom: float = np.inf) -> PosteriorCoordinates:
    return PosteriorCoordinates(np.zeros(SIZE), np.eye(SIZE), SIZE, freedom)


@pytest.mark.parametrize("round_", [True, False])
def test_a_drift_keeps_speed_stays_inside_and_can_be_walked_back(round_: bool) -> None:
    rng, possible = np.random.default_rng(1), small_set()
    shape = np.eye(SIZE) if round_ else np.linalg.cholesky(np.cov(rng.normal(size=(SIZE, 20))))
    start, n = np.zeros((CHAINS, SIZE)), rng.normal(size=(CHAINS, SIZE))
    there = ReflectedPaths(possible, shape, start.copy(), n.copy(), np.ones(CHAINS, dtype=bool))
    there.drift(1.0)
    assert there.sound.mean() > 0.99
    assert np.abs(there.z - n @ shape.T).max() > 1  # walls were met
    assert possible.margins(there.z[there.sound]).min() > -1e-12
    np.testing.assert_allclose(np.linalg.norm(there.n, axis=1), np.linalg.norm(n, axis=1), rtol=1e-10)
    back = ReflectedPaths(possible, shape, there.z.copy(), -there.n, there.sound.copy())
    back.drift(1.0)
    returned = np.abs(back.z[back.sound] - start[back.sound]).max(axis=1)
    assert np.quantile(returned, 0.95) < 1e-4  # reflections at corners magnify rounding


def test_acceptance_corrects_long_drifts() -> None:
    """Without walls, drifts of 1.2 deviations alone would give a variance of 1 / (1 - 0.36)."""
    rng, far = np.random.default_rng(2), small_set(1e6)
    z, kept, accepted = rng.normal(size=(CHAINS, SIZE)), [], []
    for _ in range(60):
        z, moved = next_points(isotropic(), far, z, rng, np.eye(SIZE), 1.2)
        kept.append(z)
        accepted.append(moved.mean())
    assert 0.4 < np.mean(accepted) < 0.95
    assert np.var(kept) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("freedom", [np.inf, 5.0])
def test_the_slope_is_that_of_the_energy(freedom: float) -> None:
    coordinates, z = isotropic(freedom), np.random.default_rng(3).normal(size=(1, SIZE))
    for k, unit in enumerate(1e-6 * np.eye(SIZE)):
        difference = (coordinates.energy(z + unit) - coordinates.energy(z - unit)) / 2e-6
        assert difference[0] == pytest.approx(coordinates.slope_of_energy(z)[0, k], rel=1e-6)
