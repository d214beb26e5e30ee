"""Intervals of estimates some of whose terms were chosen by the same data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from observed import random_problem

from excite.identification.allowances import allowing_for_selection
from excite.identification.estimators.least_squares import weighted


def test_an_added_term_has_the_interval_of_several_statements_at_once() -> None:
    plain = weighted(random_problem(0)[0])
    wider = allowing_for_selection(plain, [1], 10)
    expected = scipy.stats.t.isf(0.005 / 10, plain.degrees_of_freedom) * plain.deviation[1]
    assert wider.half_width[1] == pytest.approx(expected, rel=1e-9)
    np.testing.assert_array_equal(wider.values, plain.values)


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


@pytest.mark.parametrize(("added", "candidates"), [([], 10), ([0], 1)])
def test_without_a_choice_nothing_changes(added: list[int], candidates: int) -> None:
    plain = weighted(random_problem(0)[0])
    assert allowing_for_selection(plain, added, candidates) is plain
