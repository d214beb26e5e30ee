"""What a log shows about itself: units, signs, gaps, dead and saturated channels, another robot."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from recordings import log_of, real_log, sines
from refused import refusal

from excite.logs.event import gaps, segments
from excite.logs.log_checks import check_log
from regressors.readers.library import built_in

PANDA = built_in("panda")
MIDDLE = (PANDA.limits.lower + PANDA.limits.upper) / 2
RATE = 200.0


def good(seconds=8.0, noise=1e-5):
    """A log of the arm, well within its limits."""
    time = np.arange(round(seconds * RATE)) / RATE
    q, dq, ddq = (np.tile(x, 3)[:, :7] * 0.5 for x in sines(time, joints=3))
    random = np.random.default_rng(2)
    q, dq = q + MIDDLE + noise * random.normal(size=q.shape), dq + noise * random.normal(size=q.shape)
    effort = 5 * np.sin(q) + ddq + 0.1 * random.normal(size=q.shape)
    return log_of(time, q, dq, effort, PANDA.joint_names)


def changed(log, channel, joint, change):
    values = getattr(log, channel).copy()
    values[:, joint] = change(values[:, joint])
    return replace(log, **{channel: values})


def times(**factors):
    """Logs with some channels times a factor."""
    return lambda log: replace(log, **{name: factor * getattr(log, name) for name, factor in factors.items()})


def one(channel, joint, change):
    """Logs in which a channel of one joint is another."""
    return lambda log: changed(log, channel, joint, change)


def named(joints):
    """Logs of other joints."""
    return lambda log: replace(log, joints=tuple(joints))


def constant(value):
    return lambda x: np.full_like(x, value)


def test_a_good_log_has_nothing_to_be_said_of():
    assert check_log(good(), PANDA) == ()
    assert check_log(good().of(PANDA.joint_names[2:5]), PANDA) == ()
    assert check_log(replace(good(), dq=None, effort=None), PANDA) == ()


def noise(x):
    return np.random.default_rng(1).normal(size=x.size)


DEGREES = 180 / np.pi
WRONG = (
    (times(q=DEGREES, dq=DEGREES), r"position from .* rad looks like degrees \(limits .*unit: deg"),
    (times(dq=DEGREES), "is 57.3 times the slope of the position: it looks like degrees per second"),
    (
        lambda log: replace(log, q=np.degrees((log.q - MIDDLE) / 50) + MIDDLE, dq=log.dq / 50),
        "is 0.0175 times the slope of the position: the position looks like degrees",
    ),
    (one("dq", 2, np.negative), r"panda_joint3.velocity has the opposite"),
    (times(dq=100), "is 100 times the slope"),
    (one("dq", 0, noise), "does not follow the position"),
    (one("dq", 1, np.zeros_like), "panda_joint2.velocity is constant at 0"),
    (one("effort", 4, constant(0.25)), r"panda_joint5.effort is constant at 0.25 while the joint moves"),
    (times(effort=1e3), "its limit is 87; check its unit, gain and"),
    (one("q", 3, lambda x: x + 3.0), "panda_joint4.position from .* is far beyon"),
    (times(time=1e3), "0.2 samples per second; check that time"),
    (lambda log: replace(log, time=log.time / 100, dq=None), "by its positions, but its limit is 2.1"),
    (lambda log: replace(log, q=np.tile(MIDDLE, (log.count, 1)), dq=0 * log.dq, effort=None), "no joint moves"),
    (
        lambda log: replace(log, time=np.where(log.time > 3, log.time + 1.5, log.time), dq=None),
        r"gaps of 1.5 s after t = 3 s \(row 601\); split the log",
    ),
    (lambda log: log.rows(slice(2)), "2 rows are too few"),
    (named(built_in("iiwa7").joint_names), "robot panda has none of its joints .*robots with these joints: iiwa7"),
    (named("abcdefg"), "none of its joints a, b, c, d, e, f, g; the robot's joints: panda_joint1"),
)


def test_what_cannot_be_used_is_refused_with_the_reason():
    for change, message in WRONG:
        assert re.search(message, refusal(check_log, change(good()), PANDA, begins="LOG: "))


NOTED = (
    (lambda log: changed(one("q", 1, constant(0.1))(log), "dq", 1, np.zeros_like), "panda_joint2: not moved"),
    (one("q", 0, lambda x: x - x.max() + PANDA.limits.upper[0] + 0.02), "panda_joint1.position from .* slightly excee"),
    (one("effort", 0, lambda x: np.minimum(x, 1.0)), "panda_joint1.effort is held at 1 in .* so it may be saturated"),
    (one("effort", 6, lambda x: 15 * x / np.abs(x).max()), "panda_joint7.effort reaches 15 Nm, but its limit is 12"),
)


def test_a_placeholder_of_a_velocity_limit_stops_no_log():
    robot = PANDA.replace(limits=replace(PANDA.limits, velocity=np.full(7, 0.02)))
    for log in (good(), replace(good(), dq=None)):
        notes = check_log(log, robot)
        assert len(notes) == 7
        assert all("its limit is 0.02 rad/s" in note and "whether the limit is a placeholder" in note for note in notes)


def test_what_is_unusual_is_noted():
    for change, message in NOTED:
        (note,) = check_log(change(good()), PANDA)
        assert re.match(message, note), note
    log = good()
    wide = log_of(log.time, np.column_stack([500 * np.sin(log.time), log.q]), joints=("gripper", *log.joints))
    assert check_log(wide, PANDA) == ("gripper: no joints of panda, not checked",)
    limits = replace(PANDA.limits, lower=np.full(7, -np.inf), upper=np.full(7, np.inf), velocity=np.full(7, np.inf))
    notes = check_log(replace(log, q=np.degrees(log.q), dq=np.degrees(log.dq)), PANDA.replace(limits=limits))
    assert notes
    assert all(re.search("many turns; if these are degrees: .* unit: deg", note) for note in notes)


def test_rounded_torques_and_constant_speed_are_not_saturation():
    log = good(noise=0)
    ramp = np.minimum(np.linspace(0, 20, log.count), 10)
    log = replace(log, q=MIDDLE + 0.02 * ramp[:, None] * np.ones(7), dq=None, effort=np.round(np.sin(log.q) * 5, 1))
    assert check_log(replace(good(), effort=np.round(good().effort, 1)), PANDA) == ()
    assert all("saturated" not in note for note in check_log(log, PANDA))


@pytest.mark.parametrize("name", ["ur-20_02_10-30sec_12harm", "ur-20_01_17-ptp_10_points", "ur-20_01_31-unload"])
def test_recorded_logs_of_an_arm_are_good(name):
    assert check_log(real_log(name), built_in("ur10e")) == ()


# --- gaps ------------------------------------------------------------------------------------------------------------


def with_steps(steps):
    time = np.concatenate([[5.0], 5.0 + np.cumsum(steps)])
    return log_of(time, np.sin(time)[:, None])


def test_a_gap_is_three_missing_samples_or_more():
    for step, at, found in ((0.03, 3, 0), (0.036, 3, 1), (0.2, 0, 1), (0.2, 199, 1)):
        steps = np.full(200, 0.01)
        steps[at] = step
        gap = gaps(with_steps(steps))
        assert len(gap) == found
        if found:
            assert (gap[0].row, round(gap[0].length, 9)) == (at, step)
            assert gap[0].time == pytest.approx(5.0 + 0.01 * at)
    pause = np.full(2000, 0.001)
    pause[100] = 0.019
    for steps in (pause, np.random.default_rng(0).uniform(0.005, 0.015, 500)):
        assert gaps(with_steps(steps)) == ()


def test_segments_are_the_rows_between_gaps():
    steps = np.full(1000, 0.01)
    steps[[399, 449]] = 0.5
    log = with_steps(steps)
    one, two = segments(log)
    np.testing.assert_array_equal(one.time, log.time[:400])
    np.testing.assert_array_equal(two.q, log.q[450:])
    assert one.left_out == two.left_out == ("50 rows in parts shorter than 1 s between gaps",)
    assert [part.count for part in segments(log, shortest=0.1)] == [400, 50, 551]
    assert segments(log, shortest=0.1)[1].left_out == ()
    assert segments(one) == (one,)
    assert "gaps leave no part of 60 s or more" in refusal(segments, log, shortest=60.0)


def spoiled(channel, row, value):
    values = getattr(good(seconds=1.0), channel).copy()
    values[row] = value
    return {channel: values}


SECOND = good(seconds=1.0)


NO_LOGS = (
    (spoiled("time", -1, np.inf), "time is not finite in row 200"),
    (spoiled("time", 3, 0.01), "row 3 has 0.01 s and row 4 0.01 s"),
    (spoiled("q", 7, np.nan), "q is not finite in row 8; leave out the rows with gaps"),
    ({"q": SECOND.q + 0j}, "q: expected an array of real numbers"),
    ({"time": SECOND.time[:, None]}, "expected one number per instant"),
    ({"dq": SECOND.dq[:, 1:]}, r"dq has shape \(200, 6\), not \(200, 7\)"),
)


def test_what_is_no_log_is_refused_where_it_is_made():
    for change, message in NO_LOGS:
        assert re.search(message, refusal(replace, SECOND, **change))
