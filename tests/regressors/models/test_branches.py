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
from hypothesis import given, settings
from hypothesis import strategies as st
from slow_dynamics import joint_matrix, mass_matrix_of_body, random_body, random_chain

from regressors.errors import InputError
from regressors.models.differential import DifferentialModel, inertial_regressor
from regressors.models.energy import EnergyModel
from regressors.readers.description import parse_description
from regressors.readers.library import built_in
from regressors.robot.archive import robot_from_description
from regressors.robot.columns import Terms
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.inertia import from_centre_of_mass, parameter_names
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import BASE, Branch, Drive, Joint, Limits, Link, Robot, Structure, Transmission
from regressors.robot.symbolic.kinematics import bodies, chain
from regressors.samples import Array, Samples

INERTIAL = Terms.inertial_only()
CHAINS = st.text(alphabet="rp", min_size=1, max_size=4)
BESIDE = st.text(alphabet="rp", min_size=1, max_size=4)
SEED = st.integers(0, 2**32 - 1)
PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # our order of the ten parameters in its m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz


def branched(kinds: str, beside: str, rng: np.random.Generator) -> Robot:
    """A random chain with random bodies beside it, on links, on the base and on each other, coupled to any joints."""
    robot = random_chain(kinds, rng)
    parents, branches = [BASE, *(link.name for link in robot.links)], []
    for k, joint in enumerate(random_chain(beside, rng).joints):
        name = f"bar{k + 1}"
        row = rng.choice([-1.0, 0.0, 0.0, 1.0, 0.7], robot.n)
        row[rng.integers(robot.n)] = rng.choice([-1.0, 1.0, 1.7])
        placed = dataclasses.replace(joint, name=name)
        branches.append(Branch(str(rng.choice(parents)), placed, Link(name, random_body(rng)), row, rng.normal()))
        parents.append(name)
    return robot.replace(branches=tuple(branches))


def thetas_of(robot: Robot) -> Array:
    return np.array([body.theta for body in robot.bodies])


def states(robot: Robot, rng: np.random.Generator, count: int = 3) -> Samples:
    motion = rng.uniform(-2.0, 2.0, (3, count, robot.n))
    return Samples(np.arange(float(count)), *motion, 0 * motion[0])


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
        model = pin.Model()
        model.gravity.linear = robot.gravity
        number = {BASE: 0}
        above = [BASE, *(link.name for link in robot.links[:-1]), *(branch.parent for branch in robot.branches)]
        joints = [*robot.joints, *(branch.joint for branch in robot.branches)]
        for parent, joint, body in zip(above, joints, robot.bodies, strict=True):
            kinds = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
            place = pin.SE3(np.array(joint.rotation), np.array(joint.translation))
            number[body.name] = model.addJoint(number[parent], kinds[joint.kind](joint.axis), place, body.name)
            inertia = pin.Inertia.FromDynamicParameters(np.asarray(body.theta)[PINOCCHIO])
            model.appendBodyToJoint(number[body.name], inertia, pin.SE3.Identity())
        rows = np.array([branch.coupling for branch in robot.branches]).reshape(-1, robot.n)
        offsets = [branch.offset for branch in robot.branches]
        return cls(model, np.vstack([np.eye(robot.n), rows]), np.concatenate([np.zeros(robot.n), offsets]))

    def regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """``G' Y_tree``: what the independent joints feel of the tree's torques."""
        s, ds, dds = self.G @ q + self.s0, self.G @ dq, self.G @ ddq
        Y = pin.computeJointTorqueRegressor(self.model, self.model.createData(), s, ds, dds)
        order = [10 * body + k for body in range(self.model.nv) for k in PINOCCHIO]
        return self.G.T @ Y[:, order]

    def torques(self, q: Array, dq: Array, ddq: Array) -> Array:
        """``G' tau_tree``, without a regressor."""
        s, ds, dds = self.G @ q + self.s0, self.G @ dq, self.G @ ddq
        return self.G.T @ pin.rnea(self.model, self.model.createData(), s, ds, dds)

    def poses(self, q: Array) -> list[Array]:
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, self.G @ q + self.s0)
        return [data.oMi[k].homogeneous for k in range(1, self.model.njoints)]


def moved(robot: Robot, q: Array, dq: Array) -> list[tuple[Array, Array]]:
    """Pose of each body and its rate by the product rule on homogeneous matrices; arguments may be complex."""
    placed = {BASE: (np.eye(4), np.zeros((4, 4)))}
    steps = [
        (robot.links[k - 1].name if k else BASE, joint, robot.links[k].name, q[k], dq[k])
        for k, joint in enumerate(robot.joints)
    ]
    steps += [(b.parent, b.joint, b.name, b.coupling @ q + b.offset, b.coupling @ dq) for b in robot.branches]
    for parent, joint, name, s, ds in steps:
        (T, dT), A = placed[parent], joint_matrix(joint, s)
        placed[name] = T @ A, dT @ A + T @ joint_matrix(joint, s, 1) * ds
    return [placed[body.name] for body in robot.bodies]


def energy(robot: Robot, thetas: Array, q: Array, dq: Array) -> complex:
    """Kinetic plus potential energy of all bodies."""
    total = 0.0
    for theta, (T, dT) in zip(thetas, moved(robot, q, dq), strict=True):
        J = mass_matrix_of_body(theta)
        total += np.trace(dT @ J @ dT.T) / 2 - robot.gravity @ (T @ J[:, 3])[:3]
    return total


# --- regressor and laws ----------------------------------------------------------------------------------------------


@given(kinds=CHAINS, beside=BESIDE, seed=SEED)
@settings(max_examples=40)
def test_regressor_is_that_of_a_tree_seen_through_the_coupling(kinds: str, beside: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = branched(kinds, beside, rng)
    tree, samples = Tree.of(robot), states(robot, rng)
    found = instants(DifferentialModel(robot, INERTIAL), samples)
    assert found.shape[2] == 10 * len(kinds + beside)
    for Y, state in zip(found, each(samples), strict=True):
        expected = tree.regressor(*state)
        assert np.abs(Y - expected).max() <= 1e-11 * np.abs(expected).max()
        tau = tree.torques(*state)
        np.testing.assert_allclose(Y @ thetas_of(robot).ravel(), tau, rtol=1e-9, atol=1e-9 * np.abs(tau).max())


@given(kinds=CHAINS, beside=BESIDE, seed=SEED)
@settings(max_examples=15)
def test_energy_model_has_the_same_bodies(kinds: str, beside: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = branched(kinds, beside, rng)
    model, thetas = EnergyModel(robot, INERTIAL), thetas_of(robot)
    q, dq = (ca.SX.sym(name, robot.n) for name in ("q", "dq"))
    state = ca.Function("h", [q, dq], [ca.densify(model.state(q, dq))])
    assert model.names == DifferentialModel(robot, INERTIAL).names
    for q, dq, _ in each(states(robot, rng)):
        expected = float(np.real(energy(robot, thetas, q, dq)))
        assert float(np.array(state(q, dq))[0] @ thetas.ravel()) == pytest.approx(expected, rel=1e-10)


def test_a_joint_that_does_not_move_a_body_has_no_entry() -> None:
    """The IRp-6's coupler keeps the arm's direction: joint 3 shifts it and does not turn it; joints 4, 5 do nothing."""
    robot = built_in("irp6-full")
    symbols = [ca.SX.sym(name, 5) for name in ("q", "dq", "ddq")]
    *links, crank, coupler = bodies(robot, *symbols)
    assert [len(link.axes) for link in links] == [len(link.axes) for link in chain(robot, *symbols)] == [1, 2, 3, 4, 5]
    assert (len(crank.axes), len(coupler.axes)) == (3, 3)
    turned = [angular.nnz() > 0 for angular, _ in coupler.axes]
    shifted = [linear.nnz() > 0 for _, linear in coupler.axes]
    assert turned == [True, True, False]
    assert shifted == [True, True, True]
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


def test_structure_speaks_of_branches_too() -> None:
    zero = frozenset({"m3c3z", "I3xy"})
    robot = branched("rr", "r", np.random.default_rng(0)).replace(structure=Structure(zero=zero))
    names = DifferentialModel(robot, INERTIAL).names
    assert set(parameter_names(3)) - set(names) == zero


# --- what cannot be --------------------------------------------------------------------------------------------------

HINGE = Joint("bar", "revolute", np.eye(3), np.zeros(3))
BAR = Branch("link1", HINGE, Link("bar"), np.array([1.0, 1.0]))


def other(name: str, parent: str = "bar", number: int = 0) -> Branch:
    return Branch(parent, HINGE, Link(name, None, number), np.array([0.0, 1.0]))


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "no coupling": (lambda: dataclasses.replace(BAR, coupling=np.zeros(0)), "branch 'bar': its coupling is zero"),
    "zero coupling": (
        lambda: dataclasses.replace(BAR, coupling=np.zeros(2)),
        "branch 'bar': its coupling is zero, so it does not move; make it a part of 'link1'",
    ),
    "matrix coupling": (
        lambda: dataclasses.replace(BAR, coupling=np.eye(2)),
        "branch 'bar', coupling: expected shape (4,), given (2, 2)",
    ),
    "NaN coupling": (
        lambda: dataclasses.replace(BAR, coupling=np.array([np.nan, 1.0])),
        "branch 'bar': coupling and offset must be finite, given [nan, 1.0] and 0.0",
    ),
    "infinite offset": (lambda: dataclasses.replace(BAR, offset=np.inf), "must be finite, given [1.0, 1.0] and inf"),
    "unknown parent": (
        lambda: two_links(dataclasses.replace(BAR, parent="tower")),
        "no link or earlier branch, as parent of branch 'bar', named 'tower'; available: base, link1, link2",
    ),
    "its own parent": (lambda: two_links(dataclasses.replace(BAR, parent="bar")), "named 'bar'; available: base, lin"),
    "a later branch": (lambda: two_links(other("rod"), BAR), "'rod', named 'bar'; available: base, link1, link2"),
    "row too short": (
        lambda: two_links(dataclasses.replace(BAR, coupling=np.ones(1))),
        "robot 'chain', branch 'bar': the coupling must have 2 numbers, one per joint, given 1",
    ),
    "name of a link": (lambda: two_links(other("link2", "link1")), "share a name: base, link1, link2, link2"),
    "name twice": (lambda: two_links(BAR, other("bar")), "share a name: base, link1, link2, bar, bar"),
    "name of the base": (lambda: two_links(other("base", "link1")), "share a name: base, link1, link2, base"),
    "number twice": (lambda: two_links(BAR, other("rod", number=3)), "share a number: 1, 2, 3, 3"),
    "number of a link": (lambda: two_links(other("rod", "link1", 1)), "share a number: 1, 2, 1"),
}


def two_links(*branches: Branch) -> Robot:
    return random_chain("rr", np.random.default_rng(0)).replace(branches=branches)


@pytest.mark.parametrize("case", REFUSED.values(), ids=REFUSED.keys())
def test_refuses_and_says_why(case: tuple[Callable[[], object], str]) -> None:
    make, message = case
    with pytest.raises(InputError) as raised:
        make()
    assert message in str(raised.value)


def test_a_robot_without_branches_may_have_a_link_named_base() -> None:
    robot = random_chain("r", np.random.default_rng(0))
    assert robot.replace(links=(Link("base"),)).bodies[0].name == "base"


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
    np.testing.assert_array_equal(bar.joint.translation, [0, 0, 0.5])
    np.testing.assert_array_equal(bar.joint.axis, [0, 1, 0])
    np.testing.assert_array_equal(crank.coupling, [1, 0.5])
    assert (crank.offset, bar.offset) == (0.0, 0.25)
    np.testing.assert_allclose(crank.link.theta, from_centre_of_mass(2.0, [0.1, 0, 0], np.diag([0.1, 0.2, 0.2])))
    assert bar.link.theta is None
    assert robot.body_numbers == (1, 2, 3, 7)
    assert robot.structure.zero == {"m3c3y", "m7c7x"}


def test_branches_may_sit_on_the_base_and_turn_by_degrees() -> None:
    text = YAML.replace("parent: one", "parent: base\n    offset: 90 deg")
    crank = parse_description(text, "bars.yaml").branches[0]
    assert (crank.parent, crank.offset) == (BASE, np.pi / 2)


HINGED = "    joint: {mdh: {alpha: 90 deg, a: 0.1, d: 0.2, offset: 30 deg}}\n"
COMPLAINTS = [
    ("parent: one", "parent: three", "branches[1].parent (line 13): no link or earlier branch named 'three'; availabl"),
    ("parent: one", "parent: bar", "branches[1].parent (line 13): no link or earlier branch named 'bar'; available: b"),
    ("parent: crank", "parent: bar", "branches[2].parent (line 20): no link or earlier branch named 'bar'; available:"),
    ("    parent: one\n", "", "branches[1].parent (line 12): is missing"),
    ("name: bar\n", "name: crank\n", "branches[2].name (line 19): the name 'crank' is that of the base, a link or ano"),
    ("name: bar\n", "name: two\n", "branches[2].name (line 19): the name 'two' is that of the base, a link or another"),
    ("name: bar\n", "name: base\n", "branches[2].name (line 19): the name 'base' is that of the base, a link or anoth"),
    ("name: two\n", "name: base\n", "links[2].name (line 10): the name 'base' is that of the base frame"),
    ("name: bar\n", "name: a bar\n", "branches[2].name (line 19): a name must not be empty nor hold spaces or commas"),
    ("[1, 0.5]", "[1]", "branches[1].coupling (line 15): expected one number per joint, 2, given 1"),
    ("[1, 0.5]", "[1, 2, 3]", "branches[1].coupling (line 15): expected one number per joint, 2, given 3"),
    (
        "[1, 0.5]",
        "[0, 0]",
        "branches[1].coupling (line 15): no joint moves this branch; describe it as a part of its parent",
    ),
    (
        "[1, 0.5]",
        "[]",
        "branches[1].coupling (line 15): no joint moves this branch; describe it as a part of its parent",
    ),
    ("[1, 0.5]", "[1, .nan]", "branches[1].coupling[2] (line 15): should be a finite number, given nan"),
    ("[1, 0.5]", "[1, x]", "branches[1].coupling[2] (line 15): should be a valid number, given 'x'"),
    ("[1, 0.5]", "1", "branches[1].coupling (line 15): should be a valid list, given 1"),
    ("    coupling: [1, 0.5]\n", "", "branches[1].coupling (line 12): is missing"),
    (HINGED, "", "branches[1].joint (line 12): is missing"),
    (HINGED, "    joint: {}\n", "branches[1].joint (line 14): the joint of a branch needs mdh or pose, and not both"),
    ("pose: {xyz", "mdh: {}, pose: {xyz", "branches[2].joint (line 21): the joint of a branch needs mdh or pose, and"),
    ("kind: prismatic, p", "kind: sliding, p", "branches[2].joint.kind (line 21): should be 'revolute' or 'prismatic'"),
    ("kind: prismatic, p", "limits: {}, p", "branches[2].joint.limits (line 21): no such field; available: kind, mdh,"),
    ("axis: [0.0, 2.0, 0.0]", "axis: [0, 0, 0]", "branches[2].joint.pose.axis (line 21): an axis needs a length that"),
    ("offset: 0.25", "offset: far", "branches[2].offset (line 23): expected a number or text such as '90 deg', given"),
    ("number: 7", "number: 3", "branches[2].number (line 24): the number 3 is already that of a link or branch"),
    ("number: 7", "number: 2", "branches[2].number (line 24): the number 2 is already that of a link or branch"),
    ("number: 7", "number: 0", "branches[2].number (line 24): should be greater than 0, given 0"),
    ("number: 7", "number: 7.5", "branches[2].number (line 24): should be a valid integer, given 7.5"),
    ("    mass: 2.0\n", "", "branches[1] (line 12): link 'crank': give mass, com or first_moment, and inertia, or non"),
    ("mass: 2.0", "mas: 2.0", "branches[1].mas (line 16): no such field; did you mean mass? available: name"),
    ("branches:\n", "branches: bars\nothers:\n", "branches (line 11): should be a valid list, given 'bars'"),
    ("[m3c3y, m7c7x]", "[m4c4y]", "structure.zero[1] (line 26): no parameter named 'm4c4y'; available: m1, m1c1x"),
    ("[m3c3y, m7c7x]", "[m3c3x]", "structure.zero[1] (line 26): m3c3x is declared zero, but its link gives 0.2"),
]


@pytest.mark.parametrize(("old", "new", "message"), COMPLAINTS)
def test_reader_refuses_and_says_why(old: str, new: str, message: str) -> None:
    assert YAML.count(old) >= 1
    with pytest.raises(InputError) as raised:
        parse_description(YAML.replace(old, new, 1), "bars.yaml")
    told = str(raised.value)
    assert told.startswith("bars.yaml: ")
    assert message in told
    assert "\n" not in told


def round_trip(robot: Robot) -> Robot:
    return robot_from_description(json.loads(json.dumps(robot.description())))


@given(kinds=CHAINS, beside=BESIDE, seed=SEED)
@settings(max_examples=15)
def test_archive_brings_branches_back(kinds: str, beside: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = branched(kinds, beside, rng)
    robot = with_locked_joints(robot, sorted(rng.choice(robot.n, rng.integers(1, robot.n + 1), replace=False)))
    again = round_trip(robot)
    assert again.sha256() == robot.sha256()
    samples = states(robot, rng)
    there, back = (instants(DifferentialModel(r, INERTIAL), samples) for r in (robot, again))
    np.testing.assert_array_equal(back, there)


def test_every_part_of_a_branch_is_in_the_hash() -> None:
    robot = two_links(BAR)
    changes = {
        "parent": "link2",
        "joint": dataclasses.replace(HINGE, kind="prismatic"),
        "link": Link("bar", np.ones(10)),
        "coupling": np.array([1.0, 0.0]),
        "offset": 0.1,
    }
    assert set(changes) == {field.name for field in dataclasses.fields(Branch)}
    hashes = {two_links(dataclasses.replace(BAR, **{name: value})).sha256() for name, value in changes.items()}
    assert len(hashes | {robot.sha256(), two_links().sha256()}) == len(changes) + 2


def test_robots_without_branches_are_described_as_before() -> None:
    """Their hashes stand in files that were written before there were branches."""
    robot = built_in("irp6")
    assert "branches" not in robot.description()
    assert round_trip(robot).branches == ()


BROKEN: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "no parent": (lambda branch: branch.pop("parent"), "not a robot description: "),
    "no coupling": (lambda branch: branch.pop("coupling"), "not a robot description: "),
    "no joint": (lambda branch: branch.pop("joint"), "not a robot description: 'joint' is missing"),
    "another field": (lambda branch: branch.update(colour="red"), "not a robot description: "),
    "text for numbers": (lambda branch: branch.update(coupling=["x", "y"]), "not a robot description: "),
    "a row too short": (lambda branch: branch.update(coupling=[1.0]), "branch 'bar': the coupling must have 2 numbers"),
    "no such parent": (lambda branch: branch.update(parent="tower"), "named 'tower'; available: base, link1, link2"),
    "a joint that is none": (lambda branch: branch.update(joint=[1, 2]), "not a robot description: "),
}


@pytest.mark.parametrize("case", BROKEN.values(), ids=BROKEN.keys())
def test_archive_refuses_what_is_no_branch(case: tuple[Callable[[dict[str, Any]], object], str]) -> None:
    broken, message = case
    description = json.loads(json.dumps(two_links(BAR).description()))
    broken(description["branches"][0])
    with pytest.raises(InputError) as raised:
        robot_from_description(description)
    assert message in str(raised.value)


def test_archive_refuses_branches_that_are_no_list() -> None:
    with pytest.raises(InputError, match="not a robot description"):
        robot_from_description({**two_links(BAR).description(), "branches": 3})


# --- joints that rest ------------------------------------------------------------------------------------------------


def held(robot: Robot, moving: list[int], rest: Array, rng: np.random.Generator, count: int = 3) -> Samples:
    """Random motion of the whole robot in which the other joints rest."""
    motion = rng.uniform(-1.5, 1.5, (3, count, robot.n))
    others = np.setdiff1d(range(robot.n), moving)
    motion[0][:, others], motion[1][:, others], motion[2][:, others] = rest[others], 0.0, 0.0
    return Samples(np.arange(float(count)), *motion, 0 * motion[0])


def part(samples: Samples, moving: list[int]) -> Samples:
    return Samples(samples.time, *(x[:, moving] for x in (samples.q, samples.dq, samples.ddq, samples.dddq)))


def subset(n: int, rng: np.random.Generator) -> list[int]:
    return sorted(rng.choice(n, rng.integers(1, n + 1), replace=False).tolist())


@given(kinds=st.text(alphabet="rp", min_size=2, max_size=5), beside=BESIDE, seed=SEED)
@settings(max_examples=60)
def test_moving_joints_feel_what_they_felt_before(kinds: str, beside: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = branched(kinds, beside, rng)
    moving, rest = subset(robot.n, rng), rng.uniform(-1.5, 1.5, robot.n)
    reduced = with_locked_joints(robot, moving, rest)
    samples = held(robot, moving, rest, rng)
    tree = Tree.of(robot)
    expected = np.array([tree.torques(*state)[moving] for state in each(samples)])
    model = DifferentialModel(reduced, INERTIAL)
    found = instants(model, part(samples, moving)) @ thetas_of(reduced).ravel()
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    # no body stays as a branch that nothing moves, and those that stay keep place, name and number
    assert all(np.any(branch.coupling) for branch in reduced.branches)
    numbers = dict(zip((body.name for body in robot.bodies), robot.body_numbers, strict=True))
    assert [numbers[body.name] for body in reduced.bodies] == list(reduced.body_numbers)
    places = dict(zip(numbers, Tree.of(robot).poses(samples.q[0]), strict=True))
    for body, pose in zip(reduced.bodies, Tree.of(reduced).poses(samples.q[0][moving]), strict=True):
        np.testing.assert_allclose(pose, places[body.name], atol=1e-12)


@given(kinds=st.text(alphabet="rp", min_size=2, max_size=4), beside=BESIDE, seed=SEED)
@settings(max_examples=25)
def test_holding_joints_in_two_steps_is_holding_them_at_once(kinds: str, beside: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = branched(kinds, beside, rng)
    first, rest = subset(robot.n, rng), rng.uniform(-1.0, 1.0, robot.n)
    second = subset(len(first), rng)
    once = with_locked_joints(robot, [first[k] for k in second], rest)
    twice = with_locked_joints(with_locked_joints(robot, first, rest), second, rest[first])
    assert [b.name for b in twice.branches] == [b.name for b in once.branches]
    assert [b.parent for b in twice.branches] == [b.parent for b in once.branches]
    assert twice.body_numbers == once.body_numbers
    np.testing.assert_allclose(thetas_of(twice), thetas_of(once), atol=1e-11)
    samples = states(once, rng)
    found, expected = (instants(DifferentialModel(r, INERTIAL), samples) for r in (twice, once))
    np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


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


# Moving joints to what is left: bodies with their parents.
LEFT = {
    (0, 1): {"bar": BASE, "fin": "link1"},  # the rod is a part of the bar, the lug of link 2
    (0, 2): {"bar": BASE, "rod": "bar", "lug": "link1", "fin": "link1"},
    (1, 2): {"bar": BASE, "rod": "bar", "lug": "link2"},  # the fin stands on the base
    (2,): {"bar": BASE, "rod": "bar", "lug": BASE},  # so does link 2, which carries the lug
    (1,): {"bar": BASE},
    (0,): {"fin": "link1"},
}


@pytest.mark.parametrize("moving", LEFT, ids=str)
def test_branches_that_no_moving_joint_turns_become_parts_of_what_carries_them(moving: tuple[int, ...]) -> None:
    robot = parallelogram(np.random.default_rng(8))
    reduced = with_locked_joints(robot, moving)
    assert {branch.name: branch.parent for branch in reduced.branches} == LEFT[moving]
    standing = {branch.name for branch in robot.branches} - set(LEFT[moving])
    masses = {body.name: body.theta[0] for body in robot.bodies}
    for branch in reduced.branches:
        parts = ["rod"] * (branch.name == "bar" and "rod" in standing)
        assert branch.link.theta[0] == pytest.approx(masses[branch.name] + sum(masses[name] for name in parts))


def test_an_unknown_part_makes_its_composite_unknown() -> None:
    robot = parallelogram(np.random.default_rng(8))
    bar, rod, *others = robot.branches
    robot = robot.replace(branches=(bar, dataclasses.replace(rod, link=Link("rod")), *others))
    merged, alone = (with_locked_joints(robot, moving).branches for moving in ([0, 1], [0, 2]))
    assert {b.name for b in merged if b.link.theta is None} == {"bar"}
    assert {b.name for b in alone if b.link.theta is None} == {"rod"}


def test_knowledge_of_composites_is_that_of_all_their_parts() -> None:
    """Bar and rod in one plane with the base: their first moments along the axis vanish together, not each one's x."""
    robot = parallelogram(np.random.default_rng(8))
    flat = [
        dataclasses.replace(b, joint=Joint(b.name, "revolute", np.eye(3), np.array([0.3, 0.0, 0.0])))
        for b in robot.branches
    ]
    zero = frozenset({"m4c4x", "m4c4z", "m5c5x", "m5c5z", "m6c6z", "I7xy"})
    equal = (("I4xx", "I4yy"), ("I6xx", "I6yy"), ("I7xx", "I7yy"))
    robot = robot.replace(branches=tuple(flat), structure=Structure(zero=zero, equal=equal))
    # the rod (5) becomes a part of the bar (4), the lug (6) of link 2
    structure = with_locked_joints(robot, [0, 1]).structure
    assert structure.zero == {"m4c4z", "I7xy"}
    assert structure.equal == (("I7xx", "I7yy"),)


def test_aggregates_go_with_what_they_rest_on() -> None:
    """A wrist that rests bent makes the IRp-6's forearm unsymmetric: X1 ... X7 no longer write its torques."""
    robot = built_in("irp6")
    assert with_locked_joints(robot, [0, 1, 2], [0, 0, 0, 0, 0]).structure.aggregates
    assert not with_locked_joints(robot, [0, 1, 2], [0, 0, 0, 0.5, 0]).structure.aggregates


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
    "stands behind a screw": (driven(PARALLEL, [SCREW, SCREW]), [1], (True, False)),
    "turns along with a screw": (driven(PARALLEL, [SCREW, FIXED]), [0], (False, False)),
    "turns along behind a screw": (driven(PARALLEL, [FIXED, SCREW]), [0], (False, False)),
    "screw without a rotor": (driven(PARALLEL, [FIXED, SCREW], None), [0], (False, True)),
    "the joint's own is kept": (driven(MIXED, [FIXED, FIXED]), [1], (True, False)),
}


@pytest.mark.parametrize("case", TURNING.values(), ids=TURNING.keys())
def test_drives_that_show_nothing_new_lose_their_parameters(case: tuple[Robot, list[int], tuple[bool, ...]]) -> None:
    robot, moving, rests = case
    transmission = with_locked_joints(robot, moving).transmission
    assert transmission is not None
    assert tuple(drive.rests for drive in transmission.drives) == rests


# --- the IRp-6 in full -----------------------------------------------------------------------------------------------


def with_bodies(robot: Robot, rng: np.random.Generator) -> Robot:
    """The same mechanism with random bodies."""
    links = tuple(dataclasses.replace(link, theta=random_body(rng)) for link in robot.links)
    branches = tuple(
        dataclasses.replace(b, link=dataclasses.replace(b.link, theta=random_body(rng))) for b in robot.branches
    )
    return robot.replace(links=links, branches=branches)


def test_the_parallelogram_closes() -> None:
    """Far end of the coupler and rear end of the forearm are one point, in every pose; bars keep their directions."""
    robot = with_bodies(built_in("irp6-full"), np.random.default_rng(0))
    for q in np.random.default_rng(1).uniform(-1.5, 1.5, (20, 5)):
        _, arm, forearm, _, _, crank, coupler = Tree.of(robot).poses(q)
        np.testing.assert_allclose(coupler @ [0.455, 0, 0, 1], forearm @ [-0.14, 0, 0, 1], atol=1e-12)
        np.testing.assert_allclose(crank[:3, 3], arm[:3, 3], atol=1e-12)
        np.testing.assert_allclose(crank[:3, :3], forearm[:3, :3], atol=1e-12)
        np.testing.assert_allclose(coupler[:3, :3], arm[:3, :3], atol=1e-12)


def test_the_lever_that_the_screw_pulls_is_the_crank() -> None:
    """Screw between the crank's end and a pivot 157.5 mm behind and 183 mm below the shoulder: that is its length."""
    robot = built_in("irp6-full")
    assert robot.transmission is not None
    crank, coupler = robot.branches
    screw = robot.transmission.drives[2].ratio
    assert isinstance(screw, BallScrew)
    pivot = np.array([-0.1575, -0.183])  # radial, up, from the shoulder
    for z in np.linspace(-0.7, 0.45, 5):
        turned = crank.joint.motion(z)[:3, :3] @ coupler.joint.translation
        end = turned[[0, 2]]  # at q1 = 0 the radial direction is the base's x axis
        square = screw.square + screw.cosine * np.cos(z) + screw.sine * np.sin(z)
        assert np.sum((end - pivot) ** 2) == pytest.approx(square, abs=1e-6)
        assert crank.coupling @ [0.3, z - 0.2, 0.2, 0.0, 0.0] == pytest.approx(z)


RATIOS = {  # angle of the axis [deg] to the motor's ratio: ratio_table_deg of shared/facts/irp6.yaml, motors turn back
    1: {-40: -133.9, -30: -147.1, -20: -158.5, -10: -167.5, 0: -173.7, 10: -175.9, 20: -172.7, 30: -161.2, 40: -136.9},
    2: {-40: -153.0, -30: -163.3, -20: -171.0, -10: -175.4, 0: -175.1, 10: -168.2, 20: -151.0, 25: -136.9},
}


@pytest.mark.parametrize("drive", RATIOS)
def test_screws_have_the_published_ratios(drive: int) -> None:
    transmission = built_in("irp6-full").transmission
    assert transmission is not None
    z = ca.SX.sym("z")
    ratio = ca.Function("ratio", [z], [transmission.drives[drive].ratio.ratio(z)])
    for degrees, expected in RATIOS[drive].items():
        assert float(ratio(np.deg2rad(degrees))) == pytest.approx(expected, abs=0.051)


def test_full_irp6_is_the_irp6_but_for_screws_bars_and_shape() -> None:
    plain, full = built_in("irp6"), built_in("irp6-full")
    assert full.structure == Structure()
    assert full.transmission is not None
    assert plain.transmission is not None
    same = full.replace(name="irp6", branches=(), structure=plain.structure, constants=plain.constants)
    drives = tuple(
        dataclasses.replace(d, ratio=p.ratio)
        for d, p in zip(full.transmission.drives, plain.transmission.drives, strict=True)
    )
    same = same.replace(transmission=dataclasses.replace(full.transmission, drives=drives))
    assert same.sha256() == plain.sha256()
    ratios = [full.transmission.drives[k].ratio for k in (0, 3, 4)]
    assert ratios == [ConstantRatio(-158.0), ConstantRatio(128.0), ConstantRatio(-76.8)]


@pytest.mark.parametrize("moving", [[0, 1, 2], [0, 1], [1], [1, 2], [2], [1, 3], [0, 2, 3, 4]], ids=str)
def test_columns_left_explain_all_that_the_moving_joints_feel(moving: list[int]) -> None:
    """With the other joints resting nothing moves the joints in a way that is not modelled: no bar, no rotor."""
    robot, rng = built_in("irp6-full"), np.random.default_rng(44)
    rest = np.array([0.1, -0.2, 0.15, 0.1, 0.3])
    reduced = with_locked_joints(robot, moving, rest)
    samples = held(robot, moving, rest, rng, count=60)
    samples = dataclasses.replace(samples, q=np.where(samples.dq != 0, 0.4 * samples.q, samples.q))
    W = instants(DifferentialModel(robot), samples)[:, moving].reshape(60 * len(moving), -1)
    left = DifferentialModel(reduced).assemble(part(samples, moving))

    def normalised(columns: Array) -> Array:
        sizes = np.linalg.norm(columns, axis=0)
        return columns / np.where(sizes > 1e-12 * sizes.max(), sizes, np.inf)

    W, left = normalised(W), normalised(left)
    explained = left @ np.linalg.lstsq(left, W, rcond=1e-12)[0]
    np.testing.assert_allclose(explained, W, atol=1e-9)
