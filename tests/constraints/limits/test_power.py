"""Limits of mechanical power: torques times speeds by Pinocchio, the energy's rate, designs, and what is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_chains import chain_model, drive_torques, joint_torques

import excite
from constraints.enclosure import enclose
from constraints.nonlinear import NonlinearConstraint
from constraints.power import PowerLimit
from regressors.errors import InputError
from regressors.models.partial import of_joints
from regressors.readers.library import built_in
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


def imposed(robot: Robot, limit: PowerLimit, moving: list[int] | None = None) -> NonlinearConstraint:
    (constraint,) = limit.imposed(robot, of_joints(robot, range(robot.n) if moving is None else moving))
    return constraint


def states(n: int, seed: int, size: float = 1.0) -> Samples:
    q, dq, ddq = size * np.random.default_rng(seed).uniform(-2, 2, (3, 40, n))
    return Samples(np.arange(40.0), q, dq, ddq, np.zeros_like(q))


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_power_of_joints_is_pinocchios_torque_times_speed(name: str) -> None:
    robot, samples = built_in(name), states(built_in(name).n, 1)
    limit = imposed(robot, PowerLimit(100.0))
    np.testing.assert_allclose(limit.values(samples), joint_torques(robot, samples) * samples.dq, atol=1e-9)
    np.testing.assert_array_equal(limit.upper, 100.0)
    np.testing.assert_array_equal(limit.lower, -100.0)
    assert limit.labels == tuple(f"joint {joint} power" for joint in robot.joint_names)
    assert set(limit.units) == {"W"}


def test_power_of_drives_is_that_behind_the_coupling() -> None:
    """Rotors and viscous friction count; Coulomb friction at the velocity limit is taken off the upper bound."""
    robot, samples = built_in("irp6"), states(5, 2, 0.3)
    assert robot.transmission is not None
    limit = imposed(robot, PowerLimit())
    dz = samples.dq @ robot.transmission.coupling.T
    np.testing.assert_allclose(limit.values(samples), drive_torques(robot, samples) * dz, atol=1e-5)
    limits = robot.transmission.limits
    np.testing.assert_allclose(limit.lower, -0.5 * limits.torque * limits.velocity)
    coulomb = np.array([28.0, 28.75, 30.0, 10.0, 5.0])
    np.testing.assert_allclose(limit.upper, -limit.lower - coulomb * limits.velocity)


def test_all_joints_together_change_the_energy() -> None:
    """``sum_j tau_j dq_j = d/dt (T + V)`` along a motion, by central differences of Pinocchio's energies."""
    robot, h = built_in("panda"), 1e-5
    model = chain_model(robot)
    data = model.createData()
    rng = np.random.default_rng(3)
    centre, amplitude, phase = rng.normal(size=(3, robot.n))

    def motion(t: Array) -> Samples:
        angle = 1.7 * t[:, None] + phase
        sine, cosine = amplitude * np.sin(angle), amplitude * np.cos(angle)
        return Samples(t, centre + sine, 1.7 * cosine, -(1.7**2) * sine, -(1.7**3) * cosine)

    def energy(t: Array) -> Array:
        values = [
            pin.computeKineticEnergy(model, data, q, dq) + pin.computePotentialEnergy(model, data, q)
            for q, dq in zip(motion(t).q, motion(t).dq, strict=True)
        ]
        return np.array(values)

    t = np.linspace(0.0, 3.0, 20)
    rate = (energy(t + h) - energy(t - h)) / (2 * h)
    np.testing.assert_allclose(imposed(robot, PowerLimit(1.0)).values(motion(t)).sum(axis=1), rate, atol=1e-5)


def test_held_drives_have_no_power_and_known_friction_counts() -> None:
    robot = built_in("irp6")
    moving = states(3, 4, 0.3)
    limit = imposed(robot, PowerLimit(500.0), [0, 1, 2])
    assert np.abs(limit.values(moving)[:, 4]).max() == 0.0
    np.testing.assert_allclose(limit.upper[4], 500.0)
    curves = FrictionCurves.of_robot(robot)
    known = PowerLimit(500.0).knowing(curves)
    assert known.friction is curves
    assert known.knowing(None) is known
    np.testing.assert_allclose(imposed(robot, known).upper, imposed(robot, PowerLimit(500.0)).upper)


@pytest.mark.slow
def test_designs_keep_it_between_samples_too() -> None:
    """Bounds that bind: proven over all instants, and not exceeded by 10^4 of them."""
    task = excite.Task("irp6", harmonics=3, starts=1, executor="serial", friction=False)
    free = excite.design_trajectory(task)
    power = PowerLimit(60.0)
    tight = excite.design_trajectory(task.changed(constraints=(power,)))
    assert tight.feasible
    uses = {use.label: use for use in tight.limits if use.unit == "W"}
    assert {use.method for use in uses.values()} == {"enclosed"}
    assert max(use.use for use in uses.values()) > 0.8
    robot = built_in("irp6")
    limit = imposed(robot, power, [0, 1, 2])
    most = []
    for design in (free, tight):
        values = limit.values(design.trajectory.sampled(1000.0))
        most.append(float((values / limit.upper).max()))
    assert most[0] > 1.0 >= most[1]
    third = design.trajectory.jerk
    extrema = enclose(limit, design.trajectory.samples, design.trajectory.duration, third).extrema
    assert np.all(extrema.high >= values.max(axis=0))
    assert np.all(extrema.low <= values.min(axis=0))


def test_by_name() -> None:
    task = excite.Task("irp6", harmonics=2, starts=1, executor="serial", constraints=("power",))
    assert "drive z3 power" in {use.label for use in excite.design_trajectory(task).limits}


@pytest.mark.parametrize(
    ("robot", "limit", "message"),
    [
        ("panda", PowerLimit(-1.0), "expected a positive power, or one for each of joint panda_joint1, .*; given -1.0"),
        ("panda", PowerLimit((1.0, 2.0)), "expected a positive power, or one for each"),
        ("panda", PowerLimit(share=2.0), "share must be greater than 0 and at most 1, given 2.0"),
        ("iiwa7", PowerLimit(100.0), "power limits need the inertias of all links; unknown: link_1"),
        (
            "irp6",
            PowerLimit(5.0),
            "drive z1 power: friction of 28 at the velocity limit .* takes all of 5 W; give a larger power",
        ),
    ],
)
def test_bad_input(robot: str, limit: PowerLimit, message: str) -> None:
    with pytest.raises(InputError, match=message):
        imposed(built_in(robot), limit)


def test_a_robot_without_limits_needs_a_power() -> None:
    robot = built_in("panda")
    bare = robot.replace(limits=dataclasses.replace(robot.limits, torque=np.full(robot.n, np.inf)))
    with pytest.raises(InputError, match=r"has no torque and velocity limits to compute .*; give PowerLimit\(power\)"):
        imposed(bare, PowerLimit())
    assert len(imposed(bare, PowerLimit(100.0)).labels) == robot.n
