"""Fourier motions at rest at both ends: derivatives, ends, exact extrema, and what a grid of instants proves."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from scipy.optimize import minimize_scalar

from constraints.certificate import trigonometric_extrema
from excite.trajectories import Fourier, Trajectory

SEED = st.integers(0, 2**32 - 1)
HARMONICS = st.integers(2, 8)
SIZES = st.one_of(st.just(0.0), st.floats(-1.0, 1.0), st.sampled_from([1.0, -0.5, 1e-3, -1e-7, 1e-12, 1e-16, 1e-300]))


def series(coefficients: np.ndarray, omega: float, t: np.ndarray, derivative: int) -> np.ndarray:
    """Derivative of one series (c, a_1 ... a_K, b_1 ... b_K), term by term: each one advances by a quarter turn."""
    K = (len(coefficients) - 1) // 2
    value = np.full(t.shape, coefficients[0] if derivative == 0 else 0.0)
    for k in range(1, K + 1):
        w = k * omega
        angle = w * t + derivative * np.pi / 2
        value = value + w**derivative * (coefficients[k] * np.cos(angle) + coefficients[K + k] * np.sin(angle))
    return value


# --- the family ------------------------------------------------------------------------------------------------------


@given(harmonics=HARMONICS, duration=st.floats(0.5, 60.0), seed=SEED)
@settings(max_examples=30)
def test_motion_is_its_series_and_its_derivatives(harmonics: int, duration: float, seed: int) -> None:
    family, rng = Fourier(duration, harmonics), np.random.default_rng(seed)
    x = rng.normal(size=(2, family.size))
    t = rng.uniform(0, duration, 20)
    coefficients, samples = family.coefficients(x), Trajectory(family, x).samples(t)
    for d, motion in enumerate((samples.q, samples.dq, samples.ddq, samples.dddq)):
        expected = np.column_stack([series(row, 2 * np.pi / duration, t, d) for row in coefficients])
        np.testing.assert_allclose(motion, expected, atol=1e-11 * max(np.abs(expected).max(), 1e-12))
        np.testing.assert_allclose(family.basis(t, d) @ x.T, motion)


@given(harmonics=HARMONICS, seed=SEED)
@settings(max_examples=30)
def test_family_is_all_series_at_rest(harmonics: int, seed: int) -> None:
    """Two conditions on 2K+1 coefficients leave 2K-1; whatever meets them is a motion of the family."""
    family, K = Fourier(7.0, harmonics), harmonics
    assert np.linalg.matrix_rank(family.coefficients(np.eye(family.size))) == family.size == 2 * K - 1
    c = np.random.default_rng(seed).normal(size=(3, 2 * K + 1))
    k = np.arange(1, K + 1)
    c[:, 1] -= c[:, 1 : K + 1] @ k**2
    c[:, K + 1] -= c[:, K + 1 :] @ k
    np.testing.assert_allclose(family.coefficients(family.from_coefficients(c)), c, atol=1e-10)


def test_samples_at_the_ends_are_exactly_at_rest() -> None:
    """Where rounding would leave friction a sign; between the ends nothing is changed."""
    family = Fourier(7.3, 5)
    trajectory = Trajectory(family, np.random.default_rng(2).normal(size=(3, family.size)))
    samples = trajectory.sampled(100 / 7.3)
    for d, motion in enumerate((samples.q, samples.dq, samples.ddq, samples.dddq)):
        np.testing.assert_array_equal(motion[1:-1], (family.basis(samples.time, d) @ trajectory.x.T)[1:-1])
    np.testing.assert_array_equal(samples.dq[[0, -1]], 0.0)
    np.testing.assert_array_equal(samples.ddq[[0, -1]], 0.0)
    assert np.all(samples.dq[[1, -2]] != 0.0)


# --- exact extrema ---------------------------------------------------------------------------------------------------


def polynomial(constant: float, cosine: np.ndarray, sine: np.ndarray, angle: np.ndarray) -> np.ndarray:
    return series(np.concatenate([[constant], cosine, sine]), 1.0, np.asarray(angle, dtype=float), 0)


def searched_maximum(constant: float, cosine: np.ndarray, sine: np.ndarray, count: int = 720) -> float:
    """Largest value by dense sampling, and a bounded search about every sampled peak that could be the highest."""
    angle, step = np.linspace(0, 2 * np.pi, count, endpoint=False), 2 * np.pi / count
    value = polynomial(constant, cosine, sine, angle)
    spread = float(np.abs(cosine).sum() + np.abs(sine).sum())
    peaks = (value >= np.roll(value, 1)) & (value >= np.roll(value, -1))
    peaks &= value >= value.max() - spread * (len(cosine) * step) ** 2
    best = value.max()
    for peak in angle[peaks][:12]:
        bounds = {"bounds": (peak - step, peak + step), "method": "bounded", "options": {"xatol": 1e-9}}
        best = max(best, -minimize_scalar(lambda a: -polynomial(constant, cosine, sine, a), **bounds).fun)
    return best


@st.composite
def polynomials(draw: st.DrawFn) -> tuple[float, np.ndarray, np.ndarray]:
    K = draw(HARMONICS)
    numbers = draw(st.lists(SIZES, min_size=2 * K + 1, max_size=2 * K + 1))
    return numbers[0], np.array(numbers[1 : K + 1]), np.array(numbers[K + 1 :])


@given(polynomials())
@example((0.5, np.zeros(3), np.zeros(3)))  # constant
@example((0.0, np.array([1.0, 0.0]), np.array([0.0, 0.0])))  # leading coefficient zero
@example((0.0, np.array([4.0, 1.0]) / 4, np.zeros(2)))  # cos + cos 2 / 4: at pi the slope's root is triple
@example((0.0, np.array([0.0, 0.0, 1.0]), np.array([1e-9, 0.0, 0.0])))  # three nearly equal peaks
@example((0.0, np.array([1.0, 1e-300]), np.array([0.0, 1e-300])))
@settings(max_examples=80)
def test_extrema_are_those_of_a_search_over_continuous_time(
    polynomial_: tuple[float, np.ndarray, np.ndarray],
) -> None:
    constant, cosine, sine = polynomial_
    omega = 0.7
    found = trigonometric_extrema(np.array([constant]), cosine[None], sine[None], omega)
    tolerance = 1e-12 * (abs(constant) + np.abs(cosine).sum() + np.abs(sine).sum())
    # they are attained, so they cannot be beyond the true ones ...
    for value, time in ((found.high, found.high_time), (found.low, found.low_time)):
        assert 0.0 <= time[0] <= 2 * np.pi / omega
        assert abs(value[0] - polynomial(constant, cosine, sine, omega * time)[0]) <= tolerance
    # ... and no search finds better
    assert found.high[0] >= searched_maximum(constant, cosine, sine) - tolerance
    assert -found.low[0] >= searched_maximum(-constant, -cosine, -sine) - tolerance


@given(
    split=st.one_of(st.just(0.0), st.floats(-16.0, -0.5).map(lambda power: 10.0**power)),
    turn=st.floats(0.0, 6.28),
    lean=st.floats(-0.9, 0.9),
    extra=st.integers(0, 6),
    sign=st.sampled_from([-1, 1]),
)
@settings(max_examples=40)
def test_extrema_where_three_stationary_instants_nearly_meet(
    split: float, turn: float, lean: float, extra: int, sign: int
) -> None:
    """Slope ``sin b (cos b - cos split) (1 + lean cos b)^extra`` with b = angle - turn: roots at b = 0, +-split, pi."""
    K, count = extra + 2, 64
    angle = np.arange(count) * 2 * np.pi / count
    b = angle - turn
    slope = sign * np.sin(b) * (np.cos(b) - np.cos(split)) * (1 + lean * np.cos(b)) ** extra
    h = np.fft.fft(slope)[1 : K + 1] / count  # slope = sum_k h_k exp(i k a) + its conjugate; it has no mean
    order = np.arange(1, K + 1)
    cosine, sine = 2 * h.imag / order, 2 * h.real / order
    found = trigonometric_extrema(np.zeros(1), cosine[None], sine[None], 1.0)
    tolerance = 1e-12 * (np.abs(cosine).sum() + np.abs(sine).sum())
    assert found.high[0] >= searched_maximum(0.0, cosine, sine) - tolerance
    assert -found.low[0] >= searched_maximum(0.0, -cosine, -sine) - tolerance
    stationary = turn + np.array([0.0, split, -split, np.pi])
    known = polynomial(0.0, cosine, sine, stationary)
    assert found.high[0] == pytest.approx(known.max(), abs=tolerance)
    assert found.low[0] == pytest.approx(known.min(), abs=tolerance)


# --- what a grid proves ----------------------------------------------------------------------------------------------


@given(polynomial_=polynomials(), more=st.integers(1, 60))
@settings(max_examples=50)
def test_grid_factor_is_never_violated(polynomial_: tuple[float, np.ndarray, np.ndarray], more: int) -> None:
    """Ehlich and Zeller: max over the grid / factor bounds the maximum over continuous time, of any polynomial."""
    constant, cosine, sine = polynomial_
    K = len(cosine)
    count = 2 * K + more
    grid = np.abs(polynomial(constant, cosine, sine, np.arange(count) * 2 * np.pi / count)).max()
    true = max(searched_maximum(constant, cosine, sine), searched_maximum(-constant, -cosine, -sine))
    assert true <= grid / Fourier(1.0, K).grid_factor(count, 0) + 1e-12 * true


def test_grid_factor_is_reached() -> None:
    """cos(K a) shifted by half a step, on a grid of 2 K m instants: no larger factor would be right."""
    for K, multiple in itertools.product((2, 3, 5, 8), (2, 3, 10)):
        count = 2 * K * multiple
        shift = np.pi * K / count
        cosine, sine = np.zeros(K), np.zeros(K)
        cosine[-1], sine[-1] = np.cos(shift), np.sin(shift)
        grid = np.abs(polynomial(0.0, cosine, sine, np.arange(count) * 2 * np.pi / count)).max()
        for derivative in range(4):
            assert Fourier(1.0, K).grid_factor(count, derivative) == pytest.approx(grid, rel=1e-12)


def test_a_grid_that_is_too_coarse_proves_nothing() -> None:
    family = Fourier(1.0, 5)
    with pytest.raises(ValueError, match="a grid of 10 instants is too coarse for 5 harmonics"):
        family.grid_factor(10, 0)
    assert 0 < family.grid_factor(11, 0) < 0.2
