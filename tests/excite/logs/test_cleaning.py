"""Time rebuilt, held rows left out, missing ones told, wrong readings and resets: and good rows let alone."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from recordings import held, late, recorded, rounded, some_rows, struck, without_rows
from refused import refusal

from excite.logs.cleaning import cleaned, held_rows, with_true_time, without_held_rows
from excite.logs.event import CLOCK, GARBAGE, HELD, MISSING, RATE, SPIKE, missing_rows
from excite.logs.impacts import check_resets, without_spikes
from excite.logs.log import Removed
from excite.logs.signals.method import resample
from regressors.readers.library import built_in


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


def test_true_stamps_are_kept_and_those_that_noise_hides():
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 6000))
    even = recorded()
    q = np.column_stack([np.interp(time, even.time, column) for column in recorded(noise=0.0).q.T])
    for log in (even, replace(even, time=time, q=q + 1e-6 * rng.normal(size=q.shape))):
        assert with_true_time(log)[0] is log
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
    numbers, garbage, true = np.arange(1, log.count + 1), np.array([1501, 2601, 4201]), log.time
    if written_over:
        spoilt, true = late(log).without(GARBAGE, np.isin(numbers, garbage)), np.delete(true, garbage - 1)
    else:
        shifted = numbers + np.searchsorted(garbage, numbers, side="right")
        spoilt = replace(late(log), numbers=shifted, removed=(Removed(GARBAGE, garbage + np.arange(3)),))
    assert np.ptp(with_true_time(spoilt)[0].time - true) < 2e-4


def coupled(q: np.ndarray) -> np.ndarray:
    """Two encoders that mostly step together, of which one joint has the difference, rounded in its last bits."""
    z = rounded(np.column_stack([q[:, 0], q[:, 1], q[:, 1] + 0.1 * q[:, 2]]), 1e-4)
    return np.column_stack([z[:, 0], z[:, 1], z[:, 2] - z[:, 1]])


RESTING = replace(recorded(), q=np.where(recorded().time[:, None] < 3, recorded().q, recorded().q[3000]))
CLEAN = {
    "as it is": recorded(),
    "slow and coarse": replace(recorded(), q=rounded(0.01 * recorded().q, 1e-5)),
    "very coarse": replace(recorded(), q=rounded(recorded().q, 1e-3)),
    "coarse torques too": replace(recorded(), q=rounded(recorded().q, 1e-2), effort=rounded(recorded().effort, 1.0)),
    "coupled encoders": replace(recorded(), q=coupled(0.02 * recorded().q)),
    "at rest": RESTING,
    "no noise": replace(recorded(noise=0.0), effort=None),
}


@pytest.mark.parametrize("log", CLEAN.values(), ids=CLEAN.keys())
def test_clean_logs_have_no_held_rows(log):
    fresh, events = without_held_rows(log)
    assert fresh is log
    assert events == ()


@pytest.mark.parametrize("channels", [("q", "dq", "effort"), ("q", "dq"), ("effort",)], ids="-".join)
@pytest.mark.parametrize("share", [0.01, 0.1])
def test_held_rows_are_left_out_by_their_numbers(share, channels):
    log = recorded()
    rows = some_rows(log, share)
    fresh, _ = without_held_rows(held(log, rows, channels))
    (removed,) = fresh.removed
    assert removed.kind == HELD
    assert np.isin(removed.numbers - 1, rows).all()
    assert removed.numbers.size >= 0.98 * rows.size
    np.testing.assert_array_equal(fresh.row_numbers, np.setdiff1d(np.arange(1, log.count + 1), removed.numbers))
    np.testing.assert_array_equal(fresh.time, log.time[fresh.row_numbers - 1])


def test_a_recorder_hangs_and_a_robot_at_rest_repeats_itself():
    assert np.count_nonzero(held_rows(held(recorded(), np.arange(2000, 2030)))) == 30
    quiet = replace(RESTING, effort=np.where(RESTING.time[:, None] < 3, RESTING.effort, RESTING.effort[3000]))
    assert not held_rows(quiet)[3100:].any()


def test_a_row_that_comes_late_is_left_out():
    log = recorded()
    again = np.arange(log.count)
    again[[1200, 2900]] -= 4, 15
    late = replace(log, q=log.q[again], effort=log.effort[again])
    np.testing.assert_array_equal(np.flatnonzero(held_rows(late)), [1200, 2900])


def test_one_joint_hangs_and_makes_up_for_it_and_one_that_steps_does_not():
    log, rows = recorded(), np.concatenate([np.arange(k, k + 9) for k in (1000, 2500, 3300)])
    hung, stepped = log.q.copy(), log.q.copy()
    for k, first in enumerate(rows[::9]):
        hung[first : first + 9, k % 2] = hung[first - 1, k % 2]
    stepped[:2000, 0], stepped[2000:, 0] = log.q[0, 0], log.q[0, 0] + 0.1
    np.testing.assert_array_equal(np.flatnonzero(held_rows(replace(log, q=hung))), rows)
    assert not held_rows(replace(log, q=stepped)).any()


@pytest.mark.parametrize("length", [4, 12, 20])
def test_a_slow_recorder_that_hangs_and_catches_up_is_seen_in_all_of_its_rows(length):
    log, rows = recorded(seconds=10.0, rate=97.0), np.arange(400, 400 + length)
    np.testing.assert_array_equal(np.flatnonzero(held_rows(held(log, rows))), rows)


@pytest.mark.parametrize(("pattern", "rate"), [([1, 0], 500.0), ([1, 0, 0, 0], 250.0), ([1, 0, 1, 0, 0], 400.0)])
def test_a_lower_rate_is_no_event(pattern, rate):
    log = recorded()
    fresh = np.resize(pattern, log.count).astype(bool)
    found, (event,) = without_held_rows(held(log, np.flatnonzero(~fresh)))
    assert (event.kind, event.left_out) == (RATE, False)
    assert f"updated at {rate:.3g}" in event.text
    assert found.rate == pytest.approx(rate, rel=0.3)
    assert found.count <= 1.1 * np.count_nonzero(fresh)


def test_rows_that_were_removed_keep_their_kind_and_numbers():
    log = recorded()
    lost = np.zeros(log.count, dtype=bool)
    lost[100:103] = True
    (event,) = missing_rows(log.without(GARBAGE, lost))
    assert (event.kind, event.rows, event.left_out) == (GARBAGE, (101, 103), True)
    assert event.seconds == pytest.approx(4e-3, rel=0.02)


def test_the_other_rows_keep_their_instants_and_gaps_are_bridged_without_corners():
    log = recorded()
    uniform = resample(without_rows(log, np.array([1000, 3000, 3001, 3002]))).log
    np.testing.assert_allclose(uniform.time, log.time, atol=1e-12)
    np.testing.assert_allclose(uniform.q, log.q, atol=2e-5)
    long = resample(without_rows(recorded(noise=1e-4), np.arange(2000, 2200))).log
    np.testing.assert_allclose(long.q[1900:2300], recorded(noise=0.0).q[1900:2300], atol=5e-3)


PANDA = built_in("panda")
LOG = replace(recorded(), joints=PANDA.joint_names[:3])


def moved(rows, size):
    q = LOG.q.copy()
    q[rows, 1] += size
    return replace(LOG, q=q)


@pytest.mark.parametrize("log", [LOG, struck(LOG, 2.0, 3.0), recorded(), replace(LOG, q=60 * LOG.q)])
def test_motion_is_neither(log):
    assert without_spikes(log, PANDA) is log
    check_resets(log, PANDA)


@pytest.mark.parametrize("least", [0.0, -np.pi])
@pytest.mark.parametrize("middle", [0.0, np.pi])
def test_positions_that_wrap_around_go_on_within_the_limits(least, middle):
    log = replace(LOG, q=LOG.q + middle)  # about either end of a turn, or where no reading wraps
    limits = {"lower": np.full(7, middle - 2.9), "upper": np.full(7, middle + 2.9)}
    robot = replace(PANDA, limits=replace(PANDA.limits, **limits))
    found, _ = cleaned(replace(log, q=(log.q - least) % (2 * np.pi) + least), robot)
    np.testing.assert_allclose(found.q, log.q, atol=1e-9)
    assert cleaned(log, robot)[0].left_out == ()


def test_positions_in_degrees_are_not_turned_into_the_limits():
    log = replace(LOG, q=LOG.q + 20 * np.pi)
    np.testing.assert_array_equal(cleaned(log, PANDA)[0].q, log.q)


@pytest.mark.parametrize("rows", [slice(2000, 2001), slice(2000, 2004)])
def test_wrong_readings_are_left_out(rows):
    log = without_spikes(moved(rows, 0.3), PANDA)
    (removed,) = log.removed
    assert removed.kind == SPIKE
    np.testing.assert_array_equal(removed.numbers, np.arange(LOG.count)[rows] + 1)
    check_resets(log, PANDA)


def test_resets_are_refused_with_their_row_and_the_rows_to_use():
    log = moved(slice(2000, None), 0.05)
    assert without_spikes(log, PANDA) is log
    message = r"panda_joint2 jumps by 0.05 rad in row 2001.*`rows='1:2000'`.*`rows='2001:6000'`"
    assert re.search(message, refusal(check_resets, log, PANDA))
    check_resets(log.rows(slice(2000, None)), PANDA)
