"""Drive gains from a load of known mass: planted gains come back, with the deviation that is stated."""

from __future__ import annotations

import numpy as np
import pytest
from observed import observations_of

from excite.identification.drive_gains import drive_gains
from excite.identification.observations import Observations
from regressors.errors import InputError
from regressors.samples import Array

R, P, INSTANTS = 3, 5, 120
MASS = 2.5
GAINS = np.array([1.1, 0.9, 1.25])
NOISE = np.array([0.05, 0.2, 0.02])


def experiment(gains: Array, noise: float, seed: int) -> tuple[Observations, Array, Array, Array]:
    """Half of the instants with the load; what is measured are torques over the gains, with noise."""
    truth = np.random.default_rng(99)
    W, K = truth.normal(size=(INSTANTS, R, P)), truth.normal(size=(INSTANTS, R, 10))
    K[: INSTANTS // 2] = 0.0
    beta, phi = truth.normal(size=P), np.concatenate([[MASS], 0.3 * truth.normal(size=9)])
    e = noise * NOISE * np.random.default_rng(seed).normal(size=(INSTANTS, R))
    y = (W @ beta + K @ phi) / gains + e
    observations = observations_of(W.reshape(-1, P), y.ravel(), equations=R)
    return observations, K.reshape(-1, 10), beta, phi


@pytest.mark.parametrize("common", [False, True])
def test_planted_gains_come_back(common: bool) -> None:
    gains = np.full(R, 1.3) if common else GAINS
    observations, K, beta, phi = experiment(gains, 1e-6, 0)
    found = drive_gains(observations, K, MASS, common=common)
    np.testing.assert_allclose(found.factor, gains, rtol=1e-6)
    np.testing.assert_allclose(found.load, phi, atol=1e-6)
    np.testing.assert_allclose(found.beta, beta, atol=1e-6)
    assert found.load[0] == pytest.approx(MASS, rel=1e-12)
    assert found.equations == ("joint1", "joint2", "joint3")


def test_a_wrong_mass_scales_everything_alike() -> None:
    observations, K, beta, _ = experiment(GAINS, 1e-6, 0)
    found = drive_gains(observations, K, 2 * MASS, common=False)
    np.testing.assert_allclose(found.factor, 2 * GAINS, rtol=1e-6)
    np.testing.assert_allclose(found.beta, 2 * beta, atol=1e-5)


@pytest.mark.parametrize("common", [False, True])
def test_the_stated_deviation_is_that_of_repeated_experiments(common: bool) -> None:
    gains = np.full(R, 1.3) if common else GAINS
    found = [drive_gains(*experiment(gains, 1.0, seed)[:2], MASS, common=common) for seed in range(200)]
    factors, stated = (np.array([getattr(f, name) for f in found]) for name in ("factor", "deviation"))
    np.testing.assert_allclose(stated.mean(axis=0), factors.std(axis=0), rtol=0.2)
    # no bias beyond the square of the noise
    assert np.all(np.abs(factors.mean(axis=0) - gains) < 4 * stated.mean(axis=0) / np.sqrt(200) + 1e-4)


def test_one_gain_for_all_is_surer_than_one_each() -> None:
    observations, K, *_ = experiment(np.full(R, 1.3), 1.0, 1)
    common, each = (drive_gains(observations, K, MASS, common=kind) for kind in (True, False))
    assert np.ptp(common.factor) == np.ptp(common.deviation) == 0.0
    assert np.all(common.deviation < each.deviation)


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan"), float("inf")])
def test_a_mass_must_be_one(mass: float) -> None:
    observations, K, *_ = experiment(GAINS, 0.0, 0)
    with pytest.raises(InputError, match=f"must be a positive number of kilograms, given {mass}"):
        drive_gains(observations, K, mass, common=True)


def test_the_load_must_be_there() -> None:
    observations, K, *_ = experiment(GAINS, 0.1, 0)
    with pytest.raises(InputError, match="no row is of a motion with the load"):
        drive_gains(observations, np.zeros_like(K), MASS, common=True)


def test_every_joint_must_feel_robot_or_load() -> None:
    observations, K, *_ = experiment(GAINS, 0.1, 0)
    third = observations.equation == 2
    W, y = observations.W.copy(), observations.y.copy()
    W[third], K[third], y[third] = 0.0, 0.0, np.random.default_rng(0).normal(size=third.sum())
    blind = observations_of(W, y, equations=R)
    with pytest.raises(InputError, match="the drive gains are not identifiable from the motion"):
        drive_gains(blind, K, MASS, common=False)
