"""The uncertainty of a delay that was found from the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import EXACT, TASK, found, irp6, noisy, played, three_joints

from excite.identification.allowances import delay_column
from excite.identification.equations import equations_of
from excite.identification.estimation import estimate_parameters
from excite.identification.estimator import Context
from excite.identification.preparation import prepare
from excite.tasks.task import Task

STEP = 1 / 200
DELAYED = replace(EXACT, sign_width=0.2, delay=2e-3)


@pytest.mark.parametrize("changes", [{}, {"every": 3}])
def test_the_column_is_the_change_of_the_prediction_with_the_delay(changes: dict[str, int]) -> None:
    log, recipe = played(three_joints(), 3), replace(DELAYED, **changes)
    result = found(TASK, log, recipe=recipe)
    beta = result.estimate.coefficients
    column = delay_column(Context(result.target, result.prepared, recipe), beta)
    predicted = []
    for step in (-STEP, STEP):
        other = replace(recipe, delay=recipe.delay + step)
        part = prepare(log, irp6(), result.target, other)
        predicted.append(equations_of(result.target, part, other).W @ beta)
    assert column is not None
    inner = slice(6, -6)  # the motion is not known beyond the log
    expected = (predicted[1] - predicted[0]) / 2
    np.testing.assert_allclose(column[inner], expected[inner], atol=0.02 * np.abs(expected).max())


def test_there_is_none_without_a_delay_or_for_windows() -> None:
    log = played(three_joints(), 3)
    plain = found(TASK, log, recipe=replace(DELAYED, delay=0.0))
    assert delay_column(Context(plain.target, plain.prepared, plain.recipe), plain.estimate.coefficients) is None
    energy = found(Task("irp6", model="energy"), log, recipe=replace(EXACT, sign_width=0.0))
    recipe = replace(energy.recipe, delay=2e-3)
    assert delay_column(Context(energy.target, energy.prepared, recipe), energy.estimate.coefficients) is None


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
