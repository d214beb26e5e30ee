"""Several limits as one: the same values, derivatives and labels, in the layout of a search and in that of samples."""

from __future__ import annotations

from functools import cache

import numpy as np

from constraints.collision_limits import collision_limits
from constraints.geometry import HalfSpace, Obstacle, Part, World
from constraints.nonlinear import NonlinearConstraint, StackedConstraint
from constraints.power import tool_box, tool_speed
from constraints.torque import torque_limits
from regressors.models.nominal import standard_values
from regressors.models.partial import of_joints
from regressors.readers.library import built_in
from regressors.robot.shapes import Capsule
from regressors.samples import Array, Samples

PANDA = built_in("panda")
ARM = (
    Part("link_2", Capsule((0.0, 0.0, 0.0), (0.0, -0.3, 0.0), 0.05)),
    Part("link_5", Capsule((0.0, 0.0, -0.2), (0.0, 0.0, 0.0), 0.05)),
)


@cache
def parts() -> tuple[NonlinearConstraint, ...]:
    """Torques, the tool, and distances, whose slopes hold the nearest points."""
    names = [link.name for link in PANDA.links]
    arm = tuple(Part(names[k], part.capsule) for k, part in zip((1, 4), ARM, strict=True))
    world = World(arm, (Obstacle("table", HalfSpace((0.0, 0.0, 1.0), 0.0)),), clearance=0.01)
    far = np.full(3, np.inf)
    return (
        *torque_limits(PANDA, standard_values(PANDA), 0.1),
        tool_box(PANDA, np.zeros(3), np.array([-0.5, -0.5, 0.1]), far),
        tool_speed(PANDA, np.zeros(3), 1.5),
        *collision_limits(PANDA, world, of_joints(PANDA, range(PANDA.n))),
    )


def motion(count: int) -> list[Array]:
    return list(np.random.default_rng(3).uniform(-1.5, 1.5, (3, PANDA.n, count)))


def samples(state: list[Array]) -> Samples:
    q, dq, ddq = (part.T for part in state)
    return Samples(np.arange(float(len(q))), q, dq, ddq, np.zeros_like(q))


def test_functions_are_those_of_the_parts() -> None:
    stacked, state = StackedConstraint(parts()), motion(9)
    expected = np.concatenate([part.values(samples(state)) for part in parts()], axis=1)
    np.testing.assert_allclose(stacked.at_instants(state), expected.T, atol=1e-12)
    np.testing.assert_allclose(stacked.values(samples(state)), expected, atol=1e-12)
    shown = np.concatenate([part.shown(part.values(samples(state))) for part in parts()], axis=1)
    np.testing.assert_allclose(stacked.shown(expected), shown, atol=1e-12)
    assert len(stacked.labels) == len(stacked.units) == len(stacked.lower) == expected.shape[1]
    assert len(parts()) > 4


def test_slopes_of_some_functions_at_some_instants_are_those_of_the_parts() -> None:
    """In any order, and of columns in any order; zero where a function does not depend on a joint."""
    stacked, state, rng = StackedConstraint(parts()), motion(9), np.random.default_rng(4)
    expected = np.concatenate([part.slopes(samples(state)) for part in parts()], axis=1)
    function, instant = rng.integers(0, expected.shape[1], 60), rng.integers(0, 9, 60)
    columns = rng.permutation(3 * PANDA.n)
    found = stacked.slopes_at_instants(state)(function, instant, columns)
    np.testing.assert_allclose(found, expected[instant[:, None], function[:, None], columns], atol=1e-10)
    assert stacked.slopes_at_instants(state)(function[:0], instant[:0], columns).shape == (0, columns.size)


def test_what_functions_depend_on_is_what_their_slopes_say() -> None:
    state = samples(motion(30))
    for limit in (*parts(), StackedConstraint(parts()[-2:])):
        slopes = np.concatenate([part.slopes(state) for part in getattr(limit, "parts", (limit,))], axis=1)
        by_order = np.abs(slopes).reshape(*slopes.shape[:2], 3, PANDA.n).max(axis=(0, 3))
        assert limit.derivatives == tuple(np.flatnonzero(by_order.max(axis=0)))
        np.testing.assert_array_equal(limit.varies, by_order.max(axis=1) > 0)
