"""The wrench below a robot's base, against the forces at the first joints of Pinocchio's Newton-Euler recursion."""

from __future__ import annotations

import numpy as np
import pytest
from pinocchio_chains import ground_wrenches
from public_arms import TREES
from refused import refusal
from slow_dynamics import ROBOTS, random_body, shifted

from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.load import BaseWrenchModel, Sensor
from regressors.readers.library import load_robot
from regressors.robot.columns import Terms
from regressors.robot.robot import Link, Robot


def with_random_bodies(robot: Robot) -> Robot:
    rng = np.random.default_rng(5)
    links = tuple(Link(link.name, random_body(rng), link.number) for link in robot.links)
    return robot.replace(links=links, branches=())


@pytest.mark.parametrize("turned", [False, True], ids=["at-the-base", "turned"])
@pytest.mark.parametrize("name", [*ROBOTS, "go2"])
def test_the_wrench_is_pinocchios(name: str, turned: bool) -> None:
    tree = TREES[0]
    robot = with_random_bodies(load_robot(tree.path, tip=tree.tips) if name == tree.id else ROBOTS[name]())
    sensor = shifted(None) if turned else Sensor()
    states = random_states(robot, 20, seed=1)
    theta = np.concatenate([link.theta for link in robot.links])
    found = BaseWrenchModel(robot, sensor).instants(states) @ theta
    expected = ground_wrenches(robot, states, sensor.rotation, sensor.translation).ravel()
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


def test_it_shows_what_torques_show_and_the_weight() -> None:
    """Of the first body also what its joint's torque does not depend on, and the whole mass as the first parameter."""
    panda = ROBOTS["panda"]()
    of_torques = base_parameters(DifferentialModel(panda, Terms(rotor=False, coulomb=False, viscous=False)))
    base = base_parameters(BaseWrenchModel(panda))
    assert set(of_torques.names) < set(base.names)
    assert set(base.names) - set(of_torques.names) == {"m1", "m1c1x", "m1c1y", "I1xz", "I1yz"}


def test_a_sensor_at_a_link_is_refused() -> None:
    assert "leave `sensor` out" in refusal(BaseWrenchModel, ROBOTS["panda"](), Sensor("3"))
