"""Limits of torques and of the tool: against Pinocchio, their slopes, several as one, and what is proven of them."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from functools import cache

import casadi as ca
import numpy as np
import pytest
from motions import Polynomials, Sines, random_samples
from pinocchio_chains import drive_torques, joint_torques, tool_motion
from refused import refusal
from slow_dynamics import random_chain

from constraints.certificate import ENCLOSED, EXACT, Extrema, LimitUse, limit_uses
from constraints.collision_limits import collision_limits
from constraints.enclosure import _mean_value, enclose
from constraints.geometry import HalfSpace, Obstacle, Part, World
from constraints.linear import linear_limits
from constraints.nonlinear import JoinedConstraint, NonlinearConstraint, StackedConstraint
from constraints.power import tool_box, tool_speed
from constraints.torque import torque_limits
from excite.design.grid_limits import GridConstraint, GridJoints
from excite.tasks.task import Task
from excite.trajectories import Trajectory
from regressors.errors import InputError
from regressors.models.nominal import standard_values
from regressors.models.partial import PartialMotion, of_drives, of_joints
from regressors.readers.library import built_in
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Drive, Limits, Robot, Transmission
from regressors.robot.shapes import Capsule
from regressors.samples import Array, Samples

INF = np.inf
POINT = np.array([0.1, -0.05, 0.2])


# --- torques ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("margin", [0.0, 0.3])
@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_joint_torques_are_those_of_pinocchio(name: str, margin: float) -> None:
    robot = built_in(name)
    (limit,) = torque_limits(robot, standard_values(robot), margin)
    samples = random_samples(robot.n, 1)
    np.testing.assert_allclose(limit.values(samples), joint_torques(robot, samples), atol=1e-10)
    np.testing.assert_allclose(limit.upper, (1 - margin) * robot.limits.torque, rtol=1e-15)
    np.testing.assert_array_equal(limit.lower, -limit.upper)
    assert limit.labels == tuple(f"joint {joint} torque" for joint in robot.joint_names)
    assert set(limit.units) == {"Nm"}


def test_drive_torques_are_those_behind_the_coupling() -> None:
    robot = built_in("irp6")
    (limit,) = torque_limits(robot, standard_values(robot), 0.1)
    samples = random_samples(robot.n, 2)
    samples = dataclasses.replace(samples, q=0.3 * samples.q)
    np.testing.assert_allclose(limit.values(samples), drive_torques(robot, samples), atol=1e-6)
    coulomb = np.array([28.0, 28.75, 30.0, 10.0, 5.0])
    np.testing.assert_allclose(limit.upper, 0.9 * np.array([331.8, 210.9, 215.6, 201.6, 64.5]) - coulomb)
    assert limit.labels == tuple(f"drive z{k} torque" for k in range(1, 6))


def test_held_joints_bear_their_load_and_do_not_rub() -> None:
    """Joints 1 to 3 move: drive 4 turns along and rubs, drive 5 holds; all five have limits."""
    robot = built_in("irp6")
    motion = of_joints(robot, [0, 1, 2])
    (limit,) = torque_limits(robot, standard_values(robot), 0.0, motion)
    moving = random_samples(3, 3)
    whole = Samples(moving.time, *(x @ motion.matrix.T for x in (moving.q, moving.dq, moving.ddq, moving.dddq)))
    np.testing.assert_allclose(limit.values(moving), drive_torques(robot, whole), atol=1e-6)
    np.testing.assert_allclose(limit.upper, [303.8, 182.15, 185.6, 191.6, 64.5])


def two_joints_one_drive() -> Robot:
    limits = dataclasses.replace(Limits.none(1), torque=np.ones(1))
    transmission = Transmission(np.array([[1.0, 1.0]]), (Drive("z"),), limits)
    return random_chain("rr", np.random.default_rng(0)).replace(transmission=transmission)


def irp6_with(torque: float) -> Robot:
    robot = built_in("irp6")
    limits = dataclasses.replace(robot.transmission.limits, torque=np.full(5, torque))
    return robot.replace(transmission=dataclasses.replace(robot.transmission, limits=limits))


REFUSED: dict[str, tuple[Callable[[], Robot], float, str]] = {
    "a negative margin": (lambda: built_in("panda"), -0.1, "torque margin must be 0 or more and less than 1, given -0"),
    "unknown inertias": (lambda: built_in("iiwa7"), 0.0, "need the inertias of all links; unknown: .*, .*"),
    "friction takes all": (lambda: irp6_with(torque=40.0), 0.5, "drive z1 torque: friction of 28 Nm exceeds the limit"),
    "no torque limits": (lambda: irp6_with(torque=INF), 0.0, "robot 'irp6' has no torque limits"),
    "fewer drives than joints": (
        two_joints_one_drive,
        0.0,
        "torques of its 1 drives are not determined by those of its 2 ",
    ),
}


@pytest.mark.parametrize("case", REFUSED.values(), ids=REFUSED.keys())
def test_torque_limits_that_cannot_be(case: tuple[Callable[[], Robot], float, str]) -> None:
    robot, margin, message = case
    assert re.search(message, refusal(torque_limits, robot(), standard_values(robot()), margin))


# --- the tool --------------------------------------------------------------------------------------------------------


CHAINS = {"panda": built_in("panda"), "irp6": built_in("irp6"), "rprp": random_chain("rprp", np.random.default_rng(5))}


@pytest.mark.parametrize("robot", CHAINS.values(), ids=CHAINS.keys())
def test_the_tool_is_where_pinocchio_has_it(robot: Robot) -> None:
    """Position, and speed as it is shown; only the sides with a bound are there; held joints carry it too."""
    box = tool_box(robot, POINT, np.array([-1, -INF, 0.0]), np.array([1, INF, INF]))
    speed = tool_speed(robot, POINT, 1.5)
    assert (box.labels, box.units) == (("tool x", "tool z"), ("m", "m"))
    np.testing.assert_array_equal([box.lower, box.upper], [[-1, 0], [1, INF]])
    for moving in (list(range(robot.n)), [1, 2]):
        motion = of_joints(robot, moving)
        samples = random_samples(len(moving), 6)
        parts = (samples.q, samples.dq, samples.ddq, samples.dddq)
        whole = Samples(samples.time, *(x @ motion.matrix.T for x in parts))
        whole = dataclasses.replace(whole, q=whole.q + motion.offset)
        position, velocity = tool_motion(robot, POINT, whole)
        np.testing.assert_allclose(box.restricted(motion).values(samples), position[:, [0, 2]], atol=1e-12)
        shown = speed.shown(speed.restricted(motion).values(samples))[:, 0]
        np.testing.assert_allclose(shown, np.linalg.norm(velocity, axis=1), atol=1e-12)
    assert (speed.labels, speed.units, speed.shown(speed.upper)[0]) == (("tool speed",), ("m/s",), 1.5)
    assert speed.shown(speed.lower)[0] == -INF


BOXES = {
    "upside down": ([0.5, -1, -1], [-0.5, 1, 1], "tool box, x: the lower bound 0.5 m must be below the upper one -0.5"),
    "no number": ([-1, np.nan, 0], [1, 1, 1], "tool box, y: the lower bound nan m"),
    "no bound": ([-INF] * 3, [INF] * 3, "tool box: no bound is given"),
}


@pytest.mark.parametrize("case", BOXES.values(), ids=BOXES.keys())
def test_boxes_that_cannot_be(case: tuple) -> None:
    lower, upper, message = case
    with pytest.raises(InputError, match=message):
        tool_box(built_in("panda"), POINT, np.array(lower, dtype=float), np.array(upper, dtype=float))


@pytest.mark.parametrize("speed", [0.0, -1.0, INF, float("nan")])
def test_speeds_that_cannot_be(speed: float) -> None:
    with pytest.raises(InputError, match=f"tool speed must be a positive number, given {speed}"):
        tool_speed(built_in("panda"), POINT, speed)


# --- slopes ----------------------------------------------------------------------------------------------------------


@cache
def limits_of(name: str) -> tuple[NonlinearConstraint, ...]:
    """All kinds of limits of a built-in robot."""
    robot = built_in(name)
    return (
        *torque_limits(robot, standard_values(robot), 0.1),
        tool_box(robot, POINT, np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, INF])),
        tool_speed(robot, POINT, 1.5),
    )


@pytest.mark.parametrize("kind", range(3), ids=["torque", "box", "speed"])
def test_slopes_are_derivatives(kind: int) -> None:
    """Of the functions with respect to the state, by central differences."""
    limit = limits_of("irp6")[kind]
    at, moving, pushed = (random_samples(5, seed, 6) for seed in (7, 8, 9))
    x, h = np.concatenate([at.q, moving.dq, pushed.ddq], axis=1), 1e-6

    def values(x: Array) -> Array:
        return limit.values(Samples(np.arange(6.0), *np.split(x, 3, axis=1), np.zeros((6, 5))))

    slopes = limit.slopes(Samples(np.arange(6.0), *np.split(x, 3, axis=1), np.zeros((6, 5))))
    for k, unit in enumerate(np.eye(15)):
        np.testing.assert_allclose(slopes[:, :, k], (values(x + h * unit) - values(x - h * unit)) / (2 * h), atol=2e-5)


MOTIONS = {
    "all joints": lambda robot: of_joints(robot, [0, 1, 2, 3, 4]),
    "two drives, an offset": lambda robot: dataclasses.replace(
        of_drives(robot, ["z2", "z4"]), offset=np.array([0.3, -0.1, 0.2, 0.4, -0.5])
    ),
}


@pytest.mark.parametrize("trajectory", ["fourier", "fourier-quintic", "bspline"])
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
def test_slopes_on_a_grid_are_those_of_its_values(motion: Callable[[Robot], PartialMotion], trajectory: str) -> None:
    """With respect to the coefficients of the moving coordinates, by central differences; and where each bound is."""
    family = Task("irp6", harmonics=3, intervals=6, trajectory=trajectory).trajectory.family()
    moving = motion(built_in("irp6"))
    x = 0.2 * np.random.default_rng(10).normal(size=(len(moving.labels), family.size))
    instants, h = np.array([0, 7, 20]), 1e-6
    states = Trajectory(family, x).samples(family.grid(32))
    q, dq, ddq = (part @ moving.matrix.T for part in (states.q, states.dq, states.ddq))
    joints = Samples(states.time, q + moving.offset, dq, ddq, np.zeros_like(q))
    for limit in limits_of("irp6"):
        grid = GridConstraint.on_joints(limit, GridJoints(family.on_grid(32), moving))
        expected = limit.values(joints).T
        np.testing.assert_allclose(grid.values(x), expected, atol=1e-9)
        tangent, place = grid.tangent(x, instants), np.arange(3)
        rows = np.array([tangent(np.full(3, k), place) for k in range(len(limit.labels))])
        for k, unit in enumerate(np.eye(x.size)):
            ahead, behind = (grid.values(x + side * h * unit.reshape(x.shape))[:, instants] for side in (1, -1))
            np.testing.assert_allclose(rows[:, :, k], (ahead - behind) / (2 * h), atol=2e-4)
        for scale in (0.2, 1.0, 3.0):  # bounds that hold, and bounds that do not
            changed = dataclasses.replace(grid, lower=scale * grid.lower, upper=scale * grid.upper)
            inside = (expected <= changed.upper[:, None]) & (expected >= changed.lower[:, None])
            assert changed.holds(x) == bool(np.all(inside)) == bool(np.all(changed.uses(expected) <= 1.0))


# --- what is proven between samples ----------------------------------------------------------------------------------


def random_motion(robot: Robot, trajectory: str, seed: int, size: float) -> tuple[Trajectory, Array]:
    """A motion and its largest jerks."""
    family = Task("irp6", harmonics=4, intervals=8, order=4, trajectory=trajectory).trajectory.family()
    x = size * np.random.default_rng(seed).normal(size=(robot.n, family.size))
    third = family.extrema(x, 3)
    return Trajectory(family, x), np.maximum(np.abs(third.low), np.abs(third.high))


@pytest.mark.parametrize(
    ("name", "trajectory"),
    [("irp6", "fourier"), ("irp6", "bspline"), ("panda", "fourier-quintic"), ("panda", "bspline")],
)
def test_nothing_is_beyond_an_enclosure_and_little_is_between(name: str, trajectory: str) -> None:
    """Against 10^5 samples: never beyond, and within 0.01 of a function's scale (0.001 near a limit, or beyond it)."""
    motion, jerk = random_motion(built_in(name), trajectory, 11, 0.25)
    samples = [motion.samples(part) for part in np.array_split(np.linspace(0, 10, 100_001), 8)]
    for limit in limits_of(name):
        values = [limit.values(part) for part in samples]
        low, high = np.min([v.min(axis=0) for v in values], axis=0), np.max([v.max(axis=0) for v in values], axis=0)
        tight = enclose(limit, motion.samples, motion.duration, jerk)
        assert np.all(tight.high >= high)
        assert np.all(tight.low <= low)
        for beyond, left in ((tight.high - high, limit.upper - high), (low - tight.low, low - limit.lower)):
            part, room = beyond / limit.scale, left / limit.scale
            assert np.all(part[room < 0.98] <= 0.0101)
            assert np.all(part[room < 0.0] <= 0.00101)
        for function, (time, extreme) in enumerate(zip(tight.high_time, tight.high, strict=True)):
            near = limit.values(motion.samples(np.array([time])))[0, function]
            scale, left = limit.scale[function], limit.upper[function] - extreme
            assert extreme - near <= 0.0101 * scale or left > scale


def spike(centre: float, width: float, bound: float) -> NonlinearConstraint:
    """A function of the first joint that is 1 at a place and nearly 0 elsewhere."""
    one = np.ones(1)
    return NonlinearConstraint(
        1, lambda q, dq, ddq: 1 / (1 + ((q - centre) / width) ** 2), -one, bound * one, one, ("spike",), ("m",)
    )


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize(("bound", "holds"), [(0.9, False), (0.999, False), (1.01, True), (1.5, True)])
def test_what_happens_between_samples_is_found(width: float, bound: float, holds: bool) -> None:
    """A violation that lasts some microseconds, at a time that no sampling hits; and none where there is none."""
    q, time = lambda t: np.sin(0.7 * t), 1.2345678
    limit = spike(np.sin(0.7 * time), width, bound)

    motion = Sines(np.zeros(1), np.ones((1, 1)), np.array([0.7]), np.zeros((1, 1))).samples
    assert limit.values(motion(np.linspace(0, 2, 1025))).max() < 0.9 or width > 1e-3
    found = enclose(limit, motion, 2.0, np.array([0.7**3]))
    (use,) = found.uses(limit)
    assert use.holds is holds
    assert 1.0 <= found.high[0] <= 1.011
    assert abs(q(use.time) - q(time)) <= width
    assert use.method == ENCLOSED


def test_what_is_reached_at_an_end_is_enclosed() -> None:
    """``q = t^3`` from 0 to 2: position, velocity and acceleration are largest at the end, the slowest at the start."""
    scale = np.array([8.0, 12.0, 12.0])
    limit = NonlinearConstraint(
        1, lambda q, dq, ddq: ca.vertcat(q, dq, ddq), -scale, 1.5 * scale, scale, ("q", "dq", "ddq"), ("m",) * 3
    )

    motion = Polynomials(np.array([[0.0], [0.0], [0.0], [1.0]])).samples
    found = enclose(limit, motion, 2.0, np.array([6.0]))
    assert np.all((found.high >= scale) & (found.high <= 1.01 * scale))
    assert np.all((found.low <= 0.0) & (found.low >= -0.01 * scale))


def test_what_cannot_be_bounded_does_not_hold() -> None:
    """``1 / q`` while q passes zero."""
    one = np.ones(1)
    limit = NonlinearConstraint(1, lambda q, dq, ddq: 1 / q, -one, one, one, ("pole",), ("m",))
    motion = Polynomials(np.array([[-0.7], [1.0]])).samples
    (use,) = enclose(limit, motion, 1.0, np.zeros(1)).uses(limit)
    assert not use.holds
    assert not use.margin > -1


# --- certificates ----------------------------------------------------------------------------------------------------


def test_certificates_say_how_they_were_found() -> None:
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    motion, jerk = random_motion(robot, "fourier", 12, 0.1)
    for limit in linear_limits(robot):
        assert {use.method for use in limit_uses(limit, motion.extrema(limit))} == {EXACT}
    (speed,) = (tool_speed(built_in("irp6"), POINT, 0.5).restricted(of_joints(built_in("irp6"), [0, 1, 2])),)
    (use,) = enclose(speed, motion.samples, motion.duration, jerk).uses(speed)
    dense = np.sqrt(0.5 * speed.values(motion.samples(np.linspace(0, 10, 20_001))).max())
    assert (use.method, use.unit, use.bound) == (ENCLOSED, "m/s", 0.5)
    assert dense <= use.extreme <= dense + 0.01
    assert use.margin == pytest.approx(0.5 - use.extreme)
    assert use.holds == (use.extreme <= 0.5)
    assert use.to_dict()["method"] == "enclosed"


@pytest.mark.parametrize(
    ("low", "high", "use", "holds"),
    [(0.2, 0.8, 0.75, True), (0.0, 0.8, 1.0, True), (-0.2, 0.8, 1.25, False), (0.0, 0.0, 1.0, True)],
)
def test_a_floor_at_zero_is_used_by_a_number(low: float, high: float, use: float, holds: bool) -> None:
    floor = tool_box(built_in("panda"), POINT, np.array([-INF, -INF, 0.0]), np.full(3, INF))
    ends = np.array([low]), np.array([high])
    (found,) = limit_uses(floor, Extrema(*ends, np.zeros(1), np.zeros(1)), ENCLOSED)
    assert found.use == pytest.approx(use)
    assert found.holds is holds
    assert isinstance(found, LimitUse)
    assert found.margin == low


@pytest.mark.parametrize("velocity", [0.0, 1.0])
def test_values_in_an_interval_are_within_its_slack(velocity: float) -> None:
    """Of one joint at constant acceleration, whose derivatives say least of it where it turns."""
    size = np.ones(3)
    constraint = NonlinearConstraint(
        1, lambda q, dq, ddq: ca.vertcat(q, q**2, q * dq), -size, size, size, ("a", "b", "c"), ("",) * 3
    )
    motion = Polynomials(np.array([[0.0], [velocity], [1.5]])).samples
    value, slack = _mean_value(constraint, motion(np.zeros(1)), np.array([0.2]), np.zeros(1))
    assert np.all(np.abs(constraint.values(motion(np.linspace(-0.2, 0.2, 201))) - value) <= slack)


PANDA = built_in("panda")


@cache
def parts() -> tuple[NonlinearConstraint, ...]:
    """Torques, the tool, and distances, whose slopes hold the nearest points."""
    second, fifth = (PANDA.links[k].name for k in (1, 4))
    arm = Part(second, Capsule((0.0, 0.0, 0.0), (0.0, -0.3, 0.0), 0.05))
    wrist = Part(fifth, Capsule((0.0, 0.0, -0.2), (0.0, 0.0, 0.0), 0.05))
    world = World((arm, wrist), (Obstacle("table", HalfSpace((0.0, 0.0, 1.0), 0.0)),), clearance=0.01)
    far = np.full(3, np.inf)
    return (
        *torque_limits(PANDA, standard_values(PANDA), 0.1),
        tool_box(PANDA, np.zeros(3), np.array([-0.5, -0.5, 0.1]), far),
        tool_speed(PANDA, np.zeros(3), 1.5),
        *collision_limits(PANDA, world, of_joints(PANDA, range(PANDA.n))),
    )


def states(count: int) -> tuple[Samples, list[Array]]:
    """Random states of the arm, and as constraints take them at instants."""
    samples = random_samples(PANDA.n, 3, count, size=0.75)
    return samples, [samples.q.T, samples.dq.T, samples.ddq.T]


@pytest.mark.parametrize("together", [StackedConstraint, JoinedConstraint])
def test_functions_are_those_of_the_parts(together: type[StackedConstraint]) -> None:
    stacked, (samples, state) = together(parts()), states(9)
    values = [part.values(samples) for part in parts()]
    expected = np.concatenate(values, axis=1)
    np.testing.assert_allclose(stacked.at_instants(state), expected.T, atol=1e-12)
    np.testing.assert_allclose(stacked.values(samples), expected, atol=1e-12)
    shown = np.concatenate([part.shown(x) for part, x in zip(parts(), values, strict=True)], axis=1)
    np.testing.assert_allclose(stacked.shown(expected), shown, atol=1e-12)
    assert len(stacked.labels) == len(stacked.units) == len(stacked.lower) == expected.shape[1]
    assert len(parts()) > 4


def test_slopes_of_some_functions_at_some_instants_are_those_of_the_parts() -> None:
    """In any order, and of columns in any order; zero where a function does not depend on a joint."""
    stacked, (samples, state), rng = StackedConstraint(parts()), states(9), np.random.default_rng(4)
    expected = np.concatenate([part.slopes(samples) for part in parts()], axis=1)
    function, instant = rng.integers(0, expected.shape[1], 60), rng.integers(0, 9, 60)
    columns = rng.permutation(3 * PANDA.n)
    found = stacked.slopes_at_instants(state)(function, instant, columns)
    np.testing.assert_allclose(found, expected[instant[:, None], function[:, None], columns], atol=1e-10)
    assert stacked.slopes_at_instants(state)(function[:0], instant[:0], columns).shape == (0, columns.size)


def test_what_functions_depend_on_is_what_their_slopes_say() -> None:
    state, _ = states(30)
    for limit in (*parts(), StackedConstraint(parts()[-2:])):
        slopes = np.concatenate([part.slopes(state) for part in getattr(limit, "parts", (limit,))], axis=1)
        by_order = np.abs(slopes).reshape(*slopes.shape[:2], 3, PANDA.n).max(axis=(0, 3))
        assert limit.derivatives == tuple(np.flatnonzero(by_order.max(axis=0)))
        np.testing.assert_array_equal(limit.varies, by_order.max(axis=1) > 0)
