"""Friction that grows with the torque that a drive carries: its law, the way back from measured torques, its use."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from friction_curves import TUSTIN
from hypothesis import given, strategies as st
from played import EXACT, TASK, described, found, irp6, mixed, periodic, played, three_joints
from refused import refusal

from excite.identification.prediction import prediction, relative_error
from excite.logs.log import Log
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.readers.library import built_in
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve, Scaled, TableFriction
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import Loaded, scaled, torques_at_drives
from regressors.robot.locked_joints import with_locked_joints
from regressors.samples import Array

CURVES = FrictionCurves(
    {"z1": CoulombViscous(28.0, 25.0), "z2": Loaded(TUSTIN, 0.06, 0.11), "z3": Loaded(CoulombViscous(30.0, 26.0), 0.2)}
)
THREE = with_locked_joints(irp6(), [0, 1, 2])
C = irp6().transmission.coupling[:3, :3]


def slow(z: float, v: float, curve: Loaded) -> float:
    """Friction of one drive that carries z, written out."""
    share = curve.forward if v > 0 else curve.backward
    return float(curve.curve.torque(v)) + np.sign(v) * share * abs(z)


def test_friction_of_each_drive_grows_with_what_it_carries() -> None:
    rng = np.random.default_rng(0)
    dq, carried = rng.normal(size=(2, 40, 3))
    carried = 50.0 * carried
    at_drives = np.linalg.solve(C.T, carried.T).T
    expected = np.zeros((40, 3))
    for k, name in enumerate(("z1", "z2", "z3")):
        curve = CURVES.curve(name)
        for j, (v, z) in enumerate(zip(dq @ C[k], at_drives[:, k], strict=True)):
            expected[j] += C[k] * (slow(z, v, curve) if isinstance(curve, Loaded) else float(curve.torque(v)))
    np.testing.assert_allclose(CURVES.joint_torque(THREE, 0 * dq, dq, load=carried), expected, atol=1e-10)


@given(st.integers(0, 10_000), st.booleans())
def test_the_carried_torque_is_found_again(seed: int, directed: bool) -> None:
    rng = np.random.default_rng(seed)
    dq, carried = rng.normal(size=(2, 20, 3))
    carried *= 10.0 ** rng.uniform(-1, 3)
    direction = rng.uniform(-1.0, 1.0, (20, 3)) if directed else None
    tau = carried + CURVES.joint_torque(THREE, 0 * dq, dq, direction, load=carried)
    back = CURVES.carried_torque(THREE, 0 * dq, dq, tau, direction)
    np.testing.assert_allclose(back, carried, atol=1e-9 * np.abs(tau).max())


def test_expressions_are_the_numbers() -> None:
    dq, tau, s = ca.SX.sym("dq", 3), ca.SX.sym("tau", 3), ca.SX.sym("s", 3)
    made = [CURVES.joint_expression(THREE, dq, s, tau), CURVES.carried_expression(THREE, dq, tau, s)]
    function = ca.Function("f", [dq, tau, s], made)
    rng = np.random.default_rng(1)
    v, t, u = rng.normal(size=(10, 3)), 40 * rng.normal(size=(10, 3)), rng.uniform(-1, 1, (10, 3))
    values = [np.array([np.array(part).ravel() for part in function(*row)]) for row in zip(v, t, u, strict=True)]
    friction, carried = np.moveaxis(np.array(values), 1, 0)
    np.testing.assert_allclose(friction, CURVES.joint_torque(THREE, 0 * v, v, u, load=t), atol=1e-10)
    np.testing.assert_allclose(carried, CURVES.carried_torque(THREE, 0 * v, v, t, u), atol=1e-10)


def test_nothing_carried_is_the_curve_alone() -> None:
    bare = FrictionCurves({name: getattr(curve, "curve", curve) for name, curve in CURVES.curves.items()})
    dq = np.random.default_rng(2).normal(size=(5, 3))
    still = np.zeros((5, 3))
    for load in (None, still):
        found = CURVES.joint_torque(THREE, dq, dq, load=load)
        np.testing.assert_array_equal(found, bare.joint_torque(THREE, dq, dq, load=load))


def test_a_factor_multiplies_the_share_too() -> None:
    """2 (Fc + Fv v + k |tau|), as far as a share can be."""
    curve = Loaded(CoulombViscous(7.0, 3.0), 0.2, 0.6)
    robot = with_locked_joints(built_in("ur10e"), [0])
    for factor, v, expected in ((2.0, 0.1, 14.6 + 20.0), (0.5, -0.1, -(3.65 + 15.0)), (1.7, -0.1, -(12.41 + 49.5))):
        many = FrictionCurves({robot.joint_names[0]: curve}).scaled({robot.joint_names[0]: factor})
        found = many.joint_torque(robot, np.zeros((1, 1)), np.array([[v]]), load=np.array([[50.0]]))
        assert found.item() == pytest.approx(expected)
    assert scaled(Loaded(TUSTIN, 0.995), 1.2).shares == (0.995, 0.995)


# --- used in identification ------------------------------------------------------------------------------------------


def loaded(log: Log, curves: FrictionCurves) -> Log:
    """A log played with the description's friction, which is replaced."""
    robot = with_locked_joints(irp6(), [0, 1, 2])
    rigid = log.effort - FrictionCurves.of_robot(robot).joint_torque(robot, log.q, log.dq)
    return replace(log, effort=rigid + curves.joint_torque(robot, log.q, log.dq, load=rigid))


@pytest.mark.parametrize(
    ("task", "directions"),
    [
        (TASK, None),
        (Task("irp6", drives=("2",)), mixed([0.0, 1.0, -1.0])),
        (Task("irp6", joints=("1", "3")), mixed([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])),
    ],
)
def test_masses_are_right_where_friction_grows_with_load(task: Task, directions: Array | None) -> None:
    log = loaded(played(three_joints() if directions is None else periodic(directions, 2), 3), CURVES)
    recipe = replace(EXACT, sign_width=0.0)
    result = found(task, log, recipe=recipe, friction=CURVES)
    truth = described(result)
    np.testing.assert_allclose(result.estimate.values, truth, rtol=1e-6, atol=1e-6)
    told = prediction(result.target, result.prepared[0], result.recipe, result.estimate.coefficients, CURVES)
    assert relative_error(told.measured, told.predicted) < 1e-6
    bare = FrictionCurves({name: getattr(curve, "curve", curve) for name, curve in CURVES.curves.items()})
    told = prediction(result.target, result.prepared[0], result.recipe, result.estimate.coefficients, bare)
    assert relative_error(told.measured, told.predicted) > 0.01


# --- refused ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [-0.1, 1.0, np.nan])
def test_shares_that_cannot_be(share: float) -> None:
    assert "load forward must be at least 0 and below 1" in refusal(Loaded, TUSTIN, share)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda inner: Scaled(inner, 2.0), r"inside a Scaled one, .* outermost, Loaded\(Scaled\(\.\.\.\), \.\.\.\)"),
        (lambda inner: Loaded(inner, 0.1), "a Loaded curve must not be inside another one"),
    ],
)
def test_the_load_goes_outermost(make: Callable[[Loaded], FrictionCurve], message: str) -> None:
    assert re.search(message, refusal(make, Loaded(TUSTIN, 0.2)))


def test_a_drive_for_each_joint_is_needed() -> None:
    five = built_in("irp6")
    assert torques_at_drives(five).shape == (5, 5)
    two = with_locked_joints(five, [1, 2])
    np.testing.assert_allclose(torques_at_drives(two), np.linalg.inv(C[1:, 1:].T))
    transmission = THREE.transmission
    drives = tuple(replace(d, rests=d.rests or d.name == "z3") for d in transmission.drives)
    lacking = THREE.replace(transmission=replace(transmission, drives=drives))
    curves = FrictionCurves({"z2": Loaded(TableFriction([0.1], [5.0]), 0.1)})
    with pytest.raises(InputError, match="needs one drive for each joint; here 3 joints"):
        curves.joint_torque(lacking, np.zeros((1, 3)), np.ones((1, 3)), load=np.ones((1, 3)))
