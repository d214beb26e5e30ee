"""Mirrored limbs: which are found, and that the mirror image of a motion takes the mirror image of its torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mirrored_arms import MIRROR, arms
from pinocchio_chains import joint_torques
from public_arms import TREES, Arm

from regressors.errors import InputError
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.load import BaseWrenchModel
from regressors.models.mirrored_limbs import mirrored_bodies, with_mirrored_limbs
from regressors.models.model import RegressorModel
from regressors.models.reduction import free_parameters
from regressors.readers.library import load_robot
from regressors.robot.columns import Terms
from regressors.robot.inertia import pose_of, rotation_from_rpy, transport
from regressors.robot.robot import Drive, Limits, Link, Robot, Transmission
from regressors.samples import Samples


def reframed(robot: Robot, seed: int = 0) -> Robot:
    """The same robot with the frames of its right arm turned, and moved along the joints' axes."""
    rng, joints, links = np.random.default_rng(seed), list(robot.joints), list(robot.links)
    before = np.eye(4)
    for k in range(3, 6):
        joint, along = joints[k], rng.uniform(-0.1, 0.1)
        own = pose_of(rotation_from_rpy(rng.uniform(-3, 3, 3)), along * joint.axis)
        T = np.linalg.inv(before) @ pose_of(joint.rotation, joint.translation) @ own
        R = own[:3, :3]
        joints[k] = replace(joint, rotation=T[:3, :3], translation=T[:3, 3], axis=(-1) ** k * R.T @ joint.axis)
        links[k] = replace(links[k], theta=transport(R.T, -R.T @ own[:3, 3]) @ links[k].theta)
        before = own
    return robot.replace(joints=tuple(joints), links=tuple(links))


def equal_limbs(robot: Robot) -> Robot:
    """The robot with the bodies of its left arm on the right one too."""
    S = DifferentialModel(with_mirrored_limbs(robot), Terms.inertial_only()).composition.matrix
    theta = (S @ np.concatenate([link.theta for link in robot.links[:3]])).reshape(-1, 10)
    return robot.replace(links=tuple(map(Link, robot.joint_names, theta)))


@pytest.mark.parametrize("robot", [arms(), reframed(arms())], ids=["arms", "with other frames"])
def test_the_mirror_image_of_a_motion_takes_the_mirrored_torques(robot: Robot) -> None:
    robot, states = equal_limbs(robot), random_states(robot, 20)
    P = MIRROR if np.allclose(robot.joints[4].axis, [0, 1, 0]) else MIRROR * np.outer([-1, 1, -1] * 2, [1] * 6)
    image = Samples(states.time, *(x @ P.T for x in (states.q, states.dq, states.ddq, states.dddq)))
    np.testing.assert_allclose(joint_torques(robot, image), joint_torques(robot, states) @ P.T, atol=1e-9)
    model = DifferentialModel(with_mirrored_limbs(robot), Terms(root=True, asymmetry=True, stribeck=True))
    Y, Y_image = (model.instants(x).reshape(20, 6, -1) for x in (states, image))
    np.testing.assert_allclose(Y_image, np.einsum("ij,kjp->kip", P, Y), atol=1e-9)


@pytest.mark.parametrize("kind", [DifferentialModel, EnergyModel, BaseWrenchModel])
def test_tied_columns_are_those_of_both_sides(kind: type[RegressorModel]) -> None:
    drives = tuple(Drive(joint.name, rotor_inertia=1e-4) for joint in arms().joints)
    robot = arms().replace(transmission=Transmission(np.eye(6), drives, Limits.none(6)))
    tied, apart = kind(with_mirrored_limbs(robot)), kind(robot)  # type: ignore[call-arg]
    states = random_states(robot, 200)
    free, S, _ = free_parameters(tied.robot.structure, apart.names)
    assert tied.names == tuple(free)
    assert 2 * len(free) == len(apart.names)
    np.testing.assert_allclose(tied.instants(states), apart.instants(states) @ S, atol=1e-9)
    if tied.rows_are_joint_torques:
        assert 2 * base_parameters(tied).rank == base_parameters(apart).rank


def test_biases_have_no_side() -> None:
    model = DifferentialModel(with_mirrored_limbs(arms()), Terms(coulomb=False, viscous=False, offset=True))
    assert model.names[-6:] == tuple(f"F{k}o" for k in range(1, 7))


_PAIRS = {"go2": 6, "baxter": 7, "tiago-dual": 7, "icub": 13, "romeo": 13, "g1": 13, "centauro-arms": 6, "solo12": 6}


@pytest.mark.parametrize("tree", [tree for tree in TREES if tree.id in _PAIRS], ids=str)
def test_public_robots(tree: Arm) -> None:
    bodies = mirrored_bodies(load_robot(str(tree.path), tree.base, tree.tips))
    assert len(bodies) == _PAIRS[tree.id]
    assert any("(3 mm or mrad off)" in text for text in bodies) == (tree.id == "tiago-dual")


def test_axes_that_are_nearly_mirrored_are_enough() -> None:
    *others, last = arms().joints
    places = (last.translation + np.array([0.0, 0.0, by]) for by in (0.001, 0.01))
    near, far = (arms().replace(joints=(*others, replace(last, translation=place))) for place in places)
    assert len(mirrored_bodies(near)) == 3
    with pytest.raises(InputError, match=r"left_fore_joint and right_fore_joint are off .* 0 rad and 0.01 m"):
        with_mirrored_limbs(far)


def test_what_is_no_mirror_image_is_refused_by_name() -> None:
    robot = arms()
    parts = {"joints": robot.joints[:-1], "links": robot.links[:-1], "parents": robot.parents[:-1]}
    with pytest.raises(InputError, match="left_upper carries 1 moving bodies, and right_upper 0"):
        with_mirrored_limbs(robot.replace(**parts, limits=robot.limits.take(range(5))))
