"""Ways around what stands between two poses: free lines, few poses, and designs whose ways keep their distance."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from excite.trajectories.detours import detour

LOW, HIGH = np.full(2, -1.0), np.full(2, 1.0)
BOX = LinearConstraint(0, np.eye(2), np.zeros(2), LOW, HIGH, ("a position", "b position"), ("rad", "rad"))


def pillar(radius: float, centre: tuple[float, float] = (0.0, 0.0)) -> NonlinearConstraint:
    """A disc in the plane of two joints that is not to be entered."""

    def distance(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        return ca.sqrt((q[0] - centre[0]) ** 2 + (q[1] - centre[1]) ** 2 + 1e-12)

    bound, none = np.array([radius]), np.array([np.inf])
    return NonlinearConstraint(2, distance, bound, none, bound.copy(), ("pillar",), ("rad",))


def wall(gap: float) -> NonlinearConstraint:
    """The line a = 0 from below up to b = gap, 0.2 thick."""

    def past(q: ca.SX, dq: ca.SX, ddq: ca.SX) -> ca.SX:
        return ca.fmax(ca.fabs(q[0]) - 0.1, q[1] - gap)

    zero, none = np.zeros(1), np.array([np.inf])
    return NonlinearConstraint(2, past, zero, none, np.ones(1), ("wall",), ("rad",))


def dense(path: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([a + np.linspace(0, 1, 500)[:, None] * (b - a) for a, b in pairwise(path)])


@pytest.mark.parametrize("seed", range(3))
def test_a_pillar_is_passed_by(seed: int) -> None:
    start, end = np.array([-0.9, 0.0]), np.array([0.9, 0.05])
    found = detour(start, end, [BOX], [pillar(0.4)], LOW, HIGH, seed)
    assert found
    q = dense([start, *found, end])
    assert np.linalg.norm(q, axis=1).min() >= 0.4 * (1 - 1e-3)
    assert np.all(np.abs(q) <= 1.0)
    assert len(found) <= 4
    assert np.linalg.norm(np.diff(q, axis=0), axis=1).sum() < 2.0 * np.linalg.norm(end - start)


def test_a_narrow_gap_above_a_wall_is_found() -> None:
    start, end = np.array([-0.8, -0.8]), np.array([0.8, -0.8])
    found = detour(start, end, [BOX], [wall(0.7)], LOW, HIGH, 0)
    assert found
    q = dense([start, *found, end])
    assert np.maximum(np.abs(q[:, 0]) - 0.1, q[:, 1] - 0.7).min() >= 0.0


def test_a_free_line_needs_no_poses_and_the_same_seed_takes_the_same_way() -> None:
    assert detour(np.array([-0.9, 0.8]), np.array([0.9, 0.8]), [BOX], [pillar(0.4)], LOW, HIGH, 0) == []
    ends = np.array([-0.9, 0.0]), np.array([0.9, 0.05])
    one, again, other = (detour(*ends, [BOX], [pillar(0.4)], LOW, HIGH, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one, other)


@pytest.mark.slow
@pytest.mark.parametrize(
    "limits",
    [[wall(1.5)], [pillar(0.4, (0.9, 0.05))]],
    ids=["a wall without a gap", "an end that is not free"],
)
def test_where_there_is_no_way_none_is_told(limits: list[NonlinearConstraint]) -> None:
    assert detour(np.array([-0.9, 0.0]), np.array([0.9, 0.05]), [BOX], limits, LOW, HIGH, 0) is None


def test_limits_of_positions_count_where_the_range_is_wider() -> None:
    """A coupled limit that random poses could break: b <= 0.5 + a / 4."""
    coupled = LinearConstraint(
        0, np.array([[-0.25, 1.0]]), np.zeros(1), np.array([-9.0]), np.array([0.5]), ("sum",), ("rad",)
    )
    start, end = np.array([-0.9, 0.0]), np.array([0.9, 0.05])
    found = detour(start, end, [BOX, coupled], [pillar(0.4)], LOW, HIGH, 1)
    assert found
    q = dense([start, *found, end])
    assert np.all(q[:, 1] - 0.25 * q[:, 0] <= 0.5 + 1e-9)
