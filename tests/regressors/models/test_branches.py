"""Bodies beside the chain, such as a parallelogram's bars: against Pinocchio's trees and the laws of mechanics."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from held_motions import assert_explained, held_motion, moving_part, subset
from hypothesis import given, settings, strategies as st
from motions import random_samples
from pinocchio_chains import chain_model
from public_arms import THETA_FROM_PINOCCHIO
from refused import refusal
from slow_dynamics import random_body, random_chain

from regressors.models.differential import DifferentialModel, inertial_regressor
from regressors.readers.description import parse_description
from regressors.readers.library import built_in
from regressors.robot.archive import robot_from_description
from regressors.robot.columns import Terms
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.inertia import from_centre_of_mass, parameter_names
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import BASE, Branch, Drive, Joint, Limits, Link, Robot, Structure, Transmission
from regressors.robot.symbolic.kinematics import bodies, link_motions
from regressors.samples import Array, Samples

INERTIAL = Terms.inertial_only()
CHAINS, SEED = st.text(alphabet="rp", min_size=1, max_size=4), st.integers(0, 2**32 - 1)
BESIDE = st.text(alphabet="rp", max_size=4)


def branched(kinds: str, beside: str, rng: np.random.Generator) -> Robot:
    """A random chain with random bodies beside it, on links, on the base and on each other, coupled to any joints."""
    robot = random_chain(kinds, rng)
    parents, branches = [BASE, *(link.name for link in robot.links)], []
    for k, joint in enumerate(random_chain(beside, rng).joints if beside else ()):
        name = f"bar{k + 1}"
        row = rng.choice([-1.0, 0.0, 0.0, 1.0, 0.7], robot.n)
        row[rng.integers(robot.n)] = rng.choice([-1.0, 1.0, 1.7])
        placed = dataclasses.replace(joint, name=name)
        branches.append(Branch(str(rng.choice(parents)), placed, Link(name, random_body(rng)), row, rng.normal()))
        parents.append(name)
    return robot.replace(branches=tuple(branches))


def thetas_of(robot: Robot) -> Array:
    return np.array([body.theta for body in robot.bodies])


def each(samples: Samples) -> Any:
    return zip(samples.q, samples.dq, samples.ddq, strict=True)


def instants(model: DifferentialModel, samples: Samples) -> Array:
    """Y of each instant, shape (N, n, p)."""
    return model.assemble(samples).reshape(len(samples.time), model.robot.n, -1)


# --- the oracles -----------------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Tree:
    """The same bodies as a tree of independent joints, ``s = G q + s0``: every branch's joint is one more joint."""

    model: Any
    G: Array
    s0: Array

    @classmethod
    def of(cls, robot: Robot) -> Tree:
        names = [BASE, *(body.name for body in robot.bodies)]
        joints = (*robot.joints, *(branch.joint for branch in robot.branches))
        parents = (*range(robot.n), *(names.index(branch.parent) for branch in robot.branches))
        whole = Robot("tree", joints, robot.bodies, Limits.none(len(joints)), gravity=robot.gravity, parents=parents)
        rows = np.array([branch.coupling for branch in robot.branches]).reshape(-1, robot.n)
        offsets = [branch.offset for branch in robot.branches]
        G, s0 = np.vstack([np.eye(robot.n), rows]), np.concatenate([np.zeros(robot.n), offsets])
        return cls(chain_model(whole), G, s0)

    def regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """``G' Y_tree``: what the independent joints feel of the tree's torques."""
        s, ds, dds = self.G @ q + self.s0, self.G @ dq, self.G @ ddq
        Y = pin.computeJointTorqueRegressor(self.model, self.model.createData(), s, ds, dds)
        order = [10 * body + k for body in range(self.model.nv) for k in THETA_FROM_PINOCCHIO]
        return self.G.T @ Y.reshape(self.model.nv, -1)[:, order]

    def torques(self, q: Array, dq: Array, ddq: Array) -> Array:
        """``G' tau_tree``, without a regressor."""
        s, ds, dds = self.G @ q + self.s0, self.G @ dq, self.G @ ddq
        return self.G.T @ pin.rnea(self.model, self.model.createData(), s, ds, dds)

    def poses(self, q: Array) -> list[Array]:
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, self.G @ q + self.s0)
        return [data.oMi[k].homogeneous for k in range(1, self.model.njoints)]


# --- regressor and laws ----------------------------------------------------------------------------------------------


@given(kinds=CHAINS, beside=BESIDE, seed=SEED)
@settings(max_examples=40)
def test_regressor_is_that_of_a_tree_seen_through_the_coupling(kinds: str, beside: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = branched(kinds, beside, rng)
    tree, samples = Tree.of(robot), random_samples(robot.n, rng, 3)
    found = instants(DifferentialModel(robot, INERTIAL), samples)
    assert found.shape[2] == 10 * len(kinds + beside)
    for Y, state in zip(found, each(samples), strict=True):
        expected = tree.regressor(*state)
        assert np.abs(Y - expected).max() <= 1e-11 * np.abs(expected).max()
        tau = tree.torques(*state)
        np.testing.assert_allclose(Y @ thetas_of(robot).ravel(), tau, rtol=1e-9, atol=1e-9 * np.abs(tau).max())


def test_a_joint_that_does_not_move_a_body_has_no_entry() -> None:
    """The IRp-6's coupler keeps the arm's direction: joint 3 shifts it and does not turn it; joints 4, 5 do nothing."""
    robot = built_in("irp6-full")
    symbols = [ca.SX.sym(name, 5) for name in ("q", "dq", "ddq")]
    *links, crank, coupler = bodies(robot, *symbols)
    for each in (links, link_motions(robot, *symbols)):
        assert [len(link.axes) for link in each] == [1, 2, 3, 4, 5]
    assert (len(crank.axes), len(coupler.axes)) == (3, 3)
    turned, shifted = ([part.nnz() > 0 for part in parts] for parts in zip(*coupler.axes, strict=True))
    assert (turned, shifted) == ([True, True, False], [True, True, True])
    Y = inertial_regressor(robot, *symbols)
    assert Y.shape == (5, 70)
    assert Y[3:, 50:].nnz() == 0


# --- names and numbers -----------------------------------------------------------------------------------------------


def test_branches_are_numbered_after_the_links_or_as_told() -> None:
    robot = branched("rr", "rr", np.random.default_rng(0))
    assert (robot.link_numbers, robot.body_numbers) == ((1, 2), (1, 2, 3, 4))
    assert [body.name for body in robot.bodies] == ["link1", "link2", "bar1", "bar2"]
    first, second = robot.branches
    told = dataclasses.replace(first, link=dataclasses.replace(first.link, number=9))
    robot = robot.replace(branches=(told, second))
    assert robot.body_numbers == (1, 2, 9, 4)
    names = DifferentialModel(robot, INERTIAL).names
    assert names == tuple(name for number in (1, 2, 9, 4) for name in parameter_names(number))
    assert DifferentialModel(robot).names[-4:] == ("F1c", "F2c", "F1v", "F2v")


# --- what cannot be --------------------------------------------------------------------------------------------------

HINGE = Joint("bar", "revolute", np.eye(3), np.zeros(3))
BAR = Branch("link1", HINGE, Link("bar"), np.array([1.0, 1.0]))


def other(name: str, parent: str = "bar", number: int = 0) -> Branch:
    return Branch(parent, HINGE, Link(name, None, number), np.array([0.0, 1.0]))


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "zero coupling": (lambda: dataclasses.replace(BAR, coupling=np.zeros(2)), "branch 'bar': its coupling is zero, so"),
    "NaN coupling": (lambda: dataclasses.replace(BAR, coupling=np.array([np.nan, 1.0])), "branch 'bar': coupling and"),
    "unknown parent": (lambda: two_links(dataclasses.replace(BAR, parent="tower")), "no link or earlier branch, as pa"),
    "a later branch": (lambda: two_links(other("rod"), BAR), "'rod', named 'bar'; available: base, link1, link2"),
    "row too short": (lambda: two_links(dataclasses.replace(BAR, coupling=np.ones(1))), "robot 'chain', branch 'bar':"),
    "name of a link": (lambda: two_links(other("link2", "link1")), "share a name: base, link1, link2, link2"),
    "number of a link": (lambda: two_links(other("rod", "link1", 1)), "share a number: 1, 2, 1"),
}


def two_links(*branches: Branch) -> Robot:
    return random_chain("rr", np.random.default_rng(0)).replace(branches=branches)


@pytest.mark.parametrize("case", REFUSED.values(), ids=REFUSED.keys())
def test_refuses_and_says_why(case: tuple[Callable[[], object], str]) -> None:
    make, message = case
    assert message in refusal(make)


# --- files -----------------------------------------------------------------------------------------------------------

YAML = """\
name: bars
joints:
  - name: a
    mdh: {d: 1.0}
  - name: b
    kind: prismatic
    mdh: {a: 0.5}
links:
  - name: one
  - name: two
branches:
  - name: crank
    parent: one
    joint: {mdh: {alpha: 90 deg, a: 0.1, d: 0.2, offset: 30 deg}}
    coupling: [1, 0.5]
    mass: 2.0
    com: [0.1, 0.0, 0.0]
    inertia: {about: centre-of-mass, xx: 0.1, yy: 0.2, zz: 0.2}
  - name: bar
    parent: crank
    joint: {kind: prismatic, pose: {xyz: [0.0, 0.0, 0.5], axis: [0.0, 2.0, 0.0]}}
    coupling: [0, -1]
    offset: 0.25
    number: 7
structure:
  zero: [m3c3y, m7c7x]
"""


def test_reads_branches() -> None:
    robot = parse_description(YAML, "bars.yaml")
    crank, bar = robot.branches
    assert (crank.name, crank.parent, crank.joint.name, crank.joint.kind) == ("crank", "one", "crank", "revolute")
    assert (bar.name, bar.parent, bar.joint.name, bar.joint.kind) == ("bar", "crank", "bar", "prismatic")
    expected = Joint.from_mdh("crank", "revolute", alpha=np.pi / 2, a=0.1, d=0.2, offset=np.pi / 6)
    np.testing.assert_array_equal(crank.joint.rotation, expected.rotation)
    np.testing.assert_array_equal(crank.joint.translation, expected.translation)
    np.testing.assert_array_equal([bar.joint.translation, bar.joint.axis], [[0, 0, 0.5], [0, 1, 0]])
    np.testing.assert_array_equal(crank.coupling, [1, 0.5])
    assert (crank.offset, bar.offset) == (0.0, 0.25)
    np.testing.assert_allclose(crank.link.theta, from_centre_of_mass(2.0, [0.1, 0, 0], np.diag([0.1, 0.2, 0.2])))
    assert bar.link.theta is None
    assert robot.body_numbers == (1, 2, 3, 7)
    assert robot.structure.zero == {"m3c3y", "m7c7x"}


HINGED = "    joint: {mdh: {alpha: 90 deg, a: 0.1, d: 0.2, offset: 30 deg}}\n"
COMPLAINTS = [
    ("parent: one", "parent: three", "branches[1].parent (line 13): no link or earlier branch named 'three'; availabl"),
    ("name: bar\n", "name: crank\n", "branches[2].name (line 19): the name 'crank' is that of the base, a link or ano"),
    ("name: two\n", "name: base\n", "links[2].name (line 10): the name 'base' is that of the base frame"),
    ("[1, 0.5]", "[1]", "branches[1].coupling (line 15): expected one number per joint, 2, given 1"),
    ("[1, 0.5]", "[0, 0]", "branches[1].coupling (line 15): no joint moves this branch; describe it as a part of its"),
    (HINGED, "    joint: {}\n", "branches[1].joint (line 14): the joint of a branch needs mdh or pose, and not both"),
    ("pose: {xyz", "mdh: {}, pose: {xyz", "branches[2].joint (line 21): the joint of a branch needs mdh or pose, and"),
    ("number: 7", "number: 2", "branches[2].number (line 24): the number 2 is already that of a link or branch"),
    ("[m3c3y, m7c7x]", "[m4c4y]", "structure.zero[1] (line 26): no parameter named 'm4c4y'; available: m1, m1c1x"),
]


@pytest.mark.parametrize(("old", "new", "message"), COMPLAINTS)
def test_reader_refuses_and_says_why(old: str, new: str, message: str) -> None:
    assert YAML.count(old) >= 1
    assert message in refusal(parse_description, YAML.replace(old, new, 1), "bars.yaml", begins="bars.yaml: ")


@given(kinds=CHAINS, beside=BESIDE, seed=SEED)
@settings(max_examples=15)
def test_archive_brings_branches_back(kinds: str, beside: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = branched(kinds, beside, rng)
    robot = with_locked_joints(robot, sorted(rng.choice(robot.n, rng.integers(1, robot.n + 1), replace=False)))
    again = robot_from_description(json.loads(json.dumps(robot.description())))
    assert again.sha256() == robot.sha256()
    samples = random_samples(robot.n, rng, 3)
    there, back = (instants(DifferentialModel(r, INERTIAL), samples) for r in (robot, again))
    np.testing.assert_array_equal(back, there)


def test_every_part_of_a_branch_is_in_the_hash() -> None:
    robot = two_links(BAR)
    changes = {"parent": "link2", "joint": dataclasses.replace(HINGE, kind="prismatic"), "offset": 0.1}
    changes |= {"link": Link("bar", np.ones(10)), "coupling": np.array([1.0, 0.0])}
    assert set(changes) == {field.name for field in dataclasses.fields(Branch)}
    hashes = {two_links(dataclasses.replace(BAR, **{name: value})).sha256() for name, value in changes.items()}
    assert len(hashes | {robot.sha256(), two_links().sha256()}) == len(changes) + 2


# --- joints that rest ------------------------------------------------------------------------------------------------


@given(kinds=st.text(alphabet="rp", min_size=2, max_size=5), beside=BESIDE, seed=SEED)
@settings(max_examples=50)
def test_moving_joints_feel_what_they_felt_before(kinds: str, beside: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = branched(kinds, beside, rng)
    moving, rest = subset(robot.n, rng), rng.uniform(-1.5, 1.5, robot.n)
    first = sorted({*moving, *subset(robot.n, rng)})  # in two steps or in one
    reduced = with_locked_joints(robot, first, rest)
    reduced = with_locked_joints(reduced, [first.index(k) for k in moving], rest[first])
    samples = held_motion(robot, moving, rest, rng)
    tree = Tree.of(robot)
    expected = np.array([tree.torques(*state)[moving] for state in each(samples)])
    model = DifferentialModel(reduced, INERTIAL)
    found = instants(model, moving_part(samples, moving)) @ thetas_of(reduced).ravel()
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    # no body stays as a branch that nothing moves, and those that stay keep place, name and number
    assert all(np.any(branch.coupling) for branch in reduced.branches)
    numbers = dict(zip((body.name for body in robot.bodies), robot.body_numbers, strict=True))
    assert [numbers[body.name] for body in reduced.bodies] == list(reduced.body_numbers)
    places = dict(zip(numbers, Tree.of(robot).poses(samples.q[0]), strict=True))
    for body, pose in zip(reduced.bodies, Tree.of(reduced).poses(samples.q[0][moving]), strict=True):
        np.testing.assert_allclose(pose, places[body.name], atol=1e-12)


def parallelogram(rng: np.random.Generator) -> Robot:
    """Three links; a bar on the base and a rod on it, a bar that link 2 carries, and one that joint 1 alone moves."""
    robot = random_chain("rrr", rng)
    places = {"bar": BASE, "rod": "bar", "lug": "link2", "fin": "link1"}
    rows = np.array([[0, 1, 1], [0, 0, -1], [0, 0, 1], [2, 0, 0]], dtype=float)
    branches = [
        Branch(parent, joint, Link(name, random_body(rng)), row, 0.1)
        for joint, row, (name, parent) in zip(random_chain("rrrr", rng).joints, rows, places.items(), strict=True)
    ]
    return robot.replace(branches=tuple(branches))


def test_knowledge_of_composites_is_that_of_all_their_parts() -> None:
    """Bar and rod in one plane with the base: their first moments along the axis vanish together, not each one's x."""
    robot = parallelogram(np.random.default_rng(8))
    flat_joint = Joint("flat", "revolute", np.eye(3), np.array([0.3, 0.0, 0.0]))
    flat = [dataclasses.replace(b, joint=dataclasses.replace(flat_joint, name=b.name)) for b in robot.branches]
    zero = frozenset({"m4c4x", "m4c4z", "m5c5x", "m5c5z", "m6c6z", "I7xy"})
    equal = (("I4xx", "I4yy"), ("I6xx", "I6yy"), ("I7xx", "I7yy"))
    robot = robot.replace(branches=tuple(flat), structure=Structure(zero=zero, equal=equal))
    # the rod (5) becomes a part of the bar (4), the lug (6) of link 2
    structure = with_locked_joints(robot, [0, 1]).structure
    assert structure.zero == {"m4c4z", "I7xy"}
    assert structure.equal == (("I7xx", "I7yy"),)


# --- drives of resting joints ----------------------------------------------------------------------------------------


def driven(coupling: list[list[float]], gears: list[Any], rotor: float | None = 1e-4) -> Robot:
    robot = random_chain("rr", np.random.default_rng(0))
    drives = tuple(Drive(f"d{k}", gear, rotor) for k, gear in enumerate(gears, 1))
    return robot.replace(transmission=Transmission(np.array(coupling), drives, Limits.none(len(drives))))


FIXED, SCREW = ConstantRatio(100.0), BallScrew(0.005, 0.08, -0.03, 0.05)
PARALLEL, MIXED = [[1.0, 0.0], [-2.0, 1.0]], [[1.0, 1.0], [0.0, 1.0]]
TURNING = {
    "turns along": (driven(PARALLEL, [FIXED, FIXED]), [0], (False, True)),
    "stands": (driven(PARALLEL, [FIXED, FIXED]), [1], (True, False)),
    "turns along with a screw": (driven(PARALLEL, [SCREW, FIXED]), [0], (False, False)),
    "turns along behind a screw": (driven(PARALLEL, [FIXED, SCREW]), [0], (False, False)),
    "screw without a rotor": (driven(PARALLEL, [FIXED, SCREW], None), [0], (False, True)),
    "the joint's own is kept": (driven(MIXED, [FIXED, FIXED]), [1], (True, False)),
}


@pytest.mark.parametrize("case", TURNING.values(), ids=TURNING.keys())
def test_drives_that_show_nothing_new_lose_their_parameters(case: tuple[Robot, list[int], tuple[bool, ...]]) -> None:
    robot, moving, rests = case
    transmission = with_locked_joints(robot, moving).transmission
    assert tuple(drive.rests for drive in transmission.drives) == rests


# --- the IRp-6 in full -----------------------------------------------------------------------------------------------


def test_the_parallelogram_closes() -> None:
    """Far end of the coupler and rear end of the forearm are one point, in every pose; bars keep their directions."""
    robot = built_in("irp6-full")
    for q in np.random.default_rng(1).uniform(-1.5, 1.5, (20, 5)):
        _, arm, forearm, _, _, crank, coupler = Tree.of(robot).poses(q)
        np.testing.assert_allclose(coupler @ [0.455, 0, 0, 1], forearm @ [-0.14, 0, 0, 1], atol=1e-12)
        np.testing.assert_allclose(crank[:3, 3], arm[:3, 3], atol=1e-12)
        np.testing.assert_allclose(crank[:3, :3], forearm[:3, :3], atol=1e-12)
        np.testing.assert_allclose(coupler[:3, :3], arm[:3, :3], atol=1e-12)


RATIOS = {  # angle of the axis [deg] to the motor's ratio: ratio_table_deg of shared/facts/irp6.yaml, motors turn back
    1: {-40: -133.9, -30: -147.1, -20: -158.5, -10: -167.5, 0: -173.7, 10: -175.9, 20: -172.7, 30: -161.2, 40: -136.9},
    2: {-40: -153.0, -30: -163.3, -20: -171.0, -10: -175.4, 0: -175.1, 10: -168.2, 20: -151.0, 25: -136.9},
}


@pytest.mark.parametrize("drive", RATIOS)
def test_screws_have_the_published_ratios(drive: int) -> None:
    transmission = built_in("irp6-full").transmission
    z = ca.SX.sym("z")
    ratio = ca.Function("ratio", [z], [transmission.drives[drive].ratio.ratio(z)])
    for degrees, expected in RATIOS[drive].items():
        assert float(ratio(np.deg2rad(degrees))) == pytest.approx(expected, abs=0.051)


@pytest.mark.parametrize("moving", [[0, 1, 2], [0, 1], [1], [1, 2], [2], [1, 3], [0, 2, 3, 4]], ids=str)
def test_columns_left_explain_all_that_the_moving_joints_feel(moving: list[int]) -> None:
    """With the other joints resting nothing moves the joints in a way that is not modelled: no bar, no rotor."""
    robot, rng = built_in("irp6-full"), np.random.default_rng(44)
    rest = np.array([0.1, -0.2, 0.15, 0.1, 0.3])
    reduced = with_locked_joints(robot, moving, rest)
    samples = held_motion(robot, moving, rest, rng, count=60)
    samples = dataclasses.replace(samples, q=np.where(samples.dq != 0, 0.4 * samples.q, samples.q))
    W = instants(DifferentialModel(robot), samples)[:, moving].reshape(60 * len(moving), -1)
    assert_explained(W, DifferentialModel(reduced).assemble(moving_part(samples, moving)))
