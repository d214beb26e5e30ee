"""Position-controlled servos: how far they stay behind is their force balance, with Pinocchio's torques."""

from __future__ import annotations

import numpy as np
import pytest
from pinocchio_chains import joint_torques
from refused import refusal
from slow_dynamics import driven_chain, random_chain

from regressors.errors import InputError
from regressors.models.servo import UNKNOWNS, ServoModel
from regressors.readers.library import built_in
from regressors.robot.gears import ConstantRatio
from regressors.robot.robot import Link, Robot
from regressors.samples import Samples

ROBOTS = {"so101": built_in("so101"), "chain": random_chain("rpr", np.random.default_rng(5))}


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
@pytest.mark.parametrize("sign_width", [0.0, 0.3])
def test_rows_are_how_far_each_servo_stays_behind(robot: Robot, sign_width: float) -> None:
    n, count = robot.n, 20
    rng = np.random.default_rng(1)
    q, dq, ddq = rng.normal(size=(3, count, n))
    samples = Samples(np.arange(count) / 100, q, dq, ddq, 0 * q)
    K, D, J, F = rng.uniform(0.5, 20.0, (4, n))
    b = rng.uniform(-0.1, 0.1, n)
    direction = np.sign(dq) if sign_width == 0.0 else np.tanh(dq / sign_width)
    behind = (joint_torques(robot, samples) + D * dq + J * ddq + F * direction) / K + b  # u - q
    model = ServoModel(robot, sign_width=sign_width)
    values = np.column_stack([1 / K, D / K, J / K, F / K, b]).ravel()
    np.testing.assert_allclose((model.assemble(samples) @ values).reshape(count, n), behind, rtol=1e-9, atol=1e-11)
    assert len(model.columns) == n * UNKNOWNS


def test_names_and_units_are_those_of_each_joint() -> None:
    model = ServoModel(random_chain("rp", np.random.default_rng(0)))
    assert model.row_labels == (("j1", "rad"), ("j2", "m"))
    assert [(c.name, c.unit) for c in model.columns] == [
        ("a1", "rad/Nm"), ("T1", "s"), ("w1", "s^2"), ("s1", "rad"), ("b1", "rad"),
        ("a2", "m/N"), ("T2", "s"), ("w2", "s^2"), ("s2", "m"), ("b2", "m"),
    ]  # fmt: skip


def test_masses_that_are_unknown_and_drives_that_are_coupled_are_refused() -> None:
    chain = random_chain("rr", np.random.default_rng(0))
    unknown = chain.replace(links=(chain.links[0], Link("link2")))
    with pytest.raises(InputError, match=r"inertia of link link2 is unknown, .*; state mass, first_moment and inertia"):
        ServoModel(unknown)
    with pytest.raises(InputError, match="its drives are coupled; the model servo has one drive to a joint"):
        ServoModel(driven_chain([ConstantRatio(10.0)] * 3, np.random.default_rng(0)))
    assert "robot 'irp6'" in refusal(ServoModel, built_in("irp6"))
