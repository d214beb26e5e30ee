"""Rows near standstill: left out for the drives that stand, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, PERIOD, TASK, described, found, irp6, played, three_joints

from excite.design.design import Design
from excite.design.optimisation import design_trajectory
from excite.identification.biases import standstill_candidates, without_standstill
from excite.identification.equations import equations_of
from excite.identification.identify import identify
from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.simulation.simulate import simulate
from excite.tasks.search import Search
from excite.tasks.task import Task
from regressors.errors import InputError
from regressors.samples import Array

EXACTLY = replace(EXACT, sign_width=0.0)
C = irp6().transmission.coupling[:3, :3]


@pytest.fixture(scope="module")
def log() -> Log:
    return played(three_joints(), 3)


def slow(log: Log, speed: float) -> Array:
    """Rows of each joint's equation in which a drive that acts on it is slow, by hand."""
    dz = np.abs(log.dq @ C.T)
    return np.column_stack([np.any((dz < speed) & (np.abs(C[:, j]) > 0), axis=1) for j in range(3)])


def test_rows_of_slow_drives_are_left_out(log: Log) -> None:
    """Of the joints that carry their torque: drive 2 of the IRp-6 acts on joint 2 only, drive 3 on joints 2 and 3."""
    result = found(TASK, log, recipe=replace(EXACTLY, standstill=0.05))
    whole = found(TASK, log, recipe=EXACTLY)
    expected = np.flatnonzero(~slow(log, 0.05).ravel())
    assert 0 < expected.size < 0.95 * len(whole.observations.y)
    np.testing.assert_allclose(result.observations.W, whole.observations.W[expected], atol=1e-9)
    assert len({np.sum(result.observations.equation == j) for j in range(3)}) > 1
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-9)
    assert any(note.startswith("rows left out while a drive is slower than 0.05") for note in result.prepared[0].notes)


@pytest.mark.parametrize("speed", [0.0, None])
def test_none_are_left_out_unless_asked(speed: float | None, log: Log) -> None:
    result = found(TASK, log, recipe=replace(EXACTLY, standstill=speed))
    assert result.prepared[0].standing == ()
    assert len(result.observations.y) == 3 * log.count


@pytest.mark.parametrize("changes", [{"every": 3}, {"low_pass": 10.0}])
def test_decimated_equations_leave_the_same_stretches_out(changes: dict, log: Log) -> None:
    long = played(three_joints(), 3, seconds=3 * PERIOD)
    result = found(TASK, long, recipe=replace(EXACTLY, standstill=0.05, **changes))
    part, observations = result.prepared[0], result.observations
    at = np.searchsorted(part.samples.time, observations.time - 1e-9)
    assert not np.any(slow(replace(long, dq=part.samples.dq), 0.05)[at, observations.equation])


def test_candidates_are_parts_of_the_typical_speed(log: Log) -> None:
    result = found(TASK, log)
    candidates = standstill_candidates(result.target, result.prepared)
    typical = np.median(np.sqrt(np.mean((log.dq @ C.T) ** 2, axis=0)))
    assert candidates[0] == 0.0
    assert list(candidates) == sorted(candidates)
    assert candidates[2] == pytest.approx(0.02 * typical, rel=1e-6)
    energy = found(Task("irp6", model="energy"), log)
    assert standstill_candidates(energy.target, energy.prepared) == (0.0,)


def test_models_of_windows_refuse_it(log: Log) -> None:
    with pytest.raises(InputError, match="`standstill` is for models of joint torques at single instants"):
        found(Task("irp6", model="energy"), log, recipe=replace(EXACTLY, standstill=0.05))


def test_a_drive_that_rests_makes_no_equations(log: Log) -> None:
    result = found(TASK, log)
    part = result.prepared[0]
    still = replace(part.samples, dq=part.samples.dq * [0.0, 1.0, 1.0])
    left = without_standstill(replace(part, samples=still), result.target, 0.01)
    assert not np.any(equations_of(result.target, left, result.recipe).equation == 0)


def test_negative_speeds_are_refused() -> None:
    with pytest.raises(
        InputError, match="`standstill` must be 0 or a number from 1e-12 to 1000000 rad/s or m/s, given -1"
    ):
        Recipe(standstill=-1.0)


def test_repetitions_refuse_it() -> None:
    with pytest.raises(InputError, match="leave out `standstill`"):
        Recipe(standstill=0.1).check_repeatable(3)


@pytest.fixture(scope="module")
def design() -> Design:
    return design_trajectory("irp6", search=Search(starts=2))


@pytest.mark.slow
def test_parameters_of_a_robot_that_sticks_are_not_biased(design: Design) -> None:
    """Under a soft controller, whose joints stand wherever they turn; else errors are many times larger."""
    errors = {speed: [] for speed in (0.0, 0.01)}
    for seed in range(3):
        sensors = {"torque_noise": (0.5,), "encoder": (4000,), "rate": 1000.0, "seed": seed}
        log = simulate(design, controller="pd", bandwidth=3.0, breakaway="auto", **sensors)
        for speed, found_ones in errors.items():
            result = identify("irp6", log, design=design, recipe=Recipe(standstill=speed), choose=False)
            assert result.reference is not None
            found_ones.append(np.abs(result.estimate.values / result.reference.values - 1))
    assert np.max(errors[0.0]) > 5 * np.max(errors[0.01])
    assert np.max(errors[0.01]) < 0.03
