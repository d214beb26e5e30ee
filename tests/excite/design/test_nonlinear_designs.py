"""Designs within limits of torques and of the tool: judged by Pinocchio, run again, refused where they cannot be."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from commands import Here, content_of
from designed import NO_DISTANCES
from pinocchio_chains import drive_torques, joint_torques, tool_motion, whole_motion

from constraints.certificate import ENCLOSED, EXACT
from constraints.diagnosis import ContradictionError, interior_pose
from constraints.enclosure import enclose
from constraints.linear import linear_limits
from constraints.nonlinear import NonlinearConstraint
from constraints.power import tool_box
from excite.design import formulation
from excite.design.design import Design
from excite.design.formulation import Formulation, formulate, roomy_pose
from excite.design.initial_guesses import candidates
from excite.design.optimisation import design_trajectory
from excite.design.stated_limits import nonlinear_limits
from excite.design.task_file import task_from_options
from excite.registry import instance
from excite.tasks.limit_choice import LimitChoice
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.partial import of_joints
from regressors.readers.library import built_in
from regressors.samples import Array, Samples

Z2, SPEED = "drive z2 torque", "tool speed"
PANDA: dict[str, Any] = {
    "robot": "panda", "harmonics": 4, "joints": ("1", "2", "4"), "friction": False, "torque_margin": 0.5,
    "tool_point": (0.0, 0.0, 0.1), "tool_box": ((-0.6, 0.6), (-0.35, 0.6), (0.1, None)), "tool_speed": 1.0,
}  # fmt: skip
ABOVE = ((None,) * 2, (None,) * 2, (1.1, None))
# options of a task, and the limits that bind
CASES: dict[str, tuple[dict[str, Any], tuple[str, ...]]] = {
    "drives, two joints held": ({"torque_margin": 0.6, "tool_point": (0.1, 0.0, 0.1), "tool_speed": 0.5}, (Z2, SPEED)),
    "tool on held joints": ({"joints": ("1", "2"), "tool_box": ABOVE, "tool_speed": 0.5}, ("tool z", SPEED)),
    "one drive": ({"drives": ("2",), "torque_margin": 0.6, "tool_speed": 0.3}, (SPEED,)),
    "splines": ({"trajectory": "bspline", "intervals": 7, "torque_margin": 0.6, "tool_speed": 0.5}, (Z2, SPEED)),
    "a box": (PANDA, ("joint panda_joint2 torque", "tool z", SPEED)),
}


def task_of(name: str) -> Task:
    search = {"starts": 1, "executor": "serial"}
    return Task(**{"robot": "irp6", "harmonics": 3, **search, **NO_DISTANCES, **CASES[name][0]})


@cache
def formulated(name: str) -> Formulation:
    task = task_of(name)
    return formulate(built_in(task.robot), task)


@cache
def designed(name: str) -> Design:
    return design_trajectory(formulated(name).task)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_design_keeps_every_limit_as_pinocchio_sees_it(name: str) -> None:
    """Densely sampled, for the whole robot: torques of the joints or drives with all friction, place and speed."""
    design, task = designed(name), task_of(name)
    robot = built_in(task.robot)
    samples = design.trajectory.samples(np.linspace(0, 10, 5001))
    whole = whole_motion(robot, design.moving.joint_names, samples)
    place, velocity = tool_motion(robot, np.array(task.limits.tool_point), whole)
    assert design.feasible
    if isinstance(task.limits.torque_margin, float):
        drives = robot.transmission
        torque = np.abs(joint_torques(robot, whole) if drives is None else drive_torques(robot, whole))
        if drives is not None:  # with friction at its worst
            torque += [drive.coulomb for drive in drives.drives] * np.any(whole.dq @ drives.coupling.T != 0, axis=0)
        limit = (robot if drives is None else drives).limits
        assert np.all(torque.max(axis=0) <= (1 - task.limits.torque_margin) * limit.torque)
    assert np.linalg.norm(velocity, axis=1).max() <= task.limits.tool_speed
    for axis, (lower, upper) in enumerate(task.limits.tool_box or ()):
        assert lower is None or place[:, axis].min() >= lower
        assert upper is None or place[:, axis].max() <= upper


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_certificates_of_a_design(name: str) -> None:
    """Which limits are exact and which enclosed; the ones that bind are nearly reached, so that nothing is wasted."""
    design, task, binding = designed(name), task_of(name), CASES[name][1]
    uses = {use.label: use for use in design.limits}
    assert all(use.holds for use in design.limits)
    for label, use in uses.items():
        assert use.method == (ENCLOSED if label.startswith("tool") or label.endswith("torque") else EXACT)
        assert np.isfinite(use.use)
    for label in binding:
        assert 0.96 <= uses[label].use <= 1.0, label
    expected = set() if task.limits.torque_margin is None else {"torque"}
    expected |= {"tool speed"} | ({"tool z"} if task.limits.tool_box else set())
    found = {"torque" if label.endswith("torque") else label for label, use in uses.items() if use.method == ENCLOSED}
    assert found - {"tool x", "tool y"} == expected
    dense = design.trajectory.samples(np.linspace(0, 10, 5001))
    for limit in formulated(name).nonlinear:
        values = limit.shown(limit.values(dense))
        for k, label in enumerate(limit.labels):
            use = uses[label]
            reached = values[:, k].max() if use.bound == limit.shown(limit.upper)[k] else values[:, k].min()
            assert abs(use.extreme - reached) <= 0.0101 * limit.scale[k]


@pytest.mark.parametrize("name", [*CASES, "shaped"])
def test_starts_keep_all_limits(name: str) -> None:
    """Those that a search chooses from, one from a motion of a given shape, between samples too; they move."""
    task = task_of("tool on held joints").changed(start=("quintic",))
    made = formulate(built_in("irp6"), task) if name == "shaped" else formulated(name)
    problem = made.problem
    for index in range(2):
        for x in candidates(problem, index, np.random.default_rng(index)):
            assert problem.violation(x) <= 1e-9
            assert problem.nonlinear_hold(x)
            assert np.abs(x - problem.rest).max() > 0.01
            motion = problem.information.trajectory(x)
            third = problem.family.extrema(motion.x, 3)
            jerk = np.maximum(np.abs(third.low), np.abs(third.high))
            for limit in made.nonlinear:
                assert all(use.holds for use in enclose(limit, motion.samples, motion.duration, jerk).uses(limit))


def test_the_search_never_leaves_the_limits_and_improves() -> None:
    problem = formulated("tool on held joints").problem
    values: list[float] = []

    def watch(x: Array, value: float) -> None:
        assert problem.nonlinear_hold(x)
        assert problem.violation(x) <= 1e-9
        values.append(value)

    solution = instance("solver", "sqp").solve(problem, candidates(problem, 0, np.random.default_rng(0)), watch)
    assert solution.value == min(values)
    assert solution.value < 0.5 * values[0]


# --- a pose to start from --------------------------------------------------------------------------------------------


def test_small_boxes_are_found() -> None:
    """Boxes that few of the random poses reach, at a place that the Panda can reach."""
    robot, place = built_in("panda"), np.array([0.3, -0.25, 0.5])
    linear, motion = linear_limits(robot), of_joints(robot, range(7))
    for half in (0.2, 0.01):
        limit = tool_box(robot, np.zeros(3), place - half, place + half)
        pose = roomy_pose([limit], linear, motion, interior_pose(linear, 7))
        found, _ = tool_motion(robot, np.zeros(3), Samples(np.zeros(1), pose[None], *np.zeros((3, 1, 7))))
        assert np.all(np.abs(found[0] - place) < half)
        assert np.all((pose > robot.limits.lower) & (pose < robot.limits.upper))


def test_of_poses_with_the_same_room_the_first_is_taken() -> None:
    """Which an unstable sort leaves to the processor; judged by all limits in all poses."""
    robot = built_in("panda")
    linear, motion = linear_limits(robot), of_joints(robot, range(7))
    low, high = np.array([0.2, -np.inf, 0.1]), np.array([0.8, np.inf, 0.9])
    constant = NonlinearConstraint(7, lambda q, dq, ddq: ca.SX(0.9), -np.ones(1), np.ones(1), np.ones(1), ("g",), ("",))
    limits, centre = [tool_box(robot, np.zeros(3), low, high), constant], interior_pose(linear, 7)
    poses = formulation._poses(linear, centre)
    place, _ = tool_motion(robot, np.zeros(3), Samples(np.zeros(len(poses)), poses, *np.zeros((3, *poses.shape))))
    inside = np.minimum(place - low, high - place)[:, [0, 2]] / limits[0].scale[[0, -1]]
    near = np.minimum(poses - robot.limits.lower, robot.limits.upper - poses)
    room = np.min([inside.min(axis=1), (2 * near / (robot.limits.upper - robot.limits.lower)).min(axis=1)], axis=0)
    first = np.flatnonzero(room >= 0.1)
    assert first.size > 3
    assert np.array_equal(roomy_pose(limits, linear, motion, centre), poses[first[0]])


@pytest.mark.parametrize("place", [(4.0, 6.0), (-9.0, -4.0), (-6.2, 6.2)])
def test_poses_are_looked_for_where_the_limits_are(place: tuple[float, float]) -> None:
    """Ranges more than half a turn from zero, and of more than a turn."""
    robot = built_in("panda")
    limits = dataclasses.replace(robot.limits, lower=np.full(7, place[0]), upper=np.full(7, place[1]))
    robot = robot.replace(limits=limits)
    linear, motion = linear_limits(robot), of_joints(robot, range(7))
    centre = interior_pose(linear, 7)
    box = tool_box(robot, np.zeros(3), np.array([-np.inf, -np.inf, 0.3]), np.full(3, np.inf))
    pose = roomy_pose([box], linear, motion, centre)
    assert np.all((pose > place[0]) & (pose < place[1]))
    still = Samples(np.zeros(1), pose[None], *np.zeros((3, 1, 7)))
    assert box.values(still)[0, 0] > 0.3


def test_what_no_pose_bears_or_reaches_is_named() -> None:
    """Of a box of the tool, and of gravity: with all joints held but the first, what the second must hold stays."""
    panda, everywhere = built_in("panda"), (None, None)
    weak = panda.replace(limits=dataclasses.replace(panda.limits, torque=np.array([87, 1, 87, 87, 12, 12, 12.0])))
    for robot, options, message in (
        (panda, {"tool_box": ((3.0, 4.0), everywhere, everywhere)}, r"tool x beyond 3 m by 2\.\d+ m"),
        (panda, {"tool_box": (everywhere, everywhere, (1.6, None))}, r"tool z beyond 1\.6 m by 0\.\d+ m"),
        (weak, {"joints": ("1",), "torque_margin": 0.0}, r"joint panda_joint2 torque beyond -?1 Nm by \d"),
    ):
        with pytest.raises(ContradictionError, match=message):
            formulate(robot, Task("panda", friction=False, **options))


# --- what the files and the command line say -------------------------------------------------------------------------


@pytest.mark.slow
def test_a_design_is_told_and_can_be_run_again(here: Here) -> None:
    """Options of the command line, design.json, and the same motion from its task."""
    options = "--harmonics 3 --joints 1,2 --starts 1 --torque-margin 0.5 --tool-point 0.1,0,0 --tool-speed 0.5"
    folder = here.designed("irp6", *options.split(), "--tool-box", ":,-2:2,0.9:")
    content = content_of(folder)
    task = content["task"]
    assert (task["torque_margin"], task["tool_point"], task["tool_speed"]) == (0.5, [0.1, 0.0, 0.0], 0.5)
    assert task["tool_box"] == [[None, None], [-2.0, 2.0], [0.9, None]]
    methods = {limit["label"]: limit["method"] for limit in content["limits"]}
    assert methods["tool z"] == methods["tool speed"] == methods["drive z2 torque"] == "enclosed"
    assert methods["joint q1 position"] == "exact"
    assert "tool x" not in methods
    again = design_trajectory(task_from_options(task))
    assert again.trajectory.family.to_dict(again.trajectory.x).items() <= content["trajectory"].items()
    assert again.task == task_from_options(task)


BAD = {
    "--tool-box 1": "expected L:U for x, y and z, such as -1:1,-1:1,0: ; given '1'",
    "--tool-box -1:1,-1:1,0:a": "given '-1:1,-1:1,0:a'",
    "--tool-box :,:,:": "tool box: no bound is given",
    "--tool-box :,:,1:0": "tool box, z: the lower bound 1 m must be below the upper one 0 m",
    "--tool-box :,:,5:": "tool z beyond 5 m by",
    "--tool-speed 0": "'--tool-speed': must be a number from 1e-09 to 1000000 m/s, given 0",
    "--tool-point 0,0 --tool-speed 1": "expected three numbers separated by commas, given '0,0'",
    "--tool-point 0,0,0.1 --floor none": "--tool-point needs a limit of the tool, but none is given; "
    "give --tool-box, --tool-speed or --floor",
    "--torque-margin 1": "'--torque-margin': must be a number from 0 to 0.999, given 1",
    "--torque-margin 0.95": "drive z1 torque: friction of 28 Nm exceeds the limit of 331.8 Nm",
}


def test_bad_options(here: Here) -> None:
    for options, message in BAD.items():
        assert message in here.refused("design", "irp6", *options.split(), "--out", "out")


def test_bad_tasks() -> None:
    for options, message in (
        ({"tool_box": ((0, 1), (0, 1))}, "tool_box needs a lower and an upper bound for each of x, y, z"),
        ({"tool_point": (0, 1), "tool_speed": 1.0}, r"tool_point: expected three numbers, given \(0, 1\)"),
        ({"tool_point": (0, np.nan, 1), "tool_speed": 1.0}, "`tool_point` must be a number from -10000 to 10000 m"),
    ):
        with pytest.raises(InputError, match=message):
            Task("irp6", **options)


def test_limits_of_a_task_replace_those_of_the_robot() -> None:
    """Where resting joints rest depends on position limits that a task gives."""
    robot = built_in("panda")
    lower, upper = robot.limits.lower, robot.limits.upper
    ranges = tuple(zip(lower, upper, strict=True))
    ranges = (*ranges[:5], (1.0, 2.0), ranges[6])
    task = Task("panda", joints=("1", "2"), tool_speed=1.0, limits=LimitChoice(position=ranges))
    (speed,) = nonlinear_limits(robot, ("panda_joint1", "panda_joint2"), task)
    state = np.array([[0.3, 0.4]])
    samples = Samples(np.zeros(1), state, 2 * state, 0 * state, 0 * state)
    held = whole_motion(task.limits.applied(robot), ("panda_joint1", "panda_joint2"), samples)
    assert (held.q[0, 3], held.q[0, 5]) == (upper[3], 1.0)
    _, velocity = tool_motion(robot, np.zeros(3), held)
    assert speed.shown(speed.values(samples))[0, 0] == pytest.approx(np.linalg.norm(velocity))
