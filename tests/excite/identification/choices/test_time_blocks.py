"""Blocks of time: every instant lies in one, or in a gap."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.identification.choices.left_out import time_blocks


def test_blocks_follow_each_other_with_gaps_of_a_fifth() -> None:
    time = np.arange(10_001) / 10_000
    (block,) = time_blocks([time])
    assert np.unique(block).tolist() == [-1, 0, 1, 2, 3, 4]
    assert np.all(np.diff(block[block >= 0]) >= 0)
    for k in range(5):
        inside = time[block == k]
        assert inside[0] == pytest.approx(max(0.0, 0.2 * k + 0.02 * (k > 0)), abs=2e-4)
        assert inside[-1] == pytest.approx(0.2 * (k + 1) - 0.02 * (k < 4), abs=2e-4)


def test_gaps_of_long_logs_are_half_a_second() -> None:
    time = np.arange(0, 100, 0.01)
    (block,) = time_blocks([time])
    gaps = time[block < 0]
    assert np.ptp(gaps[gaps < 25]) == pytest.approx(0.5, abs=0.03)
    assert np.count_nonzero(block < 0) == pytest.approx(4 * 50, abs=8)


@pytest.mark.parametrize(("logs", "each"), [(1, 5), (2, 3), (3, 2), (7, 2)])
def test_logs_share_the_blocks_and_number_them_on(logs: int, each: int) -> None:
    blocks = time_blocks([np.arange(0, 10, 0.01) + k for k in range(logs)])
    assert np.unique(np.concatenate(blocks)).tolist() == list(range(-1, logs * each))
    for k, block in enumerate(blocks):
        assert set(block[block >= 0].tolist()) == set(range(k * each, (k + 1) * each))


def test_a_log_without_instants_has_no_blocks() -> None:
    none, some = time_blocks([np.empty(0), np.arange(0, 10, 0.1)])
    assert none.size == 0
    assert np.count_nonzero(some >= 0) > 50


lengths = st.lists(st.integers(1, 200), min_size=1, max_size=4)


@given(lengths, st.integers(2, 9), st.floats(1e-3, 10.0), st.floats(-1e3, 1e3), st.integers(0, 99))
def test_every_instant_is_in_a_block_or_in_a_gap(counts, number, step, start, seed) -> None:
    draws = np.random.default_rng(seed)
    times = [start + np.cumsum(step * draws.uniform(0.5, 1.5, count)) for count in counts]
    blocks = time_blocks(times, number)
    each = max(2, -(-number // len(times)))
    for k, (time, block) in enumerate(zip(times, blocks, strict=True)):
        assert block.shape == time.shape
        inside = block[block >= 0]
        assert np.all((inside >= k * each) & (inside < (k + 1) * each))
        assert np.all(np.diff(inside) >= 0)
        length = (time[-1] - time[0]) / each
        near = min(0.2 * length, 0.5) / 2
        edges = time[0] + length * np.arange(1, each)
        distance = np.abs(time[:, None] - edges).min(axis=1)
        assert np.all(distance[block < 0] <= near + 1e-9)
        assert np.all(distance[block >= 0] >= near - 1e-9)
        if time.size > 40:
            assert np.mean(block < 0) < 0.35
