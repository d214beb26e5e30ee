"""Friction from logs with gaps: noise, windows and break-aways without those in which samples are missing."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from breakaway_ramps import ramps, recorded, without
from friction_runs import fitted, log, runs
from played import irp6

from excite.friction.fit.breakaway_torque import break_aways
from excite.friction.fit.constant_speed_windows import WindowSearch, constant_windows, position_noise
from excite.friction.fit.points import drive_log


def test_a_gap_in_motion_is_no_noise() -> None:
    t = np.arange(0.0, 10.0, 1e-3)
    z = (0.5 * np.sin(t) + np.random.default_rng(0).normal(0.0, 1e-5, t.size))[:, None]
    kept = (t < 6.0) | (t > 6.03)
    assert float(position_noise(t, z)[0]) == pytest.approx(1e-5, rel=0.05)
    assert float(position_noise(t[kept], z[kept])[0]) == pytest.approx(1e-5, rel=0.05)


def test_a_gap_costs_no_break_away_but_those_beside_it() -> None:
    t, z, tau = ramps(14.1, 9.0, 1e-4, controlled=False)
    later = t[-1] + np.arange(1, 3000) * (t[1] - t[0])
    way = z[-1] + 0.4 * (1 - np.cos(2 * np.maximum(later - t[-1] - 3.0, 0.0)))
    whole = recorded(np.r_[t, later], np.r_[z, way], np.r_[tau, 0 * later], noise=0.5)
    moving = without(whole, t[-1] + 3.5, t[-1] + 3.54)
    found = [break_aways(drive_log(one, irp6()), "z1", None, controlled=False) for one in (whole, moving)]
    assert [one.direction for one in found[1] if one.time < t[-1]] == [1, -1]
    assert [one.torque for one in found[1]][:2] == pytest.approx([one.torque for one in found[0]][:2], abs=0.1)
    at = found[0][0].time
    beside = break_aways(drive_log(without(whole, at - 0.02, at + 0.03), irp6()), "z1", None, controlled=False)
    assert [one.direction for one in beside if one.time < t[-1]] == [-1]


def test_a_planned_window_with_a_gap_in_it_is_missing() -> None:
    w = runs().windows[2]
    middle = 0.5 * (w.start + w.end)
    one = fitted(without(log(), middle - 0.5, middle + 0.5))
    assert len(one.points) == 5
    assert any("1 of the plan's windows are missing or interrupted by a gap (1)" in note for note in one.notes)
    assert any("left out: 0 whose speed" in note for note in one.notes)
    bridged = fitted(without(log(), middle - 0.005, middle + 0.005))
    assert len(bridged.points) == 6


def test_windows_shorter_than_a_row_take_no_more_than_the_log() -> None:
    time = np.arange(0.0, 10.0, 0.002)
    tracemalloc.start()
    try:
        found = constant_windows(time, 0.3 * time, np.zeros((time.size, 0)), WindowSearch(1e-6, 0.05, 1e-3))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (found.windows, found.changing, found.resting) == ((), 0, 0)
    assert peak < 100 * time.nbytes
