"""Held rows are found while the robot moves; coarse encoders, standstill and lower rates are not taken for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recordings import held, recorded, rounded, some_rows

from excite.logs.cleaning import held_rows, without_held_rows
from excite.logs.event import HELD, RATE

CLEAN = {
    "as it is": recorded(),
    "slow and coarse": replace(recorded(), q=rounded(0.01 * recorded().q, 1e-5)),
    "very coarse": replace(recorded(), q=rounded(recorded().q, 1e-3)),
    "coarse torques too": replace(recorded(), q=rounded(recorded().q, 1e-2), effort=rounded(recorded().effort, 1.0)),
    "at rest": replace(recorded(), q=np.where(recorded().time[:, None] < 3, recorded().q, recorded().q[3000])),
    "no noise": replace(recorded(noise=0.0), effort=None),
}


@pytest.mark.parametrize("log", CLEAN.values(), ids=CLEAN.keys())
def test_clean_logs_have_none(log):
    fresh, events = without_held_rows(log)
    assert fresh is log
    assert events == ()


@pytest.mark.parametrize("channels", [("q", "dq", "effort"), ("q", "dq"), ("effort",)], ids="-".join)
@pytest.mark.parametrize("share", [0.01, 0.06, 0.1])
def test_held_rows_are_left_out_by_their_numbers(share, channels):
    log = recorded()
    rows = some_rows(log, share)
    fresh, _ = without_held_rows(held(log, rows, channels))
    (removed,) = fresh.removed
    assert removed.kind == HELD
    moving = np.isin(removed.numbers - 1, rows)
    assert moving.all()
    assert removed.numbers.size >= 0.98 * rows.size
    np.testing.assert_array_equal(fresh.row_numbers, np.setdiff1d(np.arange(1, log.count + 1), removed.numbers))
    np.testing.assert_array_equal(fresh.time, log.time[fresh.row_numbers - 1])


def test_a_recorder_that_hangs_is_no_standstill():
    log = recorded()
    assert np.count_nonzero(held_rows(held(log, np.arange(2000, 2030)))) == 30


def test_a_robot_at_rest_repeats_itself_rightly():
    log = replace(recorded(), q=np.where(recorded().time[:, None] < 3, recorded().q, recorded().q[3000]))
    quiet = replace(log, effort=np.where(log.time[:, None] < 3, log.effort, log.effort[3000]))
    assert not held_rows(quiet)[3100:].any()


@pytest.mark.parametrize(("pattern", "rate"), [([1, 0], 500.0), ([1, 0, 0, 0], 250.0), ([1, 0, 1, 0, 0], 400.0)])
def test_a_lower_rate_is_no_event(pattern, rate):
    log = recorded()
    fresh = np.resize(pattern, log.count).astype(bool)
    found, (event,) = without_held_rows(held(log, np.flatnonzero(~fresh)))
    assert (event.kind, event.left_out) == (RATE, False)
    assert f"updated at {rate:.3g}" in event.text
    assert found.rate == pytest.approx(rate, rel=0.3)
    assert found.count <= 1.1 * np.count_nonzero(fresh)
