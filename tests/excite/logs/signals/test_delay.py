"""Motion at earlier or later instants, against the analytic motion of sines."""

from __future__ import annotations

import numpy as np
import pytest
from motions import random_sines

from excite.logs.signals.resampling import DelayedMotion, delayed
from regressors.samples import Samples

TIME = np.arange(2001) / 500
NAMES = ("q", "dq", "ddq", "dddq")


@pytest.mark.parametrize("delay", [0.004, 0.0013, -0.007, 0.05])
def test_sines_are_those_of_earlier_instants(delay: float) -> None:
    sines = random_sines(3, 0)
    moved, true = delayed(sines.samples(TIME), delay), sines.samples(TIME - delay)
    np.testing.assert_array_equal(moved.time, TIME)
    inside = (TIME - delay >= TIME[0]) & (TIME - delay <= TIME[-1])
    for name in NAMES:
        found, expected = getattr(moved, name), getattr(true, name)
        np.testing.assert_allclose(found[inside], expected[inside], atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize(("delay", "end"), [(0.02, 0), (-0.02, -1)])
def test_before_and_after_the_motion_its_ends_are_held(delay: float, end: int) -> None:
    samples = random_sines(2, 1).samples(TIME)
    moved = delayed(samples, delay)
    beyond = slice(0, 10) if end == 0 else slice(-10, None)
    for name in NAMES:
        np.testing.assert_allclose(getattr(moved, name)[beyond], np.tile(getattr(samples, name)[end], (10, 1)))


def test_no_delay_is_the_same_object() -> None:
    samples = random_sines(2, 2).samples(TIME)
    assert delayed(samples, 0.0) is samples


def test_there_and_back() -> None:
    samples = random_sines(2, 3).samples(TIME)
    back = delayed(delayed(samples, 0.0031), -0.0031)
    for name in NAMES:
        np.testing.assert_allclose(getattr(back, name)[10:-10], getattr(samples, name)[10:-10], atol=1e-5)


def test_whole_samples_are_shifted_rows() -> None:
    samples = random_sines(2, 4).samples(TIME)
    np.testing.assert_allclose(delayed(samples, 0.01).ddq[5:], samples.ddq[:-5], atol=1e-10)


def test_what_is_not_known_stays_unknown() -> None:
    motion = random_sines(2, 5).samples(TIME)
    samples = Samples(TIME, motion.q, motion.dq, motion.ddq, np.full_like(motion.q, np.nan))
    moved = delayed(samples, 0.002)
    assert np.all(np.isnan(moved.dddq))
    assert np.all(np.isfinite(moved.ddq))


def test_a_long_motion_is_delayed_by_stretches_as_in_one() -> None:
    time = np.arange(70_000) / 500
    samples = Samples(time, *np.random.default_rng(0).normal(size=(3, time.size, 1)), np.full((time.size, 1), np.nan))
    moved, whole = delayed(samples, 0.0123), DelayedMotion(samples).by(0.0123)
    for name in NAMES:
        np.testing.assert_allclose(getattr(moved, name), getattr(whole, name), atol=1e-12)
