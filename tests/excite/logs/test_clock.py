"""Time is rebuilt where rows are even and stamps are not, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from troubled import late, recorded, rounded, without_rows

from excite.logs.clock import with_true_time
from excite.logs.event import CLOCK, MISSING
from excite.logs.missing_rows import missing_rows


@pytest.mark.parametrize("step", [0.0, 1e-4])
def test_late_stamps_are_put_right(step):
    log = recorded(noise=1e-5)
    log = replace(log, q=rounded(log.q, step)) if step else log
    spoilt = late(log)
    (event,) = (found := with_true_time(spoilt)).events
    assert (event.kind, event.left_out) == (CLOCK, False)
    assert "0.7 to" in event.text
    error = found.log.time - log.time
    assert np.std(error) < 5e-5 < 5e-4 < np.std(spoilt.time - log.time)


def test_true_stamps_of_uneven_samples_are_kept():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 6000))
    even = recorded()
    q = np.column_stack([np.interp(time, even.time, column) for column in recorded(noise=0.0).q.T])
    log = replace(even, time=time, q=q + 1e-6 * rng.normal(size=q.shape))
    assert with_true_time(log).log is log


def test_even_stamps_are_kept():
    log = recorded()
    assert with_true_time(log).log is log


def test_noise_that_hides_the_clock_leaves_it():
    assert with_true_time(late(recorded(noise=0.1))).events == ()


def test_lost_rows_stay_lost():
    log, gone = recorded(), np.array([1500, 2600, 2601, 2602, 4200])
    found = with_true_time(late(without_rows(log, gone)))
    kept = np.setdiff1d(np.arange(log.count), gone)
    assert np.ptp(found.log.time - log.time[kept]) < 2e-4
    events = missing_rows(found.log)
    assert [(event.kind, event.rows[0]) for event in events] == [(MISSING, 1500), (MISSING, 2599), (MISSING, 4196)]
