"""Choice of the delay: planted delays are inside their intervals, and none stays exactly none."""

from __future__ import annotations

import numpy as np
import pytest

from excite.identification.choices.cutoff_and_timing import choose_delay
from excite.identification.choices.left_out import BlockStatistics, LeftOut, left_out, time_blocks

TIME = np.arange(0.0, 8.0, 0.008)
RNG = np.random.default_rng(0)
FREQUENCIES, PHASES = RNG.uniform(2.0, 20.0, (3, 4)), RNG.uniform(0, 6, (3, 4))


def columns(time: np.ndarray) -> np.ndarray:
    """Three columns of each of two equations, sums of sines."""
    waves = np.sin(time[:, None, None] * FREQUENCIES + PHASES).sum(axis=2)
    return np.stack([waves, np.roll(waves, 1, axis=1)], axis=1)


def scored_of(delay: float, noise: float, seed: int):
    """Left-out errors of torques that were recorded some time after the columns."""
    torque = columns(TIME - delay) @ np.array([2.0, -1.0, 0.5])
    torque = torque + noise * np.random.default_rng(seed).normal(size=torque.shape)
    blocks = time_blocks([TIME])

    def scored(tried: float) -> LeftOut:
        return left_out(BlockStatistics.of([columns(TIME - tried)], [torque], blocks))

    return scored


@pytest.mark.parametrize("delay", [0.004, -0.006, 0.0015, 0.018, 0.031, -0.044])
def test_planted_delays_are_found_within_their_intervals(delay: float) -> None:
    found, choice = choose_delay(scored_of(delay, 0.1, 1), 0.008)
    assert choice.interval is not None
    low, high = choice.interval
    assert low <= delay <= high
    assert 2 * 0.0008 < high - low < 2 * 0.0012  # a tenth of the sample time is the resolution
    assert (choice.value, choice.unit) == (found, "s")
    assert ("ms before them" if delay > 0 else "ms after them") in choice.reason
    assert [c.value for c in choice.candidates] == sorted(c.value for c in choice.candidates)
    assert 0.0 in [c.value for c in choice.candidates]


def test_intervals_cover() -> None:
    """99 % intervals from five blocks: of 30 experiments, at most 2 may miss."""
    missed = 0
    for seed in range(30):
        _, choice = choose_delay(scored_of(0.003, 0.3, seed), 0.008)
        assert choice.interval is not None
        missed += not choice.interval[0] <= 0.003 <= choice.interval[1]
    assert missed <= 2


def test_a_delay_beyond_the_longest_is_none() -> None:
    found, choice = choose_delay(scored_of(0.08, 0.1, 1), 0.008)
    assert (found, choice.interval) == (0.0, None)


@pytest.mark.parametrize("noise", [0.0, 0.01, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_no_delay_is_exactly_none(noise: float, seed: int) -> None:
    found, choice = choose_delay(scored_of(0.0, noise, seed), 0.008)
    assert (found, choice.value, choice.interval) == (0.0, 0.0, None)
    assert "no delay" in choice.reason
