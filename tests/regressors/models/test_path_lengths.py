"""``int |dz| dt`` from samples: exact for cubics however coarse the sampling, as good as its cubics for the rest."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from motions import Polynomials, Sines, path_of_polynomial, random_sines
from scipy.integrate import quad

from regressors.models.energy import path_lengths
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)
COEFFICIENT = st.floats(-3.0, 3.0).map(lambda c: round(c, 3))
CUBIC = st.tuples(COEFFICIENT, COEFFICIENT, COEFFICIENT, COEFFICIENT)


def paths(motion: Polynomials | Sines, time: Array) -> Array:
    return path_lengths(time, motion.at(time, 0), motion.at(time, 1))


def assert_exact_path(cubic: tuple[float, ...], time: Array) -> None:
    found = paths(Polynomials(np.array(cubic)[:, None]), time)[:, 0]
    expected = [path_of_polynomial(np.array(cubic), time[0], t) for t in time]
    np.testing.assert_allclose(found, expected, atol=1e-12 * (1.0 + np.abs(cubic).max()))


@given(cubic=CUBIC, count=st.integers(2, 7))
@settings(max_examples=200)
def test_path_of_a_cubic_that_turns_once_between_samples(cubic: tuple[float, ...], count: int) -> None:
    time = np.linspace(0.0, 1.0, count)
    turns = np.roots(np.polynomial.polynomial.polyder(cubic)[::-1])
    inside = np.sort([r.real for r in turns if abs(r.imag) < 1e-9])
    assume(all(np.abs(time - r).min() > 1e-9 for r in inside))
    assume(np.histogram(inside, time)[0].max(initial=0) <= 1)
    assert_exact_path(cubic, time)


@given(cubic=CUBIC, count=st.integers(2, 7))
@example(cubic=(0.0, 0.21, -0.5, 1 / 3), count=2)  # dz = (t - 0.3)(t - 0.7): there, back, and there again
@example(cubic=(0.0, 0.0, 0.25, -1 / 3), count=2)  # dz = t (1/2 - t): starts at rest, and turns before the next sample
@example(cubic=(0.0, 0.0, 0.0, 0.0), count=3)
@settings(max_examples=200)
def test_path_of_any_cubic_is_exact_however_coarse_the_sampling(cubic: tuple[float, ...], count: int) -> None:
    """Also where a drive turns twice between two samples, or leaves a rest and turns."""
    assert_exact_path(cubic, np.linspace(0.0, 1.0, count))


def test_path_of_a_cubic_against_quadrature_with_breakpoints() -> None:
    """z = t^3 - 1.1 t^2 + 0.3 t turns at 0.179 and 0.554; adaptive quadrature is told so."""
    slope = np.array([0.3, -2.2, 3.0])
    turns = np.sort(np.roots(slope[::-1]))
    velocity = np.polynomial.polynomial.Polynomial(slope)
    time = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    expected = [quad(lambda t: abs(velocity(t)), 0.0, end, points=turns[turns < end])[0] for end in time[1:]]
    found = paths(Polynomials(np.array([[0.0], [0.3], [-1.1], [1.0]])), time)[:, 0]
    np.testing.assert_allclose(found, [0.0, *expected], atol=1e-12)


def path_of_sine(x: Array) -> Array:
    """``int_0^x |cos u| du`` in closed form."""
    halves = np.floor(x / np.pi + 0.5)
    return 2 * halves + np.sin(x - np.pi * halves)


@pytest.mark.parametrize("count", [9, 17, 40, 333])
def test_path_of_a_sine_is_as_good_as_its_cubics(count: int) -> None:
    """A cubic from positions and velocities is wrong by h^4/384 max|z''''| at most, twice per turning point."""
    size, frequency, phase = 0.7, 5.0, 0.4
    time = np.linspace(0.0, 3.0, count)
    motion = Sines(np.zeros(1), np.array([[size]]), np.array([frequency]), np.array([[phase]]))
    expected = size * (path_of_sine(frequency * time + phase) - path_of_sine(np.array(phase)))
    bound = 2 * (time[1] * frequency) ** 4 / 384 * size
    turns = np.floor((frequency * time + phase) / np.pi + 0.5)
    assert np.all(np.abs(paths(motion, time)[:, 0] - expected) <= bound * turns + 1e-13)


def test_path_of_trapezoids_to_and_fro() -> None:
    """Velocity of straight pieces, whose corners are samples: 0, up, kept, down through zero, kept, up to zero."""
    time = np.array([0.0, 0.5, 1.0, 2.0, 2.25, 2.75])
    dz = np.array([0.0, 0.8, 0.8, -0.4, -0.4, 0.0])
    z = np.concatenate([[0.0], np.cumsum(np.diff(time) * (dz[1:] + dz[:-1]) / 2)])
    parts = np.array([0.2, 0.4, 0.8 * (2 / 3) / 2 + 0.4 * (1 / 3) / 2, 0.1, 0.1])
    found = path_lengths(time, z[:, None], dz[:, None])[:, 0]
    np.testing.assert_allclose(found, np.concatenate([[0.0], np.cumsum(parts)]), atol=1e-15)


def test_path_of_a_constant_velocity_and_of_a_rest() -> None:
    time = np.linspace(0.0, 2.0, 5)
    z, dz = np.outer(time, [-0.3, 0.0, 1.5]), np.tile([-0.3, 0.0, 1.5], (5, 1))
    np.testing.assert_allclose(path_lengths(time, z, dz), np.outer(time, [0.3, 0.0, 1.5]), atol=1e-15)


@given(seed=SEED, pace=st.floats(0.1, 5.0))
@settings(max_examples=30)
def test_path_does_not_depend_on_pace_direction_or_place(seed: int, pace: float) -> None:
    """It is at least the way between its ends, and the same backwards, mirrored, moved and at another pace."""
    motion, time = random_sines(2, seed), np.linspace(0.0, 2.0, 21)
    z, dz = motion.at(time, 0), motion.at(time, 1)
    length = path_lengths(time, z, dz)
    assert np.all(np.diff(length, axis=0) >= np.abs(np.diff(z, axis=0)) - 1e-14)
    np.testing.assert_allclose(path_lengths(time / pace, 3.0 - z, -pace * dz), length, atol=1e-12)
    backwards = path_lengths(time, z[::-1], -dz[::-1])
    np.testing.assert_allclose(length[-1] - backwards[::-1], length, atol=1e-12)
