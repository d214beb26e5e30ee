"""Motion from positions: exact where it must be, linear, without delay, and as noisy as theory says."""

from __future__ import annotations

import re

import numpy as np
import pytest
from recordings import sines
from refused import refusal

from excite.logs.excitation import noise_deviation, quantum, quietest_deviation
from excite.logs.signals import filters as savitzky_golay
from excite.logs.signals.filters import Butterworth, SavitzkyGolay, smooth_differences
from excite.logs.signals.method import Method, signal_method
from excite.logs.signals.periods import bandwidth, chosen_cutoff, estimated_period
from excite.logs.signals.series import FourierFit, SmoothingSpline, best_harmonics, fourier_basis
from excite.registry import SIGNALS
from regressors.errors import InputError, UnknownName
from regressors.samples import Array

RATE = 100.0
TIME = 3.0 + np.arange(1200) / RATE  # three periods of `sines`
FIXED = {  # every method with nothing left to choose
    "differences": {},
    "butterworth": {"cutoff": 12.0},
    "savitzky-golay": {"window": 0.2},
    "spline": {"knots": 0.1},
    "fourier": {"period": 4.0, "harmonics": 5},
}


def fixed(name):
    return signal_method(name, **FIXED[name])


@pytest.fixture(params=FIXED)
def method(request):
    return fixed(request.param)


def largest(x):
    return np.abs(x).max()


# --- what all methods have in common ---------------------------------------------------------------------------------


CLOSE = {  # largest errors of position, velocity, acceleration as shares of the largest of each
    "butterworth": (1e-4, 1e-3, 5e-3),
    "differences": (1e-8, 3e-4, 1e-3),
    "fourier": (1e-8, 1e-8, 1e-8),
    "savitzky-golay": (1e-4, 1e-3, 2e-3),
    "spline": (1e-8, 1e-6, 1e-4),
}


@pytest.mark.parametrize("name", SIGNALS)
def test_sines_are_differentiated_as_they_come(name):
    """With the settings that the methods choose themselves, on positions almost without noise."""
    q, dq, ddq = sines(TIME)
    motion = signal_method(name).motion(TIME, q + 1e-9 * np.random.default_rng(0).normal(size=q.shape))
    found, kept = motion.samples, motion.kept
    np.testing.assert_array_equal(found.time, TIME[kept])
    assert np.isnan(found.dddq).all()
    for share, what, true in zip(CLOSE[name], ("q", "dq", "ddq"), (q, dq, ddq), strict=True):
        assert largest(getattr(found, what) - true[kept]) < share * largest(true), what
    assert found.time.size > 0.8 * TIME.size
    assert motion.assumed


def test_nothing_is_delayed(method):
    """Time backwards: positions and accelerations the same, velocities with the other sign."""
    q = sines(TIME)[0] + 0.01 * np.random.default_rng(4).normal(size=(1200, 2))
    forwards, backwards = method.motion(TIME, q), method.motion(TIME, q[::-1])
    assert forwards.kept == backwards.kept
    assert forwards.kept.start == 1200 - forwards.kept.stop
    for name, sign in {"q": 1, "dq": -1, "ddq": 1}.items():
        x, y = getattr(forwards.samples, name), getattr(backwards.samples, name)
        np.testing.assert_allclose(y[::-1], sign * x, atol=1e-5 * largest(x))


#: Rounding of second derivatives by least squares, some hundred times eps / h^2; other processors round otherwise.
_ROUNDING = 1e-9


@pytest.mark.parametrize(
    ("name", "of_velocity", "of_acceleration"), [("differences", 2, 3), ("savitzky-golay", 4, 4), ("spline", 5, 5)]
)
def test_polynomials_are_differentiated_exactly(name, of_velocity, of_acceleration):
    t = TIME - TIME.mean()
    for what, order, degree in (("dq", 1, of_velocity), ("ddq", 2, of_acceleration)):
        for power in range(degree + 1):
            found = fixed(name).motion(TIME, (t**power)[:, None])
            true = np.polynomial.Polynomial.basis(power).deriv(order)(t[found.kept])
            error = largest(getattr(found.samples, what)[:, 0] - true) / 6.0**power
            assert error < _ROUNDING


# --- one by one ------------------------------------------------------------------------------------------------------


def test_seven_points_are_exact_to_degree_six():
    t = np.arange(-20, 21) * 0.1
    for power in range(7):
        first, second = smooth_differences(t**power, 0.1)
        np.testing.assert_allclose(first[3:-3], power * t[3:-3] ** max(power - 1, 0), atol=1e-10)
        np.testing.assert_allclose(second[3:-3], power * (power - 1) * t[3:-3] ** max(power - 2, 0), atol=1e-9)
        assert np.isnan(first[[0, 1, 2, -3, -2, -1]]).all()


@pytest.mark.parametrize("frequency", [0.5, 4.0, 8.0, 16.0])
def test_the_filter_has_the_gain_that_it_states(frequency):
    """``1 / (1 + (f / f_c)^(2 n))`` of sines, at frequencies warped as the bilinear transform warps them."""
    q = np.sin(2 * np.pi * frequency * TIME)[:, None]
    found = signal_method("butterworth", cutoff=8.0, order=3).motion(TIME, q)
    warped = np.tan(np.pi * frequency / RATE) / np.tan(np.pi * 8.0 / RATE)
    middle = slice(400, -400)
    gain = found.samples.q[middle, 0] @ q[found.kept][middle, 0] / np.sum(q[found.kept][middle] ** 2)
    assert gain == pytest.approx(1 / (1 + warped**6), abs=2e-3)


def test_savitzky_golay_is_least_squares_in_a_window():
    q = np.random.default_rng(7).normal(size=(60, 2))
    time = np.arange(60) * 0.02
    found = signal_method("savitzky-golay", window=0.2, degree=3).motion(time, q)
    for row, k in enumerate(range(60)[found.kept]):
        window = slice(k - 5, k + 6)
        p = np.polynomial.polynomial.polyfit(time[window] - time[k], q[window], 3)
        for name, true, close in (("q", p[0], 1e-10), ("dq", p[1], 1e-8), ("ddq", 2 * p[2], 1e-6)):
            np.testing.assert_allclose(getattr(found.samples, name)[row], true, atol=close)


def test_the_spline_finds_the_noise_and_beats_differences():
    q, _, ddq = sines(TIME)
    noisy = q + 1e-4 * np.random.default_rng(8).normal(size=q.shape)
    for settings in ({}, {"noise": 1e-4}):
        found = signal_method("spline", **settings).motion(TIME, noisy)
        assert np.sqrt(np.mean((found.samples.q - noisy[found.kept]) ** 2)) == pytest.approx(1e-4, rel=0.05)
        plain = signal_method("differences").motion(TIME, noisy)
        error, other = (np.sqrt(np.mean((m.samples.ddq - ddq[m.kept]) ** 2)) for m in (found, plain))
        assert error < 0.1 * other


def test_the_series_is_found_with_its_period_and_harmonics():
    q, _, ddq = sines(TIME)
    noisy = q + 1e-4 * np.random.default_rng(9).normal(size=q.shape)
    found = signal_method("fourier").motion(TIME, noisy)
    assert "with 3 harmonics (chosen)" in found.assumed
    assert found.samples.time.size == TIME.size
    assert largest(found.samples.q - q) < 1e-4
    assert largest(found.samples.ddq - ddq) < 1e-3
    assert "a large part" not in found.assumed
    assert "a large part" in signal_method("fourier", period=3.0, harmonics=3).motion(TIME, q).assumed


@pytest.mark.parametrize("seed", range(0, 12, 2))
def test_the_number_of_harmonics_is_that_of_the_slow_search(seed):
    """Also where the highest ones are hardly above the noise."""
    random = np.random.default_rng(seed)
    basis = fourier_basis(np.arange(300) / RATE, 3.0, 12)[0]
    size = 0.05 * np.exp(-0.25 * np.arange(25))[:, None]
    q = basis @ (size * random.normal(size=(25, 3))) + 0.01 * random.normal(size=(300, 3))
    criterion = []
    for harmonics in range(1, 13):
        part = basis[:, : 2 * harmonics + 1]
        rest = np.sum((q - part @ np.linalg.lstsq(part, q, rcond=None)[0]) ** 2, axis=0)
        criterion.append(300 * np.log(rest).sum() + 3 * part.shape[1] * np.log(300))
    assert best_harmonics(basis, q) == 1 + int(np.argmin(criterion))


def test_a_measured_velocity_is_taken_as_it_is_and_differentiated_once():
    q, dq, ddq = sines(TIME)
    dq = dq + 0.25  # as no position says
    found = signal_method("butterworth", measured_velocity=True, cutoff=10.0).motion(TIME, q, dq)
    kept = found.kept
    assert largest(found.samples.q - q[kept]) < 1e-4
    assert largest(found.samples.dq - dq[kept]) < 1e-4 * largest(dq)
    assert largest(found.samples.ddq - ddq[kept]) < 1e-3 * largest(ddq)
    assert "no velocity was measured" in refusal(signal_method("spline", measured_velocity=True).motion, TIME, q)


# --- what they choose by ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("frequency", [0.5, 2.0, 5.0])
def test_the_bandwidth_is_that_of_the_fastest_joint(frequency):
    q = np.column_stack([np.sin(2 * np.pi * 0.2 * TIME), 0.1 * np.sin(2 * np.pi * frequency * TIME), 0 * TIME])
    q = q + 1e-5 * np.random.default_rng(12).normal(size=q.shape) * [1, 1, 0]
    assert bandwidth(q, RATE) == pytest.approx(frequency, abs=0.2)
    cutoff, said = chosen_cutoff(q, RATE)
    assert cutoff == pytest.approx(min(10 * frequency, 35), abs=2.0)
    assert "99.9 %" in said


def test_joints_that_rest_do_not_count_whatever_their_noise():
    time = np.arange(4000) / RATE
    rng = np.random.default_rng(0)
    moving = 0.5 * np.sin(2 * np.pi * 0.5 * time)
    noise, shaken = 1e-5 * rng.normal(size=time.size), 1e-3 * np.sin(2 * np.pi * 30.0 * time)
    alone = bandwidth((moving + noise)[:, None], RATE)
    assert alone < 2.0
    assert bandwidth(np.column_stack([moving + noise, noise, shaken]), RATE) == alone
    with pytest.raises(InputError, match="no joint moves, so no cutoff can be chosen"):
        signal_method("butterworth").motion(TIME, np.zeros((1200, 2)))


def test_noise_is_measured_beside_motion():
    q = sines(TIME)[0]
    for noise in (1e-3, 1e-6):
        noisy = q + noise * np.random.default_rng(13).normal(size=q.shape)
        np.testing.assert_allclose(noise_deviation(noisy), noise, rtol=0.1)
    np.testing.assert_allclose(noise_deviation(np.round(q, 3)), 1e-3 / np.sqrt(12), rtol=0.15)
    np.testing.assert_allclose(quantum(np.round(q, 3)), 1e-3, rtol=1e-9)
    np.testing.assert_array_equal(quantum(0 * q), 0)
    resting = np.concatenate([0 * q, q]) + 1e-5 * np.random.default_rng(14).normal(size=(2400, 2))
    np.testing.assert_allclose(quietest_deviation(resting, 32), 1e-5, rtol=0.3)


@pytest.mark.parametrize("period", [4.0, 3.217, 1.0])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_the_period_is_the_shortest_that_repeats(period, noise):
    q = sines(TIME, period=period)[0] + noise * np.random.default_rng(15).normal(size=(1200, 2))
    assert estimated_period(TIME, q) == pytest.approx(period, rel=1e-7 + 0.5 * noise)


def test_what_does_not_repeat_has_no_period():
    for q, message in (
        (np.cumsum(np.random.default_rng(16).normal(size=(1200, 1)), axis=0), "does not repeat itself within 5.99"),
        (sines(TIME, period=9.0)[0], "does not repeat itself within"),
        (np.zeros((1200, 2)), "no joint moves, so the motion has no period"),
        ((TIME**2)[:, None], "does not repeat itself"),
    ):
        assert re.search(message, refusal(estimated_period, TIME, q))


# --- bad settings ----------------------------------------------------------------------------------------------------


def test_bad_settings_are_refused():
    for name, settings, message in (
        ("kalman", {}, "no method of signals named 'kalman'; available: butterworth, differences, fourier"),
        ("butterworth", {"window": 1}, "no setting of butterworth named 'window'; available: cutoff, order"),
        ("butterworth", {"cutoff": 0.0}, "butterworth: cutoff must be a positive number, given 0"),
        ("savitzky-golay", {"degree": 1}, "degree must be 2 or more, given 1"),
    ):
        with pytest.raises(InputError, match=message) as error:
            signal_method(name, **settings)
        assert isinstance(error.value, UnknownName) == ("named" in message)
    for name, settings, time, message in (
        ("butterworth", {"cutoff": 50.0}, TIME, "cutoff 50 Hz must be below half the sample rate, 50 Hz"),
        ("butterworth", {"cutoff": 0.1}, TIME, "1200 samples are too few for a cutoff of 0.1 Hz; needs 2001"),
        ("butterworth", {"cutoff": 0.3}, TIME, "1200 samples are too few: 667 are cut from each end"),
        ("savitzky-golay", {"window": 20.0}, TIME, "window of 2001 samples is longer than the 1200 samples"),
        ("savitzky-golay", {"window": 0.01}, TIME, "window of 1 samples is too short for degree 4"),
        ("fourier", {"period": 20.0}, TIME, "12 s do not hold one period of 20 s"),
        ("fourier", {"period": 0.2, "harmonics": 10}, TIME, "10 harmonics need 21 samples per period, there are 20"),
        ("differences", {}, TIME[:5], "differences needs 7 samples or more, given 5"),
        ("spline", {}, np.sqrt(TIME), "needs uniform samples; .* resample first"),
    ):
        assert re.search(message, refusal(signal_method(name, **settings).motion, time, sines(time)[0]))


HERTZ, SHORT_COUNT = 100.0, 203
SHORT_TIME = 3.0 + np.arange(SHORT_COUNT) / HERTZ
OPERATORS = {name: fixed(name) for name in FIXED} | {
    "fourier": FourierFit(period=1.9, harmonics=4),
    "spline of each joint": SmoothingSpline(knots=(0.1, 0.25, 0.1)),
}


def positions(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    motion = np.sin(2 * np.pi / 1.9 * np.array([1, 2, 3]) * SHORT_TIME[:, None] + rng.uniform(0, 2 * np.pi, 3))
    return np.asarray(motion + 1e-3 * rng.standard_normal(motion.shape))


def dense(method: Method) -> Array:
    """Matrices from the positions of each joint to q, dq and ddq, shape (3, joints, M, N)."""
    columns = []
    for impulse in np.eye(SHORT_COUNT):
        samples = method.motion(SHORT_TIME, np.tile(impulse[:, None], 3)).samples
        columns.append(np.stack([samples.q.T, samples.dq.T, samples.ddq.T]))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("name", OPERATORS)
def test_an_operator_acts_as_the_dense_matrix_of_its_method(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(savitzky_golay, "_LONG", 1)  # by transforms
    method, q = OPERATORS[name], positions(1)
    found = method.operator(SHORT_TIME, positions(0))(q)
    expected = np.einsum("djmk,kj->dmj", dense(method), q)
    for values, true in zip((found.samples.q, found.samples.dq, found.samples.ddq), expected, strict=True):
        np.testing.assert_allclose(values, true, rtol=0, atol=1e-11 * np.abs(true).max())
    np.testing.assert_array_equal(found.samples.time, SHORT_TIME[found.kept])


@pytest.mark.parametrize(
    "method",
    [Butterworth(), SavitzkyGolay(), FourierFit(), FourierFit(period=1.9), SmoothingSpline()],
    ids=lambda method: repr(method),
)
def test_an_operator_keeps_the_settings_that_its_method_chose(method: Method) -> None:
    """Whatever other positions it meets: those of the first ones are not chosen anew."""
    time = np.arange(800) / HERTZ
    smooth = np.sin(2 * np.pi / 1.9 * np.array([1.0, 2.0]) * time[:, None])
    noise = 0.05 * np.random.default_rng(2).standard_normal(smooth.shape)
    settled = method.settled(time, smooth)
    found, expected = method.operator(time, smooth)(smooth + noise), settled.motion(time, smooth + noise)
    assert settled.settled(time, smooth + noise) == settled
    assert found.kept == expected.kept
    np.testing.assert_allclose(found.samples.ddq, expected.samples.ddq, rtol=0, atol=1e-9 * np.abs(noise).max() * HERTZ)
