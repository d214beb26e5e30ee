"""Stretches of long logs that stand for all of their rows."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from observed import observations_of

from excite.identification import observations as module
from excite.identification.covariance import robust_covariance
from excite.identification.estimators.least_squares import weighted
from excite.identification.observations import Observations, row_stretches

COUNT = 6000


def correlated(logs: tuple[int, ...] = (COUNT,)) -> Observations:
    """Two equations with autoregressive noise, and a motion that is the same throughout."""
    rng = np.random.default_rng(3)
    n = sum(logs)
    t = np.arange(n)
    W = np.zeros((n, 2, 3))
    W[:, 0, 0], W[:, 0, 1], W[:, 1, 1] = np.sin(t / 3), np.cos(t / 11), np.sin(t / 7)
    W[:, 1, 2] = 1.0
    u = rng.normal(size=(n, 2))
    e = np.zeros((n, 2))
    for k in range(1, n):
        e[k] = 0.8 * e[k - 1] + u[k]
    one = observations_of(W.reshape(-1, 3), (W @ np.ones(3) + e).reshape(-1))
    return replace(
        one,
        equation=np.tile([0, 1], n),
        equations=(("a", "Nm"), ("b", "Nm")),
        log=np.repeat(np.arange(len(logs)), logs).repeat(2),
        logs=tuple(f"L{k}" for k in range(len(logs))),
        time=t.repeat(2).astype(float),
    )


@pytest.mark.parametrize("logs", [(COUNT,), (4000, 2000), (5000, 3, 997)])
def test_stretches_are_whole_instants_of_one_log_each(logs: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST", 2000)
    observations = correlated(logs)
    stretches = row_stretches(observations)
    assert 0.9 * 2000 < sum(s.stop - s.start for s in stretches) <= 2000 + 2 * len(logs)
    assert len(stretches) in range(8, 10)
    for before, after in itertools.pairwise(stretches):
        assert before.stop <= after.start
    for s in stretches:
        assert s.start % 2 == s.stop % 2 == 0
        assert np.unique(observations.log[s]).size == 1
    assert set(observations.log[[s.start for s in stretches]].tolist()) == set(range(len(logs)))


def test_few_rows_are_all_taken() -> None:
    assert row_stretches(correlated()) == [slice(0, 2 * COUNT)]


def test_stretches_of_a_uniform_motion_give_what_all_rows_give(monkeypatch: pytest.MonkeyPatch) -> None:
    observations = correlated()
    estimate = weighted(observations)
    whole = robust_covariance(estimate, observations, "autoregressive")
    monkeypatch.setattr(module, "MOST", 4000)
    part = robust_covariance(estimate, observations, "autoregressive")
    np.testing.assert_allclose(part.deviation, whole.deviation, rtol=0.1)
    assert np.all(whole.deviation / estimate.deviation > [0.5, 1.5, 2.0])
    assert "found from 4000 of 12000 rows" in part.notes[-1]
    assert "of 12000 rows" in robust_covariance(estimate, observations).notes[-1]
