"""Limits as linear functions of the motion, their certificates, and what is said where they contradict each other."""

from __future__ import annotations

import dataclasses
import itertools
import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import linprog
from slow_dynamics import random_chain

from constraints.certificate import Extrema, LimitUse, limit_uses
from constraints.diagnosis import ContradictionError, interior_pose
from constraints.linear import LinearConstraint, linear_limits
from excite.trajectories import Fourier, Trajectory
from regressors.models.partial import PartialMotion
from regressors.readers.library import built_in, load_robot
from regressors.robot.locked_joints import with_locked_joints
from regressors.robot.robot import Drive, Limits, Robot, Transmission
from regressors.samples import Array, Samples

SEED = st.integers(0, 2**32 - 1)
INF = np.inf


def robot_with(limits: Limits, drives: Limits | None = None, coupling: Array | None = None, kinds: str = "") -> Robot:
    """A chain of which only the limits matter."""
    n = limits.lower.size
    robot = random_chain(kinds or "r" * n, np.random.default_rng(0)).replace(limits=limits)
    if drives is None or coupling is None:
        return robot
    made = tuple(Drive(f"z{k + 1}") for k in range(len(coupling)))
    return robot.replace(transmission=Transmission(coupling, made, drives))


def positions(*ranges: tuple[float, float]) -> Limits:
    lower, upper = np.array(ranges, dtype=float).T
    return dataclasses.replace(Limits.none(len(ranges)), lower=lower, upper=upper)


# --- one form for all ------------------------------------------------------------------------------------------------


def table(constraints: tuple[LinearConstraint, ...]) -> list[tuple[str, str, float, float]]:
    return [row for c in constraints for row in zip(c.labels, c.units, c.lower.tolist(), c.upper.tolist(), strict=True)]


def test_limits_of_a_robot_with_and_without_each_kind() -> None:
    ranges, rates = (
        positions((-1.0, 2.0), (-INF, INF), (0.0, 0.5)),
        {"velocity": [INF, 3.0, 0.2], "jerk": [INF, INF, 50.0]},
    )
    limits = dataclasses.replace(ranges, **rates, torque=[10.0, 10.0, 10.0])
    drives = dataclasses.replace(positions((-9.0, 9.0), (-8.0, 8.0)), acceleration=[7.0, INF])
    robot = robot_with(limits, drives, np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 2.0]]), kinds="rrp")
    assert table(linear_limits(robot)) == [
        ("joint j1 position", "rad", -1.0, 2.0),
        ("joint j3 position", "m", 0.0, 0.5),
        ("joint j2 velocity", "rad/s", -3.0, 3.0),
        ("joint j3 velocity", "m/s", -0.2, 0.2),
        ("joint j3 jerk", "m/s^3", -50.0, 50.0),
        ("drive z1 position", "rad", -9.0, 9.0),
        ("drive z2 position", "m", -8.0, 8.0),
        ("drive z1 acceleration", "rad/s^2", -7.0, 7.0),
    ]
    quantities = [c.quantity for c in linear_limits(robot)]
    assert quantities == ["position", "velocity", "jerk", "position", "acceleration"]


@given(SEED)
@settings(max_examples=25)
def test_limits_of_a_partial_motion_are_those_of_the_joints_that_it_moves(seed: int) -> None:
    """``A (N s + q0) + a0`` at random s and s' = ds: the same values, and only functions that stand are left out."""
    rng = np.random.default_rng(seed)
    n, k = 4, 2
    N = rng.normal(size=(n, k)) * (rng.random((n, 1)) < 0.6)
    motion = PartialMotion(("s1", "s2"), ("rad", "rad"), N, rng.normal(size=n))
    A, offset = rng.integers(-1, 2, (5, n)).astype(float), rng.normal(size=5)
    s = rng.normal(size=(4, 6, k))
    joints = Samples(np.arange(6.0), s[0] @ N.T + motion.offset, *(part @ N.T for part in s[1:]))
    for d in range(4):
        names = tuple("abcde")
        whole = LinearConstraint(d, A, offset, -np.arange(1.0, 6), np.arange(1.0, 6), names, ("rad",) * 5)
        part, values = whole.restricted(motion), whole.values(joints)
        moving = [name for name, row in zip(names, A @ N, strict=True) if np.abs(row).max() > 1e-9]
        assert list(part.labels) == moving
        kept = [names.index(name) for name in moving]
        np.testing.assert_allclose(part.values(Samples(np.arange(6.0), *s)), values[:, kept], atol=1e-12)
        np.testing.assert_array_equal([part.lower, part.upper], [whole.lower[kept], whole.upper[kept]])


# --- certificates ----------------------------------------------------------------------------------------------------


def certificate(lower: float, upper: float, low: float, high: float) -> LimitUse:
    one = np.ones(1)
    constraint = LinearConstraint(0, np.eye(1), 0 * one, lower * one, upper * one, ("joint a position",), ("rad",))
    (use,) = limit_uses(constraint, Extrema(low * one, high * one, 1.5 * one, 2.5 * one))
    return use


CERTIFICATES = {
    "closer to the upper bound": ((-1, 3, 0.0, 2.5), (2.5, 2.5, 3.0, 0.5, 0.75)),
    "closer to the lower bound": ((-1, 3, -0.5, 1.0), (-0.5, 1.5, -1.0, 0.5, 0.75)),
    "on the bound": ((-2, 2, -1.0, 2.0), (2.0, 2.5, 2.0, 0.0, 1.0)),
    "beyond the upper bound": ((-2, 2, -1.0, 2.5), (2.5, 2.5, 2.0, -0.5, 1.25)),
    "beyond both, further below": ((-2, 2, -3.0, 2.5), (-3.0, 1.5, -2.0, -1.0, 1.5)),
    "bounded above alone": ((-INF, 4, -100.0, 3.0), (3.0, 2.5, 4.0, 1.0, 0.75)),
}


@pytest.mark.parametrize("case", CERTIFICATES.values(), ids=CERTIFICATES.keys())
def test_certificate(case: tuple) -> None:
    given_, (extreme, time, bound, margin, use) = case
    found = certificate(*given_)
    assert (found.extreme, found.time, found.bound, found.margin, found.use) == (extreme, time, bound, margin, use)
    assert found.holds == (margin >= 0)
    assert found.to_dict() == {**dataclasses.asdict(found), "holds": found.holds}
    assert (found.label, found.unit) == ("joint a position", "rad")


@pytest.mark.parametrize(("excess", "holds"), [(0.9e-9, True), (1.1e-9, False), (1e-6, False)])
def test_a_limit_holds_to_a_billionth_of_itself(excess: float, holds: bool) -> None:
    for bound in (0.002, 1.0, 4000.0):
        assert certificate(-bound, bound, 0.0, bound * (1 + excess)).holds is holds
        assert certificate(-bound, bound, -bound * (1 + excess), 0.0).holds is holds


@given(SEED)
@settings(max_examples=25)
def test_certificates_of_a_motion_are_true_everywhere(seed: int) -> None:
    """Margins from exact extrema, against densely sampled values."""
    rng = np.random.default_rng(seed)
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    family = Fourier(8.0, 4)
    trajectory = Trajectory(family, 0.2 * rng.normal(size=(3, family.size)))
    samples = trajectory.samples(np.linspace(0, 8, 3001))
    for constraint in linear_limits(robot):
        values = constraint.values(samples)
        room = np.minimum(constraint.upper - values, values - constraint.lower).min(axis=0)
        for use, smallest in zip(limit_uses(constraint, trajectory.extrema(constraint)), room, strict=True):
            assert use.margin <= smallest + 1e-12
            assert use.margin == pytest.approx(smallest, abs=1e-4)
            at = constraint.values(trajectory.samples(np.array([use.time])))[0, constraint.labels.index(use.label)]
            assert use.extreme == pytest.approx(at, abs=1e-12)
            assert use.margin == pytest.approx(abs(use.bound - at) * np.sign(use.margin), abs=1e-12)


# --- a pose inside ---------------------------------------------------------------------------------------------------


def room(limits: tuple[LinearConstraint, ...], poses: Array) -> Array:
    """Smallest part of the half range left between each pose and any position bound."""
    parts = []
    for limit in limits:
        if limit.derivative == 0:
            value = poses @ limit.matrix.T + limit.offset
            middle, half = (limit.upper + limit.lower) / 2, (limit.upper - limit.lower) / 2
            parts.append(1 - np.abs(value - middle) / half)
    return np.hstack(parts).min(axis=1)


@given(SEED)
@settings(max_examples=20)
def test_no_other_pose_has_more_room(seed: int) -> None:
    """Against a fine grid of poses of two joints whose drives couple them."""
    rng = np.random.default_rng(seed)
    centre = rng.normal(size=(3, 1))
    drives = positions(*(centre[:2] + rng.uniform(0.2, 2.0, (2, 1)) * [-1, 1]))
    robot = robot_with(positions((-1, 1), (-1.5, 0.5)), drives, rng.uniform(0.5, 1.5, (2, 2)))
    robot = robot.replace(transmission=dataclasses.replace(robot.transmission, offset=rng.normal(0.0, 0.5, 2)))
    limits = linear_limits(robot)
    poses = np.array(list(itertools.product(np.linspace(-1, 1, 101), np.linspace(-1.5, 0.5, 101))))
    best = room(limits, poses).max()
    try:
        pose = interior_pose(limits, 2)
    except ContradictionError:
        assert best <= 1e-9
        return
    assert room(limits, pose[None])[0] >= best - 1e-9
    assert room(limits, pose[None])[0] > 0


def test_joints_without_position_limits_are_at_zero() -> None:
    limits = linear_limits(robot_with(positions((-INF, INF), (1, 2), (-INF, INF))))
    np.testing.assert_allclose(interior_pose(limits, 3), [0.0, 1.5, 0.0], atol=1e-9)
    np.testing.assert_array_equal(interior_pose((), 2), [0.0, 0.0])


@pytest.mark.parametrize("bounds", [(-2.0, 1e20), (-1e20, 1e20), (-1e20, -2.0), (1.0, 1e19), (-1e300, 3.0)])
def test_bounds_that_solvers_take_for_infinite_have_a_pose(bounds: tuple[float, float]) -> None:
    limits = linear_limits(robot_with(positions((-1.0, 3.0), bounds)))
    pose = interior_pose(limits, 2)
    assert pose[0] == pytest.approx(1.0)
    assert bounds[0] < pose[1] < bounds[1]


# --- contradictions --------------------------------------------------------------------------------------------------


def irp6_with_z3(lower: float, upper: float) -> Robot:
    """The IRp-6's first axes with another range of the forearm's drive, z3 = q2 + q3."""
    robot = with_locked_joints(built_in("irp6"), [0, 1, 2])
    old = robot.transmission
    low, high = old.limits.lower.copy(), old.limits.upper.copy()
    low[2:4], high[2:4] = [lower, -INF], [upper, INF]
    limits = dataclasses.replace(old.limits, lower=low, upper=high)
    return robot.replace(transmission=dataclasses.replace(old, limits=limits))


def explanation(robot: Robot) -> str:
    with pytest.raises(ContradictionError) as caught:
        interior_pose(linear_limits(robot), robot.n)
    return str(caught.value)


def cures(message: str) -> dict[str, float]:
    _, _, text = message.partition("the smallest relaxation widens ")
    return {label: float(size) for label, size in re.findall(r"(?:^| and )(.+? position) by (\S+) (?:rad|m)", text)}


def widened(robot: Robot, sizes: dict[str, float]) -> Robot:
    """The robot with position ranges widened by so much on both sides."""

    def wider(limits: Limits, names: list[str]) -> Limits:
        more = np.array([sizes.get(f"{name} position", 0.0) for name in names])
        return dataclasses.replace(limits, lower=limits.lower - more, upper=limits.upper + more)

    robot = robot.replace(limits=wider(robot.limits, [f"joint {name}" for name in robot.joint_names]))
    old = robot.transmission
    if old is None:
        return robot
    drives = wider(old.limits, [f"drive {drive.name}" for drive in old.drives])
    return robot.replace(transmission=dataclasses.replace(old, limits=drives))


def test_contradiction_is_named_with_its_bounds() -> None:
    message = explanation(irp6_with_z3(2.0, 3.0))
    assert message.startswith("limits contradict each other: no pose has ")
    bounds = ("joint q2 position in [-0.6981, 0.6981] rad", "joint q3 position in", "drive z3 position in [2, 3] rad")
    assert [part for part in bounds if part not in message] == []
    assert "q1" not in message
    assert "\n" not in message


# Lower and upper bound of z3, where q2 + q3 reaches 1.39626 only: gaps of all sizes and roundings.
BOXES = [(2.0, 3.0), (1.5, 4.0), (1.4, 1.42), (-9.0, -1.5123), (1.83749, 2.5), (-3.0, -1.39649)]


@pytest.mark.parametrize("box", BOXES, ids=str)
def test_the_cure_cures_a_little_less_does_not_and_none_is_smaller(box: tuple[float, float]) -> None:
    """As a part of half ranges: the gap over the largest half range of the three that are at fault."""
    robot = irp6_with_z3(*box)
    cure = cures(explanation(robot))
    for factor in (1.0, 1.01):
        interior_pose(linear_limits(widened(robot, {label: factor * size for label, size in cure.items()})), 3)
    explanation(widened(robot, {label: 0.99 * size for label, size in cure.items()}))
    gap = max(box[0] - 2 * 0.69813, -2 * 0.69813 - box[1])
    halves = {"joint q2 position": 0.69813, "joint q3 position": 0.69813, "drive z3 position": (box[1] - box[0]) / 2}
    total = sum(size / halves[label] for label, size in cure.items())
    assert total == pytest.approx(gap / max(halves.values()), rel=6e-3)  # three digits are printed


def test_limits_that_touch_leave_a_single_pose() -> None:
    robot = robot_with(positions((-1, 1)), positions((1, 2)), np.array([[1.0]]))
    touching = "joint j1 position in [-1, 1] rad and drive z1 position in [1, 2] rad"
    assert explanation(robot).endswith(f"{touching}; only a single pose keeps them")


@given(SEED)
@settings(max_examples=40)
def test_a_pose_is_found_or_an_irreducible_contradiction_is_named(seed: int) -> None:
    """Feasibility by a bare linear programme; of the bounds named, any one left out ends the contradiction."""
    rng = np.random.default_rng(seed)
    n, m = 3, 3
    joints, drives = (positions(*(rng.normal(size=(k, 1)) + rng.uniform(0.1, 1, (k, 1)) * [-1, 1])) for k in (n, m))
    C = rng.integers(-1, 2, (m, n)).astype(float)
    C[np.arange(m), np.arange(m)] = 1.0
    robot = robot_with(joints, drives, C)
    limits = linear_limits(robot)
    A, b = np.vstack([C, -C]), np.concatenate([drives.upper, -drives.lower])
    bounds = list(zip(joints.lower, joints.upper, strict=True))
    feasible = linprog(np.zeros(n), A_ub=A, b_ub=b, bounds=bounds, method="highs").success
    try:
        pose = interior_pose(limits, n)
    except ContradictionError as error:
        assert not feasible
        named = re.findall(r"(joint j\d|drive z\d) position in", str(error))
        assert len(named) >= 2
        for left_out in named:
            others = [_only(limit, [name for name in named if name != left_out]) for limit in limits]
            interior_pose([limit for limit in others if limit.labels], n)
        sizes = {label: 1.01 * size for label, size in cures(str(error)).items()}
        interior_pose(linear_limits(widened(robot, sizes)), n)
        return
    assert feasible
    assert room(limits, pose[None])[0] > 0


def _only(limit: LinearConstraint, names: list[str]) -> LinearConstraint:
    """A constraint's rows of these names."""
    rows = [k for k, label in enumerate(limit.labels) if label.removesuffix(" position") in names]
    labels, units = (tuple(values[k] for k in rows) for values in (limit.labels, limit.units))
    arrays = (values[rows] for values in (limit.matrix, limit.offset, limit.lower, limit.upper))
    return LinearConstraint(limit.derivative, *arrays, labels, units)


def test_bounds_on_single_joints_need_no_linear_program(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise AssertionError

    limits = linear_limits(load_robot("panda"))
    bounds = [x for x in limits if x.derivative == 0]
    lower, upper = (np.concatenate([getattr(x, side) for x in bounds]) for side in ("lower", "upper"))
    monkeypatch.setattr("scipy.optimize.linprog", refused)
    np.testing.assert_allclose(interior_pose(limits, 7), (lower + upper) / 2, atol=1e-12)
