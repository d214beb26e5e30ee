"""Bias by noise in the measured motion: its size, and intervals that reach the truth nevertheless."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played import TASK, found, irp6, noisy, played, three_joints

from excite.identification.biases import motion_noise
from excite.identification.identification import Identification
from excite.identification.preparation import prepare
from excite.identification.recipe import Recipe
from excite.information.target import target_of
from excite.logs.log import Log

RECIPE = Recipe(rows="all", cutoff=40.0, sign_width=0.0)
NOISE = 3e-4


@pytest.fixture(scope="module")
def exact() -> Log:
    return played(three_joints(), 3, seconds=4.0)


@pytest.mark.parametrize("stretch", [2**16, 500])
@pytest.mark.parametrize("delay", [0.0, 0.01])
def test_the_noise_has_the_size_that_passes_the_filter(
    exact: Log, stretch: int, delay: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("excite.identification.biases._NOISE_STRETCH", stretch)
    recipe = replace(RECIPE, delay=delay)
    target = target_of(irp6(), TASK)
    clean = prepare(exact, irp6(), target, recipe)
    for seed in (1, 2):
        part = prepare(noisy(exact, 0.0, NOISE, seed), irp6(), target, recipe)
        drawn = motion_noise(part, recipe, "ddq", seed)
        assert drawn is not None
        assert drawn.values.shape == part.samples.q.shape
        measured = np.std(part.samples.ddq - clean.samples.ddq, axis=0)
        np.testing.assert_allclose(np.std(drawn.values, axis=0), measured, rtol=0.2)


@pytest.mark.parametrize(
    "change", [{"average": True, "period": 2.0}, {"measured_velocity": True}, {"signals": "spline"}]
)
def test_motions_that_are_no_linear_function_of_positions_have_none(exact: Log, change: dict) -> None:
    part = prepare(exact, irp6(), target_of(irp6(), TASK), RECIPE)
    assert motion_noise(part, replace(RECIPE, **change), "ddq") is None


def missed(result: Identification) -> int:
    assert result.reference is not None
    return int(np.sum(np.abs(result.estimate.values - result.reference.values) > result.estimate.half_width))


def test_intervals_reach_the_truth_although_the_estimate_is_biased(exact: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    results = [found(TASK, noisy(exact, 0.3, NOISE, seed), recipe=RECIPE) for seed in range(4)]
    assert any("noise in the motion biases" in note for note in results[0].estimate.notes)
    assert sum(missed(r) for r in results) <= 2
    monkeypatch.setattr("excite.identification.estimation.allowing_for_motion_noise", lambda estimate, *_: estimate)
    without = [found(TASK, noisy(exact, 0.3, NOISE, seed), recipe=RECIPE) for seed in range(4)]
    assert sum(missed(r) for r in without) > 8


def test_an_exact_motion_says_nothing(exact: Log) -> None:
    result = found(TASK, noisy(exact, 0.3, 0.0, 0), recipe=RECIPE)
    assert not any("noise in the motion" in note for note in result.estimate.notes)
