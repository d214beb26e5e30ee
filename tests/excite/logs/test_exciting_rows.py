"""The exciting stretch of a log: found between idling, approach and return."""

from __future__ import annotations

import numpy as np
import pytest
from recordings import log_of, real_log

from excite.logs.excitation import exciting_rows, mean_speed, span_ends
from regressors.errors import InputError

RATE = 100.0


def quintic(seconds, start, end):
    s = np.arange(round(seconds * RATE)) / (seconds * RATE)
    return start + (end - start) * s**3 * (10 - 15 * s + 6 * s**2)


def rest(seconds, at):
    return np.full(round(seconds * RATE), at)


def excitation(seconds, at):
    t = np.arange(round(seconds * RATE)) / RATE
    return at + 0.4 * np.sin(2 * np.pi * t / seconds) * np.sin(2 * np.pi * 0.7 * t)


def recording(*parts, noise=1e-5, seed=0):
    q = np.concatenate(parts)
    q = np.column_stack([q, -0.6 * q]) + noise * np.random.default_rng(seed).normal(size=(q.size, 2))
    return log_of(1000.0 + np.arange(q.shape[0]) / RATE, np.round(q, 6))


def moving(*parts, **more):
    """Rows and words for parts, each given as a time and the name of what happens."""
    return exciting_rows(recording(*parts, **more))


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-4])
def test_idling_approach_and_return_are_left_out(noise):
    parts = [rest(3, 0), quintic(2, 0, 0.5), rest(1, 0.5), excitation(20, 0.5), rest(1, 0.5), quintic(2, 0.5, 0)]
    rows, said = moving(*parts, rest(2, 0), noise=noise)
    assert rows.start == pytest.approx(600, abs=20)
    assert rows.stop == pytest.approx(2600, abs=20)
    assert f"rows {rows.start + 1} to {rows.stop} of 3100 excite" in said
    assert f"left out before them: {rows.start} rows" in said
    assert f"left out after them: {3100 - rows.stop} rows" in said


def test_a_log_that_excites_throughout_is_kept_whole():
    rows, said = moving(excitation(20, 0.5)[40:-40])
    assert (rows.start, rows.stop) == (0, 1920)
    assert "left out" not in said


def test_two_excitations_are_kept_together():
    rows, _ = moving(rest(1, 0.5), excitation(10, 0.5), rest(2, 0.5), excitation(10, 0.5), rest(1, 0.5))
    assert rows.start == pytest.approx(100, abs=15)
    assert rows.stop == pytest.approx(2300, abs=15)


def test_moves_from_point_to_point_are_all_kept():
    rows, _ = moving(
        rest(2, 0), quintic(2, 0, 1), rest(1, 1), quintic(2, 1, 2), rest(1, 2), quintic(2, 2, 0), rest(2, 0)
    )
    assert rows.start == pytest.approx(200, abs=20)
    assert rows.stop == pytest.approx(1000, abs=20)


def test_a_slow_approach_is_left_out_however_long_it_takes():
    rows, _ = moving(rest(2, 0), quintic(8, 0, 0.5), rest(1, 0.5), excitation(20, 0.5), rest(1, 0.5))
    assert rows.start == pytest.approx(1100, abs=20)


def test_a_short_trial_before_is_left_out():
    rows, _ = moving(excitation(2, 0.5), rest(2, 0.5), excitation(20, 0.5))
    assert rows.start == pytest.approx(400, abs=15)


def test_units_and_the_origin_of_time_do_not_matter():
    log = recording(rest(3, 0), quintic(2, 0, 0.5), rest(1, 0.5), excitation(20, 0.5), rest(2, 0.5))
    one, other = exciting_rows(log)[0], exciting_rows(log_of(log.time - log.time[0], 3.0 * log.q + 1.0))[0]
    assert (other.start, other.stop) == pytest.approx((one.start, one.stop), abs=1)  # time rounds differently


@pytest.mark.parametrize("parts", [[rest(5, 0.2)], [rest(0.05, 0.2)]])
def test_no_motion_is_refused(parts):
    with pytest.raises(InputError, match="LOG: no joint moves"):
        moving(*parts)


@pytest.mark.parametrize(
    ("name", "start", "stop"),
    [
        ("ur-20_02_10-30sec_12harm", 635, 3510),
        ("ur-20_02_05-20sec_8harm", 320, 2310),
        ("ur-20_01_31-unload", 348, 2474),
        ("ur-20_01_31-load", 494, 2619),
    ],
)
def test_rows_of_recorded_logs_are_those_that_people_chose(name, start, stop):
    """The first two are published (the second end with half a second of rest); the others show a move, then a pause."""
    rows, said = exciting_rows(real_log(name))
    assert rows.start == pytest.approx(start, abs=15)
    assert rows.stop == pytest.approx(stop, abs=40)
    assert "with motion of 0." in said


def test_the_whole_point_to_point_motion_is_kept():
    rows, _ = exciting_rows(real_log("ur-20_01_17-ptp_10_points"))
    assert rows.start < 700
    assert rows.stop > 4200
    assert rows.stop - rows.start < 4000


@pytest.mark.parametrize("count", [2, 3, 9, 10, 11, 12, 300])
def test_mean_speeds_are_those_over_the_spans(count):
    rng = np.random.default_rng(count)
    log = log_of(np.cumsum(rng.uniform(0.8, 1.2, count)) / RATE, rng.normal(size=(count, 2)))
    for row, (a, b) in enumerate(zip(*span_ends(log), strict=True)):
        expected = (log.q[b] - log.q[a]) / (log.time[b] - log.time[a])
        np.testing.assert_array_equal(mean_speed(log)[row], expected)
