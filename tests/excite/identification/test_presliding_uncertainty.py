"""The uncertainty of a presliding width that was found from the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from observed import observations_of
from played import EXACT, TASK, found, irp6, noisy, played, three_joints

from excite.identification.allowances import presliding_column, with_nuisance, without_nuisance
from excite.identification.covariance import robust_covariance
from excite.identification.equations import equations_of
from excite.identification.estimator import Context
from excite.identification.estimators.least_squares import weighted
from excite.identification.streamed_rows import HeldRows, StreamedRows
from excite.information.target import target_of

C = irp6().transmission.coupling[:3, :3]


@pytest.mark.parametrize("setting", [{"sign_width": 0.05}, {"breakaway": 2e-3}])
def test_the_column_is_the_change_of_the_prediction_with_the_width(setting: dict[str, float]) -> None:
    recipe = replace(EXACT, **setting)
    result = found(TASK, played(three_joints(), 3), recipe=recipe)
    beta = result.estimate.coefficients
    column = presliding_column(Context(result.target, result.prepared, recipe), beta)
    predicted = []
    for step in (-0.05, 0.05):
        changed = replace(recipe, **{k: v * np.exp(step) for k, v in setting.items()})
        target = target_of(irp6(), TASK, changed.sign_width or 0.0)
        predicted.append(equations_of(target, result.prepared[0], changed).W @ beta)
    assert column is not None
    np.testing.assert_allclose(column, (predicted[1] - predicted[0]) / 0.1, atol=1e-9 * np.abs(column).max())


def test_there_is_no_column_for_the_exact_sign() -> None:
    result = found(TASK, played(three_joints(), 3), recipe=replace(EXACT, sign_width=0.0))
    recipe = replace(EXACT, sign_width=0.0)
    assert presliding_column(Context(result.target, result.prepared, recipe), result.estimate.coefficients) is None


def test_the_wider_covariance_is_the_block_of_the_larger_problem() -> None:
    rng = np.random.default_rng(0)
    W, c = rng.normal(size=(200, 3)), rng.normal(size=200)
    W[:, 0] += c
    observations = observations_of(W, W @ np.ones(3) + 0.1 * rng.normal(size=200))
    estimate = weighted(observations)
    extended, _ = with_nuisance(estimate, observations, c)
    wider = without_nuisance(extended, estimate)
    sigma = float(estimate.noise[0, 0])
    A = np.column_stack([W, c])
    np.testing.assert_allclose(wider.covariance, sigma**2 * np.linalg.inv(A.T @ A)[:3, :3], rtol=1e-6)
    assert wider.deviation[0] > 1.1 * estimate.deviation[0]
    np.testing.assert_array_equal(wider.values, estimate.values)


def test_a_width_that_is_found_widens_the_intervals_of_friction() -> None:
    log = played(three_joints(), 3)
    assert log.dq is not None
    assert log.effort is not None
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


def test_streamed_rows_are_widened_as_an_array_is() -> None:
    rng = np.random.default_rng(0)
    W, c = rng.normal(size=(200, 3)), rng.normal(size=200)
    held = observations_of(W, W @ np.ones(3) + 0.1 * rng.normal(size=200))
    streamed = replace(held, W=StreamedRows([HeldRows(W[:, None])], [None]))
    results = []
    for observations in (held, streamed):
        extended, wider = with_nuisance(weighted(observations), observations, c)
        robust = robust_covariance(extended, wider)
        rows = wider.W[np.array([0, 7, 150])]
        results.append((extended.covariance, robust.covariance, wider.W[5:9], rows, wider.W @ np.arange(4.0)))
    assert isinstance(wider.W, StreamedRows)
    for array, blocks in zip(*results, strict=True):
        np.testing.assert_allclose(blocks, array, rtol=1e-9, atol=1e-15)
