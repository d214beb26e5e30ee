"""Sensors of a simulation, and whether a run is what was asked for: saturation, tracking and limits."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from motions import random_fourier
from refused import refusal

from excite.simulation.sensors import first_order_noise, sensed_torques, sensor_notes, stepped
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import simulate_motion
from excite.simulation.simulation import Simulation, simulation_outcome
from excite.tasks.task import Task
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
    motion = random_fourier(6, 3, 2.0, 0.12, harmonics=3)
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
    names = [f"joint {simulation.robot.joint_names[k]}" for k in np.flatnonzero(at_limit.any(axis=0))]
    assert [one.label for one in outcome.saturated] == names
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


SENSED_RATE = 1000.0
SENSED_TIME = np.arange(2001) / SENSED_RATE
Q = np.column_stack([np.sin(3 * SENSED_TIME), np.cos(2 * SENSED_TIME)])
EFFORT, FRICTION = 10 * Q, np.tile([2.0, -3.0], (2001, 1))


def sensed(seed: int = 0, **options: Any) -> np.ndarray:
    return sensed_torques(SENSED_TIME, EFFORT, FRICTION, SimulationSettings(seed=seed, **options))


def test_exact_sensors_change_nothing() -> None:
    np.testing.assert_array_equal(sensed(), EFFORT)
    np.testing.assert_array_equal(stepped(Q, (0.0,)), Q)
    assert sensor_notes(SimulationSettings()) == []


def test_gain_and_friction_change_torques() -> None:
    course = (sensed(torque_gain=(1.1, 0.9), friction_drift=-0.3) / [1.1, 0.9] - EFFORT) / FRICTION
    np.testing.assert_allclose(course[[0, -1]], [[0, 0], [-0.3, -0.3]], atol=1e-12)
    assert np.all(np.diff(course[:, 0]) < 0)
    assert course[1000, 0] == pytest.approx(-0.3 * (1 - np.exp(-1)) / (1 - np.exp(-2)))


def test_positions_are_multiples_of_their_step() -> None:
    q = stepped(Q, (1e-3, 0.0))
    np.testing.assert_allclose(np.mod(q[:, 0] / 1e-3 + 0.5, 1.0), 0.5, atol=1e-9)
    assert 4e-4 < np.abs(q[:, 0] - Q[:, 0]).max() <= 5e-4 + 1e-12
    np.testing.assert_array_equal(q[:, 1], Q[:, 1])


def test_noise_has_the_deviation_and_the_correlation_of_a_first_order_low_pass() -> None:
    time, corner = np.arange(400_000) / SENSED_RATE, 8.0
    noise = first_order_noise(time, (2.0, 0.5), corner, np.random.default_rng(0))
    np.testing.assert_allclose(noise.std(axis=0), [2.0, 0.5], rtol=0.02)
    for lag in (1, 10, 40):
        found = np.mean(noise[lag:, 0] * noise[:-lag, 0]) / 4.0
        assert found == pytest.approx(np.exp(-2 * np.pi * corner * lag / SENSED_RATE), abs=0.02)
    starts = [first_order_noise(time[:2], (2.0,), corner, np.random.default_rng(k))[0, 0] for k in range(2000)]
    assert np.std(starts) == pytest.approx(2.0, rel=0.05)


def test_slow_noise_is_seeded() -> None:
    one, same, other = (sensed(seed, coloured_noise=(2.0,)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.any(one != other)


def test_every_error_of_the_sensors_has_its_note() -> None:
    options: dict[str, Any] = {"friction_drift": -0.3, "torque_gain": (1.1, 0.9), "coloured_noise": (1.0,)}
    options["position_step"] = (1e-4,)
    notes = [sensor_notes(SimulationSettings(**{name: value})) for name, value in options.items()]
    assert [len(note) for note in notes] == [1] * len(options)
    assert [note for own in notes for note in own] == sensor_notes(SimulationSettings(**options))
    assert notes[1] == ["measured torques are 1.1, 0.9 times the true ones"]


def test_invalid_sensors() -> None:
    step = "`position_step` must be 0 or a number from 1e-12 to 10000 rad or m, given -1"
    assert "`torque_gain` must not be zero" in refusal(SimulationSettings, torque_gain=(1.0, 0.0))
    assert step in refusal(SimulationSettings, position_step=(1e-4, -1.0))
    assert "position_step needs one value, or 2" in refusal(stepped, Q, (0.1, 0.1, 0.1))
