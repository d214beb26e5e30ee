"""Recursive least squares: a literal loop of [KD96] eq. (17), (18), batch least squares with the prior, forgetting."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from observed import observations_of, random_problem, robot_observations

from excite.identification.estimators import recursive as recursive_file
from excite.identification.estimators.least_squares import least_squares
from excite.identification.estimators.recursive import recursive
from excite.identification.observations import join_observations
from regressors.errors import InputError
from regressors.samples import Array


def literal(W: Array, y: Array, c: float) -> tuple[Array, Array]:
    """[KD96] eq. (17), (18), one row after the other: estimates after every row, and the last P."""
    p = W.shape[1]
    X, P, path = np.zeros(p), c * np.eye(p), []
    for d, value in zip(W, y, strict=True):
        P = P - np.outer(P @ d, d) @ P / (1 + d @ P @ d)
        X = X + P @ d * (value - d @ X)
        path.append(X)
    return np.array(path), P


def small_problem(seed: int, rows: int, p: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(rows, p))
    return W, W @ rng.normal(size=p) + 0.1 * rng.normal(size=rows)


@given(st.integers(0, 2**32 - 1), st.integers(1, 100), st.integers(1, 5), st.sampled_from([1.0, 1e4]))
@settings(max_examples=25)
def test_every_row_is_the_literal_loops(seed: int, rows: int, p: int, c: float) -> None:
    W, y = small_problem(seed, rows, p)
    path, _ = literal(W, y, c)
    time, estimates = recursive(observations_of(W, y), prior=c).history
    np.testing.assert_allclose(estimates, path, atol=1e-7 * (1 + np.abs(path).max()))
    np.testing.assert_allclose(time, np.arange(rows) * 0.01)


def test_covariance_is_the_literal_loops() -> None:
    W, y = small_problem(0, 90, 4)
    path, P = literal(W, y, 1e3)
    found = recursive(observations_of(W, y), prior=1e3)
    square = float(np.sum((y - W @ path[-1]) ** 2))
    np.testing.assert_allclose(found.covariance, square / 86 * P, rtol=1e-8, atol=1e-12)
    np.testing.assert_array_equal(found.covariance, found.covariance.T)


@pytest.mark.parametrize("block", [1, 5, 32, 1000])
def test_rows_of_one_instant_are_taken_one_after_the_other(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three rows per instant in blocks of any size: the history holds the literal loop's every third estimate."""
    monkeypatch.setattr(recursive_file, "_BLOCK", block)
    W, y = small_problem(1, 120, 4)
    path, _ = literal(W, y, 10.0)
    _, estimates = recursive(observations_of(W, y, equations=3), prior=10.0).history
    np.testing.assert_allclose(estimates, path[2::3], rtol=1e-9)


@pytest.mark.parametrize("c", [1e-2, 1.0, 1e8])
def test_last_estimate_is_least_squares_with_the_prior(c: float) -> None:
    W, y = small_problem(2, 200, 6)
    regularised = np.linalg.lstsq(np.concatenate([W, np.eye(6) / np.sqrt(c)]), np.append(y, np.zeros(6)))[0]
    np.testing.assert_allclose(recursive(observations_of(W, y), prior=c).values, regularised, rtol=1e-8)


def test_parameters_of_a_robot_are_those_of_least_squares() -> None:
    observations, _ = robot_observations("panda", noise=0.01)
    found, expected = recursive(observations, prior=1e12), least_squares(observations)
    np.testing.assert_allclose(found.values, expected.values, atol=1e-6 * float(expected.deviation.min()))
    np.testing.assert_allclose(found.deviation, expected.deviation, rtol=1e-6)


@pytest.mark.parametrize(("every", "instants"), [(1, 60), (7, 9), (30, 2), (59, 2), (1000, 1)])
def test_decimated_history_ends_with_the_last_estimate(every: int, instants: int) -> None:
    observations, _ = random_problem(3)
    found = recursive(observations, every=every)
    time, estimates = found.history
    assert len(time) == instants
    assert time[-1] == observations.time[-1]
    np.testing.assert_array_equal(estimates[-1], found.values)
    whole = recursive(observations).history[1]
    np.testing.assert_array_equal(estimates[:-1], whole[every - 1 :: every][: instants - 1])


def test_logs_follow_one_another() -> None:
    observations, _ = random_problem(4)
    parts = [observations.rows(np.arange(0, 60)), observations.rows(np.arange(60, 120))]
    parts[1] = dataclasses.replace(parts[1], time=parts[1].time - parts[1].time[0] + parts[0].time[-1])
    found = recursive(join_observations(parts))
    np.testing.assert_allclose(found.values, recursive(observations).values, rtol=1e-9)
    assert len(found.history[0]) == 60  # the last instant of one log and the first of the next stay apart


@pytest.mark.parametrize("equations", [1, 2])
@pytest.mark.parametrize("forgetting", [0.7, 0.98])
def test_forgetting_is_an_exponential_weight(forgetting: float, equations: int) -> None:
    W, y = small_problem(5, 120, 3)
    age = np.repeat(np.arange(120 // equations)[::-1], equations)
    w = forgetting ** (age / 2)
    prior = np.sqrt(forgetting ** (120 // equations) / 100.0) * np.eye(3)
    stacked = np.concatenate([W * w[:, None], prior])
    expected = np.linalg.lstsq(stacked, np.append(y * w, np.zeros(3)))[0]
    found = recursive(observations_of(W, y, equations=equations), prior=100.0, forgetting=forgetting)
    np.testing.assert_allclose(found.values, expected, rtol=1e-7)


def test_forgetting_follows_a_parameter_that_changes() -> None:
    W, _ = small_problem(6, 600, 2)
    beta = np.where(np.arange(600)[:, None] < 300, [1.0, 1.0], [4.0, -2.0])
    y = np.sum(W * beta, axis=1)
    np.testing.assert_allclose(recursive(observations_of(W, y), forgetting=0.9).values, [4.0, -2.0], atol=1e-9)
    assert np.abs(recursive(observations_of(W, y)).values - [4.0, -2.0]).min() > 0.5


BAD = {
    "prior": ({"prior": 0.0}, "the prior c must be a positive number, given 0.0"),
    "forgetting": ({"forgetting": 1.2}, r"forgetting factor must be in \(0, 1\], given 1.2"),
    "every": ({"every": 0}, "every must be 1 or more, given 0"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_settings(case: str) -> None:
    setting, message = BAD[case]
    with pytest.raises(InputError, match=message):
        recursive(random_problem(0)[0], **setting)
