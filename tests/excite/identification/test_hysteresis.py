"""Friction's direction with a memory, against the recursion written out sample by sample, and Dahl's equation."""

import math

import numpy as np
import pytest

from excite.identification.equations import dahl_direction
from regressors.samples import Array


def written_out(z: Array, distance: float) -> Array:
    s = np.zeros_like(z)
    for k in range(1, len(z)):
        for j in range(z.shape[1]):
            way = float(z[k, j] - z[k - 1, j])
            u = float(np.sign(way))
            s[k, j] = u + (s[k - 1, j] - u) * math.exp(-abs(way) / distance)
    return s


@pytest.mark.parametrize("count", [1, 2, 3, 4, 10, 99, 100, 101, 1000])
@pytest.mark.parametrize("distance", [1e-6, 1e-3, 0.1, 1e3])
def test_every_length_of_path_follows_the_recursion(count: int, distance: float) -> None:
    rng = np.random.default_rng(count)
    z = np.cumsum(rng.normal(size=(count, 2)) * [1e-3, 1e-1], axis=0)
    np.testing.assert_allclose(dahl_direction(z, distance), written_out(z, distance), atol=1e-13)


def test_a_path_that_turns_over_less_than_the_distance_never_reaches_full_friction() -> None:
    z = np.sin(np.linspace(0.0, 200.0, 5000))[:, None]
    assert np.abs(dahl_direction(z, 1e-3)[1000:]).max() == pytest.approx(1.0)
    assert np.abs(dahl_direction(z, 10.0)[1000:]).max() < 0.2


def test_the_direction_stays_where_the_motion_stops() -> None:
    z = np.concatenate([np.linspace(0.0, -1.0, 200), np.full(5000, -1.0)])[:, None]
    np.testing.assert_allclose(dahl_direction(z, 0.01)[200:], -1.0, atol=1e-12)


def test_the_slope_along_the_path_is_that_of_dahl() -> None:
    t = np.linspace(0.0, 3.0, 30_001)
    z = np.sin(3.0 * t)[:, None]
    s, d = dahl_direction(z, 0.2)[:, 0], 0.2
    way = np.diff(z[:, 0])
    middle = (s[1:] + s[:-1]) / 2
    fast = np.abs(way) > 1e-5
    np.testing.assert_allclose((np.diff(s) / way)[fast], ((1 - middle * np.sign(way)) / d)[fast], rtol=1e-4, atol=1e-6)


def test_over_no_distance_the_direction_is_the_sign_of_the_last_motion() -> None:
    way = np.array([0.0, 0.1, 0.0, 0.2, -0.1, 0.0, 0.0, -0.3, 0.4])
    s = dahl_direction(np.cumsum(way)[:, None], 1e-9)[:, 0]
    np.testing.assert_array_equal(s, [0.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0, 1.0])
