"""Intervals that allow for what was found from the same data: delay, presliding, chosen terms, a pull."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.stats
from observed import observations_of, random_problem
from played import EXACT, TASK, described, found, irp6, noisy, played, three_joints
from written_files import saved

from excite.identification.allowances import (
    allowing_for_pull,
    allowing_for_selection,
    delay_columns,
    presliding_columns,
    with_nuisance,
    without_nuisance,
)
from excite.identification.covariance import robust_covariance
from excite.identification.equations import equations_of
from excite.identification.estimator import Context
from excite.identification.estimators.least_squares import weighted
from excite.identification.preparation import prepare
from excite.identification.procedure import estimate_parameters
from excite.identification.result_json import load_result
from excite.identification.streamed_rows import StreamedRows, held_rows
from excite.information.target import target_of
from excite.tasks.task import Task
from regressors.errors import InputError

C = irp6().transmission.coupling[:3, :3]


def test_the_column_is_the_change_of_the_prediction_with_the_width() -> None:
    log = played(three_joints(), 3)
    for setting in ({"sign_width": 0.05}, {"breakaway": 2e-3}):
        recipe = replace(EXACT, **setting)
        result = found(TASK, log, recipe=recipe)
        (column,) = presliding_columns(Context(result.target, result.prepared, recipe), result.coefficients).T
        own = replace(recipe, **{name: (size,) * 3 for name, size in setting.items()})
        columns = presliding_columns(Context(result.target, result.prepared, own), result.coefficients)
        np.testing.assert_allclose(columns.sum(axis=1), column, atol=1e-9 * np.abs(column).max())
        predicted = []
        for step in (-0.05, 0.05):
            changed = replace(recipe, **{k: v * np.exp(step) for k, v in setting.items()})
            target = target_of(irp6(), TASK, changed.sign_width or 0.0)
            predicted.append(equations_of(target, result.prepared[0], changed).W @ result.coefficients)
        np.testing.assert_allclose(column, (predicted[1] - predicted[0]) / 0.1, atol=1e-9 * np.abs(column).max())
    sign = Context(result.target, result.prepared, replace(EXACT, sign_width=0.0))
    assert presliding_columns(sign, result.coefficients).size == 0


def test_the_wider_covariance_is_the_block_of_the_larger_problem() -> None:
    """Of an array, and of streamed rows."""
    rng = np.random.default_rng(0)
    W, c = rng.normal(size=(200, 3)), rng.normal(size=200)
    W[:, 0] += c
    held, A = observations_of(W, W @ np.ones(3) + 0.1 * rng.normal(size=200)), np.column_stack([W, c])
    robust = []
    for observations in (held, replace(held, W=StreamedRows([held_rows(W[:, None])]))):
        estimate = weighted(observations)
        extended, rows = with_nuisance(estimate, observations, c)
        wider = without_nuisance(extended, estimate)
        sigma = float(estimate.noise[0, 0])
        np.testing.assert_allclose(wider.covariance, sigma**2 * np.linalg.inv(A.T @ A)[:3, :3], rtol=1e-6)
        assert wider.deviation[0] > 1.1 * estimate.deviation[0]
        np.testing.assert_array_equal(wider.values, estimate.values)
        robust.append(robust_covariance(extended, rows).covariance)
        for which in (slice(5, 9), np.array([0, 7, 150])):
            np.testing.assert_allclose(rows.W[which], A[which], rtol=1e-9)
        np.testing.assert_allclose(rows.W @ np.arange(4.0), A @ np.arange(4.0), rtol=1e-9)
    assert isinstance(rows.W, StreamedRows)
    np.testing.assert_allclose(*robust, rtol=1e-9, atol=1e-15)


def test_a_width_that_is_found_widens_the_intervals_of_friction() -> None:
    log = played(three_joints(), 3)
    dz = log.dq @ C.T
    smooth = replace(log, effort=log.effort + (np.array([28.0, 28.75, 30.0]) * (np.tanh(dz / 0.1) - np.sign(dz))) @ C)
    moved = noisy(smooth, 2.0, 0.0, 0)
    free = found(TASK, moved, recipe=replace(EXACT, covariance="white", breakaway=0.0))
    given = found(TASK, moved, recipe=replace(EXACT, covariance="white", sign_width=free.recipe.sign_width))
    np.testing.assert_allclose(free.estimate.values, given.estimate.values, rtol=1e-9)
    ratio = free.estimate.deviation / given.estimate.deviation
    coulomb = [k for k, name in enumerate(free.names) if name.endswith("c")]
    assert np.all(ratio > 1.0 - 1e-9)
    assert ratio[coulomb].max() > 1.02


STEP = 1 / 200
DELAYED = replace(EXACT, sign_width=0.2, delay=2e-3)


@pytest.mark.parametrize("changes", [{}, {"every": 3}])
def test_the_column_is_the_change_of_the_prediction_with_the_delay(changes: dict[str, int]) -> None:
    log, recipe = played(three_joints(), 3), replace(DELAYED, **changes)
    result = found(TASK, log, recipe=recipe)
    beta = result.estimate.coefficients
    (column,) = delay_columns(Context(result.target, result.prepared, recipe), beta).T
    predicted = []
    for step in (-STEP, STEP):
        other = replace(recipe, delay=recipe.delay + step)
        part = prepare(log, irp6(), result.target, other)
        predicted.append(equations_of(result.target, part, other).W @ beta)
    inner = slice(6, -6)  # the motion is not known beyond the log
    expected = (predicted[1] - predicted[0]) / 2
    np.testing.assert_allclose(column[inner], expected[inner], atol=0.02 * np.abs(expected).max())


def test_joints_have_delays_of_their_own(tmp_path: Path) -> None:
    """Torques of one joint that are some rows late are matched again; equal delays are one delay of all."""
    log, exact = played(three_joints(), 3), replace(EXACT, sign_width=0.0)
    late = log.effort.copy()
    late[4:, 2] = log.effort[:-4, 2]
    shifted = replace(exact, delay=(0.0, 0.0, 4 / log.rate))
    plain, other = (found(TASK, replace(log, effort=late, sha256="late"), recipe=recipe) for recipe in (exact, shifted))
    assert other.training_error < 0.1 * plain.training_error
    np.testing.assert_allclose(other.estimate.values, described(other), rtol=1e-6, atol=1e-6)
    assert load_result(saved(tmp_path, other)).recipe == other.recipe
    one, each = (found(TASK, log, recipe=replace(exact, delay=delay)) for delay in (2e-3, (2e-3,) * 3))
    np.testing.assert_array_equal(one.observations.y, each.observations.y)
    np.testing.assert_array_equal(one.observations.matrix, each.observations.matrix)
    with pytest.raises(InputError, match="`delay` needs one value, or, of joint torques, 3, one of each of"):
        found(TASK, log, recipe=replace(exact, delay=(0.0, 0.0)))


def test_there_is_none_without_a_delay_or_for_windows() -> None:
    log = played(three_joints(), 3)
    plain = found(TASK, log, recipe=replace(DELAYED, delay=0.0))
    assert not delay_columns(Context(plain.target, plain.prepared, plain.recipe), plain.estimate.coefficients).size
    energy = found(Task("irp6", model="energy"), log, recipe=replace(EXACT, sign_width=0.0))
    recipe = replace(energy.recipe, delay=2e-3)
    assert not delay_columns(Context(energy.target, energy.prepared, recipe), energy.estimate.coefficients).size


def test_a_delay_that_is_found_widens_the_intervals() -> None:
    log = noisy(played(three_joints(), 3), 1.0, 0.0, 0)
    known, found_too = (
        estimate_parameters(irp6(), TASK, [log], DELAYED, found=found) for found in (frozenset(), frozenset({"delay"}))
    )
    np.testing.assert_array_equal(known.estimate.values, found_too.estimate.values)
    assert known.names == found_too.names
    ratio = found_too.estimate.deviation / known.estimate.deviation
    assert np.all(ratio > 0.999)
    assert ratio.max() > 1.1


def test_an_added_term_has_the_interval_of_several_statements_at_once() -> None:
    plain = weighted(random_problem(0)[0])
    wider = allowing_for_selection(plain, [1], 10)
    expected = scipy.stats.t.isf(0.005 / 10, plain.degrees_of_freedom) * plain.deviation[1]
    assert wider.half_width[1] == pytest.approx(expected, rel=1e-9)
    np.testing.assert_array_equal(wider.values, plain.values)
    assert allowing_for_selection(plain, [], 10) is allowing_for_selection(plain, [0], 1) is plain


def test_others_widen_by_their_correlation_with_it() -> None:
    plain = weighted(random_problem(0)[0])
    p = len(plain.names)
    alone = replace(plain, covariance=np.diag(np.arange(1.0, p + 1)))
    wider = allowing_for_selection(alone, [0], 5)
    np.testing.assert_allclose(wider.covariance[1:, 1:], alone.covariance[1:, 1:])
    tied = replace(plain, covariance=np.full((p, p), 1.0) + 1e-9 * np.eye(p))
    factor = allowing_for_selection(tied, [0], 5).deviation / tied.deviation
    np.testing.assert_allclose(factor, factor[0], rtol=1e-6)
    assert factor[0] > 1.1


def test_the_covariance_holds_the_square_of_the_distance_to_the_estimate_without_pull() -> None:
    observations, _ = random_problem(0)
    free, shift = weighted(observations), np.array([0.5, -0.2, 0.0, 1.0])
    pulled = replace(free, values=free.values + shift)
    for by in ({"described_within": 0.3}, {"described_within": 3.0}):
        wider = allowing_for_pull(pulled, SimpleNamespace(**by), observations)
        np.testing.assert_allclose(wider.covariance, free.covariance + np.outer(shift, shift))
        assert "estimate without the description" in wider.notes[-1]
    for by in ({"described_within": None}, {}):
        assert allowing_for_pull(free, SimpleNamespace(**by), observations) is free
