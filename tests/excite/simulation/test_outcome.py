"""Whether a simulated run is what was asked for: saturation, tracking and limits, and when that is said."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation, simulation_outcome
from excite.tasks.task import Task
from excite.trajectories import Fourier, Trajectory
from regressors.readers.library import built_in
from regressors.robot.robot import Robot
from regressors.samples import Array, Samples

RATE = 200.0
TIME = np.arange(401) / RATE


def weakened(share: float) -> Robot:
    """The UR10e whose drives have less torque than they need."""
    robot = built_in("ur10e")
    return replace(robot, limits=replace(robot.limits, torque=share * robot.limits.torque))


@cache
def run(share: float, torque_limits: bool = True) -> Simulation:
    family = Fourier(2.0, 3)
    motion = Trajectory(family, np.random.default_rng(3).normal(0.0, 0.12, (6, family.size)))
    settings = SimulationSettings(rate=RATE, torque_limits=torque_limits)
    return simulate_motion(weakened(share), Task("ur10e", acceleration=(100.0,)), motion, settings)


def test_a_motion_that_is_followed_holds() -> None:
    outcome = run(1.0).outcome
    assert outcome.holds
    assert (outcome.saturated, outcome.failures, outcome.notes) == ((), (), ())
    assert [tracking.joint for tracking in outcome.tracking] == list(built_in("ur10e").joint_names)


def test_saturation_is_when_the_torque_that_acted_is_the_limit() -> None:
    simulation = run(0.3)
    outcome, limits = simulation.outcome, simulation.robot.limits.torque
    assert not outcome.holds
    assert simulation.log.saturated == outcome.saturated != ()
    at_limit = np.abs(simulation.run.effort) >= limits
    for one in outcome.saturated:
        k = simulation.robot.joint_names.index(one.label.removeprefix("joint "))
        inside = np.any([(simulation.log.time >= a) & (simulation.log.time <= b) for a, b in one.spans], axis=0)
        np.testing.assert_array_equal(inside, at_limit[:, k])
        assert (one.rows, one.limit, one.unit) == (np.count_nonzero(inside), limits[k], "Nm")
    assert {one.label for one in outcome.saturated} == {
        f"joint {name}" for name, ever in zip(simulation.robot.joint_names, at_limit.any(axis=0), strict=True) if ever
    }
    first = outcome.saturated[0]
    assert any(f"torque of {first.label} was at its limit of {first.limit:.4g} Nm in" in s for s in outcome.failures)


def test_torques_that_nothing_cuts_off_pass_their_limits_and_are_noted() -> None:
    outcome = run(0.3, torque_limits=False).outcome
    assert outcome.holds
    assert outcome.saturated == run(0.3, torque_limits=False).log.saturated == ()
    assert any("the torque of joint" in note and "passes its limit" in note for note in outcome.notes)


def still(q: Array, dq: Array | None = None) -> Samples:
    zero = np.zeros_like(q)
    return Samples(TIME, q, zero if dq is None else dq, zero, zero)


def waves(robot: Robot, size: float = 0.5) -> Array:
    """Positions of joints about the middle of their ranges; the last joint rests."""
    middle = np.clip((robot.limits.lower + robot.limits.upper) / 2, -1.0, 1.0)
    q = np.tile(middle, (TIME.size, 1))
    q[:, :-1] += size * np.sin(np.pi * TIME)[:, None]
    return q


@pytest.mark.parametrize(
    ("joint", "error", "holds", "noted"),
    [
        (1, 0.0099, True, False),  # 1 m or rad of range
        (1, 0.011, True, True),
        (1, 0.049, True, True),
        (1, 0.051, False, False),
        (-1, 0.0049, True, True),  # rests: of 0.1 rad
        (-1, 0.0051, False, False),
    ],
)
def test_tracking_is_judged_by_the_range_of_motion(joint: int, error: float, holds: bool, noted: bool) -> None:
    robot = built_in("panda")
    wanted = waves(robot)
    happened = wanted.copy()
    happened[200, joint] += error
    outcome = simulation_outcome(robot, still(wanted), still(happened), np.zeros_like(wanted))
    assert (outcome.holds, bool(outcome.notes)) == (holds, noted)
    name = robot.joint_names[joint]
    for text in (*outcome.failures, *outcome.notes):
        assert text.startswith(f"joint {name} deviates from the reference by {error:.3g} rad, ")
    assert outcome.tracking[joint].error == pytest.approx(error)
    pushed = simulation_outcome(robot, still(wanted), still(happened), np.zeros_like(wanted), pushed=True)
    assert pushed.holds
    assert pushed.tracking == ()


@pytest.mark.parametrize(
    ("share", "holds", "noted"), [(-1e-3, True, False), (0.009, True, True), (0.011, False, False)]
)
def test_positions_beyond_a_limit_are_judged_by_the_allowed_range(share: float, holds: bool, noted: bool) -> None:
    robot = built_in("panda")
    q = waves(robot)
    upper, lower = robot.limits.upper[3], robot.limits.lower[3]
    q[:, 3] += upper + share * (upper - lower) - q[:, 3].max()
    outcome = simulation_outcome(robot, still(q), still(q), np.zeros_like(q))
    assert (outcome.holds, bool(outcome.notes)) == (holds, noted)
    for text in (*outcome.failures, *outcome.notes):
        assert text.startswith("the position of joint panda_joint4 passes its limit of ")


@pytest.mark.parametrize(("share", "holds", "noted"), [(0.999, True, False), (1.04, True, True), (1.06, False, False)])
def test_velocities_are_judged_at_the_drives_too(share: float, holds: bool, noted: bool) -> None:
    robot = built_in("irp6")
    q = np.zeros((TIME.size, robot.n))
    dz = np.zeros_like(q)
    dz[7, 1] = -share * robot.transmission.limits.velocity[1]
    dq = dz @ np.linalg.inv(robot.transmission.coupling).T
    outcome = simulation_outcome(robot, still(q), still(q, dq), np.zeros_like(q))
    assert (outcome.holds, bool(outcome.notes)) == (holds, noted)
    for text in (*outcome.failures, *outcome.notes):
        assert text.startswith("the velocity of drive z2 passes its limit of 1.137 rad/s by")
