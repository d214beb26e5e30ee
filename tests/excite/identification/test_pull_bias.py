"""Intervals of a pulled estimate reach the estimate without pull."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from observed import random_problem

from excite.identification.allowances import allowing_for_pull
from excite.identification.estimators.least_squares import weighted


@pytest.mark.parametrize("pulled_by", [{"pull": 1.0}, {"pull": 0.0, "described_within": 0.3}])
def test_the_covariance_holds_the_square_of_the_distance(pulled_by: dict[str, float]) -> None:
    observations, _ = random_problem(0)
    free = weighted(observations)
    shift = np.array([0.5, -0.2, 0.0, 1.0])
    pulled = type(free)(**{**vars(free), "values": free.values + shift})
    wider = allowing_for_pull(pulled, SimpleNamespace(**pulled_by), observations)  # type: ignore[arg-type]
    np.testing.assert_allclose(wider.covariance, free.covariance + np.outer(shift, shift))
    assert "allow for the pull" in wider.notes[-1]


def test_without_pull_nothing_changes() -> None:
    observations, _ = random_problem(0)
    free = weighted(observations)
    assert allowing_for_pull(free, SimpleNamespace(pull=0.0), observations) is free  # type: ignore[arg-type]
    assert allowing_for_pull(free, SimpleNamespace(), observations) is free  # type: ignore[arg-type]
