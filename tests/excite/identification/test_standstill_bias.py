"""Intervals that allow for what friction near standstill does to an estimate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, TASK, found, irp6, noisy, played, three_joints

from excite.identification.biases import allowing_for_standstill, fails_near_standstill, fast_rows
from excite.identification.estimator import Context
from excite.identification.estimators.least_squares import Weighted
from excite.identification.streamed_rows import HeldRows, StreamedRows
from excite.logs.log import Log
from regressors.samples import Array

EXACTLY = replace(EXACT, sign_width=0.0)
C = irp6().transmission.coupling[:3, :3]


@pytest.fixture(scope="module")
def log() -> Log:
    return noisy(played(three_joints(), 3, seconds=6.0), 1.0, 0.0, 0)


def sticking(log: Log, size: float, speed: float = 0.05) -> Log:
    """Friction of drive 3 that is smaller near standstill than its model says."""
    assert log.dq is not None
    assert log.effort is not None
    dz = log.dq @ C[2]
    return replace(log, effort=log.effort - size * np.outer(np.sign(dz) * (np.abs(dz) < speed), C[2]))


def context_of(result):

    return Context(result.target, result.prepared, result.recipe)


def slowest(result) -> Array:
    """Least speed of the drives of each row, by hand."""
    dz = np.abs(result.prepared[0].samples.dq @ C.T)
    each = np.column_stack([np.where(np.abs(C[:, j]) > 0, dz, np.inf).min(axis=1) for j in range(3)])
    return each.ravel()


def test_rows_of_fast_drives(log: Log) -> None:
    result = found(TASK, log, recipe=EXACTLY)
    np.testing.assert_array_equal(fast_rows(result.observations, context_of(result), 0.1), slowest(result) >= 0.1)


def test_where_friction_holds_the_change_without_slow_rows_enters(log: Log) -> None:
    result = found(TASK, sticking(log, 20.0), recipe=EXACTLY)
    speeds = np.sqrt(np.mean((result.prepared[0].samples.dq @ C.T) ** 2, axis=0))
    fast = slowest(result) >= 0.1 * np.median(speeds)
    assert fails_near_standstill(result.estimate, result.observations, fast)
    estimator = Weighted()
    other = estimator.estimate(result.observations.rows(np.flatnonzero(fast)))
    plain = estimator.estimate(result.observations)
    wider = allowing_for_standstill(plain, estimator, result.observations, context_of(result))
    change = other.values - plain.values
    np.testing.assert_allclose(wider.covariance, plain.covariance + np.outer(change, change), rtol=1e-6)
    truth = np.array([irp6().transmission.drives[2].coulomb])
    place = result.names.index("F3c")
    assert abs(plain.values[place] - truth) > plain.half_width[place]
    assert abs(plain.values[place] - truth) < wider.half_width[place]
    assert any("friction near standstill" in note for note in wider.notes)


def test_friction_that_is_right_changes_nothing(log: Log) -> None:
    result = found(TASK, log, recipe=EXACTLY)
    plain = Weighted().estimate(result.observations)
    assert allowing_for_standstill(plain, Weighted(), result.observations, context_of(result)) is plain


def test_where_rows_are_left_out_twice_the_speed_is_tried(log: Log) -> None:
    result = found(TASK, log, recipe=replace(EXACTLY, standstill=0.05))
    plain = Weighted().estimate(result.observations)
    wider = allowing_for_standstill(plain, Weighted(), result.observations, context_of(result))
    fast = fast_rows(result.observations, context_of(result), 0.1)
    assert 0 < np.count_nonzero(~fast) < fast.size
    change = Weighted().estimate(result.observations.rows(np.flatnonzero(fast))).values - plain.values
    np.testing.assert_allclose(wider.covariance, plain.covariance + np.outer(change, change), rtol=1e-6)


def test_what_only_slow_rows_show_has_an_interval_as_wide_as_itself(log: Log) -> None:
    """Friction of drives that hardly move in any row that is compared with."""
    result = found(TASK, log, recipe=EXACTLY)
    part = result.prepared[0]
    moved = replace(part.samples, dq=part.samples.dq * [1.0, 1e-3, 1e-3])
    slow = replace(context_of(result), prepared=(replace(part, samples=moved),))
    recipe = replace(EXACTLY, standstill=1e-2)
    plain = Weighted().estimate(result.observations)
    wider = allowing_for_standstill(plain, Weighted(), result.observations, replace(slow, recipe=recipe))
    place = result.names.index("F3c")
    assert wider.deviation[place] >= abs(plain.values[place])


def test_of_streamed_rows_stretches_stand_for_all(log: Log) -> None:
    result = found(TASK, sticking(log, 20.0), recipe=EXACTLY)
    held = result.observations
    rows = HeldRows(held.matrix.reshape(-1, 3, held.W.shape[1]))
    streamed = replace(held, W=StreamedRows((rows,), (None,)))
    plain = Weighted().estimate(held)
    expected = allowing_for_standstill(plain, Weighted(), held, context_of(result))
    wider = allowing_for_standstill(plain, Weighted(), streamed, context_of(result))
    np.testing.assert_allclose(wider.covariance, expected.covariance, rtol=1e-6)
