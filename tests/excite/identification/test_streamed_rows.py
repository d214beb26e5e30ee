"""Rows that are computed in blocks: the same numbers as the whole array, whatever the blocks are; memory; refusals."""

from __future__ import annotations

import dataclasses
import tracemalloc
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from played import TASK, found, noisy, played, three_joints

from excite.identification import equations, observations, streamed_rows
from excite.identification.recipe import Recipe
from excite.identification.streamed_rows import RowSource, StreamedRows, held_rows, joined_rows
from excite.logs.log import Log
from regressors.errors import InputError

ALL = Recipe(rows="all")
RECIPES = {
    "white": dataclasses.replace(ALL, covariance="white"),
    "low-passed": dataclasses.replace(ALL, cutoff=40.0, low_pass=20.0, covariance="robust"),
    "decimated": dataclasses.replace(ALL, every=3),
    "presliding": dataclasses.replace(ALL, breakaway=1e-3, estimator="least-squares", covariance="robust"),
    "near described": dataclasses.replace(ALL, estimator="physical", described_within=0.5, covariance="robust"),
}


@cache
def logs() -> list[Log]:
    return [noisy(played(three_joints(), 3, seconds=seconds), 0.5, 1e-5, 1) for seconds in (4.005, 2.505)]


@pytest.mark.slow
@pytest.mark.parametrize("name", RECIPES)
def test_blocks_give_what_the_whole_gives(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two logs, in blocks of 37 instants, against the array."""
    whole = found(TASK, *logs(), recipe=RECIPES[name])
    assert isinstance(whole.observations.W, np.ndarray)
    for module, what, value in (
        (equations, "HELD", 0),
        (streamed_rows, "HELD", 0),
        (streamed_rows, "BLOCK", 37),
        (observations, "BLOCK", 37),
    ):
        monkeypatch.setattr(module, what, value)
    blocks = found(TASK, *logs(), recipe=RECIPES[name])
    assert isinstance(blocks.observations.W, StreamedRows)
    size = np.abs(whole.observations.W).max()
    np.testing.assert_allclose(blocks.observations.matrix, whole.observations.W, rtol=0, atol=1e-11 * size)
    tolerance = 1e-9 * whole.estimate.deviation
    assert np.all(np.abs(blocks.estimate.values - whole.estimate.values) <= tolerance)
    np.testing.assert_allclose(blocks.estimate.deviation, whole.estimate.deviation, rtol=1e-9)
    assert blocks.condition_number == pytest.approx(whole.condition_number, rel=1e-9)
    assert blocks.training_error == pytest.approx(whole.training_error, rel=1e-9)
    assert blocks.estimate.notes == whole.estimate.notes
    np.testing.assert_allclose(blocks.scatter.each.deviations, whole.scatter.each.deviations, rtol=1e-8)


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 3))
@settings(max_examples=30, deadline=None)
def test_streamed_rows_are_read_as_an_array_is(seed: int, block: int, r: int) -> None:
    rng = np.random.default_rng(seed)
    parts = [rng.normal(size=(int(rng.integers(1, 20)), r, 4)) for _ in range(3)]
    kept = [np.flatnonzero(rng.random(len(part)) < 0.7) for part in parts]
    W = np.concatenate([part[k].reshape(-1, 4) for part, k in zip(parts, kept, strict=True)])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(streamed_rows, "BLOCK", block)
        streamed = StreamedRows([held_rows(part).at(k) for part, k in zip(parts, kept, strict=True)])
        a, b = np.sort(rng.integers(0, len(W) + 1, 2))
        np.testing.assert_array_equal(streamed[a:b], W[a:b])
        np.testing.assert_array_equal(streamed[a:b:2], W[a:b:2])
        some = rng.integers(0, len(W), 5) if len(W) else np.zeros(0, dtype=int)
        np.testing.assert_array_equal(streamed[some], W[some])
        beta = rng.normal(size=4)
        np.testing.assert_allclose(streamed @ beta, W @ beta, atol=1e-14)
        np.testing.assert_allclose(streamed @ (2 * beta), W @ (2 * beta), atol=1e-14)
        np.testing.assert_array_equal(streamed.whole(), W)
        both = joined_rows([W, streamed])
        assert isinstance(both, StreamedRows)
        np.testing.assert_array_equal(both.whole(), np.concatenate([W, W]))


def test_a_product_holds_one_block_at_once() -> None:
    """Rows of 240 MB are multiplied in less than 40 MB, half of which is the product."""
    W = StreamedRows([RowSource((1_000_000, 3, 10), lambda which: np.full((which.stop - which.start, 3, 10), 1.0))])
    tracemalloc.start()
    product = W @ np.ones(10)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert np.all(product == 10.0)
    assert W.nbytes == 240e6
    assert peak < 40e6


def test_methods_that_hold_all_rows_refuse_more_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(equations, "HELD", 0)
    monkeypatch.setattr(streamed_rows, "MOST", 10_000)
    for estimator in ("weighted", "least-squares"):
        result = found(TASK, logs()[1], recipe=dataclasses.replace(ALL, estimator=estimator))
        assert np.all(np.isfinite(result.estimate.values))
    for estimator in ("huber", "recursive"):
        with pytest.raises(InputError, match=r"equations for \d+ parameters take .* GB .*`every=\d+`.*weighted"):
            found(TASK, logs()[1], recipe=dataclasses.replace(ALL, estimator=estimator))
