"""An identification repeated in simulation: which, and with which noise."""

from __future__ import annotations

import numpy as np
import pytest
from played import TASK, found, noisy, played, three_joints

from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.registry import REPEATABLE
from excite.study.moments import ESTIMATORS
from excite.study.repetitions import effort_noise, position_noise
from excite.tasks.task import Task


@pytest.fixture(scope="module")
def noise() -> Log:
    return noisy(played(three_joints(), 3, seconds=4.005), 0.5, 1e-5, 1)


def test_the_estimators_that_can_be_repeated_are_those_in_batches() -> None:
    assert set(REPEATABLE) == set(ESTIMATORS)


def test_repetitions_have_the_noise_of_the_torques_whatever_the_equations_are(noise: Log) -> None:
    for task, recipe in (
        (TASK, Recipe(rows="all")),
        (TASK, Recipe(rows="all", low_pass=5.0)),
        (Task("irp6", model="energy"), Recipe(rows="all")),
    ):
        result = found(task, noise, recipe=recipe)
        np.testing.assert_allclose(effort_noise(result), 0.5, rtol=0.15)
    np.testing.assert_allclose(position_noise(result), 1e-5, rtol=0.25)
