"""Constraints on the grid of a family, linear in x or not: tangents, largest steps, where a search looks."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motion_families import LINEAR, NONLINEAR
from slow_dynamics import random_chain

from constraints.linear import LinearConstraint
from constraints.nonlinear import NonlinearConstraint
from constraints.power import tool_box, tool_speed
from constraints.torque import torque_limits
from excite.design import formulation
from excite.design.formulation import formulate
from excite.design.grid_limits import GridConstraint, GridJoints
from excite.design.initial_guesses import random_motion
from excite.design.multistart import serial
from excite.design.problem import Problem
from excite.design.solvers.limit_rows import NearRows
from excite.design.stated_limits import nonlinear_limits
from excite.tasks.task import Task
from excite.trajectories.family import Family
from excite.trajectories.fourier import Fourier
from regressors.models.nominal import standard_values
from regressors.models.partial import of_joints
from regressors.readers.library import built_in
from regressors.samples import Array

POSE = np.array([0.3, -0.4])


@pytest.fixture(params=["fourier", "quartic", "waypoints", "sines"])
def family(request: pytest.FixtureRequest) -> Family:
    return (LINEAR | NONLINEAR)[request.param]()


def motion(family: Family, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    x = family.resting(POSE, rng)
    family.split(x)[0][:] += 0.3 * rng.normal(size=(POSE.size, family.size))
    return x


def constraints(family: Family) -> list[GridConstraint]:
    """One that is linear in the motion of two coordinates, one that is not."""
    robot, grid = built_in("irp6"), family.on_grid(64)
    matrix, one = np.array([[1.0, 0.5], [0.0, -2.0], [1.0, 1.0]]), np.ones(3)
    linear = LinearConstraint(1, matrix, 0 * one, -one, 2 * one, ("a", "b", "c"), 3 * ("rad/s",))
    speed = tool_speed(robot, np.zeros(3), 1.0)
    joints = GridJoints(grid, of_joints(robot, [0, 1]))
    return [GridConstraint.on_coordinates(linear, grid), GridConstraint.on_joints(speed, joints)]


# --- constraints


def test_tangents_are_derivatives_of_the_values(family: Family) -> None:
    x, step = motion(family, 1), np.random.default_rng(2).normal(size=motion(family, 1).shape)
    for constraint in constraints(family):
        h = 1e-6
        expected = (constraint.values(x + h * step) - constraint.values(x - h * step)) / (2 * h)
        size = np.abs(expected).max()
        some = np.arange(1, expected.shape[1], 7)
        tangent = constraint.tangent(x, some)
        function, place = (i.ravel() for i in np.indices((len(expected), some.size)))
        rows = tangent(function, place)
        np.testing.assert_allclose(rows @ step.ravel(), expected[:, some].ravel(), atol=1e-6 * size)
        assert tangent(function[:0], place[:0]).shape == (0, x.size)
        np.testing.assert_allclose(constraint.tangent(x)(function, some[place]), rows)


def test_rows_are_the_same_everywhere_where_a_constraint_is_linear_in_x(family: Family) -> None:
    """And only there."""
    function, place = np.array([0, 0]), np.array([10, 40])
    for k, constraint in enumerate(constraints(family)):
        assert constraint.linear == (family.linear and k == 0)
        first, second = (constraint.tangent(motion(family, seed))(function, place) for seed in (3, 4))
        assert np.array_equal(first, second) == constraint.linear


def test_the_largest_part_of_a_step_ends_where_a_bound_begins(family: Family) -> None:
    x = family.drawn(motion(family, 5), POSE, 0.05)
    step = family.coordinate_step(x, 1, np.random.default_rng(6).normal(size=family.size))
    linear, _ = constraints(family)
    assert linear.excess(linear.values(x)) < 0.0
    part = linear.largest_part(linear.values(x), linear.values(x + step) - linear.values(x))
    assert linear.excess(linear.values(x + part * step)) == pytest.approx(0.0, abs=1e-9)
    assert linear.excess(linear.values(x + 1.01 * part * step)) > 0.0
    assert linear.largest_part(linear.values(x), 0.0 * linear.values(x)) == np.inf


# --- what a family says of its x


def test_families_move_draw_and_step_their_coefficients_alone(family: Family) -> None:
    x, t = motion(family, 7), np.linspace(0.0, family.duration, 40)
    before, y = x.copy(), family.motion(x, t, 0)
    np.testing.assert_allclose(family.motion(family.moved(x, POSE), t, 0), y + POSE, atol=1e-12)
    np.testing.assert_allclose(family.motion(family.drawn(x, POSE, 0.4), t, 0), POSE + 0.4 * (y - POSE), atol=1e-12)
    step = family.coordinate_step(x, 0, np.ones(family.size))
    assert np.count_nonzero(step) == family.size
    np.testing.assert_allclose(family.motion(x + step, t, 2)[:, 1], family.motion(x, t, 2)[:, 1], atol=1e-12)
    for changed in (family.moved(x, POSE), family.drawn(x, POSE, 0.4), x + step):
        np.testing.assert_array_equal(family.split(changed)[1], family.split(x)[1])
    np.testing.assert_array_equal(x, before)
    assert (family.split(x)[1].size == 0) == family.linear


# --- limits are built once, and kept by solvers that can


def test_nonlinear_limits_are_built_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """By the checks, the problem and the search of one process together; from home also those of every joint."""
    built, home = list[Any](), {"home": (0.0, 0.2, -0.2, 0.0, 0.0)}
    monkeypatch.setattr(formulation, "nonlinear_limits", lambda *given: built.append(given) or nonlinear_limits(*given))
    for changes, builds in (({}, 1), (home, 2), ({**home, "joints": tuple("12345")}, 1)):
        built.clear()
        made = formulate(built_in("irp6"), Task("irp6", harmonics=4, tool_speed=3.0).changed(**changes))
        (limit,) = made.problem.limits.nonlinear
        assert limit.function.constraint is made.nonlinear[0]
        serial(made, [], tmp_path, lambda _: None)
        assert len(built) == builds


PANDA = built_in("panda")
LINEAR_FAMILIES = ("fourier", "bspline", "fourier-quintic")


@cache
def problem(family: str) -> Problem:
    return formulate(PANDA, Task("panda", trajectory=family, torque_margin="none", executor="serial")).problem


@cache
def limits(family: str) -> tuple[GridConstraint, ...]:
    joints = GridJoints(problem(family).limits.linear[0].grid, of_joints(PANDA, range(PANDA.n)))
    kinds: tuple[NonlinearConstraint, ...] = (
        *torque_limits(PANDA, standard_values(PANDA), 0.5),
        tool_box(PANDA, np.zeros(3), np.array([-0.4, -0.4, 0.2]), np.array([0.5, 0.5, 1.0])),
        tool_speed(PANDA, np.zeros(3), 1.0),
    )
    return tuple(GridConstraint.on_joints(kind, joints) for kind in kinds)


def motions(family: str, count: int) -> list[Array]:
    """Random motions, drawn towards the centre until each uses about all of a limit at its peak."""
    rng, near = np.random.default_rng(5), []
    for k in range(count):
        limit, x = limits(family)[k % 3], random_motion(problem(family), rng)
        parts = [problem(family).drawn(x, part) for part in np.linspace(0.02, 1.0, 25)]
        peaks = [abs(limit.uses(limit.values(x)).max() - 1.0) for x in parts]
        near.append(parts[int(np.argmin(peaks))])
    return near


@pytest.mark.parametrize("family", LINEAR_FAMILIES)
def test_a_search_overlooks_no_peak_of_the_grid(family: str) -> None:
    """Its largest use is that of the whole grid wherever this is near a bound, and values are those of the grid."""
    looked, tight = 0, 0
    for x in motions(family, 9):
        for limit in limits(family):
            (instants, sampled, use), values = limit.sampled(x), limit.values(x)
            np.testing.assert_allclose(sampled, values[:, instants], atol=1e-12)
            np.testing.assert_allclose(use, limit.uses(values)[:, instants], atol=1e-12)
            assert np.all(np.diff(instants) > 0)
            most = limit.uses(values).max()
            assert limit.holds(x) == (most <= 1.0)
            if most > 0.95:
                assert use.max() == pytest.approx(most, abs=1e-12)
                tight += 1
            looked += instants.size < values.shape[1]
    assert tight > 5
    assert looked > 10


def test_a_tool_on_the_axis_of_the_only_joint_has_one_place() -> None:
    family, robot = Fourier(7.0, 3), random_chain("r", np.random.default_rng(0))
    box = tool_box(robot, np.zeros(3), np.full(3, -5.0), np.full(3, 5.0))
    limit = GridConstraint.on_joints(box, GridJoints(family.on_grid(64), of_joints(robot, [0])))
    _, values, use = limit.sampled(motion(family, 0)[:1])
    np.testing.assert_allclose(np.ptp(values, axis=1), 0.0, atol=1e-12)
    assert use.max() < 1.0


def test_rows_of_the_programme_forbid_what_they_linearise() -> None:
    """A step that the rows allow keeps the linearised limits; one that breaks them adds rows."""
    x, rng = motions("fourier", 1)[0], np.random.default_rng(6)
    inside = problem("fourier").drawn(x, 0.98)
    near = NearRows(limits("fourier"), inside)
    before = len(near.rows()[0])
    assert not near.broken(np.zeros(x.size))
    step = rng.normal(size=x.size)
    step *= np.sign(step @ (x - inside).ravel())
    while not near.broken(step):
        step *= 1.5
    A, lower, upper = near.rows()
    assert len(A) > before
    assert np.any((A @ step > upper) | (A @ step < lower))
    assert not near.broken(step)  # nothing new
    assert np.all(lower <= 0.0)
    assert np.all(upper >= 0.0)
