"""Friction curves in torque limits: what bounds them, and that torques within the limits leave room for friction."""

from __future__ import annotations

import dataclasses
import itertools
import re

import numpy as np
import pytest
from friction_curves import TUSTIN, without_friction
from hypothesis import given, settings, strategies as st
from pinocchio_chains import drive_torques, joint_torques
from refused import refusal
from slow_dynamics import random_chain

from constraints.drive_friction import DriveFriction, drive_friction, friction_bound
from constraints.torque import torque_limits
from regressors.errors import InputError, UnknownName
from regressors.models.nominal import standard_values
from regressors.models.partial import of_joints
from regressors.readers.library import built_in
from regressors.robot.friction.curve import (
    CoulombViscous,
    FrictionCurve,
    FunctionFriction,
    Scaled,
    Stribeck,
    TableFriction,
)
from regressors.robot.friction.curves import FrictionCurves, Side
from regressors.robot.friction.load_and_temperature import Loaded, Slope, Warm
from regressors.robot.robot import Drive, Limits, Robot, Transmission
from regressors.samples import Array, Samples

INF = np.inf
# the second joint of [KD96] section 5.2 breaks away at 16.8 and 10.6 Nm
RISING = Stribeck(Side(28.0, 26.0, 18.0, 0.3, 2.0), Side(30.0, 30.0, 14.1, 0.2, 1.0), -2.0)
TABLE = TableFriction([-1.0, -0.2, 0.1, 0.5], [-60.0, -19.0, 22.0, 35.0])
CURVES: dict[str, FrictionCurve] = {
    "coulomb-viscous": CoulombViscous(28.75, 26.0, -0.7),
    "falling": TUSTIN,
    "rising": RISING,
    "table": TABLE,
    "odd table": TableFriction([0.05, 0.3, 1.0], [12.0, 10.0, 20.0]),
    "scaled": Scaled(TUSTIN, 1.5),
    "opposite": Scaled(RISING, -0.5),
}
FASTEST = 1.2


def rest(curve: FrictionCurve, viscous: float) -> Array:
    """What is left of friction beside a viscous part, at all speeds in all directions that are told of."""
    speed = np.linspace(0.0, FASTEST, 2401)
    v = np.concatenate([-speed, speed])
    directions = [np.full(v.size, s) for s in np.linspace(-1.0, 1.0, 21)]
    if isinstance(curve, TableFriction):
        directions = [np.where(v == 0, s, np.sign(v)) for s in directions]
    return np.concatenate([curve.torque(v, s) - viscous * v for s in directions])


@pytest.mark.parametrize("name", CURVES)
def test_friction_lies_within_its_bound(name: str) -> None:
    bound = friction_bound(CURVES[name], FASTEST)
    left = rest(CURVES[name], bound.viscous)
    assert bound.lower - 1e-12 <= left.min() <= left.max() <= bound.upper + 1e-12
    if name in ("coulomb-viscous", "table", "odd table"):  # where it is reached
        assert (left.min(), left.max()) == pytest.approx((bound.lower, bound.upper), abs=1e-9)


OIL = (Slope(-0.11, -0.3), Slope(-0.2, -0.1))
WARM = {
    "coulomb-viscous": Warm(CURVES["coulomb-viscous"], 32.0, OIL[0], range=(20.0, 45.0)),
    "sides of their own": Warm(CURVES["coulomb-viscous"], 25.0, *OIL, range=(20.0, 45.0)),
    "rising": Warm(RISING, 45.0, *OIL, range=(20.0, 45.0)),
    "more viscous when warm": Warm(CURVES["coulomb-viscous"], 32.0, Slope(0.1, 0.3), range=(20.0, 45.0)),
    "table": Warm(TABLE, 32.0, *OIL, range=(20.0, 45.0)),
}


@pytest.mark.parametrize("name", WARM)
def test_friction_lies_within_its_bound_at_every_temperature(name: str) -> None:
    """Where it was measured; the bound at one temperature alone would not do."""
    curve = WARM[name]
    bound = friction_bound(curve, FASTEST)
    speed = np.linspace(0.0, FASTEST, 601)
    v = np.concatenate([-speed, speed])
    s = np.repeat([-1.0, 1.0], speed.size)
    left = [curve.torque_at(v, T, s) - bound.viscous * v for T in np.linspace(20.0, 45.0, 11)]
    assert bound.lower - 1e-12 <= np.min(left) <= np.max(left) <= bound.upper + 1e-12
    alone = friction_bound(dataclasses.replace(curve, range=None), FASTEST)
    assert alone.upper - alone.lower < bound.upper - bound.lower


@pytest.mark.parametrize(
    ("curve", "fastest", "expected"),
    [
        (CoulombViscous(3.0, 2.0, 0.5), INF, (2.0, -2.5, 3.5)),
        (Stribeck(Side(20.0, 5.0, 10.0, 1.0, 1.0)), 1.0, (5.0, -16.321206, 16.321206)),  # 20 - 10 / e
        (Stribeck(Side(20.0, 5.0, 10.0, 1.0, 1.0)), INF, (5.0, -20.0, 20.0)),
        # viscous friction 23 +- 3 |v|: what is more than 23 v counts upward, where the torque is positive
        (TUSTIN, 0.5, (23.0, 0.4 - 10.6, 0.4 + 16.8 + 1.5)),
        (TABLE, INF, (0.0, -60.0, 35.0)),
        (TableFriction([0.5], [7.0]), 2.0, (0.0, -7.0, 7.0)),
    ],
)
def test_bounds_by_hand(curve: FrictionCurve, fastest: float, expected: tuple[float, float, float]) -> None:
    assert dataclasses.astuple(friction_bound(curve, fastest)) == pytest.approx((*expected, 0.0), abs=1e-6)


UNBOUNDED = (
    (TUSTIN, INF, "viscous friction that differs between the directions has no bound without a"),
    (WARM["coulomb-viscous"], INF, "viscous friction that depends on temperature has no bound without a velocity"),
    (WARM["table"], INF, "a table of friction that depends on temperature has no bound without a veloc"),
    (FunctionFriction(np.tanh), 1.0, "a friction curve of type FunctionFriction has no known bound .*; give a table"),
)


@pytest.mark.parametrize(("curve", "fastest", "message"), UNBOUNDED)
def test_friction_without_a_bound(curve: FrictionCurve, fastest: float, message: str) -> None:
    assert re.search(message, refusal(friction_bound, curve, fastest))


# --- torque limits ---------------------------------------------------------------------------------------------------


def states(robot: Robot, count: int, size: float) -> Samples:
    """Random ones within the velocity limits of the IRp-6's drives, with accelerations about their limits."""
    rng = np.random.default_rng(5)
    limits, C = robot.transmission.limits, robot.transmission.coupling
    dz, ddz = (x * rng.uniform(-1, 1, (count, 5)) for x in (limits.velocity, size * limits.acceleration))
    q = rng.uniform(-0.6, 0.6, (count, 5))
    return Samples(np.arange(float(count)), q, *(x @ np.linalg.inv(C).T for x in (dz, ddz, 0 * ddz)))


VELOCITY = (1.266, 1.137, 1.137, 1.563, 2.604)
TORQUE = (331.8, 210.9, 215.6, 201.6, 64.5)
OF_DRIVES: dict[str, FrictionCurve] = {
    "z1": RISING,
    "z2": TUSTIN,
    "z3": TABLE,
    "z4": CURVES["odd table"],
    "z5": CoulombViscous(5.0, 3.0, 1.0),
}


@pytest.mark.parametrize("share", [0.0, 0.15])
def test_torques_within_the_limits_leave_room_for_friction(share: float) -> None:
    """Total torques by Pinocchio and the curves themselves; no known friction counts beside that of a curve."""
    robot, bare = built_in("irp6"), without_friction(built_in("irp6"))
    known = {name: Loaded(curve, share, 0.5 * share) for name, curve in OF_DRIVES.items()} if share else OF_DRIVES
    (limit,) = torque_limits(robot, standard_values(robot), 0.5, friction=FrictionCurves(known))
    samples = states(robot, 400, 25.0)
    dz = samples.dq @ robot.transmission.coupling.T
    viscous = [friction_bound(curve, v).viscous for curve, v in zip(OF_DRIVES.values(), VELOCITY, strict=True)]
    values, moving = limit.values(samples), drive_torques(bare, samples)
    np.testing.assert_allclose(values, (1 + share) * moving + viscous * dz, atol=1e-6)
    total = moving + np.column_stack([curve.torque(dz[:, k]) for k, curve in enumerate(OF_DRIVES.values())])
    total += np.where(dz > 0, share, -0.5 * share) * np.abs(moving)
    held = (values >= limit.lower) & (values <= limit.upper)
    assert 0.2 < held[:, :3].mean() < 0.95
    assert np.all(np.abs(total)[held] <= 0.5 * np.tile(TORQUE, (400, 1))[held])


def test_drives_without_a_curve_keep_the_friction_of_the_description() -> None:
    robot = built_in("irp6")
    one, known = FrictionCurves({"z2": CoulombViscous(40.0, 26.0, 1.0)}), standard_values(robot)
    plain, partly = (torque_limits(robot, known, 0.1, friction=friction)[0] for friction in (None, one))
    np.testing.assert_allclose(partly.upper - plain.upper, [0, 28.75 - 41.0, 0, 0, 0])
    np.testing.assert_allclose(partly.lower - plain.lower, [0, 39.0 - 28.75, 0, 0, 0])
    samples = states(robot, 20, 1.0)
    np.testing.assert_array_equal(partly.values(samples), plain.values(samples))
    np.testing.assert_array_equal(partly.scale, 0.5 * (partly.upper - partly.lower))


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_joints_of_a_robot_without_a_transmission(share: float) -> None:
    robot = built_in("ur10e")
    curve = CoulombViscous(10.0, 4.0, -2.0)
    known = FrictionCurves({robot.joint_names[1]: Loaded(curve, 0.0, share) if share else curve})
    (limit,) = torque_limits(robot, standard_values(robot), 0.2, friction=known)
    q, dq, ddq = np.random.default_rng(1).uniform(-2, 2, (3, 30, 6))
    samples = Samples(np.arange(30.0), q, dq, ddq, 0 * q)
    expected = joint_torques(robot, samples)
    expected[:, 1] = (1 + share) * expected[:, 1] + 4.0 * dq[:, 1]
    np.testing.assert_allclose(limit.values(samples), expected, atol=1e-9)
    np.testing.assert_allclose(limit.upper - 0.8 * robot.limits.torque, [0, -8.0, 0, 0, 0, 0], atol=1e-9)
    largest = drive_friction(robot, {}, of_joints(robot, range(6)), known).largest[1]
    assert largest == pytest.approx(4.0 * robot.limits.velocity[1] + 12.0)
    np.testing.assert_allclose(limit.lower + 0.8 * robot.limits.torque, [0, 12.0, 0, 0, 0, 0], atol=1e-9)


@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1))
def test_friction_counts_at_its_worst_behind_a_coupling(seed: int) -> None:
    """The joints' bounds are those of every choice of both ends of the drives' friction, and no more."""
    rng = np.random.default_rng(seed)
    chain, C = random_chain("rpr", rng), rng.normal(size=(3, 3)) + 2 * np.eye(3)
    maximum, none = rng.uniform(500, 900, 3), Limits.none(3)
    drives = tuple(Drive(f"z{k}") for k in range(1, 4))
    limits = dataclasses.replace(none, torque=maximum)
    robot = chain.replace(limits=limits, transmission=Transmission(C, drives, none))
    curves = {f"z{k}": CoulombViscous(*rng.uniform(0, 5, 2), rng.uniform(-9, 9)) for k in range(1, 4)}
    (limit,) = torque_limits(robot, {}, 0.25, friction=FrictionCurves(curves))
    ends = [(c.offset - c.coulomb, c.offset + c.coulomb) for c in curves.values()]
    worst = np.array(list(itertools.product(*ends))) @ C
    np.testing.assert_allclose(0.75 * maximum - limit.upper, worst.max(axis=0))
    np.testing.assert_allclose(-0.75 * maximum - limit.lower, worst.min(axis=0))


def test_the_speed_of_a_drive_is_bounded_by_the_joints() -> None:
    """Of z = q1 - 2 q2 with joints of 0.3 and 0.1 rad/s; its own limit is looser."""
    none = dataclasses.replace(Limits.none(2), torque=np.full(2, 900.0))
    joints, of_drives = (dataclasses.replace(none, velocity=np.array(v)) for v in ([0.3, 0.1], [0.9, INF]))
    transmission = Transmission(np.array([[1.0, -2.0], [0.0, 1.0]]), (Drive("z1"), Drive("z2")), of_drives)
    robot = random_chain("rr", np.random.default_rng(0)).replace(limits=joints, transmission=transmission)
    _, drives = torque_limits(robot, {}, 0.0, friction=FrictionCurves({"z1": TUSTIN}))
    np.testing.assert_allclose(900.0 - drives.upper, [0.4 + 16.8 + 3.0 * 0.5, 0.0])


def test_a_drive_of_any_speed_says_nothing_of_joints_that_it_does_not_move() -> None:
    robot, largest = built_in("irp6"), np.array([np.inf, 1.0, 1.0, 1.0, 1.0])
    found = DriveFriction({}, np.zeros((5, 2)), np.zeros(5), largest).at_joints(robot).largest
    np.testing.assert_allclose(found, [np.inf, *np.abs(robot.transmission.coupling)[1:, 1:].sum(axis=0)])


LARGE = Loaded(CoulombViscous(5.0, 20.0), 0.1)
REFUSED: dict[str, tuple[object, type[InputError], str]] = {
    "z9": (TUSTIN, UnknownName, "no drive named 'z9'; available: z1, z2, z3, z4, z5"),
    "z2": (np.tanh, InputError, "torque limits: friction curve of z2: a friction curve of type"),
    "z5": (
        LARGE,
        InputError,
        "drive z5 torque: friction of 57.08 Nm exceeds the limit of 64.5 Nm less a margin of 15 %",
    ),
}


@pytest.mark.parametrize("drive", REFUSED)
def test_curves_that_torque_limits_refuse(drive: str) -> None:
    (curve, kind, message), robot = REFUSED[drive], built_in("irp6")
    with pytest.raises(kind, match=f"^{message}"):
        torque_limits(robot, standard_values(robot), 0.15, friction=FrictionCurves({drive: curve}))


def test_loads_of_drives_do_not_tell_those_of_coupled_joints() -> None:
    robot = built_in("irp6")
    curves = FrictionCurves({"z2": Loaded(TUSTIN, 0.1)})
    limits = dataclasses.replace(robot.limits, torque=np.array([300.0, np.inf, np.inf, np.inf, np.inf]))
    with pytest.raises(InputError, match="friction grows with the load of its drives, so it cannot be computed per"):
        torque_limits(robot.replace(limits=limits), standard_values(robot), 0.0, friction=curves)
