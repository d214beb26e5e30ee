"""Limits of power, and of the torques of plausible robots: by Pinocchio, of designs, and what is refused."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from motions import random_samples
from pinocchio_chains import drive_torques, joint_torques
from refused import refusal
from written_files import saved

import excite
from constraints.enclosure import enclose
from constraints.nonlinear import NonlinearConstraint
from constraints.power import PowerLimit
from constraints.torque import PlausibleTorqueLimit, torque_limits
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import random_states
from regressors.models.nominal import standard_values, stated_deviations
from regressors.models.partial import of_joints
from regressors.readers.library import built_in, load_robot
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples


def imposed(robot: Robot, limit: PowerLimit, moving: list[int] | None = None) -> NonlinearConstraint:
    (constraint,) = limit.imposed(robot, of_joints(robot, range(robot.n) if moving is None else moving))
    return constraint


@pytest.mark.parametrize("name", ["panda", "ur10e"])
def test_power_of_joints_is_pinocchios_torque_times_speed(name: str) -> None:
    robot, samples = built_in(name), random_samples(built_in(name).n, 1)
    limit = imposed(robot, PowerLimit(100.0))
    np.testing.assert_allclose(limit.values(samples), joint_torques(robot, samples) * samples.dq, atol=1e-9)
    np.testing.assert_array_equal(limit.upper, 100.0)
    np.testing.assert_array_equal(limit.lower, -100.0)
    assert limit.labels == tuple(f"joint {joint} power" for joint in robot.joint_names)
    assert set(limit.units) == {"W"}


def test_power_of_drives_is_that_behind_the_coupling() -> None:
    """Rotors and viscous friction count; Coulomb friction at the velocity limit is taken off the upper bound."""
    robot, samples = built_in("irp6"), random_samples(5, 2, size=0.3)
    limit = imposed(robot, PowerLimit())
    dz = samples.dq @ robot.transmission.coupling.T
    np.testing.assert_allclose(limit.values(samples), drive_torques(robot, samples) * dz, atol=1e-5)
    limits = robot.transmission.limits
    np.testing.assert_allclose(limit.lower, -0.5 * limits.torque * limits.velocity)
    coulomb = np.array([28.0, 28.75, 30.0, 10.0, 5.0])
    np.testing.assert_allclose(limit.upper, -limit.lower - coulomb * limits.velocity)


def test_held_drives_have_no_power_and_known_friction_counts() -> None:
    robot = built_in("irp6")
    moving = random_samples(3, 4, size=0.3)
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
    loose, values = (limit.values(design.trajectory.sampled(1000.0)) for design in (free, tight))
    assert (loose / limit.upper).max() > 1.0 >= (values / limit.upper).max()
    motion = tight.trajectory
    extrema = enclose(limit, motion.samples, motion.duration, motion.jerk)
    assert np.all(extrema.high >= values.max(axis=0))
    assert np.all(extrema.low <= values.min(axis=0))


def test_by_name() -> None:
    task = excite.Task("irp6", harmonics=2, starts=1, executor="serial", constraints=("power",))
    assert "drive z3 power" in {use.label for use in excite.design_trajectory(task).limits}


@pytest.mark.parametrize(
    ("robot", "limit", "message"),
    [
        ("panda", PowerLimit(-1.0), "expected a positive power, or one for each of joint panda_joint1, .*; given -1.0"),
        ("panda", PowerLimit(share=2.0), "share must be greater than 0 and at most 1, given 2.0"),
        ("iiwa7", PowerLimit(100.0), "power limits need the inertias of all links; unknown: link_1"),
        ("irp6", PowerLimit(5.0), "drive z1 power: friction of 28 at the velocity limit .* takes all of 5 W; give a l"),
    ],
)
def test_bad_input(robot: str, limit: PowerLimit, message: str) -> None:
    assert re.search(message, refusal(imposed, built_in(robot), limit))


def test_a_robot_without_limits_needs_a_power() -> None:
    robot = built_in("panda")
    bare = robot.replace(limits=dataclasses.replace(robot.limits, torque=np.full(robot.n, np.inf)))
    with pytest.raises(InputError, match=r"has no torque and velocity limits to compute .*; give PowerLimit\(power\)"):
        imposed(bare, PowerLimit())
    assert len(imposed(bare, PowerLimit(100.0)).labels) == robot.n


SHARE = 0.2


def slack(robot: Robot, states: Samples, known: dict[str, float]) -> Array:
    """Distances of the torques of one robot from their upper and lower bounds, shape (2, N, k)."""
    (limit,) = torque_limits(robot, known, 0.0)
    values = limit.values(states)
    return np.array([limit.upper - values, values - limit.lower])


def least_slack(robot: Robot, states: Samples) -> Array:
    """The same of all robots of the box, as the limit has it."""
    (limit,) = PlausibleTorqueLimit(SHARE).imposed(robot, of_joints(robot, range(robot.n)))
    values, k = limit.values(states), len(limit.labels) // 2
    assert np.all(np.isinf(limit.lower[:k]))
    assert np.all(np.isinf(limit.upper[k:]))
    return np.array([limit.upper[:k] - values[:, :k], values[:, k:] - limit.lower[k:]])


@pytest.mark.slow
def test_limit_is_that_of_the_worst_robot_with_drives() -> None:
    """Each parameter off on its own gives one term; torques and bounds are linear in them."""
    robot = load_robot("irp6")
    states, known = random_states(robot, 6, seed=1), standard_values(robot)
    nominal = slack(robot, states, known)
    worst = nominal.copy()
    for parameter, deviation in stated_deviations(robot, SHARE).items():
        worst -= np.abs(slack(robot, states, {**known, parameter: known[parameter] + deviation}) - nominal)
    np.testing.assert_allclose(least_slack(robot, states), worst, atol=1e-9)


def pinocchio_torques(robot: Robot, thetas: Array, states: Samples) -> Array:
    links = (dataclasses.replace(link, theta=theta) for link, theta in zip(robot.links, thetas, strict=True))
    return joint_torques(robot.replace(links=tuple(links)), states)


def test_robots_of_the_box_by_pinocchio() -> None:
    robot, rng = load_robot("panda"), np.random.default_rng(3)
    states = random_states(robot, 30, seed=3)
    deviations = np.array(list(stated_deviations(robot, SHARE).values())[:70]).reshape(7, 10)
    nominal = np.array([link.theta for link in robot.links])
    least = least_slack(robot, states)
    tau, off = worst_torques(robot, nominal, deviations, states)
    most = robot.limits.torque - off
    np.testing.assert_allclose(least, [most - tau, most + tau], atol=1e-9)
    for _ in range(20):
        tau = pinocchio_torques(robot, nominal + rng.choice([-1.0, 1.0], (7, 10)) * deviations, states)
        assert np.all(robot.limits.torque - tau >= least[0] - 1e-9)
        assert np.all(robot.limits.torque + tau >= least[1] - 1e-9)


@pytest.mark.parametrize("wrong", [0.0, -0.1, float("inf"), float("nan")])
def test_wrong_uncertainty(wrong: float) -> None:
    robot = load_robot("panda")
    with pytest.raises(InputError, match="torque uncertainty must be a number greater than 0"):
        PlausibleTorqueLimit(wrong).imposed(robot, of_joints(robot, range(7)))


# --- designs ---------------------------------------------------------------------------------------------------------

TIGHT = {"harmonics": 3, "payload": (3.0, 0.0, 0.0, 0.1), "acceleration": (20.0,), "jerk": (1e4,)}


def used_by_any(design: excite.Design) -> float:
    """Largest use of a torque limit by any robot of the box, at instants of a design's motion, by Pinocchio.

    Torques are linear in the parameters, so that the worst robot of each instant is a corner of the box.
    """
    robot, samples = design.moving, design.trajectory.sampled(200.0)
    deviations = np.array(list(stated_deviations(robot, SHARE).values())[:70]).reshape(7, 10)
    nominal = np.array([body.theta for body in robot.bodies])
    tau, off = worst_torques(robot, nominal, deviations, samples)
    return float(np.max((np.abs(tau) + off) / robot.limits.torque))


def worst_torques(robot: Robot, nominal: Array, deviations: Array, states: Samples) -> tuple[Array, Array]:
    """Torques of the nominal robot, and how far those of any robot of the box are from them."""
    tau, off = pinocchio_torques(robot, nominal, states), np.zeros(states.q.shape)
    for place in np.ndindex(7, 10):
        other = nominal.copy()
        other[place] += deviations[place]
        off += np.abs(pinocchio_torques(robot, other, states) - tau)
    return tau, off


@pytest.mark.slow
def test_a_design_keeps_the_limits_of_plausible_robots(tmp_path: Path) -> None:
    task = Task("panda", starts=1, executor="serial", **TIGHT)
    plain = excite.design_trajectory(task)
    sure = excite.design_trajectory(task, torque_uncertainty=SHARE)
    assert plain.feasible
    assert sure.feasible
    used = used_by_any(sure)
    assert used_by_any(plain) > 1.0
    assert used <= 1.0
    uses = [use for use in sure.limits if use.quantity == "torque of plausible robots"]
    assert len(uses) == 14
    assert {use.method for use in uses} == {"enclosed"}
    assert used < max(use.use for use in uses) < used + 0.02
    assert excite.load_design(saved(tmp_path / "design", sure)).task == sure.task
