"""Signals of whole logs: uniform instants, averaged periods, and the filter on both sides of the equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal
from recordings import log_of, real_log, sines

from excite.logs.excitation import exciting_rows
from excite.logs.signals.butterworth import edge, kept_rows, low_passed
from excite.logs.signals.method import spacing
from excite.logs.signals.periods import average_periods
from excite.logs.signals.resampling import resample
from regressors.errors import InputError

RATE = 100.0


def uniform(seconds=12.0, period=4.0, noise=0.0, seed=0, joints=2):
    time = 7.0 + np.arange(round(seconds * RATE)) / RATE
    q, dq, ddq = sines(time, joints, period)
    random = np.random.default_rng(seed)
    q, dq, effort = (x + scale * noise * random.normal(size=x.shape) for x, scale in ((q, 1), (dq, 10), (ddq, 100)))
    return log_of(time, q, dq, effort)


# --- resampling ------------------------------------------------------------------------------------------------------


def test_jitter_is_taken_out():
    random = np.random.default_rng(1)
    time = 7.0 + np.cumsum(random.uniform(0.008, 0.012, 1000))
    q, dq, ddq = sines(time)
    made = resample(log_of(time, q, dq, ddq, wrench=np.tile(time[:, None], 6), temperature=q))
    log = made.log
    assert spacing(log.time, "test", 2) == pytest.approx((time[-1] - time[0]) / 999)
    assert (log.time[0], log.count) == (time[0], 1000)
    assert log.time[-1] == pytest.approx(time[-1], abs=1e-12)
    true = sines(log.time)
    np.testing.assert_allclose(log.q, true[0], atol=2e-7)
    np.testing.assert_allclose(log.dq, true[1], atol=2e-6)
    np.testing.assert_allclose(log.effort, true[2], atol=2e-3)
    np.testing.assert_allclose(log.wrench, np.tile(log.time[:, None], 6), rtol=1e-12)
    np.testing.assert_allclose(log.temperature, true[0], atol=1e-3)
    assert "time stamps 8.01 to 12 ms apart" in made.note
    assert "cubic splines, the rest linearly" in made.note


def test_another_rate():
    log = resample(uniform(), rate=250.0).log
    assert spacing(log.time, "test", 2) == pytest.approx(1 / 250)
    np.testing.assert_allclose(log.q, sines(log.time)[0], atol=1e-6)
    assert log.time[-1] <= uniform().time[-1]


def test_uniform_logs_stay_as_they_are():
    made = resample(uniform())
    np.testing.assert_array_equal(made.log.q, uniform().q)
    assert made.note == "time stamps are uniform, 100 Hz"
    bare = resample(replace(uniform(), dq=None, effort=None), rate=150.0).log
    assert bare.dq is None
    assert bare.effort is None


@pytest.mark.parametrize(
    ("change", "rate", "message"),
    [
        (lambda log: log.rows(slice(3)), None, "resampling needs 4 rows or more, given 3"),
        (
            lambda log: replace(log, time=np.where(log.time > 9, log.time + 1, log.time)),
            None,
            r"LOG: not resampled across gaps of 1.01 s after t = 9 s \(row 201\); split the log",
        ),
        (lambda log: log, 50.0, "50 Hz is less than its 100 Hz; filter before leaving out rows"),
        (lambda log: log, -1.0, "rate must be a positive number"),
    ],
)
def test_what_cannot_be_resampled(change, rate, message):
    with pytest.raises(InputError, match=message):
        resample(change(uniform()), rate)


# --- averaged periods ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [4.0, 3.217])
def test_the_mean_of_exact_periods_is_the_period(period):
    for given in (None, period):
        mean = average_periods(uniform(period=period), given)
        assert mean.period == pytest.approx(period, rel=1e-7)
        assert "mean of 3 periods" in mean.note
        assert mean.log.count == round(period * RATE)
        assert mean.log.time[0] == 7.0
        assert spacing(mean.log.time, "test", 2) * mean.log.count == pytest.approx(period)
        for x, true in zip((mean.log.q, mean.log.dq, mean.log.effort), sines(mean.log.time, 2, period), strict=True):
            np.testing.assert_allclose(x, true, atol=2e-4 * np.abs(true).max())


def test_a_period_repeated_and_averaged_is_the_period_again():
    one = uniform(seconds=4.0)
    time = 7.0 + np.arange(5 * one.count + 30) / RATE
    many = log_of(time, *(np.tile(x, (6, 1))[: time.size] for x in (one.q, one.dq, one.effort)))
    mean = average_periods(many, 4.0)
    np.testing.assert_allclose(mean.log.q, one.q, atol=1e-15)
    np.testing.assert_allclose(mean.log.effort, one.effort, atol=1e-14)
    assert mean.log.left_out == ("30 rows after the last whole period",)


def test_noise_is_averaged_away():
    """Less by sqrt(K) in the mean."""
    mean = average_periods(uniform(seconds=40.0, noise=1e-3))
    assert "mean of 10 periods" in mean.note
    for name, scale, true in zip(("q", "dq", "effort"), (1, 10, 100), sines(mean.log.time), strict=True):
        rest = getattr(mean.log, name) - true
        np.testing.assert_allclose(rest.std(axis=0), 1e-3 * scale / np.sqrt(10), rtol=0.15)


def test_a_joint_that_rests_does_not_make_the_motion_unperiodic():
    log = uniform(noise=1e-4)
    still = replace(log, q=np.column_stack([log.q[:, 0], 0.3 + 1e-4 * np.random.default_rng(2).normal(size=log.count)]))
    assert "mean of 3 periods" in average_periods(still, 4.0).note


@pytest.mark.parametrize(
    ("log", "period", "message"),
    [
        (uniform(), 3.9, "not periodic with 3.9 s: [ab] differs by .* % of its motion; at most 2 % are allowed"),
        (uniform(noise=0.05), 4.0, "not periodic with 4 s"),
        (uniform(seconds=7.0), 4.0, "7 s hold 1 periods of 4 s; expected 2 or more"),
        (uniform(seconds=7.0), None, "does not repeat itself"),
        (uniform(), 0.0, "period must be a positive number"),
        (replace(uniform(), time=np.sqrt(uniform().time)), 4.0, "needs uniform samples; .*: resample first"),
    ],
)
def test_what_is_not_periodic_is_refused(log, period, message):
    with pytest.raises(InputError, match=message):
        average_periods(log, period)


# --- both sides ------------------------------------------------------------------------------------------------------


def decimated(x, cutoff, every=None):
    """Filtered signals at the instants that are left, and these."""
    kept = kept_rows(len(x), RATE, cutoff, every)
    return low_passed(x, RATE, cutoff)[kept], kept


def test_what_holds_before_the_filter_holds_after_it():
    random = np.random.default_rng(3)
    W, beta = random.normal(size=(600, 3, 5)), random.normal(size=5)
    (V, kept), (y, _) = decimated(W, 8.0), decimated(W @ beta, 8.0)
    np.testing.assert_allclose(V @ beta, y, atol=1e-12)
    assert V.shape == (len(range(600)[kept]), 3, 5)
    assert kept.start == edge(RATE, 8.0) == 25


def test_the_filter_is_that_of_scipy_row_by_row():
    x = np.random.default_rng(4).normal(size=(500, 2, 2))
    sections = scipy.signal.butter(4, 8.0, fs=RATE, output="sos")
    found = low_passed(x, RATE, 8.0)
    for i in range(2):
        for j in range(2):
            slow = scipy.signal.sosfiltfilt(sections, x[:, i, j], padtype="odd", padlen=50)
            np.testing.assert_allclose(found[:, i, j], slow, atol=1e-12)


def test_constants_pass_and_fast_noise_does_not():
    np.testing.assert_allclose(low_passed(np.full((300, 2), 3.5), RATE, 5.0), 3.5, rtol=1e-9)
    noise = low_passed(np.random.default_rng(5).normal(size=(20000, 1)), RATE, 5.0)
    frequency = np.linspace(0, 50, 20001)
    power = 1 / (1 + (np.tan(np.pi * frequency / RATE) / np.tan(np.pi * 5 / RATE)) ** 8) ** 2
    assert noise.std() == pytest.approx(np.sqrt(power.mean()), rel=0.05)


def test_decimated_rows_are_some_of_the_filtered_ones_with_noise_almost_white():
    y = np.random.default_rng(6).normal(size=(20000, 1))
    every, (some, kept) = low_passed(y, RATE, 5.0)[edge(RATE, 5.0) :], decimated(y, 5.0)
    assert kept.step == 8
    np.testing.assert_array_equal(some, every[::8][: len(some)])

    def next_to(x):
        return float(x[:-1] @ x[1:] / (x @ x))

    assert next_to(every[:, 0]) > 0.9
    assert abs(next_to(some[:, 0])) < 0.4
    assert decimated(y, 5.0, every=3)[1].step == 3


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"cutoff": 60.0}, "cutoff 60 Hz must be below half the sample rate, 50 Hz"),
        ({"cutoff": 2.0}, "100 samples are too few: 100 are cut from each end"),
        ({"cutoff": 0.0}, "cutoff must be a positive number"),
        ({"cutoff": 10.0, "every": 6}, "every 6th row leaves 16.6667 Hz, less than twice"),
        ({"cutoff": 10.0, "every": 0}, "every must be a positive number"),
    ],
)
def test_filters_that_do_not_suit_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        decimated(np.ones((100, 1)), **settings)


def test_a_recorded_log_becomes_uniform_and_its_derivatives_agree_with_its_velocities():
    from excite.logs.signals.method import signal_method

    log = real_log("ur-20_02_10-30sec_12harm")
    made = resample(log.rows(exciting_rows(log)[0]))
    assert "time stamps 8 to 13 ms apart" in made.note
    for name in ("butterworth", "savitzky-golay", "spline"):
        motion = signal_method(name).motion(made.log.time, made.log.q)
        assert np.sqrt(np.mean((motion.samples.dq - made.log.dq[motion.kept]) ** 2)) < 0.005
