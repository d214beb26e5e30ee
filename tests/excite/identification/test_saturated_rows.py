"""Rows in which a torque was at its limit make no equations, and what is said of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, LOAD, TASK, described, found, periodic, played, three_joints

from excite.identification.preparation import spans_in_mean
from excite.logs.log import Log
from excite.logs.saturation import Saturation, Spans, saturation_of, within
from excite.tasks.task import Task
from excite.verification.verify import verify
from regressors.errors import InputError

AUTO = replace(EXACT, rows="auto")
SPANS = ((0.5, 0.7), (1.0, 1.2))


def saturated(log: Log, spans: Spans = SPANS, cut: float = 100.0) -> Log:
    """The log, its second torque known to be at a limit in some spans, where the recorded one is not what acted."""
    effort = log.effort.copy()
    lost = within(log.time, spans)
    effort[lost, 1] = cut
    return replace(log, effort=effort, saturated=(saturation_of("joint q2", cut, "Nm", log.time, lost),))


def test_rows_at_a_limit_do_not_reach_the_estimate() -> None:
    clean = played(three_joints(), 3)
    result = found(TASK, saturated(clean), recipe=AUTO)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-6, atol=1e-6)
    lost = np.count_nonzero(within(clean.time, SPANS))
    assert len(result.observations.y) == 3 * (clean.count - lost)
    assert not np.any(within(result.observations.time, SPANS))
    assert (
        f"left out: {lost} rows (0.41 s) in which the torque of joint q2 was at its limit" in result.prepared[0].notes
    )
    assert result.training_error < 1e-6


def test_rows_that_are_asked_for_are_used() -> None:
    log = saturated(played(three_joints(), 3))
    result = found(TASK, log, recipe=EXACT)
    assert len(result.observations.y) == 3 * log.count
    assert result.training_error > 0.1
    (note,) = (note for note in result.prepared[0].notes if "limit" in note)
    assert note.startswith("used, since they were asked for: 82 rows (0.41 s) in which the torque of joint q2")


def test_a_log_mostly_at_its_limits_is_refused() -> None:
    log = saturated(played(three_joints(), 3), ((0.1, 0.8), (1.0, 1.5)))
    message = (
        r"LOG: in 242 of its 400 exciting rows the torque of joint q2 was at its limit.*`torque_margin`.*rows='all'"
    )
    with pytest.raises(InputError, match=message):
        found(TASK, log, recipe=AUTO)


def test_windows_that_meet_such_rows_are_left_out() -> None:
    log = saturated(played(three_joints(), 3))
    result = found(Task("irp6", model="energy", window="short"), log, recipe=AUTO)
    end = result.observations.time
    assert not np.any(within(end, SPANS, end - 0.0049))
    assert np.any(within(end, SPANS, end - 0.0101))


def test_filtered_equations_leave_them_out_too() -> None:
    result = found(TASK, saturated(played(three_joints(), 3)), recipe=replace(AUTO, every=3))
    assert not np.any(within(result.observations.time, SPANS))
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-6, atol=1e-6)


def test_several_logs_each_lose_their_own_rows() -> None:
    clean, other = played(three_joints(), 3, source="CLEAN"), saturated(played(three_joints(2), 3, source="OTHER"))
    result = found(TASK, clean, other, recipe=AUTO)
    rows = [np.count_nonzero(result.observations.log == k) // 3 for k in (0, 1)]
    assert rows == [clean.count, other.count - 82]


def test_a_wrench_is_what_it_is_whatever_the_torques_were() -> None:
    clean = played(periodic(np.eye(5), 1), 5, load=LOAD)
    log = replace(clean, saturated=(Saturation("joint q2", 1.0, "Nm", 9, SPANS),))
    result = found(Task("irp6", model="load"), log, recipe=AUTO)
    assert len(result.observations.y) == 6 * clean.count


def test_the_mean_of_periods_lacks_the_phases_of_every_period() -> None:
    clean = played(three_joints(), 3, seconds=6.0)
    log = saturated(clean, ((0.5, 0.6), (3.9, 4.1)))  # the second one from the end of one period into the next
    result = found(TASK, log, recipe=replace(AUTO, average=True, period=2.0))
    lost = within(result.observations.time, ((0.4999, 0.6001), (1.8999, 2.0), (0.0, 0.1001)))
    assert not np.any(lost)
    assert len(result.observations.y) == 3 * (400 - 21 - 20 - 21)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-6, atol=1e-6)


def test_spans_longer_than_a_period_fill_it() -> None:
    mean = played(three_joints(), 3)
    assert np.all(within(mean.time, spans_in_mean(((0.3, 2.8),), mean)))


def test_verification_says_what_it_leaves_out() -> None:
    result = found(TASK, played(three_joints(), 3), recipe=EXACT)
    log = saturated(played(three_joints(2), 3, seconds=4.0, source="OTHER"))
    judged = verify(replace(result, recipe=replace(EXACT, rows="auto")), log)
    assert judged.time.size == log.count - 82
    assert judged.relative_error < 1e-2
    assert any(remark.startswith("left out: 82 rows") for remark in judged.verdict.remarks)
