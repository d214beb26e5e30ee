"""Windows of a long motion: as many as asked for, spread over all of it, also where it repeats itself."""

from __future__ import annotations

import numpy as np
import pytest

from excite.simulation.replay import chosen_windows


@pytest.mark.parametrize(("count", "most"), [(1, 1), (1, 60), (59, 60), (60, 60)])
def test_few_windows_are_all_chosen(count: int, most: int) -> None:
    np.testing.assert_array_equal(chosen_windows(count, most), np.arange(count))


@pytest.mark.parametrize(("count", "most"), [(61, 60), (91, 60), (120, 60), (1200, 60), (1201, 7), (5, 1)])
def test_one_window_is_chosen_in_each_stretch(count: int, most: int) -> None:
    chosen = chosen_windows(count, most)
    assert chosen.size == most
    assert np.all(np.diff(chosen) > 0)
    edges = np.arange(most + 1) * count // most
    assert np.all((chosen >= edges[:-1]) & (chosen < edges[1:]))


@pytest.mark.parametrize("period", [2, 5, 10, 20, 40])
def test_every_part_of_a_repeated_motion_is_seen_alike(period: int) -> None:
    """1200 windows by twenties: at equal distances all would be the first of their period."""
    phase = chosen_windows(1200, 60) % period / period
    early = np.mean(phase < 0.5)
    assert early == pytest.approx((period + 1) // 2 / period, abs=0.07)
    assert np.unique(phase).size >= min(period, 20) * 0.75
