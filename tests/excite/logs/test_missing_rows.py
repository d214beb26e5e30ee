"""Rows that are missing between others are events, of their kind and with their numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recordings import recorded, without_rows

from excite.logs.event import GARBAGE, MISSING, Event
from excite.logs.gaps import missing_rows
from excite.logs.signals.resampling import resample


def test_a_whole_log_misses_none():
    assert missing_rows(recorded()) == ()


def test_time_steps_show_them():
    (one, two) = missing_rows(without_rows(recorded(), np.array([1000, 3000, 3001])))
    assert (one.kind, one.rows) == (MISSING, (1000, 1001))
    assert (one.begin, one.end) == (pytest.approx(0.99901), pytest.approx(1.00099))
    assert two.rows == (2999, 3000)


def test_rows_that_were_removed_keep_their_kind_and_numbers():
    log = recorded()
    lost = np.zeros(log.count, dtype=bool)
    lost[100:103] = True
    (event,) = missing_rows(log.without(GARBAGE, lost))
    assert isinstance(event, Event)
    assert (event.kind, event.rows, event.left_out) == (GARBAGE, (101, 103), True)
    assert event.seconds == pytest.approx(4e-3, rel=0.02)


def test_uneven_stamps_are_no_gaps():
    time = np.cumsum(np.random.default_rng(0).exponential(1e-3, 6000))
    assert len(missing_rows(replace(recorded(), time=time))) == 0


def test_the_other_rows_keep_their_instants():
    log = recorded()
    holed = without_rows(log, np.array([1000, 3000, 3001, 3002]))
    uniform = resample(holed).log
    np.testing.assert_allclose(uniform.time, log.time, atol=1e-12)
    np.testing.assert_allclose(uniform.q, log.q, atol=2e-5)


def test_a_gap_is_bridged_without_corners():
    log = recorded(noise=1e-4)
    holed = without_rows(log, np.arange(2000, 2200))
    uniform = resample(holed).log
    smooth = recorded(noise=0.0)
    np.testing.assert_allclose(uniform.q[1900:2300], smooth.q[1900:2300], atol=5e-3)
