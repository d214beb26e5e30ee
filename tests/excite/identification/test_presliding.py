"""How friction turns its direction: planted turnings are found, of each drive too, and against Dahl's equation."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, TASK, curves, described, found, irp6, played, three_joints
from refused import refusal
from written_files import saved

from excite.identification.equations import (
    dahl_direction,
    drive_directions,
    friction_drives,
    measured_direction,
    measured_regressor,
)
from excite.identification.preparation import prepare
from excite.identification.presliding import with_presliding
from excite.identification.result_json import load_result
from excite.information.target import target_of
from excite.logs.log import Log
from excite.tasks.task import Task
from regressors.robot.friction.curves import FrictionCurves
from regressors.robot.friction.load_and_temperature import friction_rows
from regressors.samples import Array, Samples

C = irp6().transmission.coupling[:3, :3]


def turned(direction: Array) -> Log:
    """A log with friction whose direction is not the sign of the velocity."""
    log = played(three_joints(), 3)
    return replace(log, effort=log.effort + ([28.0, 28.75, 40.0] * (direction - np.sign(log.dq @ C.T))) @ C)


def softened(width: float) -> Log:
    return turned(np.tanh(played(three_joints(), 3).dq @ C.T / width))


def test_a_planted_width_is_found() -> None:
    """And searched more closely than noise lets it be known."""
    for width in (0.01, 0.02):
        result = found(TASK, softened(width))
        assert result.recipe.sign_width == pytest.approx(width, rel=2e-3)
        assert result.recipe.breakaway == 0.0
        assert any("reverses over 0.0" in note and "rad/s" in note for note in result.estimate.notes)
        np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)


def test_a_planted_distance_is_found() -> None:
    # Dahl's equation by small steps of Euler along a fine path
    motion, fine = three_joints(), 200
    time = np.arange(400 * fine + 1) / (200.0 * fine)
    z = motion.at(time, 0)[:, :3] @ C.T
    s, kept, d = np.sign(z[1] - z[0]), [], 0.001
    for way in np.diff(z, axis=0, prepend=z[:1]):
        s = s + way * (1.0 - s * np.sign(way)) / d
        kept.append(s)
    result = found(TASK, turned(np.array(kept)[:-1:fine]))
    assert (result.recipe.breakaway, result.recipe.sign_width) == (pytest.approx(0.001, rel=0.1), 0.0)
    assert any("and holds at standstill" in note for note in result.estimate.notes)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)


def test_models_without_friction_turn_nothing() -> None:
    log = played(three_joints(), 3)
    for task in (TASK.changed(friction=False), TASK.changed(model="energy")):
        target = target_of(irp6(), task)
        part = prepare(log, irp6(), target, EXACT)
        assert with_presliding(EXACT, target, [part], None) == replace(EXACT, sign_width=0.0, breakaway=0.0)


@pytest.mark.parametrize("task", [TASK, Task("irp6", joints=("1", "3")), Task("irp6", drives=("2", "3"))])
def test_friction_columns_are_directions_spread_by_the_coupling(task: Task) -> None:
    target = target_of(irp6(), task)
    model, n = target.model, target.robot.n
    rng = np.random.default_rng(4)
    time, shape = np.arange(50) / 100.0, (50, len(target.motion.labels))
    moved = [rng.normal(size=shape) @ target.motion.matrix.T for _ in range(4)]
    samples = Samples(time, *moved)
    drives = friction_drives(target, samples)
    columns, rows = drives.columns, drives.rows
    C = irp6().transmission.coupling[:n, :n]  # of the moving joints
    which = [int(target.base.names[k][1:-1]) - 1 for k in columns]
    np.testing.assert_array_equal(friction_rows(target.robot)[list(drives.drives)], C[which])
    W = measured_regressor(target, samples).reshape(50, -1, target.base.rank)
    signs = np.sign(samples.dq @ C[which].T)
    for k, column in enumerate(columns):
        np.testing.assert_allclose(W[:, :, column], signs[:, [k]] * rows[k], atol=1e-12)
    assert len(model.row_labels) == rows.shape[1]


WIDTHS, DISTANCES = (0.2, 0.0, 0.02), (0.02, 1e-9, 0.001)


def test_widths_and_distances_of_each_drive_are_taken(tmp_path) -> None:
    soft = softened(np.maximum(WIDTHS, 1e-12))
    for known in ({}, {"friction": FrictionCurves({"z1": curves()["z1"]})}):
        result = found(TASK, soft, recipe=replace(EXACT, sign_width=WIDTHS), **known)
        np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-8, atol=1e-8)
        assert "reverses over 0.2, 0, 0.02 rad/s" in " ".join(result.estimate.notes)
        assert result.training_error < 1e-8
        assert load_result(saved(tmp_path, result, replace=True)).recipe.sign_width == WIDTHS
    log = played(three_joints(), 3)
    pace = log.dq @ C.T / log.rate
    hysteretic = turned(measured_direction(log.q @ C.T, np.array(DISTANCES), pace))
    result = found(TASK, hysteretic, recipe=replace(EXACT, breakaway=DISTANCES))
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=1e-8, atol=1e-8)
    energy = Task("irp6", model="energy")
    for task, changes, message in (
        (TASK, {"sign_width": (0.1, 0.1)}, "`sign_width` needs one value, or 3, one per moving drive; given 2"),
        (TASK, {"breakaway": (0.1,)}, "`breakaway` needs one value, or 3, one per moving drive; given 1"),
        (energy, {"sign_width": (0.1,) * 3}, "a `sign_width` of each drive is for the differential model"),
    ):
        assert re.search(message, refusal(found, task, soft, recipe=replace(EXACT, **changes)))
    robot, dq = irp6(), np.array([[0.3] * 5, [0.0] * 5])  # zero is the sign
    samples, widths = Samples(np.arange(2.0), *[dq] * 4), (0.0,) * 4 + (1e-9,)
    directions = drive_directions(robot, samples, widths, None)
    np.testing.assert_array_equal(directions, np.sign(dq @ friction_rows(robot).T))
    assert drive_directions(robot, samples, 0.0, (0.0,) * 5) is None


def written_out(z: Array, distance: float) -> Array:
    """Dahl's equation solved along the path, row by row."""
    s = np.zeros_like(z)
    for k in range(1, len(z)):
        way = z[k] - z[k - 1]
        s[k] = np.sign(way) + (s[k - 1] - np.sign(way)) * np.exp(-np.abs(way) / distance)
    return s


def test_a_drive_turns_between_its_samples() -> None:
    """Over a vanishing distance the direction is the sign of the velocity, from the first row after a reversal on."""
    t = np.arange(0.0, 3.0, 0.01)[:, None]
    z, dz = np.sin(5.0 * t + [0.0, 1.0]), 5.0 * np.cos(5.0 * t + [0.0, 1.0])
    np.testing.assert_allclose(measured_direction(z, 1e-9, 0.01 * dz), np.sign(dz), atol=1e-9)
    late = np.flatnonzero(measured_direction(z, 1e-9)[:, 0] != np.sign(dz[:, 0]))
    assert late.size  # without the velocities
    slow = measured_direction(z, 0.2)  # and changes nothing over distances that are long against a row
    np.testing.assert_allclose(measured_direction(z, 0.2, 0.01 * dz), slow, atol=0.01)


@pytest.mark.parametrize("distance", [1e-6, 1e-3, 0.1, 1e3])
def test_every_length_of_path_follows_the_recursion(distance: float) -> None:
    for count in (1, 2, 3, 4, 10, 99, 100, 101, 1000):
        rng = np.random.default_rng(count)
        z = np.cumsum(rng.normal(size=(count, 2)) * [1e-3, 1e-1], axis=0)
        np.testing.assert_allclose(dahl_direction(z, distance), written_out(z, distance), atol=1e-13)


def test_the_slope_along_the_path_is_that_of_dahl() -> None:
    t = np.linspace(0.0, 3.0, 30_001)
    z = np.sin(3.0 * t)[:, None]
    s, d = dahl_direction(z, 0.2)[:, 0], 0.2
    way = np.diff(z[:, 0])
    middle = (s[1:] + s[:-1]) / 2
    fast = np.abs(way) > 1e-5
    np.testing.assert_allclose((np.diff(s) / way)[fast], ((1 - middle * np.sign(way)) / d)[fast], rtol=1e-4, atol=1e-6)
