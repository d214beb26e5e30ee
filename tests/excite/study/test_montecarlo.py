"""Repetitions: against the chain done by hand, and against the laws of least squares."""

from __future__ import annotations

import dataclasses
import tracemalloc
from functools import cache
from typing import Any

import numpy as np
import pytest
import repeated_experiments
import scipy.stats
from motions import random_sines
from repeated_experiments import NOISE, TIME, arm, experiment
from slow_dynamics import random_chain

from excite.identification.estimator import Estimate
from excite.identification.estimators.least_squares import least_squares, weighted
from excite.identification.estimators.robust import instrumental
from excite.identification.observations import Observations
from excite.logs.signals.filters import Differences, kept_rows, low_passed
from excite.logs.signals.series import FourierFit, SmoothingSpline
from excite.study import experiment as chain_file, moments
from excite.study.experiment import Experiment, Noise, drawn
from excite.study.repetitions import Repetitions, executor_of_repetitions, repeat_experiment
from regressors.errors import InputError, TooLargeError
from regressors.models.base import base_parameters
from regressors.models.differential import DifferentialModel
from regressors.models.energy import EnergyModel
from regressors.models.load import LoadIntegralModel, LoadModel
from regressors.models.model import RegressorModel
from regressors.models.windows import Window, WindowModel
from regressors.robot.columns import Terms
from regressors.samples import Array, Samples

RATE = 100.0


# --- one repetition by hand ------------------------------------------------------------------------------------------


@cache
def chains() -> dict[str, Experiment]:
    shared = repeated_experiments.chains()
    return {
        "differential": experiment(DifferentialModel(arm()), NOISE, method=Differences(), estimator="least-squares"),
        "filtered": shared["differential"],
        "energy": shared["energy"],
        "load": shared["load"],
        "spline": experiment(DifferentialModel(arm()), NOISE, method=SmoothingSpline(knots=(0.1, 0.2))),
        "fourier": experiment(DifferentialModel(arm()), NOISE, method=FourierFit(3.01, 8)),
    }


def truth(e: Experiment) -> Array:
    """Torques or wrench of the parameters, each of the other columns being zero."""
    model, standard = e.model, np.zeros(len(e.model.columns))
    standard[e.base.index] = e.beta
    kind: RegressorModel = model
    if isinstance(model, EnergyModel):
        kind = DifferentialModel(model.robot, model.terms)
    elif isinstance(model, LoadIntegralModel):
        kind = LoadModel(model.robot, model.sensor)
    return (kind.assemble(e.samples) @ standard).reshape(e.samples.time.size, -1)


def by_hand(e: Experiment, seed: int, number: int) -> Estimate:
    """The slow chain of one repetition, with the same random numbers."""
    model, (N, n) = e.model, e.samples.q.shape
    tau = truth(e)
    draw = drawn(seed, number, N, n, tau.shape[1])
    tau = tau + np.asarray(e.noise.effort) * draw[0]
    q = e.samples.q + np.asarray(e.noise.position) * draw[1]
    for j, step in enumerate(np.broadcast_to(np.asarray(e.noise.count), n)):
        if step > 0:
            q[:, j] = step * (np.round(q[:, j] / step + draw[2][j]) - draw[2][j])
    motion = e.method.motion(TIME, q)
    true = Samples(*(getattr(e.samples, name)[motion.kept] for name in ("time", "q", "dq", "ddq", "dddq")))
    r, index = len(model.row_labels), e.base.index
    W, Z = (model.assemble(x)[:, index].reshape(-1, r, index.size) for x in (motion.samples, true))
    y = model.right_side(motion.samples, tau[motion.kept]).reshape(-1, r)
    if e.low_pass is not None:
        kept = kept_rows(len(y), RATE, e.low_pass, e.every)
        W, Z, y = (low_passed(x, RATE, e.low_pass)[kept] for x in (W, Z, y))
    elif not isinstance(model, WindowModel):
        W, Z, y = W[:: e.every], Z[:: e.every], y[:: e.every]
    count, b = len(W) * r, index.size
    equations = np.tile(np.arange(r), len(W)), model.row_labels, np.zeros(count, dtype=np.intp), ("log",)
    columns = e.base.names, e.base.units
    observations = Observations(W.reshape(count, b), y.ravel(), *columns, *equations, np.zeros(count))
    if e.estimator == "instrumental":
        return instrumental(observations, Z.reshape(count, b))
    return {"least-squares": least_squares, "weighted": weighted}[e.estimator](observations)


@pytest.mark.parametrize("kind", [EnergyModel, LoadIntegralModel])
def test_true_efforts_have_the_integrals_that_windows_show(kind: type[EnergyModel] | type[LoadIntegralModel]) -> None:
    e = experiment(kind(arm(), window=Window("short", 0.1)), Noise())
    expected = e.model.assemble(e.samples)[:, e.base.index] @ e.beta
    found = e.model.right_side(e.samples, e.efforts)
    np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["differential", "filtered", "energy", "load", "spline", "fourier"])
def test_repetitions_are_the_chain_done_by_hand(name: str) -> None:
    e = chains()[name]
    found = repeat_experiment(e, 3, seed=11)
    for number in (0, 2):
        expected = by_hand(e, 11, number)
        half = 1e-6 * expected.deviation
        assert np.all(np.abs(found.estimates[number] - expected.values) <= half)
        np.testing.assert_allclose(found.predicted[number], expected.deviation, rtol=1e-6)
        np.testing.assert_allclose(found.noise[number], expected.noise[0], rtol=1e-6)
        assert found.degrees_of_freedom == expected.degrees_of_freedom
    assert found.names == expected.names


def test_badly_conditioned_columns_are_mixed_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same estimates from columns that are multiplied by a triangular factor."""
    for name in ("differential", "filtered"):
        e = chains()[name]
        plain = repeat_experiment(e, 2, seed=11)
        with monkeypatch.context() as patch:
            patch.setattr(chain_file, "_WELL", 0.0)
            mixed = repeat_experiment(e, 2, seed=11)
        assert np.all(np.abs(mixed.estimates - plain.estimates) <= 1e-6 * plain.predicted)
        np.testing.assert_allclose(mixed.predicted, plain.predicted, rtol=1e-6)


# --- the laws of least squares ---------------------------------------------------------------------------------------

TORQUE_NOISE = Noise([0.5, 0.05])
RARE = 1e-6  # probability of each bound's being crossed by chance


@cache
def torque_noise(estimator: str) -> Repetitions:
    return repeat_experiment(experiment(DifferentialModel(arm()), TORQUE_NOISE, estimator=estimator), 2000, seed=0)


def covariance(weights: Array) -> Array:
    """Of estimates whose rows are weighted, for the noise of `torque_noise`."""
    model = DifferentialModel(arm())
    W = model.assemble(random_sines(2, 2).samples(TIME))[:, base_parameters(model).index]
    w, s = np.tile(weights, TIME.size)[:, None], np.tile([0.5, 0.05], TIME.size)[:, None]
    inverse = np.linalg.inv(W.T @ (w**2 * W))
    return np.asarray(inverse @ (W.T @ (w**4 * s**2 * W)) @ inverse)


@pytest.mark.slow
@pytest.mark.parametrize(("estimator", "weights"), [("least-squares", [1.0, 1.0]), ("weighted", [2.0, 20.0])])
def test_estimates_spread_as_the_covariance_says(estimator: str, weights: list[float]) -> None:
    """Their variance within chi-square bounds, their mean within its error."""
    found = torque_noise(estimator)
    expected = np.sqrt(np.diag(covariance(np.array(weights))))
    freedom = found.count - 1
    low, high = scipy.stats.chi2.ppf([RARE, 1 - RARE], freedom) / freedom
    ratio = (found.deviation / expected) ** 2
    slack = 0.02 if estimator == "weighted" else 0.0  # weights are estimated too
    assert np.all((ratio > low - slack) & (ratio < high + slack))
    assert np.all(np.abs(found.bias) < 5 * found.bias_error)


def test_intervals_of_the_weighted_estimate_hold_as_often_as_they_say() -> None:
    found = torque_noise("weighted")
    hits = scipy.stats.binom.ppf([RARE, 1 - RARE], found.count, 0.99) / found.count
    assert np.all((found.coverage >= hits[0]) & (found.coverage <= hits[1]))
    expected = np.sqrt(np.diag(covariance(np.array([2.0, 20.0]))))
    np.testing.assert_allclose(found.predicted_deviation, expected, rtol=0.02)
    np.testing.assert_allclose(found.noise.mean(axis=0), [0.5, 0.05], rtol=0.01)


@pytest.mark.slow
def test_noisy_positions_bias_least_squares_and_instruments_repair_it() -> None:
    """Noise of the differentiated positions is also in the regressor, and makes inertia look smaller."""
    model = DifferentialModel(random_chain("r", np.random.default_rng(0)), Terms(coulomb=False))
    errors = {}
    for estimator in ("least-squares", "instrumental"):
        e = experiment(model, Noise(0.05, 1e-3), method=Differences(), estimator=estimator)
        found = repeat_experiment(e, 400, seed=5)
        inertia = found.names.index("I1xx")
        errors[estimator] = found.bias[inertia] / found.beta[inertia], found.bias_error[inertia] / found.beta[inertia]
    bias, error = errors["least-squares"]
    assert bias < -0.2
    assert error < 0.01
    bias, error = errors["instrumental"]
    assert abs(bias) < 0.02


# --- repetitions are repeatable --------------------------------------------------------------------------------------


def test_repetitions_depend_on_the_seed_and_not_on_their_number() -> None:
    e, again = experiment(DifferentialModel(arm()), TORQUE_NOISE), torque_noise("weighted")
    seen: list[tuple[int, int]] = []
    first = repeat_experiment(e, 8, seed=0, progress=lambda done, count: seen.append((done, count)))
    other = repeat_experiment(e, 8, seed=1)
    assert seen == [(k, 8) for k in range(1, 9)]
    assert first.estimates.shape == first.predicted.shape == (8, e.base.rank)
    np.testing.assert_allclose(first.estimates, again.estimates[:8], rtol=1e-9)
    assert np.all(np.abs(first.estimates - other.estimates) > 1e-6 * first.deviation)
    assert np.all(np.diff(np.sort(again.estimates, axis=0), axis=0) > 0)  # no repetition is another one again


@pytest.mark.parametrize("name", ["differential", "load"])
def test_repetitions_do_not_depend_on_how_many_rows_are_computed_at_once(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    e = chains()[name]
    whole = repeat_experiment(e, 3, seed=4)
    for module in (moments, chain_file):
        monkeypatch.setattr(module, "BLOCK", 37)
    parts = repeat_experiment(e, 3, seed=4)
    assert np.all(np.abs(parts.estimates - whole.estimates) <= 1e-9 * whole.predicted)
    np.testing.assert_allclose(parts.predicted, whole.predicted, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["differential", "energy"])
def test_jax_computes_the_same_repetitions_in_batches_of_any_size(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a GPU, but here on whatever JAX has."""
    e = dataclasses.replace(chains()[name], estimator="instrumental")
    expected = repeat_experiment(e, 3, seed=4)
    monkeypatch.setattr(chain_file, "has_gpu", lambda: True)
    for at_once in (2, 5):
        monkeypatch.setattr(moments, "_MOST", at_once)
        assert chain_file.Chain(e).batch == at_once
        found = repeat_experiment(e, 3, seed=4)
        assert np.all(np.abs(found.estimates - expected.estimates) <= 1e-7 * expected.predicted)
        np.testing.assert_allclose(found.predicted, expected.predicted, rtol=1e-7)


def test_jax_leaves_what_it_does_not_compute_to_the_processor() -> None:
    chain = chain_file.Chain(chains()["filtered"])
    assert not moments.has_jax_form(chain.columns)


def test_summaries() -> None:
    estimates, predicted = np.array([[1.0], [3.0], [5.0]]), np.array([[3.0], [1.0], [1.0]])
    found = Repetitions(("a",), ("kg",), np.array([1.0]), estimates, predicted, np.ones((3, 1)), 10, 0)
    assert found.count == 3
    assert found.bias == 2.0
    assert found.deviation == 2.0
    np.testing.assert_allclose(found.bias_error, 2 / np.sqrt(3))
    np.testing.assert_allclose(found.predicted_deviation, np.sqrt(11 / 3))
    np.testing.assert_allclose(found.coverage, 2 / 3)  # t of 10 degrees of freedom: 3.17


# --- bad input -------------------------------------------------------------------------------------------------------


def test_experiments_that_cannot_be() -> None:
    good = experiment(DifferentialModel(arm()), Noise(0.1))
    fields = {"model": good.model, "base": good.base, "samples": good.samples, "beta": good.beta}
    for choices, message in (
        ({"noise": Noise(0.1, 1e-3)}, "positions with noise or counts need a method"),
        ({"noise": Noise([0.1, 0.2, 0.3])}, "noise, effort: expected 1 number or 2, given 3"),
        ({"estimator": "best"}, "no estimator named 'best'; available: least-squares, weighted, instrumental"),
        ({"every": 0}, "every must be 1 or more, given 0"),
        ({"beta": np.ones(2)}, r"expected \d+ finite parameters, given \[1. 1.\]"),
        ({"samples": random_sines(3, 0).samples(TIME)}, "motion of 3 joints for a robot of 2"),
        ({"samples": random_sines(2, 0).samples(TIME**2)}, "uniform"),
        ({"model": EnergyModel(arm()), "low_pass": 5.0}, "a model of windows integrates already"),
    ):
        with pytest.raises(InputError, match=message):
            Experiment(**{**fields, **choices})
    for value in (-1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="noise, count: expected finite numbers, zero or more"):
            Noise(count=[0.0, value])


def of_length(instants: int, **choices: Any) -> Experiment:
    """Of so many instants, without the checks of a motion."""
    e = experiment(DifferentialModel(arm()), Noise(0.1, 1e-5), method=Differences(), **choices)
    still = np.broadcast_to(0.0, (instants, 2))
    object.__setattr__(e, "samples", Samples(np.broadcast_to(0.0, instants), still, still, still, still))
    return e


def test_memory_is_planned_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, in_blocks = of_length(4_000_000, low_pass=10.0), of_length(3_000_000)
    tracemalloc.start()
    with pytest.raises(
        TooLargeError, match=r"^the repetition of the experiment would take about .* the cap of 4 GB: .*`rows`"
    ):
        repeat_experiment(whole, 1000, seed=0)
    assert tracemalloc.get_traced_memory()[1] < 1e6
    tracemalloc.stop()
    executor_of_repetitions("serial", None, in_blocks, 1000)
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.3")  # little more than the programs themselves
    with pytest.raises(TooLargeError):
        executor_of_repetitions("serial", None, in_blocks, 1000)


def test_repetitions_that_cannot_be() -> None:
    e = experiment(DifferentialModel(arm()), Noise(0.1))
    with pytest.raises(InputError, match="expected 2 or more, given 1"):
        repeat_experiment(e, 1, 0)
    still = Samples(TIME, *(0.0 * x for x in (e.samples.q, e.samples.dq, e.samples.ddq, e.samples.dddq)))
    with pytest.raises(InputError, match=r"experiment: .* identifiable from the motion"):
        repeat_experiment(Experiment(e.model, e.base, still, e.beta), 2, 0)
