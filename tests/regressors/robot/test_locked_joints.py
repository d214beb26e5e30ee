"""The robot that is left when joints are held, against the whole robot and against Pinocchio's reduced models."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from public_arms import ARMS, THETA_FROM_PINOCCHIO, Arm, reference
from slow_dynamics import mass_matrix_of_body, poses, random_body, random_chain, thetas_of, torques

from constraints.linear import drive_limits
from regressors.errors import InputError
from regressors.models.base import random_states
from regressors.models.differential import DifferentialModel
from regressors.readers.library import built_in
from regressors.readers.urdf import read_urdf
from regressors.robot.columns import Terms
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.inertia import parameter_names
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Aggregates, Drive, Limits, Link, Robot, Structure, Transmission
from regressors.samples import Array, Samples

INERTIAL = Terms.inertial_only()
LONG_ARMS = [arm for arm in ARMS if arm.id in {
    "panda-hand", "ur5-gripper", "kinova", "xarm7", "z1", "tiago-torso-arm", "pr2-torso-right", "icub-left-arm",
    "talos-right-arm", "romeo-right-arm",
}]  # fmt: skip


def held_motion(robot: Robot, moving: list[int], rest: Array, rng: np.random.Generator, count: int = 5) -> Samples:
    """Random motion of the whole robot in which the other joints rest."""
    motion = rng.uniform(-1.5, 1.5, (3, count, robot.n))
    held = np.setdiff1d(range(robot.n), moving)
    motion[0][:, held], motion[1][:, held], motion[2][:, held] = rest[held], 0.0, 0.0
    return Samples(np.arange(float(count)), *motion, 0 * motion[0])


def moving_part(samples: Samples, moving: list[int]) -> Samples:
    return Samples(samples.time, *(x[:, moving] for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))


def subset(n: int, rng: np.random.Generator) -> list[int]:
    return sorted(rng.choice(n, rng.integers(1, n + 1), replace=False).tolist())


# --- bodies and torques ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arm", LONG_ARMS, ids=str)
def test_equals_pinocchios_reduced_model(arm: Arm) -> None:
    whole, robot = reference(arm), read_urdf(arm.path, base=arm.base, tip=arm.tip, snap_angles=False)
    rng = np.random.default_rng(41)
    for _ in range(3):
        moving, rest = subset(robot.n, rng), rng.uniform(-1.5, 1.5, robot.n)
        if len(moving) == robot.n:
            moving = moving[1:]
        reduced = with_locked_joints(robot, moving, rest)
        names = [robot.joint_names[k] for k in moving]
        assert reduced.joint_names == tuple(names)
        held = [whole.joint(name).id for name in robot.joint_names if name not in names]
        position = dict(zip(robot.joint_names, rest, strict=True))
        model = pin.buildReducedModel(whole.model, held, whole.configuration(position))
        data = model.createData()
        bodies = [model.inertias[k].toDynamicParameters() for k in range(1, model.njoints)]
        expected = np.array(bodies)[:, THETA_FROM_PINOCCHIO]
        np.testing.assert_allclose(thetas_of(reduced), expected, rtol=1e-9, atol=1e-10)
        regressor = DifferentialModel(reduced, INERTIAL)
        for _ in range(3):
            q, v, a = rng.uniform(-1.5, 1.5, (3, len(moving)))
            configuration = np.concatenate(
                [[x] if model.joints[k + 1].nq == 1 else [np.cos(x), np.sin(x)] for k, x in enumerate(q)]
            )
            tau = pin.rnea(model, data, configuration, v, a)
            W = regressor.assemble(Samples(np.zeros(1), q[None], v[None], a[None], 0 * q[None]))
            np.testing.assert_allclose(W @ expected.ravel(), tau, rtol=1e-9, atol=1e-9 * np.abs(tau).max())


@given(kinds=st.text(alphabet="rp", min_size=1, max_size=5), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=40)
def test_moving_joints_feel_what_they_felt_before(kinds: str, seed: int) -> None:
    """Torques by the merged parameters are the whole chain's, with the others held at a random pose."""
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng)
    moving, rest = subset(robot.n, rng), rng.uniform(-1.5, 1.5, robot.n)
    reduced = with_locked_joints(robot, moving, rest)
    samples = held_motion(robot, moving, rest, rng, count=2)
    expected = [
        torques(robot, thetas_of(robot), *state)[moving]
        for state in zip(samples.q, samples.dq, samples.ddq, strict=True)
    ]
    found = DifferentialModel(reduced, INERTIAL).assemble(moving_part(samples, moving)) @ thetas_of(reduced).ravel()
    np.testing.assert_allclose(found, np.ravel(expected), rtol=1e-9, atol=1e-9 * np.abs(expected).max())


@given(kinds=st.text(alphabet="rp", min_size=2, max_size=5), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_moving_links_stay_where_they_are_and_no_mass_is_lost(kinds: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_chain(kinds, rng)
    moving, rest = subset(robot.n, rng), rng.uniform(-1.5, 1.5, robot.n)
    reduced = with_locked_joints(robot, moving, rest)
    q = rest.copy()
    q[moving] = rng.uniform(-1.5, 1.5, len(moving))
    before, after = poses(robot, q), poses(reduced, q[moving])
    for k, T in zip(moving, after, strict=True):
        np.testing.assert_allclose(T, before[k], atol=1e-12)

    def distribution(robot: Robot, placed: list[Array], first: int) -> Array:
        """Second moment of the mass of all links from one on, about the base."""
        links = zip(placed[first:], thetas_of(robot)[first:], strict=True)
        return sum(T @ mass_matrix_of_body(theta) @ T.T for T, theta in links)

    np.testing.assert_allclose(distribution(reduced, after, 0), distribution(robot, before, moving[0]), atol=1e-10)


def test_all_joints_moving_is_the_robot_itself() -> None:
    robot = built_in("panda")
    assert with_locked_joints(robot, range(7)) is robot


def test_order_and_repetition_of_the_moving_joints_do_not_matter() -> None:
    robot = built_in("irp6")
    assert with_locked_joints(robot, [2, 0, 2]).sha256() == with_locked_joints(robot, [0, 2]).sha256()


def test_rests_at_zero_or_the_nearest_limit_if_not_told() -> None:
    """The Panda's fourth joint cannot stand at zero: its range ends at -0.0698."""
    robot = built_in("panda")
    told = with_locked_joints(robot, [0, 4], [0, 0, 0, -0.0698, 0, 0, 0])
    assert with_locked_joints(robot, [0, 4]).sha256() == told.sha256()
    other = with_locked_joints(robot, [0, 4], [0, 0, 0, -0.5, 0, 0, 0])
    assert other.sha256() != told.sha256()


def test_an_unknown_link_makes_its_composite_unknown() -> None:
    robot = built_in("panda")
    links = list(robot.links)
    links[4] = Link(links[4].name)
    reduced = with_locked_joints(robot.replace(links=tuple(links)), [1, 3, 5])
    assert [link.theta is None for link in reduced.links] == [False, True, False]


def test_links_keep_their_numbers_and_joints_their_limits() -> None:
    robot = built_in("panda")
    reduced = with_locked_joints(robot, [1, 4])
    assert reduced.link_numbers == (2, 5)
    assert DifferentialModel(reduced, INERTIAL).names == (*parameter_names(2), *parameter_names(5))
    assert [link.name for link in reduced.links] == ["panda_link2", "panda_link5"]
    np.testing.assert_array_equal(reduced.limits.upper, robot.limits.upper[[1, 4]])
    np.testing.assert_array_equal(reduced.limits.jerk, robot.limits.jerk[[1, 4]])


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_holding_joints_in_two_steps_is_holding_them_at_once(seed: int) -> None:
    """Drives and limits included: the IRp-6, whose drives move several joints."""
    rng = np.random.default_rng(seed)
    robot = built_in("irp6")
    first, rest = subset(5, rng), rng.uniform(-0.4, 0.4, 5)
    second = subset(len(first), rng)
    once = with_locked_joints(robot, [first[k] for k in second], rest)
    twice = with_locked_joints(with_locked_joints(robot, first, rest), second, rest[first])
    assert twice.joint_names == once.joint_names
    assert DifferentialModel(twice).names == DifferentialModel(once).names
    np.testing.assert_allclose(thetas_of(twice), thetas_of(once), atol=1e-12)
    transmissions = once.transmission, twice.transmission
    assert transmissions[0] is not None
    assert transmissions[1] is not None
    np.testing.assert_array_equal(transmissions[1].coupling, transmissions[0].coupling)
    np.testing.assert_allclose(transmissions[1].offset, transmissions[0].offset, atol=1e-15)


# --- drives ----------------------------------------------------------------------------------------------------------


def test_limits_of_drives_shift_by_the_resting_pose() -> None:
    """What the reduced robot's drive limits say of a motion is what the whole robot's say."""
    robot, rng = built_in("irp6"), np.random.default_rng(43)
    for moving in ([0, 1, 2], [1, 3], [2], [0, 3, 4]):
        rest = rng.uniform(-0.3, 0.3, 5)
        reduced = with_locked_joints(robot, moving, rest)
        samples = held_motion(robot, moving, rest, rng)
        whole = {
            label: (values, lower, upper, unit)
            for limit in drive_limits(robot)
            for label, values, lower, upper, unit in zip(
                limit.labels, limit.values(samples).T, limit.lower, limit.upper, limit.units, strict=True
            )
        }
        seen = set()
        for limit in drive_limits(reduced):
            found = limit.values(moving_part(samples, moving)).T
            for k, label in enumerate(limit.labels):
                values, lower, upper, unit = whole[label]
                np.testing.assert_allclose(found[k], values, atol=1e-14)
                assert (limit.lower[k], limit.upper[k], limit.units[k]) == (lower, upper, unit)
                seen.add(label)
        still = {label for label in whole if np.ptp(whole[label][0]) == 0.0}
        assert seen == set(whole) - still


def test_drives_of_resting_joints_have_no_parameters() -> None:
    reduced = with_locked_joints(built_in("irp6"), [0, 2])
    assert DifferentialModel(reduced, Terms(offset=True)).names[-8:] == (
        "Iar1", "Iar3", "F1c", "F3c", "F1v", "F3v", "F1o", "F3o"
    )  # fmt: skip


def assert_all_is_explained(whole: Robot, reduced: Robot, moving: list[int], samples: Samples) -> None:
    """Every column of the whole robot in the moving joints' rows is a combination of the reduced robot's columns."""
    W = DifferentialModel(whole).assemble(samples).reshape(samples.time.size, whole.n, -1)[:, moving]
    left = DifferentialModel(reduced).assemble(moving_part(samples, moving))
    W, left = (normalised(columns) for columns in (W.reshape(left.shape[0], -1), left))
    explained = left @ np.linalg.lstsq(left, W, rcond=1e-12)[0]
    np.testing.assert_allclose(explained, W, atol=1e-9)


def normalised(columns: Array) -> Array:
    sizes = np.linalg.norm(columns, axis=0)
    return columns / np.where(sizes > 1e-12 * sizes.max(), sizes, np.inf)


@pytest.mark.parametrize("moving", [[0, 1, 2], [0, 1], [1], [1, 3], [0, 2, 3, 4], [2, 3]], ids=str)
@pytest.mark.parametrize("geared", ["constant ratio", "ball screws"])
def test_columns_left_explain_all_that_the_moving_joints_feel(moving: list[int], geared: str) -> None:
    """No parameter of the whole robot, of a drive that still turns neither, moves the joints in a way not modelled."""
    robot = built_in("irp6").replace(structure=Structure())
    assert robot.transmission is not None
    if geared == "ball screws":
        gears = {1: BallScrew(0.005, 0.0779, -0.0293, -0.0609), 2: BallScrew(0.005, 0.0779, -0.0441, -0.0512)}
        old = robot.transmission.drives
        drives = tuple(dataclasses.replace(drive, ratio=gears.get(k, drive.ratio)) for k, drive in enumerate(old))
        robot = robot.replace(transmission=dataclasses.replace(robot.transmission, drives=drives))
    rest = np.array([0.1, -0.2, 0.15, 0.1, 0.3])
    reduced = with_locked_joints(robot, moving, rest)
    samples = held_motion(robot, moving, rest, np.random.default_rng(44), count=60)
    samples = dataclasses.replace(samples, q=np.where(samples.dq != 0, 0.4 * samples.q, samples.q))
    assert_all_is_explained(robot, reduced, moving, samples)


@given(kinds=st.text(alphabet="rp", min_size=2, max_size=4), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_columns_left_explain_all_whatever_the_chain_and_its_coupling(kinds: str, seed: int) -> None:
    """Axes in all directions, drives that move several joints, constant ratios."""
    rng = np.random.default_rng(seed)
    n = len(kinds)
    drives = tuple(Drive(f"d{k}", ConstantRatio(rng.uniform(1.0, 3.0)), rotor_inertia=1e-4) for k in range(n))
    coupling = np.tril(rng.integers(0, 2, (n, n)), -1) + np.eye(n)
    robot = random_chain(kinds, rng).replace(transmission=Transmission(coupling, drives, Limits.none(n)))
    moving, rest = subset(n, rng), rng.uniform(-1.0, 1.0, n)
    samples = held_motion(robot, moving, rest, rng, count=60)
    assert_all_is_explained(robot, with_locked_joints(robot, moving, rest), moving, samples)


def test_a_rotor_that_turns_along_with_a_slider_has_no_weight() -> None:
    """A mass on a slider takes m (ddq + g), a rotor on a held joint behind it n^2 Ia ddq: not the same column."""
    rng = np.random.default_rng(48)
    drives = (Drive("slide"), Drive("turn", ConstantRatio(2.0), rotor_inertia=1e-4))
    transmission = Transmission(np.array([[1.0, 0.0], [1.0, 1.0]]), drives, Limits.none(2))
    robot = random_chain("pr", rng).replace(transmission=transmission)
    samples = held_motion(robot, [0], np.zeros(2), rng, count=30)
    assert_all_is_explained(robot, with_locked_joints(robot, [0]), [0], samples)


# --- structure -------------------------------------------------------------------------------------------------------


def vanishing(robot: Robot, moving: list[int], rest: Array) -> frozenset[str]:
    """Composite parameters that are zero for every choice of the links' own nonzero ones: by trying some."""
    rng, sizes = np.random.default_rng(45), {}
    for _ in range(5):
        links = []
        for number, link in zip(robot.link_numbers, robot.links, strict=True):
            theta = [0.0 if name in robot.structure.zero else rng.normal() for name in parameter_names(number)]
            links.append(Link(link.name, np.array(theta), link.number))
        loaded = robot.replace(links=tuple(links))
        q = np.array(rest, dtype=float)
        placed = poses(loaded, q)
        for place, k in enumerate(moving):
            last = moving[place + 1] if place + 1 < len(moving) else robot.n
            J = sum(
                (T := np.linalg.solve(placed[k], placed[i])) @ mass_matrix_of_body(links[i].theta) @ T.T
                for i in range(k, last)
            )
            S = J[:3, :3]
            I = np.trace(S) * np.eye(3) - S
            theta = [J[3, 3], *J[:3, 3], I[0, 0], I[0, 1], I[0, 2], I[1, 1], I[1, 2], I[2, 2]]
            for name, value in zip(parameter_names(robot.link_numbers[k]), np.real(theta), strict=True):
                sizes[name] = max(sizes.get(name, 0.0), abs(value))
    return frozenset(name for name, size in sizes.items() if size < 1e-10)


@pytest.mark.parametrize("moving", [[0, 1, 2], [0, 1], [0, 2], [1, 4], [0], [3]], ids=str)
@pytest.mark.parametrize("rest", [[0.0] * 5, [0.1, 0.2, -0.3, 0.4, 0.5]], ids=["zero", "bent"])
def test_zeros_that_are_left_are_those_of_the_composites(moving: list[int], rest: list[float]) -> None:
    robot = built_in("irp6")
    reduced = with_locked_joints(robot, moving, rest)
    assert reduced.structure.zero == vanishing(robot, moving, np.array(rest))


def test_the_irp6s_forearm_with_a_straight_wrist_is_symmetric_and_with_a_bent_one_it_is_not() -> None:
    straight = with_locked_joints(built_in("irp6"), [0, 1, 2])
    assert {"m3c3y", "m3c3z", "I3xy", "I3xz", "I3yz"} < straight.structure.zero
    bent = with_locked_joints(built_in("irp6"), [0, 1, 2], [0, 0, 0, 0.5, 0])
    assert not {"m3c3y", "I3xy"} & bent.structure.zero
    assert {"m3c3z", "I3xz", "I3yz"} < bent.structure.zero


def test_equal_parameters_stay_equal_only_in_links_that_stay_alone() -> None:
    groups = (("I1xx", "I1yy"), ("I2xx", "I2yy"), ("m1", "m2"), ("I4xx", "I4yy"))
    robot = random_chain("rrrr", np.random.default_rng(1)).replace(structure=Structure(equal=groups))
    assert with_locked_joints(robot, [0, 1, 3]).structure.equal == (("I1xx", "I1yy"), ("I4xx", "I4yy"))
    assert with_locked_joints(robot, [0, 1, 2]).structure.equal == (("I1xx", "I1yy"), ("I2xx", "I2yy"), ("m1", "m2"))
    assert with_locked_joints(robot, [2]).structure.equal == ()


@pytest.mark.parametrize("rest", [[0.0] * 5, [0, 0, 0, 0, 1.2], [0, 0, 0, 0.5, 0]], ids=["straight", "turned", "bent"])
def test_parameters_in_use_explain_the_torques_of_the_default_axes(rest: list[float]) -> None:
    """Also where the wrist rests bent, so that forearm and hand together are not symmetric."""
    robot = built_in("irp6").replace(transmission=None)
    moving, position = [0, 1, 2], np.array(rest)
    reduced = with_locked_joints(robot, moving, position)
    model = DifferentialModel(reduced, INERTIAL)
    samples = held_motion(robot, moving, position, np.random.default_rng(46))
    whole = DifferentialModel(robot.replace(structure=Structure()), INERTIAL).assemble(samples)
    expected = (whole @ thetas_of(robot).ravel()).reshape(5, 5)[:, moving]
    definition, _ = model.definition()
    found = model.assemble(moving_part(samples, moving)) @ (definition @ thetas_of(reduced).ravel())
    np.testing.assert_allclose(found, expected.ravel(), atol=1e-9 * np.abs(expected).max())


def test_aggregates_stay_only_for_their_own_joints() -> None:
    robot = built_in("irp6")
    assert [a.joints for a in with_locked_joints(robot, [0, 1, 2]).structure.aggregates] == [("q1", "q2", "q3")]
    assert with_locked_joints(robot, [0, 1]).structure.aggregates == ()
    one = random_chain("rr", np.random.default_rng(2))
    one = one.replace(structure=Structure(aggregates=(Aggregates(("j2",), {"X": {"m2": 1.0}}),)))
    assert DifferentialModel(with_locked_joints(one, [1]), INERTIAL).names == ("X",)


# --- what cannot be --------------------------------------------------------------------------------------------------


def test_no_joint_moves() -> None:
    message = "robot 'irp6': no joint moves; choose from q1, q2, q3, q4, q5"
    with pytest.raises(InputError, match=re.escape(message)):
        with_locked_joints(built_in("irp6"), [])


def test_nothing_of_the_whole_robot_is_changed() -> None:
    robot = random_chain("rrr", np.random.default_rng(3))
    drives = tuple(Drive(f"d{k}", ConstantRatio(10.0)) for k in range(3))
    limits = dataclasses.replace(Limits.none(3), lower=np.full(3, -1.0), upper=np.full(3, 1.0))
    robot = robot.replace(transmission=Transmission(np.tril(np.ones((3, 3))), drives, limits))
    before = robot.sha256()
    with_locked_joints(robot, [1], [0.3, 0.0, 0.2])
    random_states(robot, 3)
    assert robot.sha256() == before


def test_merging_bodies_is_adding_their_masses_in_one_frame() -> None:
    """Two links on one prismatic axis, the second pulled out by 0.4 m: first moments add, inertias by Steiner."""
    rng = np.random.default_rng(6)
    robot = random_chain("pp", rng)
    straight = tuple(
        dataclasses.replace(j, rotation=np.eye(3), translation=np.zeros(3), axis=np.array([1.0, 0.0, 0.0]))
        for j in robot.joints
    )
    a, b = random_body(rng), random_body(rng)
    robot = robot.replace(joints=straight, links=(Link("a", a), Link("b", b)))
    theta = with_locked_joints(robot, [0], [0.0, 0.4]).links[0].theta
    assert theta is not None
    m, x, y, z = b[:4]
    shift = [0, 0.4 * m, 0, 0, 0, -0.4 * y, -0.4 * z, 0.8 * x + 0.16 * m, 0, 0.8 * x + 0.16 * m]
    np.testing.assert_allclose(theta, a + b + shift, rtol=1e-12)
