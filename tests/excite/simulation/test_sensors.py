"""Sensors of a simulation: slow noise, gains and drift of torques, steps of positions, and the notes on them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from excite.simulation.sensors import first_order_noise, sensed_torques, stepped
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import sensor_notes
from regressors.errors import InputError

RATE = 1000.0
TIME = np.arange(2001) / RATE
Q = np.column_stack([np.sin(3 * TIME), np.cos(2 * TIME)])
EFFORT, FRICTION = 10 * Q, np.tile([2.0, -3.0], (2001, 1))


def sensed(seed: int = 0, **options: Any) -> np.ndarray:
    return sensed_torques(TIME, EFFORT, FRICTION, SimulationSettings(seed=seed, **options))


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
    time, corner = np.arange(400_000) / RATE, 8.0
    noise = first_order_noise(time, (2.0, 0.5), corner, np.random.default_rng(0))
    np.testing.assert_allclose(noise.std(axis=0), [2.0, 0.5], rtol=0.02)
    for lag in (1, 10, 40):
        found = np.mean(noise[lag:, 0] * noise[:-lag, 0]) / 4.0
        assert found == pytest.approx(np.exp(-2 * np.pi * corner * lag / RATE), abs=0.02)
    starts = [first_order_noise(time[:2], (2.0,), corner, np.random.default_rng(k))[0, 0] for k in range(2000)]
    assert np.std(starts) == pytest.approx(2.0, rel=0.05)


def test_slow_noise_is_seeded() -> None:
    one, same, other = (sensed(seed, coloured_noise=(2.0,)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.any(one != other)


def test_every_error_of_the_sensors_has_its_note() -> None:
    options: dict[str, Any] = {
        "friction_drift": -0.3, "torque_gain": (1.1, 0.9), "coloured_noise": (1.0,), "position_step": (1e-4,)
    }  # fmt: skip
    notes = [sensor_notes(SimulationSettings(**{name: value})) for name, value in options.items()]
    assert [len(note) for note in notes] == [1] * len(options)
    assert [note for own in notes for note in own] == sensor_notes(SimulationSettings(**options))
    assert notes[1] == ["measured torques are 1.1, 0.9 times the true ones"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"torque_gain": (1.0, 0.0)}, "`torque_gain` must not be zero"),
        (
            {"position_step": (1e-4, -1.0)},
            "`position_step` must be 0 or a number from 1e-12 to 10000 rad or m, given -1",
        ),
    ],
)
def test_invalid_sensors(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        SimulationSettings(**options)


def test_a_step_for_each_joint() -> None:
    with pytest.raises(InputError, match="position_step needs one value, or 2"):
        stepped(Q, (0.1, 0.1, 0.1))
