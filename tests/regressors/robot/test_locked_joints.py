"""The robot that is left when joints are held, against the whole robot and against Pinocchio's reduced models."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from held_motions import assert_explained, held_motion, moving_part, subset
from hypothesis import given, settings, strategies as st
from public_arms import ARMS, THETA_FROM_PINOCCHIO, Arm, reference
from slow_dynamics import mass_matrix_of_body, poses, random_chain, thetas_of

from constraints.linear import drive_limits
from regressors.errors import InputError
from regressors.models.differential import DifferentialModel
from regressors.models.nominal import standard_values
from regressors.readers.library import built_in
from regressors.readers.urdf import read_urdf
from regressors.robot.columns import Terms
from regressors.robot.friction.curve import CoulombViscous, TableFriction
from regressors.robot.friction.curves import CurveUncertainty, FrictionCurves
from regressors.robot.gears import ConstantRatio
from regressors.robot.inertia import parameter_names
from regressors.robot.locked_joints import with_locked_drives, with_locked_joints
from regressors.robot.robot import Aggregates, Drive, Joint, Limits, Link, Robot, Structure, Transmission
from regressors.samples import Array, Samples

INERTIAL = Terms.inertial_only()
LONG_ARMS = [arm for arm in ARMS if arm.id in {
    "panda-hand", "ur5-gripper", "z1", "tiago-torso-arm", "pr2-torso-right", "icub-left-arm",
}]  # fmt: skip


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
            one = [model.joints[k].nq == 1 for k in range(1, model.njoints)]
            configuration = np.concatenate(
                [[x] if own else [np.cos(x), np.sin(x)] for own, x in zip(one, q, strict=True)]
            )
            tau = pin.rnea(model, data, configuration, v, a)
            W = regressor.assemble(Samples(np.zeros(1), q[None], v[None], a[None], 0 * q[None]))
            np.testing.assert_allclose(W @ expected.ravel(), tau, rtol=1e-9, atol=1e-9 * np.abs(tau).max())


def test_all_joints_moving_is_the_robot_itself_in_whatever_order_they_are_named() -> None:
    robot = built_in("panda")
    assert with_locked_joints(robot, range(7)) is robot
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
    np.testing.assert_array_equal(transmissions[1].coupling, transmissions[0].coupling)
    np.testing.assert_allclose(transmissions[1].offset, transmissions[0].offset, atol=1e-15)


# --- drives ----------------------------------------------------------------------------------------------------------


def test_limits_of_drives_shift_by_the_resting_pose() -> None:
    """What the reduced robot's drive limits say of a motion is what the whole robot's say."""
    robot, rng = built_in("irp6"), np.random.default_rng(43)
    for moving in ([0, 1, 2], [1, 3], [2], [0, 3, 4]):
        rest = rng.uniform(-0.3, 0.3, 5)
        reduced = with_locked_joints(robot, moving, rest)
        samples = held_motion(robot, moving, rest, rng, count=5)
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


def assert_all_is_explained(whole: Robot, reduced: Robot, moving: list[int], samples: Samples) -> None:
    """Every column of the whole robot in the moving joints' rows is a combination of the reduced robot's columns."""
    W = DifferentialModel(whole).assemble(samples).reshape(samples.time.size, whole.n, -1)[:, moving]
    left = DifferentialModel(reduced).assemble(moving_part(samples, moving))
    assert_explained(W.reshape(left.shape[0], -1), left)


@given(kinds=st.text(alphabet="rp", min_size=2, max_size=4), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=8)
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


def fully_described(name: str) -> Robot:
    """A built-in robot with some inertia where the description states none."""
    robot, theta = built_in(name), np.array([1.0, 0.1, 0.2, 0.0, 0.3, 0.0, 0.1, 0.4, 0.0, 0.5])
    branches = tuple(
        replace(b, link=replace(b.link, theta=theta)) if b.link.theta is None else b for b in robot.branches
    )
    return robot.replace(branches=branches)


def described_torque(robot: Robot, samples: Samples) -> Array:
    """Joint torques of the description, shape (N, n)."""
    model = DifferentialModel(robot)
    definition, names = model.definition()
    known = standard_values(robot)
    return np.reshape(model.assemble(samples) @ definition @ [known[name] for name in names], (-1, robot.n))


@pytest.mark.parametrize("name", ["irp6", "irp6-full"])
@pytest.mark.parametrize("moving", [[0, 1, 2], [1, 3], [0, 2], [1], [0, 3, 4]], ids=str)
def test_described_torques_are_those_of_the_whole_robot(name: str, moving: list[int]) -> None:
    """Friction and rotors of the drives that turn along included."""
    robot, rng = fully_described(name), np.random.default_rng(49)
    rest = rng.uniform(-0.3, 0.3, 5)
    samples = held_motion(robot, moving, rest, rng, count=20)
    reduced = described_torque(with_locked_joints(robot, moving, rest), moving_part(samples, moving))
    np.testing.assert_allclose(reduced, described_torque(robot, samples)[:, moving], atol=1e-11)


def two_links(coupling: Array) -> Robot:
    """Planar arm of links of 1 m, each a point mass at its end, under gravity along -y."""
    joints = tuple(Joint(f"q{k}", "revolute", np.eye(3), np.array([k - 1.0, 0.0, 0.0])) for k in (1, 2))
    theta = [np.array([m, m, 0, 0, 0, 0, 0, m, 0, m]) for m in (3.0, 2.0)]
    links = tuple(Link(f"link{k}", theta[k - 1]) for k in (1, 2))
    drives = tuple(
        Drive(f"z{k}", ConstantRatio(n), r, c, v) for k, n, r, c, v in ((1, 50, 2e-4, 7, 3), (2, 80, 1e-4, 4, 2))
    )
    limits = Limits(*(np.array([x, x]) for x in (-2.0, 2.0, 3.0, 9.0, 50.0, 90.0)))
    gravity = np.array([0.0, -9.81, 0.0])
    return Robot("arm", joints, links, limits, Transmission(coupling, drives, Limits.none(2)), gravity)


def test_a_planar_arm_of_two_links_with_a_coupling_by_hand() -> None:
    """``z2 = 2 q1 + q2``: with q2 = 0.5 held drive 2 turns twice as fast; with drive 2 held, link 2 turns by -2 q1."""
    arm = two_links(np.array([[1.0, 0.0], [2.0, 1.0]]))
    q, v, a = np.random.default_rng(50).normal(size=(3, 9, 1))
    samples = Samples(np.zeros(9), q, v, a, 0 * q)
    rotor, friction = 50**2 * 2e-4 * a, 7 * np.sign(v) + 3 * v

    square = 2 + 2 * np.cos(0.5)  # distance of the second mass from the base, squared
    bodies = (3 + 2 * square) * a + 9.81 * ((3 + 2) * np.cos(q) + 2 * np.cos(q + 0.5))
    along = 4 * 80**2 * 1e-4 * a + 2 * 4 * np.sign(v) + 4 * 2 * v
    joint = with_locked_joints(arm, [0], np.array([0.0, 0.5]))
    np.testing.assert_allclose(described_torque(joint, samples), bodies + rotor + friction + along, rtol=1e-12)

    def energy(x: Array, dx: Array) -> tuple[Array, Array]:  # link 2 points along x - 2 x = -x
        return 1.5 * dx**2 + 2 * (1 - np.cos(2 * x)) * dx**2, 9.81 * (5 * np.sin(x) - 2 * np.sin(x))

    h, inertia = 1e-5, 2 * energy(q, 1.0)[0]
    slope = (energy(q + h, v)[0] - energy(q - h, v)[0]) / (2 * h)
    weight = (energy(q + h, v)[1] - energy(q - h, v)[1]) / (2 * h)
    drive = with_locked_drives(arm, ["z2"])
    assert (drive.joint_names, drive.branches[0].coupling.tolist()) == (("q1",), [-2.0])
    expected = inertia * a + slope + weight + rotor + friction
    np.testing.assert_allclose(described_torque(drive, samples), expected, rtol=1e-7, atol=1e-7)
    bounds = [limit for limit in drive_limits(drive) if limit.labels == ("drive q2 position",)]
    assert (bounds[0].matrix.item(), bounds[0].upper.item()) == (-2.0, 2.0)


@pytest.mark.parametrize(
    ("locked", "moved"), [(["z4", "z5"], [0, 1, 2]), (["5"], [0, 1, 2, 3]), (["2", "3", "z4", "5"], [0])]
)
def test_locked_drives_do_no_work(locked: list[str], moved: list[int]) -> None:
    """Torques along the motion ``q = N s`` are ``N' tau`` of the whole robot."""
    robot, rng = fully_described("irp6-full"), np.random.default_rng(51)
    z = np.zeros((5, len(moved)))
    z[moved] = robot.transmission.coupling[np.ix_(moved, moved)]
    N = np.linalg.solve(robot.transmission.coupling, z)
    part = Samples(np.zeros(20), *rng.uniform(-0.3, 0.3, (3, 20, len(moved))), np.zeros((20, len(moved))))
    whole = Samples(part.time, *(getattr(part, name) @ N.T for name in ("q", "dq", "ddq", "dddq")))
    reduced = with_locked_drives(robot, locked)
    np.testing.assert_allclose(described_torque(reduced, part), described_torque(robot, whole) @ N, atol=1e-10)


def test_curves_of_drives_that_turn_along_add_up() -> None:
    arm = two_links(np.array([[1.0, 0.0], [-2.0, 1.0]]))
    curves = FrictionCurves(
        {"z1": CoulombViscous(7.0, 3.0, 0.5), "z2": CoulombViscous(4.0, 2.0, 0.1)},
        {"z2": CurveUncertainty(("coulomb", "offset"), np.diag([0.01, 0.04]))},
    )
    v = np.array([[-0.7], [0.3]])
    part = with_locked_joints(arm, [0])
    together = curves.along(part)
    expected = curves.joint_torque(arm, np.zeros((2, 2)), np.hstack([v, 0 * v]), np.sign(np.hstack([v, -2 * v])))[:, :1]
    np.testing.assert_allclose(together.joint_torque(part, 0 * v, v, np.sign(v)), expected, rtol=1e-12)
    np.testing.assert_allclose(together.uncertainty["z1"].covariance, np.diag([0.04, 0.16]))
    assert together.along(part) == together
    table = FrictionCurves({**curves.curves, "z2": TableFriction([0.1, 1.0], [3.0, 4.0])})
    assert table.along(part) == table


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
            relative = [(np.linalg.solve(placed[k], placed[i]), links[i].theta) for i in range(k, last)]
            J = sum(T @ mass_matrix_of_body(theta) @ T.T for T, theta in relative)
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


def test_equal_parameters_stay_equal_only_in_links_that_stay_alone() -> None:
    groups = (("I1xx", "I1yy"), ("I2xx", "I2yy"), ("m1", "m2"), ("I4xx", "I4yy"))
    robot = random_chain("rrrr", np.random.default_rng(1)).replace(structure=Structure(equal=groups))
    assert with_locked_joints(robot, [0, 1, 3]).structure.equal == (("I1xx", "I1yy"), ("I4xx", "I4yy"))
    assert with_locked_joints(robot, [0, 1, 2]).structure.equal == (("I1xx", "I1yy"), ("I2xx", "I2yy"), ("m1", "m2"))
    assert with_locked_joints(robot, [2]).structure.equal == ()


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


@pytest.mark.parametrize(
    ("drives", "message"),
    [
        (["z9"], "no drive named 'z9'"),
        (["1", "2", "3", "4", "5"], "every drive is locked, so no joint moves"),
        (["z3"], "joint q3 cannot follow the others and carry joint q5, which moves: lock the drive of q5 too"),
    ],
)
def test_drives_that_cannot_be_locked(drives: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        with_locked_drives(built_in("irp6"), drives)
