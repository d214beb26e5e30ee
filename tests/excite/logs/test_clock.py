"""Time is rebuilt where rows are even and stamps are not, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recordings import late, recorded, rounded, without_rows

from excite.logs.cleaning import with_true_time
from excite.logs.event import CLOCK, GARBAGE, MISSING
from excite.logs.gaps import missing_rows
from excite.logs.log import Removed


@pytest.mark.parametrize("step", [0.0, 1e-4])
def test_late_stamps_are_put_right(step):
    log = recorded(noise=1e-5)
    log = replace(log, q=rounded(log.q, step)) if step else log
    spoilt = late(log)
    found, (event,) = with_true_time(spoilt)
    assert (event.kind, event.left_out) == (CLOCK, False)
    assert "0.7 to" in event.text
    error = found.time - log.time
    assert np.std(error) < 5e-5 < 5e-4 < np.std(spoilt.time - log.time)


def test_true_stamps_of_uneven_samples_are_kept():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 6000))
    even = recorded()
    q = np.column_stack([np.interp(time, even.time, column) for column in recorded(noise=0.0).q.T])
    log = replace(even, time=time, q=q + 1e-6 * rng.normal(size=q.shape))
    assert with_true_time(log)[0] is log


def test_even_stamps_are_kept():
    log = recorded()
    assert with_true_time(log)[0] is log


def test_noise_that_hides_the_clock_leaves_it():
    assert with_true_time(late(recorded(noise=0.1)))[1] == ()


def test_lost_rows_stay_lost():
    log, gone = recorded(), np.array([1500, 2600, 2601, 2602, 4200])
    found, _ = with_true_time(late(without_rows(log, gone)))
    kept = np.setdiff1d(np.arange(log.count), gone)
    assert np.ptp(found.time - log.time[kept]) < 2e-4
    events = missing_rows(found)
    assert [(event.kind, event.rows[0]) for event in events] == [(MISSING, 1500), (MISSING, 2599), (MISSING, 4196)]


@pytest.mark.parametrize("written_over", [False, True])
def test_garbage_between_the_rows_takes_no_time_unless_a_row_is_lost(written_over):
    log = recorded()
    numbers = np.arange(1, log.count + 1)
    garbage = np.array([1501, 2601, 4201])
    if written_over:
        spoilt = late(log).without(GARBAGE, np.isin(numbers, garbage))
        true = np.delete(log.time, garbage - 1)
    else:
        shifted = numbers + np.searchsorted(garbage, numbers, side="right")
        spoilt = replace(late(log), numbers=shifted, removed=(Removed(GARBAGE, garbage + np.arange(3)),))
        true = log.time
    assert np.ptp(with_true_time(spoilt)[0].time - true) < 2e-4
