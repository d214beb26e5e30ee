"""Signals of whole logs: uniform instants, averaged periods, delays, noise, and the filter on both sides."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.signal
from motions import random_sines
from recordings import log_of, real_log, sines
from refused import refusal

from excite.logs.excitation import exciting_rows
from excite.logs.signals.filters import edge, kept_rows, low_passed
from excite.logs.signals.method import DelayedMotion, delayed, resample, signal_method, spacing
from excite.logs.signals.periods import HIGHEST_MOTION, average_periods, measurement_noise, motion_ends
from regressors.samples import Samples

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
    made = resample(log_of(time, q, dq, ddq, wrench=np.tile(time[:, None], 6), temperature=q, command=np.round(q)))
    log = made.log
    held = np.searchsorted(time, log.time, side="right") - 1
    np.testing.assert_array_equal(log.command, np.round(q)[held])
    assert spacing(log.time, "test", 2) == pytest.approx((time[-1] - time[0]) / 999)
    assert (log.time[0], log.count) == (time[0], 1000)
    assert log.time[-1] == pytest.approx(time[-1], abs=1e-12)
    q, dq, ddq = sines(log.time)
    for name, true, close in (("q", q, 2e-7), ("dq", dq, 2e-6), ("effort", ddq, 2e-3), ("temperature", q, 1e-3)):
        np.testing.assert_allclose(getattr(log, name), true, atol=close)
    np.testing.assert_allclose(log.wrench, np.tile(log.time[:, None], 6), rtol=1e-12)
    assert "time stamps 8.01 to 12 ms apart" in made.note
    assert "cubic splines, the rest linearly" in made.note


def test_uniform_logs_stay_as_they_are():
    made = resample(uniform())
    np.testing.assert_array_equal(made.log.q, uniform().q)
    assert made.note == "time stamps are uniform, 100 Hz"


def test_what_cannot_be_resampled():
    log = uniform()
    assert "resampling needs 4 rows or more, given 3" in refusal(resample, log.rows(slice(3)))
    paused = replace(log, time=np.where(log.time > 9, log.time + 1, log.time))
    across = "LOG: not resampled across gaps of 1.01 s after t = 9 s (row 201); split the log"
    assert across in refusal(resample, paused)


# --- averaged periods ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("period", [4.0, 3.217])
def test_the_mean_of_exact_periods_is_the_period(period):
    for given in (None, period):
        mean, found, note = average_periods(uniform(period=period), given)
        assert found == pytest.approx(period, rel=1e-7)
        assert "mean of 3 periods" in note
        assert mean.count == round(period * RATE)
        assert mean.time[0] == 7.0
        assert spacing(mean.time, "test", 2) * mean.count == pytest.approx(period)
        for x, true in zip((mean.q, mean.dq, mean.effort), sines(mean.time, 2, period), strict=True):
            np.testing.assert_allclose(x, true, atol=2e-4 * np.abs(true).max())


def test_noise_is_averaged_away():
    """Less by sqrt(K) in the mean; a joint that rests does not make the motion unperiodic."""
    mean, _, note = average_periods(uniform(seconds=40.0, noise=1e-3))
    assert "mean of 10 periods" in note
    for name, scale, true in zip(("q", "dq", "effort"), (1, 10, 100), sines(mean.time), strict=True):
        rest = getattr(mean, name) - true
        np.testing.assert_allclose(rest.std(axis=0), 1e-3 * scale / np.sqrt(10), rtol=0.15)
    log = uniform(noise=1e-4)
    still = replace(log, q=np.column_stack([log.q[:, 0], 0.3 + 1e-4 * np.random.default_rng(2).normal(size=log.count)]))
    assert "mean of 3 periods" in average_periods(still, 4.0)[2]


def test_what_is_not_periodic_is_refused():
    for log, period, message in (
        (uniform(), 3.9, "not periodic with 3.9 s: [ab] differs by .* % of its motion; at most 2 % are allowed"),
        (uniform(noise=0.05), 4.0, "not periodic with 4 s"),
        (uniform(seconds=7.0), 4.0, "7 s hold 1 periods of 4 s; expected 2 or more"),
        (uniform(seconds=7.0), None, "does not repeat itself"),
        (uniform(), 0.0, "period must be a positive number"),
        (replace(uniform(), time=np.sqrt(uniform().time)), 4.0, "needs uniform samples; .*: resample first"),
    ):
        assert re.search(message, refusal(average_periods, log, period))


# --- both sides ------------------------------------------------------------------------------------------------------


def decimated(x, cutoff, every=None):
    """Filtered signals at the instants that are left, and these."""
    kept = kept_rows(len(x), RATE, cutoff, every)
    return low_passed(x, RATE, cutoff)[kept], kept


def test_the_filter_is_that_of_scipy_row_by_row():
    x = np.random.default_rng(4).normal(size=(500, 2, 2))
    sections = scipy.signal.butter(4, 8.0, fs=RATE, output="sos")
    slow = scipy.signal.sosfiltfilt(sections, x, axis=0, padtype="odd", padlen=50)
    np.testing.assert_allclose(low_passed(x, RATE, 8.0), slow, atol=1e-12)
    assert kept_rows(600, RATE, 8.0, None).start == edge(RATE, 8.0) == 25


def test_decimated_rows_are_some_of_the_filtered_ones() -> None:
    """With noise that is almost white."""
    y = np.random.default_rng(6).normal(size=(20000, 1))
    every, (some, kept) = low_passed(y, RATE, 5.0)[edge(RATE, 5.0) :], decimated(y, 5.0)
    assert (kept.step, decimated(y, 5.0, every=3)[1].step) == (8, 3)
    np.testing.assert_array_equal(some, every[::8][: len(some)])
    next_to = [float(x[:-1] @ x[1:] / (x @ x)) for x in (every[:, 0], some[:, 0])]
    assert abs(next_to[1]) < 0.4 < 0.9 < next_to[0]


def test_filters_that_do_not_suit_are_refused():
    for settings, message in (
        ({"cutoff": 60.0}, "cutoff 60 Hz must be below half the sample rate, 50 Hz"),
        ({"cutoff": 2.0}, "100 samples are too few: 100 are cut from each end"),
        ({"cutoff": 0.0}, "cutoff must be a positive number"),
        ({"cutoff": 10.0, "every": 6}, "every 6th row leaves 16.6667 Hz, less than twice"),
        ({"cutoff": 10.0, "every": 0}, "every must be a positive number"),
    ):
        assert re.search(message, refusal(decimated, np.ones((100, 1)), **settings))


def test_a_recorded_log_becomes_uniform_and_its_derivatives_agree_with_its_velocities():
    log = real_log("ur-20_02_10-30sec_12harm")
    made = resample(log.rows(exciting_rows(log)[0]))
    assert "time stamps 8 to 13 ms apart" in made.note
    for name in ("butterworth", "savitzky-golay", "spline"):
        motion = signal_method(name).motion(made.log.time, made.log.q)
        assert np.sqrt(np.mean((motion.samples.dq - made.log.dq[motion.kept]) ** 2)) < 0.005


INSTANTS = np.arange(2001) / 500
NAMES = ("q", "dq", "ddq", "dddq")


@pytest.mark.parametrize("delay", [0.004, 0.0013, -0.007, 0.05])
def test_sines_are_those_of_earlier_instants(delay: float) -> None:
    sines = random_sines(3, 0)
    moved, true = delayed(sines.samples(INSTANTS), delay), sines.samples(INSTANTS - delay)
    np.testing.assert_array_equal(moved.time, INSTANTS)
    inside = (INSTANTS - delay >= INSTANTS[0]) & (INSTANTS - delay <= INSTANTS[-1])
    for name in NAMES:
        found, expected = getattr(moved, name), getattr(true, name)
        np.testing.assert_allclose(found[inside], expected[inside], atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize(("delay", "end"), [(0.02, 0), (-0.02, -1)])
def test_before_and_after_the_motion_its_ends_are_held(delay: float, end: int) -> None:
    samples = random_sines(2, 1).samples(INSTANTS)
    moved = delayed(samples, delay)
    beyond = slice(0, 10) if end == 0 else slice(-10, None)
    for name in NAMES:
        np.testing.assert_allclose(getattr(moved, name)[beyond], np.tile(getattr(samples, name)[end], (10, 1)))


def test_what_is_not_known_stays_unknown() -> None:
    motion = random_sines(2, 5).samples(INSTANTS)
    samples = Samples(INSTANTS, motion.q, motion.dq, motion.ddq, np.full_like(motion.q, np.nan))
    moved = delayed(samples, 0.002)
    assert np.all(np.isnan(moved.dddq))
    assert np.all(np.isfinite(moved.ddq))
    assert delayed(samples, 0.0) is samples


def test_a_long_motion_is_delayed_by_stretches_as_in_one() -> None:
    time = np.arange(70_000) / 500
    samples = Samples(time, *np.random.default_rng(0).normal(size=(3, time.size, 1)), np.full((time.size, 1), np.nan))
    moved, whole = delayed(samples, 0.0123), DelayedMotion(samples).by(0.0123)
    for name in NAMES:
        np.testing.assert_allclose(getattr(moved, name), getattr(whole, name), atol=1e-12)


FAST, COUNT = 200.0, 4000
LONG = np.arange(COUNT) / FAST
TORQUE = (10 * np.sin(2 * np.pi * 0.3 * LONG) + 5 * np.sign(np.sin(2 * np.pi * 0.4 * LONG)))[:, None]


@pytest.mark.parametrize(("size", "above"), [(0.3, 5.0), (3.0, 5.0), (30.0, 5.0), (3.0, 40.0)])
def test_white_noise_is_found(size: float, above: float) -> None:
    off = []
    for seed in range(30):
        noise = size * np.random.default_rng(seed).normal(size=(COUNT, 1))
        found = measurement_noise(TORQUE + noise, noise + 0.03 * TORQUE, FAST, above)
        off.append((found.square[0] - np.mean(noise**2)) / found.deviation[0])
        assert found.square[0] == pytest.approx(np.mean(noise**2), rel=0.15)
    assert 0.4 < np.std(off) < 1.6  # its standard deviation is the one that is stated


def test_neither_motion_nor_errors_of_the_model_nor_noise_of_predictions_count() -> None:
    found = measurement_noise(TORQUE, 0.1 * TORQUE, FAST, 5.0)
    assert found.square[0] < 0.03 * np.mean((0.1 * TORQUE) ** 2)
    noise = np.random.default_rng(0).normal(size=(COUNT, 1))
    slow = 10 * np.sin(2 * np.pi * 0.3 * LONG)[:, None]
    assert measurement_noise(slow, noise, FAST, 5.0).square[0] < 1e-3
    sampled = measurement_noise(TORQUE[::20], TORQUE[::20], FAST / 20, 5.0)
    assert (sampled.square[0], sampled.level[0], sampled.deviation[0]) == (0.0, 0.0, 0.0)


def test_coloured_noise_is_never_taken_for_more_than_it_is() -> None:
    for pole in (0.5, 0.9, 0.99):
        white = np.random.default_rng(0).normal(size=(COUNT, 1))
        noise = scipy.signal.lfilter([1.0], [1.0, -pole], white, axis=0)
        found = measurement_noise(TORQUE + noise, noise, FAST, 5.0)
        assert found.square[0] < 1.1 * np.mean(noise**2)


def test_where_the_motion_ends() -> None:
    q = np.sin(2 * np.pi * 0.4 * LONG)[:, None]
    assert motion_ends(q, FAST) == pytest.approx(4.0, rel=0.3)
    assert motion_ends(np.sin(2 * np.pi * 3.0 * LONG)[:, None], FAST) == HIGHEST_MOTION
    assert motion_ends(np.zeros((COUNT, 1)), FAST) == HIGHEST_MOTION
