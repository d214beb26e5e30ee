"""How friction turns its direction: planted turnings are found, and reach the equations through the drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, TASK, described, found, irp6, played, three_joints

from excite.identification.equations import drive_rows, equations_of, friction_drives, measured_regressor
from excite.identification.preparation import prepare
from excite.identification.presliding import Presliding, best_presliding
from excite.information.target import target_of
from excite.logs.log import Log
from excite.tasks.task import Task
from regressors.samples import Array, Samples


@pytest.fixture(scope="module")
def log() -> Log:
    return played(three_joints(), 3)


def turned(log: Log, direction: Array) -> Log:
    """The log with friction whose direction is not the sign of the velocity."""
    C = irp6().transmission.coupling[:3, :3]
    coulomb = np.array([28.0, 28.75, 30.0])
    assert log.effort is not None
    assert log.dq is not None
    extra = (coulomb * (direction - np.sign(log.dq @ C.T))) @ C
    return replace(log, effort=log.effort + extra)


def test_a_planted_width_is_found(log: Log) -> None:
    assert log.dq is not None
    z = log.dq @ irp6().transmission.coupling[:3, :3].T
    result = found(TASK, turned(log, np.tanh(z / 0.02)))
    assert result.recipe.sign_width == pytest.approx(0.02, rel=0.1)
    assert result.recipe.breakaway == 0.0
    assert any("changes sign over 0.0" in note and "rad/s" in note for note in result.estimate.notes)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)


@pytest.mark.parametrize("width", [0.01, 0.02])
def test_a_width_is_searched_more_closely_than_noise_lets_it_be_known(log: Log, width: float) -> None:
    assert log.dq is not None
    z = log.dq @ irp6().transmission.coupling[:3, :3].T
    result = found(TASK, turned(log, np.tanh(z / width)))
    assert result.recipe.sign_width == pytest.approx(width, rel=2e-3)


def test_a_planted_distance_is_found(log: Log) -> None:
    # Dahl's equation by small steps of Euler along a fine path
    motion, fine = three_joints(), 200
    time = np.arange(400 * fine + 1) / (200.0 * fine)
    z = motion.at(time, 0)[:, :3] @ irp6().transmission.coupling[:3, :3].T
    s, kept, d = np.sign(z[1] - z[0]), [], 0.001
    for way in np.diff(z, axis=0, prepend=z[:1]):
        s = s + way * (1.0 - s * np.sign(way)) / d
        kept.append(s)
    result = found(TASK, turned(log, np.array(kept)[:-1:fine]))
    assert result.recipe.breakaway == pytest.approx(0.001, rel=0.1)
    assert result.recipe.sign_width == 0.0
    assert any("and holds at standstill" in note for note in result.estimate.notes)
    np.testing.assert_allclose(result.estimate.values, described(result), rtol=0.01, atol=0.1)


def test_a_turning_that_is_given_is_taken(log: Log) -> None:
    given = found(TASK, log, recipe=replace(EXACT, sign_width=0.3))
    assert (given.recipe.sign_width, given.recipe.breakaway) == (0.3, 0.0)
    given = found(TASK, log, recipe=replace(EXACT, breakaway=0.01))
    assert (given.recipe.sign_width, given.recipe.breakaway) == (0.0, 0.01)


def test_models_without_friction_turn_nothing(log: Log) -> None:
    for task in (TASK.changed(friction=False), TASK.changed(model="energy")):
        target = target_of(irp6(), task)
        part = prepare(log, irp6(), target, EXACT)
        assert best_presliding(target, [(part, equations_of(target, part, EXACT))]) == Presliding()


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
    C = irp6().transmission.coupling[:n, :n]
    which = [int(target.base.names[k][1:-1]) - 1 for k in columns]
    np.testing.assert_array_equal(drive_rows(target.robot)[list(drives.drives)], C[which])
    W = measured_regressor(target, samples).reshape(50, -1, target.base.rank)
    signs = np.sign(samples.dq @ C[which].T)
    for k, column in enumerate(columns):
        np.testing.assert_allclose(W[:, :, column], signs[:, [k]] * rows[k], atol=1e-12)
    assert len(model.row_labels) == rows.shape[1]
