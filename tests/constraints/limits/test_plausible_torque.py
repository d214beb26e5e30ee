"""Torque limits of every robot of a box of parameters: other robots by Pinocchio, the worst ones, and designs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_chains import chain_model, inertia

import excite
from constraints.torque import PlausibleTorqueLimit, torque_limits
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.models.base import random_states
from regressors.models.nominal import standard_values, stated_deviations
from regressors.models.partial import of_joints
from regressors.readers.library import load_robot
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

SHARE = 0.2
ROBOTS = ("panda", "irp6")


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


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_no_robot_of_the_box_is_nearer_to_its_limits(name: str) -> None:
    robot, rng = load_robot(name), np.random.default_rng(0)
    states, known = random_states(robot, 20, seed=2), standard_values(robot)
    least = least_slack(robot, states)
    for _ in range(20):
        signs = {parameter: rng.choice([-1.0, 1.0]) for parameter in known}
        off = {p: known[p] + signs[p] * d for p, d in stated_deviations(robot, SHARE).items()}
        assert np.all(slack(robot, states, {**known, **off}) >= least - 1e-9)


def pinocchio_torques(robot: Robot, thetas: Array, states: Samples) -> Array:
    chain = chain_model(robot)
    for number, theta in enumerate(thetas, 1):
        chain.inertias[number] = inertia(theta)
    data = chain.createData()
    return np.array([pin.rnea(chain, data, *state) for state in zip(states.q, states.dq, states.ddq, strict=True)])


def test_robots_of_the_box_by_pinocchio() -> None:
    robot, rng = load_robot("panda"), np.random.default_rng(3)
    states = random_states(robot, 30, seed=3)
    deviations = np.array(list(stated_deviations(robot, SHARE).values())[:70]).reshape(7, 10)
    nominal = np.array([link.theta for link in robot.links])
    least = least_slack(robot, states)
    tau, off = pinocchio_torques(robot, nominal, states), np.zeros(states.q.shape)
    for place in np.ndindex(7, 10):
        other = nominal.copy()
        other[place] += deviations[place]
        off += np.abs(pinocchio_torques(robot, other, states) - tau)
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


def broken_by(design: excite.Design, count: int = 30) -> int:
    """How many robots of the box break a torque limit at an instant of a design's motion, by Pinocchio."""
    robot, rng = design.moving, np.random.default_rng(5)
    samples = design.trajectory.sampled(200.0)
    deviations = np.array(list(stated_deviations(robot, SHARE).values())[:70]).reshape(7, 10)
    nominal = np.array([body.theta for body in robot.bodies])
    thetas = (nominal + rng.choice([-1.0, 1.0], (7, 10)) * deviations for _ in range(count))
    most = [np.abs(pinocchio_torques(robot, theta, samples)).max(axis=0) for theta in thetas]
    return sum(bool(np.any(torque > robot.limits.torque)) for torque in most)


@pytest.mark.slow
def test_a_design_keeps_the_limits_of_plausible_robots(tmp_path: Path) -> None:
    task = Task("panda", starts=1, executor="serial", **TIGHT)
    plain = excite.design_trajectory(task)
    sure = excite.design_trajectory(task, torque_uncertainty=SHARE)
    assert plain.feasible
    assert sure.feasible
    assert broken_by(plain) > 0
    assert broken_by(sure) == 0
    uses = [use for use in sure.limits if use.quantity == "torque of plausible robots"]
    assert len(uses) == 14
    assert {use.method for use in uses} == {"enclosed"}
    assert max(use.use for use in uses) > 0.95
    sure.save(tmp_path / "design")
    assert excite.load_design(tmp_path / "design").task == sure.task
