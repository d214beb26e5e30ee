from __future__ import annotations

import numpy as np
import pytest

from excite.optimality.limited_states import LimitedStates
from excite.optimality.moment_conditions import MomentConditions, matrix_of, triangle

W, HARMONICS = 0.7, 4
R, V, A = np.array([1.0, 0.6]), np.array([1.2, 0.9]), np.array([2.0, 1.7])


def states(bandwidth: float | None) -> LimitedStates:
    D = np.array([[1.0, 0.0], [1.0, 1.0]])
    return LimitedStates(D, -R, R, V, A, bandwidth, np.zeros(2), np.ones(2, dtype=bool))


def motion(seed: int, count: int = 4000) -> np.ndarray:
    """States of a random trigonometric polynomial, scaled into the limits of `states`, at equal steps."""
    rng = np.random.default_rng(seed)
    t = (np.arange(count) + 0.5) * 2 * np.pi / W / count
    k = np.arange(1, HARMONICS + 1) * W
    a, b = rng.standard_normal((2, HARMONICS, 2)) / k[:, None]
    phase = np.outer(t, k)
    y = np.cos(phase) @ a + np.sin(phase) @ b
    dy = (-np.sin(phase) * k) @ a + (np.cos(phase) * k) @ b
    ddy = -(np.cos(phase) * k**2) @ a - (np.sin(phase) * k**2) @ b
    D = states(None).directions
    largest = max(np.abs(part @ D.T / bound).max() for part, bound in ((y, R), (dy, V), (ddy, A)))
    return np.hstack([y, dy, ddy]) * (0.999 / largest)


def test_vectors_have_the_inner_product_of_matrices() -> None:
    rng = np.random.default_rng(0)
    A, B = (M + M.T for M in rng.standard_normal((2, 5, 5)))
    assert triangle(A) @ triangle(B) == pytest.approx(np.trace(A @ B))
    np.testing.assert_allclose(matrix_of(triangle(A), 5), A)


@pytest.mark.parametrize("seed", range(8))
def test_motions_pass_admissible_states_only(seed: int) -> None:
    assert np.all(states(HARMONICS * W).hold(motion(seed)))


def test_a_lower_bandwidth_admits_fewer_states() -> None:
    drawn = states(None).drawn(4000, np.random.default_rng(0))
    few, more = (states(bandwidth).hold(drawn) for bandwidth in (1.0, 3.0))
    assert np.all(more[few])
    assert 0 < few.sum() < more.sum() < drawn.shape[0]


def test_drawn_states_are_inside_and_reach_the_limits() -> None:
    drawn = states(HARMONICS * W).drawn(2000, np.random.default_rng(1))
    assert np.all(states(HARMONICS * W).hold(drawn))
    assert np.abs(drawn[:, 4:] @ states(None).directions.T / A).max() == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_have_mean_zero_over_a_period(seed: int) -> None:
    conditions = MomentConditions(states(None), np.ones(2, dtype=bool), np.zeros(0))
    h = conditions.values(motion(seed))
    np.testing.assert_allclose(h.mean(axis=0), 0.0, atol=2e-3)  # kinks of |dz| between instants
    assert np.all(np.abs(h).max(axis=0) > 0.01)


@pytest.mark.parametrize("seed", range(4))
def test_admitted_multipliers_have_a_mean_of_one_sign_over_every_motion(seed: int) -> None:
    conditions = MomentConditions(states(HARMONICS * W), np.ones(2, dtype=bool), W * np.arange(1.0, HARMONICS + 1))
    rng = np.random.default_rng(100 + seed)
    drawn = rng.standard_normal(conditions.values(motion(0)[:1]).shape[1])
    drawn[len(conditions.cone()) :] = 0.0
    unit = np.concatenate([triangle(np.eye(7)[None])[0], np.zeros(drawn.size - 28)])
    admitted = conditions.admitted(drawn)
    means = [conditions.values(motion(each)).mean(axis=0) for each in range(10)]
    assert min(mean @ admitted for mean in means) >= 0.0
    assert min(mean @ -unit for mean in means) < 0.0 <= min(mean @ conditions.admitted(-unit) for mean in means)


def test_the_positions_of_a_coordinate_can_be_left_out() -> None:
    counted = np.array([False, True])
    conditions = MomentConditions(states(HARMONICS * W), counted, W * np.arange(1.0, HARMONICS + 1))
    S = motion(0)[:50]
    moved = S.copy()
    moved[:, 0] += 1.0
    unit = len(conditions.cone())
    np.testing.assert_allclose(conditions.values(S)[:, :unit], conditions.values(moved)[:, :unit])
