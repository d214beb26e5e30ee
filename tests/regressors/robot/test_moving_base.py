"""The equations of a robot on six joints are those of a free base, by Pinocchio's free flyer."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from public_arms import THETA_FROM_PINOCCHIO, TREES
from refused import refusal
from scipy.spatial.transform import Rotation

from regressors.errors import InputError
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.readers.library import load_robot
from regressors.robot.archive import robot_from_description
from regressors.robot.columns import Terms
from regressors.robot.moving_base import BASE_JOINTS, turning_axes, with_moving_base
from regressors.robot.robot import Robot
from regressors.samples import Array

GO2 = TREES[0]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return with_moving_base(load_robot(GO2.path))


def flying(robot: Robot, model: Any, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, Array]:
    """Configuration, velocity and acceleration of a free flyer and its joints, from those of the six joints."""
    names = [robot.joint_names.index(name) for name in list(model.names)[2:]]
    R, turns = Rotation.from_euler("ZYX", q[3:6]), q[None, 3:6]
    E = turning_axes(turns)[0]
    rate = turning_axes(turns + 1e-30j * dq[3:6])[0].imag / 1e-30
    v, omega = R.inv().apply(dq[:3]), E @ dq[3:6]
    a = R.inv().apply(ddq[:3]) - np.cross(omega, v)
    pose = np.concatenate([q[:3], R.as_quat(), q[names]])
    return pose, np.concatenate([v, omega, dq[names]]), np.concatenate([a, E @ ddq[3:6] + rate @ dq[3:6], ddq[names]])


def test_its_regressor_is_that_of_a_free_flyer(robot: Robot) -> None:
    model = pin.buildModelFromUrdf(str(GO2.path), pin.JointModelFreeFlyer())
    data, states = model.createData(), random_states(robot, 5)
    Y = DifferentialModel(robot, Terms.inertial_only())
    ours = Y.instants(states).reshape(5, robot.n, -1) @ Y.reduction.definition  # of all standard parameters
    number = {**{link.name: k for k, link in enumerate(robot.links)}}
    for state, rows in zip(zip(states.q, states.dq, states.ddq, strict=True), ours, strict=True):
        q = state[0]
        theirs = pin.computeJointTorqueRegressor(model, data, *flying(robot, model, *state))
        R, E = Rotation.from_euler("ZYX", q[3:6]).as_matrix(), turning_axes(q[None, 3:6])[0]
        expected = np.zeros_like(rows)
        for joint in range(1, model.njoints):
            name = model.names[joint]
            link = robot.joint_names.index(name) if name in robot.joint_names else number["moving_base"]
            block = theirs[:, 10 * (joint - 1) : 10 * joint][:, THETA_FROM_PINOCCHIO]
            columns = slice(10 * link, 10 * link + 10)
            expected[:3, columns], expected[3:6, columns] = R @ block[:3], E.T @ block[3:6]
            for k, driven in enumerate(list(model.names)[2:]):
                expected[robot.joint_names.index(driven), columns] = block[6 + k]
        np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_the_base_has_ten_parameters_and_no_friction(robot: Robot) -> None:
    base = base_parameters(DifferentialModel(robot))
    assert base.names[:2] == ("m13", "m13c13x")
    assert sum(base.columns[k].group == "inertial" for k in base.index) == 10 + 12 * 7
    assert {base.columns[k].owner for k in base.index if base.columns[k].group == "friction"} == {*range(1, 13)}
    held = load_robot(GO2.path)
    assert held.base is not None
    np.testing.assert_array_equal(robot.links[5].theta, held.base.theta)


def test_base_parameters_hold_every_motion_where_velocity_limits_are_placeholders(robot: Robot) -> None:
    fast = robot.replace(limits=replace(robot.limits, velocity=np.where(np.arange(robot.n) < 6, np.inf, 1e4)))
    model = DifferentialModel(fast, Terms.inertial_only())
    base = base_parameters(model)
    np.testing.assert_allclose(base.D, base_parameters(model, states=random_states(robot, 2000)).D, rtol=0, atol=1e-9)


def test_what_is_written_of_it_is_read_and_a_base_that_stands_still_is_no_part_of_it(robot: Robot) -> None:
    again = robot_from_description(robot.description())
    assert (again.sha256(), again.base_joints) == (robot.sha256(), BASE_JOINTS)
    held = load_robot(GO2.path)
    assert held.replace(base=None).description() == held.description()
    assert with_moving_base(robot) is robot


def test_a_base_that_is_the_world_does_not_move() -> None:
    held = load_robot(GO2.path)
    with pytest.raises(InputError, match="its base is the world, which does not move; name the body that does"):
        with_moving_base(held.replace(base=held.base and type(held.base)("world")))


def test_what_knows_no_moving_base_says_so(robot: Robot) -> None:
    assert "a bound does not support a moving base; put the base on a stand" in refusal(robot.check_open, "a bound")
