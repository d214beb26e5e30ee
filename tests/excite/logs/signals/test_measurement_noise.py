"""Noise of measured torques: what is noise is found, what is motion, friction or an error of the model is not."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from excite.logs.signals.periods import HIGHEST_MOTION, measurement_noise, motion_ends

RATE, COUNT = 200.0, 4000
TIME = np.arange(COUNT) / RATE
TORQUE = (10 * np.sin(2 * np.pi * 0.3 * TIME) + 5 * np.sign(np.sin(2 * np.pi * 0.4 * TIME)))[:, None]


@pytest.mark.parametrize(("size", "above"), [(0.3, 5.0), (3.0, 5.0), (30.0, 5.0), (3.0, 40.0)])
def test_white_noise_is_found(size: float, above: float) -> None:
    off = []
    for seed in range(30):
        noise = size * np.random.default_rng(seed).normal(size=(COUNT, 1))
        found = measurement_noise(TORQUE + noise, noise + 0.03 * TORQUE, RATE, above)
        off.append((found.square[0] - np.mean(noise**2)) / found.deviation[0])
        assert found.square[0] == pytest.approx(np.mean(noise**2), rel=0.15)
    assert 0.4 < np.std(off) < 1.6  # its standard deviation is the one that is stated


def test_neither_motion_nor_an_error_of_the_model_is_noise() -> None:
    found = measurement_noise(TORQUE, 0.1 * TORQUE, RATE, 5.0)
    assert found.square[0] < 0.03 * np.mean((0.1 * TORQUE) ** 2)


def test_noise_of_the_predictions_is_not_that_of_the_measurement() -> None:
    noise = np.random.default_rng(0).normal(size=(COUNT, 1))
    slow = 10 * np.sin(2 * np.pi * 0.3 * TIME)[:, None]
    assert measurement_noise(slow, noise, RATE, 5.0).square[0] < 1e-3


def test_coloured_noise_is_never_taken_for_more_than_it_is() -> None:
    for pole in (0.5, 0.9, 0.99):
        white = np.random.default_rng(0).normal(size=(COUNT, 1))
        noise = scipy.signal.lfilter([1.0], [1.0, -pole], white, axis=0)
        found = measurement_noise(TORQUE + noise, noise, RATE, 5.0)
        assert found.square[0] < 1.1 * np.mean(noise**2)


def test_slow_sampling_shows_no_noise() -> None:
    found = measurement_noise(TORQUE[::20], TORQUE[::20], RATE / 20, 5.0)
    assert (found.square[0], found.level[0], found.deviation[0]) == (0.0, 0.0, 0.0)


def test_where_the_motion_ends() -> None:
    q = np.sin(2 * np.pi * 0.4 * TIME)[:, None]
    assert motion_ends(q, RATE) == pytest.approx(4.0, rel=0.3)
    assert motion_ends(np.sin(2 * np.pi * 3.0 * TIME)[:, None], RATE) == HIGHEST_MOTION
    assert motion_ends(np.zeros((COUNT, 1)), RATE) == HIGHEST_MOTION
