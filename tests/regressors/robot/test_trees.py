"""Robots that are trees: against Pinocchio on random ones, and the laws that one with a single branch is a chain."""

from __future__ import annotations

import pickle

import jax
import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from pinocchio_chains import joint_torques
from refused import refusal
from slow_dynamics import random_chain

from regressors.jax_models.jax_model import JaxModel
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel, inertial_torque
from regressors.models.energy import EnergyModel
from regressors.models.load import LoadModel, PayloadModel, Sensor
from regressors.models.model import RegressorModel
from regressors.readers.description import parse_description
from regressors.robot.archive import robot_from_description
from regressors.robot.columns import Terms
from regressors.robot.locked_joints import with_locked_drives, with_locked_joints
from regressors.robot.robot import Drive, Limits, Robot, Transmission
from regressors.samples import Array, Samples

INERTIAL = Terms.inertial_only()
TREES = st.lists(st.tuples(st.sampled_from("rp"), st.integers(0, 5)), min_size=2, max_size=6)
SEED = st.integers(0, 2**32 - 1)


def tree(shape: list[tuple[str, int]], seed: int) -> Robot:
    """A tree whose joint k sits on the link of the number that is given for it, modulo k + 1."""
    robot = random_chain("".join(kind for kind, _ in shape), np.random.default_rng(seed))
    return robot.replace(parents=tuple(parent % (k + 1) for k, (_, parent) in enumerate(shape)))


SHAPE = [("r", 0), ("r", 1), ("p", 2), ("r", 1), ("r", 4), ("r", 0)]
TWO_ARMS = tree(SHAPE, 3)


def theta_of(robot: Robot) -> Array:
    return np.concatenate([link.theta for link in robot.links])


def states(robot: Robot, count: int = 4, seed: int = 0) -> Samples:
    return random_states(robot, count, seed)


# --- dynamics --------------------------------------------------------------------------------------------------------


@given(TREES, SEED)
@example(SHAPE, 3)
@settings(max_examples=25, deadline=None)
def test_torques_are_those_of_pinocchio(shape: list[tuple[str, int]], seed: int) -> None:
    robot = tree(shape, seed)
    samples = states(robot)
    tau = joint_torques(robot, samples)
    W = DifferentialModel(robot, INERTIAL).instants(samples)
    np.testing.assert_allclose((W @ theta_of(robot)).reshape(tau.shape), tau, atol=1e-9 * np.abs(tau).max())


@given(TREES, SEED, st.sets(st.integers(0, 5), min_size=1))
@example(SHAPE, 3, {0, 3, 4})
@settings(max_examples=25, deadline=None)
def test_the_masses_behind_locked_joints_are_kept(shape: list[tuple[str, int]], seed: int, moving: set[int]) -> None:
    robot = tree(shape, seed)
    keep = sorted({k % robot.n for k in moving})
    q0 = np.random.default_rng(seed).uniform(-1, 1, robot.n)
    left = with_locked_joints(robot, keep, q0)
    samples = states(left)
    whole = [np.tile(value, (len(samples.q), 1)) for value in (q0, 0 * q0, 0 * q0, 0 * q0)]
    for all_joints, moving in zip(whole, (samples.q, samples.dq, samples.ddq, samples.dddq), strict=True):
        all_joints[:, keep] = moving
    expected = joint_torques(robot, Samples(samples.time, *whole))[:, keep]
    np.testing.assert_allclose(joint_torques(left, samples), expected, atol=1e-9 * np.abs(expected).max())


def test_a_joint_sees_only_the_bodies_that_it_carries() -> None:
    """The first arm is links 1 to 3, the second 4 and 5 on link 1, and link 6 stands on the base alone."""
    carried = {1: {1, 2, 3, 4, 5}, 2: {2, 3}, 3: {3}, 4: {4, 5}, 5: {5}, 6: {6}}
    model = DifferentialModel(TWO_ARMS, INERTIAL)
    rows = model.entries(states(TWO_ARMS), np.arange(len(model.columns)))
    owners = [{model.columns[k].owner for k in columns} for columns, _ in rows]
    assert dict(enumerate(owners, 1)) == carried


@pytest.mark.parametrize("model", [DifferentialModel(TWO_ARMS, INERTIAL), EnergyModel(TWO_ARMS, INERTIAL)])
def test_the_jax_form_is_the_same(model: RegressorModel) -> None:
    samples = states(TWO_ARMS)
    with jax.enable_x64(True):
        theirs = np.array(JaxModel(model).rows(samples.q, samples.dq, samples.ddq))
    ours = model.instants(samples).reshape(theirs.shape)
    np.testing.assert_allclose(theirs, ours, atol=1e-10 * np.abs(ours).max())


def test_bodies_of_given_parameters_weigh_as_their_regressor_says() -> None:
    model, samples = DifferentialModel(TWO_ARMS, INERTIAL), states(TWO_ARMS)
    function = model._compiled(lambda *motion: inertial_torque(TWO_ARMS, theta_of(TWO_ARMS).reshape(-1, 10), *motion))
    tau = np.zeros((TWO_ARMS.n, len(samples.q)))
    tau[function.row] = function(samples.q.T, samples.dq.T, samples.ddq.T)
    np.testing.assert_allclose(tau.T, joint_torques(TWO_ARMS, samples), atol=1e-9)


def test_branches_that_meet_at_the_base_identify_what_each_does_alone() -> None:
    robot = tree([("r", 0), ("r", 1), ("r", 0), ("r", 3)], 5)
    limbs = [with_locked_joints(robot, keep) for keep in ([0, 1], [2, 3])]
    ranks = [base_parameters(DifferentialModel(limb, INERTIAL)).rank for limb in limbs]
    base = base_parameters(DifferentialModel(robot, INERTIAL))
    W = DifferentialModel(robot, INERTIAL).instants(states(robot, 400, 7))
    assert base.rank == sum(ranks) == np.linalg.matrix_rank(W, rtol=1e-9)


def test_a_sensor_of_one_branch_feels_it_alone() -> None:
    robot = TWO_ARMS
    model = LoadModel(robot, Sensor(link="link3"))
    chain = with_locked_joints(robot, [0, 1, 2])
    samples = states(robot)
    part = Samples(samples.time, *(x[:, :3] for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))
    np.testing.assert_allclose(model.instants(samples), LoadModel(chain).instants(part), atol=1e-12)


# --- descriptions ----------------------------------------------------------------------------------------------------


def test_a_tree_with_one_branch_is_the_chain() -> None:
    chain = random_chain("rprr", np.random.default_rng(1))
    as_tree = chain.replace(parents=(0, 1, 2, 3))
    assert as_tree.is_chain
    assert as_tree.description() == chain.description()
    assert as_tree.sha256() == chain.sha256()
    assert "parents" not in chain.description()
    np.testing.assert_array_equal(*(DifferentialModel(r).instants(states(chain)) for r in (chain, as_tree)))
    assert TWO_ARMS.sha256() != TWO_ARMS.replace(parents=tuple(range(6))).sha256()


def test_a_tree_comes_back_from_its_description() -> None:
    for again in (robot_from_description(TWO_ARMS.description()), pickle.loads(pickle.dumps(TWO_ARMS))):
        assert again.sha256() == TWO_ARMS.sha256()
        assert again.parents == (0, 1, 2, 1, 4, 0)
    assert [link.name for link in TWO_ARMS.tips] == ["link3", "link5", "link6"]
    assert TWO_ARMS.limbs == ({"link1", "link2", "link3"}, {"link1", "link4", "link5"}, {"link6"})


@pytest.mark.parametrize("parents", [(1, 0), (0, -1), (0, 2), (0,)])
def test_parents_are_earlier_links(parents: tuple[int, ...]) -> None:
    robot = random_chain("rr", np.random.default_rng(0))
    assert "the number of an earlier link as its parent" in refusal(robot.replace, parents=parents)


def test_what_has_its_place_on_a_last_link_asks_for_one_branch() -> None:
    for make in (PayloadModel, LoadModel):
        message = refusal(make, TWO_ARMS)
        assert "ends in link3, link5, link6" in message
        assert message.endswith("read the part of its URDF or MJCF that ends there, with `tip`")


YAML = """
name: torso
joints:
  - {name: waist, mdh: {}}
  - {name: left, mdh: {a: 0.2}}
  - {name: right, mdh: {a: -0.2}, parent: link1}
  - {name: wheel, mdh: {}, parent: base}
"""


def test_a_robot_yaml_says_what_carries_each_joint() -> None:
    assert parse_description(YAML, "torso.yaml").parents == (0, 1, 1, 0)
    message = refusal(parse_description, YAML.replace("link1", "link4"), "torso.yaml")
    assert "no earlier link named 'link4'; did you mean 'link2' or 'link1'? available: base, link1, link2" in message
    assert "line 6" in message


def test_a_drive_may_be_locked_where_its_joint_carries_what_rests() -> None:
    """Joint 1 follows joint 3 of another branch; on its own branch nothing moves by itself."""
    robot = tree([("r", 0), ("r", 1), ("r", 0)], 2)
    coupling = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    robot = robot.replace(transmission=Transmission(coupling, tuple(map(Drive, "abc")), Limits.none(3)))
    left = with_locked_drives(robot, ["a", "b"])
    assert (left.joint_names, [branch.name for branch in left.branches]) == (("j3",), ["link1"])
    assert "joint j1 cannot follow the others and carry joint j2" in refusal(with_locked_drives, robot, ["a"])
