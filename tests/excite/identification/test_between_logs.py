"""Scatter between logs: the statistic, its test, and intervals that allow for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from played import EXACT, TASK, found, noisy, played, three_joints

from excite.identification.between_logs import EachLog, allowing_for_logs, interval_scope, log_scatter, scatter_warning
from excite.identification.estimator import Estimate
from excite.identification.identify import identify
from excite.identification.result_json import result_content
from regressors.errors import InputError
from regressors.samples import Array

COUNT = 8  # parameters, of which the second half is friction


def each_of(values: Array, deviations: Array | float = 1.0, freedom: float = 1e6) -> EachLog:
    K, p = values.shape
    names, units = tuple(f"b{j}" for j in range(p)), ("1",) * p
    deviations = np.broadcast_to(deviations, values.shape).astype(float)
    logs = tuple(f"log{k}" for k in range(K))
    return EachLog(logs, names, units, np.arange(p) >= p // 2, values, deviations, np.full(K, freedom))


def together(each: EachLog) -> Estimate:
    """Weighted mean of the logs, with its deviation for noise alone."""
    w = 1 / each.deviations**2
    values = np.sum(w * each.values, axis=0) / w.sum(axis=0)
    return Estimate("weighted", each.names, each.units, values, np.diag(1 / w.sum(axis=0)), np.ones((1, 1)), 10**6)


@pytest.mark.parametrize("sizes", [(7, 12), (7, 12, 5)])
def test_it_is_welchs_test(sizes: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    logs = [rng.normal(size=size) * (k + 1) for k, size in enumerate(sizes)]
    means, s = ([[f(x)] for x in logs] for f in (np.mean, scipy.stats.sem))
    each = replace(each_of(np.array(means), np.array(s)), degrees_of_freedom=np.array(sizes) - 1.0)
    expected = scipy.stats.f_oneway(*logs, equal_var=False).pvalue
    assert log_scatter(each).probabilities[0] == pytest.approx(expected, rel=1e-6)


def test_noise_alone_seldom_warns_and_a_change_is_named() -> None:
    rng = np.random.default_rng(2)
    warned = sum(bool(log_scatter(each_of(rng.normal(size=(3, COUNT)))).exceeding) for _ in range(500))
    assert warned <= 15  # 1 % of 500, plus what chance allows
    values = rng.normal(size=(3, COUNT))
    values[:, 5] += [0.0, 9.0, -4.0]
    scatter = log_scatter(each_of(values))
    assert scatter.exceeding == ("b5",)
    warning = scatter_warning(scatter)
    assert warning.startswith("b5 differs from log to log")


@pytest.mark.slow
@pytest.mark.parametrize(("logs", "change"), [(2, 0.0), (2, 10.0), (3, 1.0), (5, 10.0)])
def test_intervals_cover_the_mean_over_logs_whose_friction_changes(logs: int, change: float) -> None:
    rng = np.random.default_rng(logs)
    size = np.where(np.arange(COUNT) >= COUNT // 2, np.hypot(1.0, change), 1.0)
    inside, plain = [], []
    for _ in range(300):
        each = each_of(rng.normal(size=(logs, COUNT)) * size)
        alone = together(each)
        wider = allowing_for_logs(alone, log_scatter(each))
        inside.append(np.abs(wider.values) <= wider.half_width)
        plain.append(np.abs(alone.values) <= alone.half_width)
    assert np.mean(inside, axis=0).min() > 0.97
    if change == 10.0:
        assert np.mean(plain, axis=0)[-1] < 0.5


def test_variances_follow_the_scatter_with_as_many_degrees_of_freedom_as_logs() -> None:
    """``s^2 max(1, m, (m + (K - 1) Q / (K - 1)) / K)`` with the mean m of ``Q / (K - 1)`` over each kind."""
    values = np.random.default_rng(5).normal(size=(3, COUNT)) * np.linspace(0.5, 6.0, COUNT)
    each = each_of(values)
    ratios = np.var(values, axis=0, ddof=1).reshape(2, -1)  # of bodies, and of friction
    m = np.maximum(1.0, ratios.mean(axis=1, keepdims=True))
    expected = np.maximum(m, (m + 2 * ratios) / 3).ravel() / 3
    wider = allowing_for_logs(together(each), log_scatter(each))
    np.testing.assert_allclose(np.diag(wider.covariance), expected)
    np.testing.assert_allclose(wider.half_width, scipy.stats.t.ppf(0.995, 3) * np.sqrt(expected))


def test_a_parameter_that_one_log_does_not_show_is_left_out() -> None:
    values = np.array([[1.0, 2.0, 3.0, 4.0], [1.1, np.nan, 3.1, 4.1]])
    scatter = log_scatter(each_of(values, np.where(np.isnan(values), np.inf, 0.1)))
    assert list(scatter.counts) == [2, 1, 2, 2]
    assert np.isnan(scatter.ratios[1])
    assert np.all(scatter.factors() >= 1.0)
    values = np.array([[1.0, np.nan], [np.nan, 2.0]])  # without common parameters nothing changes but a note
    estimate = together(each_of(np.ones((2, 2))))
    alone = allowing_for_logs(estimate, log_scatter(each_of(values, np.where(np.isnan(values), np.inf, 0.1))))
    np.testing.assert_array_equal(alone.covariance, estimate.covariance)
    assert "leave out the scatter between logs" in alone.notes[-1]


@pytest.mark.slow
def test_each_log_is_estimated_as_if_it_were_alone() -> None:
    exact, recipe = played(three_joints(), 3, seconds=4.0), replace(EXACT, sign_width=0.0)
    logs = [noisy(exact, 0.5, 0.0, 1), replace(noisy(exact, 0.5, 0.0, 2), source="OTHER")]
    both = identify(TASK, logs, recipe=recipe, each=True)
    alone = [found(TASK, log, recipe=recipe) for log in logs]
    np.testing.assert_allclose(both.scatter.each.values, [a.estimate.values for a in alone], rtol=1e-9)
    np.testing.assert_allclose(both.scatter.each.deviations, [a.estimate.deviation for a in alone], rtol=1e-6)
    assert both.estimate.degrees_of_freedom == 2
    content = result_content(both)
    first = content["between_logs"]["parameters"][0]
    assert [e["log"] for e in first["each"]] == ["LOG", "OTHER"]
    assert first["each"][0]["value"] == both.scatter.each.values[0, 0]
    assert content["interval_scope"] == interval_scope(2)
    plain = result_content(identify(TASK, logs, recipe=recipe))
    assert "each" not in plain["between_logs"]["parameters"][0]
    single = result_content(alone[0])
    assert single["between_logs"] is None
    assert single["interval_scope"].startswith("the intervals cover the noise of this log alone")
    with pytest.raises(InputError, match="`each` compares the estimates of several logs, but one log is given"):
        identify(TASK, logs[0], recipe=EXACT, each=True)
