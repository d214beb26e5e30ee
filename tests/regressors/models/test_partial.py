"""Partial motions: which joints move when drives are held, what such motions show, and that limits hold for them."""

from __future__ import annotations

import dataclasses
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from refused import refusal
from slow_dynamics import general, random_chain, table_energies, three_axes

from constraints.linear import linear_limits
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.errors import UnknownName
from regressors.models.base import base_parameters, random_states
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.model import PartialModel, RegressorModel
from regressors.models.partial import PartialMotion, drive_names, of_drives, of_joints
from regressors.readers.library import built_in
from regressors.robot.robot import Drive, Limits, Robot, Transmission
from regressors.samples import Array

SEED = st.integers(0, 2**32 - 1)


def coupled(seed: int, kinds: str = "rpr") -> Robot:
    """A chain with as many drives as joints, each moving several of them, with offsets."""
    rng = np.random.default_rng(seed)
    n = len(kinds)
    while True:
        C = np.round(rng.uniform(-2.0, 2.0, (n, n)), 1)
        if np.linalg.cond(C) < 30:
            break
    drives = tuple(Drive(f"d{k + 1}", rotor_inertia=1e-4) for k in range(n))
    offset = rng.uniform(-0.3, 0.3, n)
    return random_chain(kinds, rng).replace(transmission=Transmission(C, drives, Limits.none(n), offset))


def coupling(robot: Robot) -> Array:
    return robot.transmission.coupling[[not drive.rests for drive in robot.transmission.drives]]


# --- which joints move -----------------------------------------------------------------------------------------------


def test_drives_of_the_first_three_axes() -> None:
    """The wrist rests there, so nothing turns back for it; drives of resting joints are none that can move."""
    robot = three_axes()
    assert drive_names(robot) == ("z1", "z2", "z3")
    np.testing.assert_array_equal(of_drives(robot, ["z3", "1", "z1"]).matrix, [[1, 0], [0, 0], [0, 1]])
    assert of_drives(robot, ["3", "1"]).labels == ("z1", "z3")
    whole = of_drives(robot, ["1", "2", "3"])
    np.testing.assert_array_equal(whole.matrix, [[1, 0, 0], [0, 1, 0], [0, -1, 1]])
    assert not whole.complete  # the coordinates are those of the drives


@given(seed=SEED, data=st.data())
@settings(max_examples=40)
def test_held_drives_stand_and_moving_ones_follow_their_coordinate(seed: int, data: st.DataObject) -> None:
    """``z(N s + q0) - z(q0)`` is s for the drives that move and zero for the others, whatever the coupling."""
    robot = coupled(seed, data.draw(st.text(alphabet="rp", min_size=2, max_size=4)))
    moving = data.draw(st.lists(st.integers(0, robot.n - 1), min_size=1, unique=True).map(sorted))
    motion = of_drives(robot, [f"d{k + 1}" for k in moving])
    s = np.random.default_rng(seed).normal(size=(5, len(moving)))
    z = (s @ motion.matrix.T) @ coupling(robot).T
    np.testing.assert_allclose(z[:, moving], s, atol=1e-12)
    np.testing.assert_allclose(np.delete(z, moving, axis=1), 0.0, atol=1e-12)
    assert motion.labels == tuple(f"d{k + 1}" for k in moving)


def test_joints_that_move_and_joints_that_are_held() -> None:
    """Held joints rest at zero, or at the nearest limit: the panda's fourth is below zero always."""
    motion = of_joints(built_in("panda"), [5, 0])
    assert motion.labels == ("panda_joint1", "panda_joint6")
    assert motion.units == ("rad", "rad")
    np.testing.assert_array_equal(motion.matrix, np.eye(7)[:, [0, 5]])
    np.testing.assert_array_equal(motion.offset, [0, 0, 0, -0.0698, 0, 0, 0])
    assert not motion.complete
    moving_too = of_joints(built_in("panda"), [3])
    np.testing.assert_array_equal(moving_too.offset, np.zeros(7))  # its coordinate is the joint's
    assert of_joints(built_in("panda"), range(7)).complete
    assert of_joints(three_axes(), [2, 1, 0, 1]).complete


def test_units_of_the_moving_coordinates() -> None:
    robot = coupled(0, "rp").replace(transmission=None)
    assert of_joints(robot, [0, 1]).units == ("rad", "m")
    drives = (Drive("turn"), Drive("slide"))
    robot = robot.replace(transmission=Transmission(np.eye(2), drives, Limits.none(2)))
    assert of_drives(robot, ["turn", "slide"]).units == ("rad", "m")
    labels = PartialModel(DifferentialModel(robot), of_drives(robot, ["slide"])).row_labels
    assert labels == (("slide", "N"),)


def test_robots_without_a_transmission_have_a_drive_per_joint() -> None:
    robot = built_in("panda")
    assert drive_names(robot) == robot.joint_names
    for moving in (["2"], ["panda_joint4", "1"]):
        ours = of_drives(robot, moving)
        theirs = of_joints(robot, [robot.joint_index(name) for name in moving])
        assert (ours.labels, ours.units) == (theirs.labels, theirs.units)
        np.testing.assert_array_equal(ours.matrix, theirs.matrix)
        np.testing.assert_array_equal(ours.offset, theirs.offset)


@given(seed=SEED, data=st.data())
@settings(max_examples=30)
def test_states_of_a_motion_are_states_that_it_can_have(seed: int, data: st.DataObject) -> None:
    """They lie in q0 + range N with rates in range N, held drives stand, and those that did so already stay."""
    robot = data.draw(st.sampled_from([three_axes(), built_in("irp6"), coupled(seed)]))
    names = drive_names(robot)
    moving = data.draw(st.lists(st.sampled_from(names), min_size=1, unique=True))
    motion = of_drives(robot, moving)
    states = motion.states(random_states(robot, 20, seed=seed))
    held = [k for k, name in enumerate(names) if name not in moving]
    for x, place in ((states.q, motion.offset), (states.dq, 0.0), (states.ddq, 0.0)):
        s = np.linalg.lstsq(motion.matrix, (x - place).T, rcond=None)[0]
        np.testing.assert_allclose((motion.matrix @ s).T + place, x, atol=1e-10)
        np.testing.assert_allclose(((x - place) @ coupling(robot).T)[:, held], 0.0, atol=1e-10)
    again = motion.states(states)
    np.testing.assert_allclose(again.q, states.q, atol=1e-10)
    np.testing.assert_allclose(again.dq, states.dq, atol=1e-10)
    assert np.linalg.matrix_rank(states.dq, tol=1e-8) == len(moving)


@pytest.mark.parametrize("moving", [c for size in (1, 4) for c in combinations("12345", size)], ids="".join)
def test_held_drives_show_no_friction(moving: tuple[str, ...]) -> None:
    """``C N`` is exactly one or zero, so that rounding of a held drive's rate, which has a sign, moves nothing."""
    robot = general(built_in("irp6"))
    motion = of_drives(robot, moving)
    np.testing.assert_array_equal(coupling(robot) @ motion.matrix, np.eye(5)[:, [int(k) - 1 for k in moving]])
    states = motion.states(random_states(robot, 50, seed=1))
    held = [k for k in "12345" if k not in moving]
    torque, energy = PartialModel(DifferentialModel(robot), motion), EnergyModel(robot)
    columns = [torque.names.index(f"F{k}{kind}") for k in held for kind in "cv"]
    assert not torque.instants(states)[:, columns].any()
    np.testing.assert_allclose(energy.instants(states)[:, columns], 0.0, atol=1e-15)
    shown = base_parameters(torque, states=states).names
    assert {name for name in shown if name[0] == "F"} == {f"F{k}{kind}" for k in moving for kind in "cv"}


# --- the model seen by the moving coordinates ------------------------------------------------------------------------


@given(seed=SEED, data=st.data())
@settings(max_examples=20)
def test_rows_are_those_of_the_moving_coordinates(seed: int, data: st.DataObject) -> None:
    """``N' Y``, so that the power of the moving coordinates' torques is that of the joints', ``ds' N' Y = dq' Y``."""
    robot = coupled(seed)
    moving = data.draw(st.lists(st.sampled_from(drive_names(robot)), min_size=1, unique=True))
    motion, model = of_drives(robot, moving), DifferentialModel(robot)
    seen = PartialModel(model, motion)
    states = motion.states(random_states(robot, 10, seed=seed))
    Y = model.instants(states).reshape(10, robot.n, -1)
    found = seen.instants(states).reshape(10, len(moving), -1)
    np.testing.assert_allclose(found, np.einsum("jk,njp->nkp", motion.matrix, Y), atol=1e-12 * np.abs(Y).max())
    ds = np.linalg.lstsq(motion.matrix, states.dq.T, rcond=None)[0].T
    power = np.einsum("nj,njp->np", states.dq, Y)
    np.testing.assert_allclose(np.einsum("nk,nkp->np", ds, found), power, atol=1e-10 * np.abs(Y).max())
    np.testing.assert_array_equal(seen.assemble(states), found.reshape(-1, len(model.columns)))


# --- ranks -----------------------------------------------------------------------------------------------------------

# Identifiable parameters of each subset of motors (shared/paper/errata.md), as combinations of standard ones.
X1, X3, X4 = "I1zz + I2xx + I3yy + n1^2 Ia1", "I2zz + l2^2 m3 + I3zz + n2^2 Ia2 + n3^2 Ia3", "I3zz + n3^2 Ia3"
X2, X5, X6, X7 = "-I2xx + I2yy + l2^2 m3 + I3xx - I3yy", "-I3xx + I3yy", "m3c3x", "m2c2x + l2 m3"
X2_AND_X5 = "-I2xx + I2yy + l2^2 m3"
X3_LESS_X4 = "I2zz + l2^2 m3 + n2^2 Ia2"  # [KD96] section 5: what the second movement shows
MOTORS = {
    "123": (13, [X1, X2, X3, X4, X5, X6, X7]),
    "2": (4, [X3_LESS_X4, X7]),
    "3": (4, [X4, X6]),
    "13": (8, [X1, X4, X5, X6]),
    "23": (8, [X3, X4, X6, X7]),
    "12": (9, [X1, X2_AND_X5, X3_LESS_X4, X6, X7]),  # with the forearm held at one angle, see below
}


def models(motion: PartialMotion) -> dict[str, RegressorModel]:
    """Both models of the IRp-6's first three axes, as a motion sees them."""
    robot = three_axes()
    return {"energy": EnergyModel(robot), "differential": PartialModel(DifferentialModel(robot), motion)}


@pytest.mark.parametrize("model", ["energy", "differential"])
@pytest.mark.parametrize("motors", MOTORS)
def test_tasks_find_the_same(motors: str, model: str) -> None:
    """Through the options of ``excite design``: ``--drives 1,3 --model energy``."""
    target = target_of(built_in("irp6"), Task("irp6", drives=tuple(motors), model=model))
    rank, inertial = MOTORS[motors]
    assert target.base.rank == rank
    assert list(target.base.expressions[: len(inertial)]) == inertial
    assert target.motion.labels == tuple(f"z{k}" for k in motors)


def numerical_rank(W: Array) -> int:
    """Singular values above 1e-9 of the largest, columns of equal length; between them and the rest is a gap."""
    sizes = np.linalg.norm(W, axis=0)
    sigma = np.linalg.svd(W / np.where(sizes > 1e-10 * sizes.max(), sizes, np.inf), compute_uv=False)
    counted = sigma > 1e-9 * sigma[0]
    assert sigma[counted][-1] > 1e-6 * sigma[0]
    assert np.all(sigma[~counted] < 1e-11 * sigma[0])
    return int(counted.sum())


# Joints 1 and 2, joint 3 held: d_5 = 1/2 (sin^2 q2 - sin^2(q2 + q3)) dq1^2 vanishes for q3 = 0, and only there.
JOINTS = {
    ("123", 0.0): 13,
    ("12", 0.0): 9,
    ("12", 0.3): 10,
    ("13", 0.0): 8,
    ("23", 0.0): 8,
    ("2", 0.0): 5,
    ("3", 0.0): 4,
}


@pytest.mark.parametrize("joints", JOINTS, ids=str)
def test_what_a_subset_of_joints_shows(joints: tuple[str, float]) -> None:
    """The forearm turns with the arm when joint 3 is held, and so does its drive: F2c + F3c, F2v + F3v are seen."""
    names, held = joints
    motion = of_joints(three_axes(), [int(k) - 1 for k in names])
    motion = dataclasses.replace(motion, offset=np.array([0.0, 0.0, 0.0 if "3" in names else held]))
    states = motion.states(random_states(three_axes(), 300, seed=10))
    assert numerical_rank(rates(states.q, states.dq, states.ddq)) == JOINTS[joints]
    for model in models(motion).values():
        assert base_parameters(model, states=states).rank == JOINTS[joints]
        if held == 0.0:
            kind = "energy" if isinstance(model, EnergyModel) else "differential"
            target = target_of(built_in("irp6"), Task("irp6", joints=tuple(names), model=kind))
            assert target.base.rank == JOINTS[joints]
            assert target.motion.labels == tuple(f"q{k}" for k in names)


# --- motors 1 and 2: nine parameters, or ten -------------------------------------------------------------------------


def rates(q: Array, dq: Array, ddq: Array) -> Array:
    """Rates of d_1 ... d_13 of the corrected table (shared/paper/errata.md), in plain NumPy, by the complex step."""
    step = 1e-30
    energies = table_energies((q + 1j * step * dq).T, (dq + 1j * step * ddq).T)
    dz = dq @ np.array([[1, 0, 0], [0, 1, 1], [0, 0, 1]])
    return np.hstack([np.imag(np.column_stack(energies)) / step, np.abs(dz), dz**2])


HELD = {(0.0,): 9, (0.3,): 9, (-0.5,): 9, (0.3, -0.3): 9, (0.0, 0.3): 10, (-0.5, 0.0, 0.3): 10}


@pytest.mark.parametrize("angles", HELD, ids=str)
def test_motors_1_and_2_show_ten_parameters_only_over_two_angles_of_the_forearm(angles: tuple[float, ...]) -> None:
    """Errata.md says 10; with the forearm held at one angle, it is 9.

    d_5 = 1/2 (sin^2 q2 - sin^2 z3) dq1^2 with z3 = q2 + q3, and motor 3 holds z3. At one angle, then,
    d_5 = d_2 - sin^2(z3) d_1, and X_5 cannot be told from X_1 and X_2: 9 parameters. Runs at angles whose sin^2
    differ tell them apart: 10, and no more, since d_4 = -d_3 remains. Angles z3 and -z3 are not enough.
    """
    states = random_states(three_axes(), 300, seed=5)
    rows = []
    for angle in angles:
        motion = dataclasses.replace(of_drives(three_axes(), ["1", "2"]), offset=np.array([0.0, 0.0, angle]))
        moved = motion.states(states)
        np.testing.assert_allclose(moved.q[:, 1] + moved.q[:, 2], angle, atol=1e-14)
        by_models = (model.instants(moved) for model in models(motion).values())
        rows.append([rates(moved.q, moved.dq, moved.ddq), *by_models])
    for W in zip(*rows, strict=True):  # by the table, by the energy, by the torques
        assert numerical_rank(np.vstack(W)) == HELD[angles]


# --- limits ----------------------------------------------------------------------------------------------------------


def test_motor_2_alone_is_limited_by_what_it_moves() -> None:
    """It turns joints 2 and 3; the forearm's orientation does not change, so drive 3 has no limit to keep."""
    robot = built_in("irp6")
    restricted = [limit.restricted(of_drives(robot, ["2"])) for limit in linear_limits(robot)]
    labels = {label for limit in restricted for label in limit.labels}
    assert labels == {"joint q2 position", "joint q3 position", "drive z2 velocity", "drive z2 acceleration"}


# --- bad input -------------------------------------------------------------------------------------------------------


def test_drives_and_joints_that_cannot_move() -> None:
    robot = built_in("irp6")
    with pytest.raises(UnknownName, match=r"no drive named 'z9'; available: 1 \(z1\), 2 \(z2\)"):
        of_drives(robot, ["z9"])
    for number in ("0", "6", "-1", "2.0", ""):
        with pytest.raises(UnknownName, match="no drive named"):
            of_drives(robot, ["1", number])
    with pytest.raises(UnknownName, match="no equation named 'z1'"):
        PartialModel(DifferentialModel(robot), of_drives(robot, ["2", "3"]), ["z1"])
    assert r"no joint moves; choose from q1, q2, q3, q4, q5" in refusal(of_joints, robot, [])
    assert r"no drive moves; choose from z1, z2, z3, z4, z5" in refusal(of_drives, robot, [])
    assert "`joints` and `drives` exclude each other" in refusal(Task, "irp6", joints=("1",), drives=("1",))
    with pytest.raises(UnknownName, match="no joint named 'elbow'"):
        of_drives(built_in("panda"), ["elbow"])
    with pytest.raises(UnknownName, match=r"no drive named '4'; available: 1 \(z1\), 2 \(z2\), 3 \(z3\)"):
        of_drives(three_axes(), ["4"])
    with pytest.raises(UnknownName, match="no joint named 'q9'"):
        target_of(robot, Task("irp6", joints=("q9",)))
    with pytest.raises(UnknownName, match="no drive named 'q2'"):
        target_of(robot, Task("irp6", drives=("q2",)))


def test_drives_that_do_not_fix_the_joints() -> None:
    robot = coupled(1)
    C = robot.transmission.coupling.copy()
    C[2] = C[0] + C[1]
    singular = robot.replace(transmission=dataclasses.replace(robot.transmission, coupling=C))
    few = Transmission(C[:2], robot.transmission.drives[:2], Limits.none(2))
    for broken in (singular, robot.replace(transmission=few)):
        assert "drives do not fix its 3 joints" in refusal(of_drives, broken, ["d1"])
