"""Predicted accuracy: against dense algebra, against repeats, and against exact logs."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import excite
from excite.design.design import Design
from excite.identification.allowances import presliding_columns
from excite.identification.covariance import divisors
from excite.identification.identification import Identification
from excite.identification.streamed_rows import Decimation
from excite.simulation.settings import SimulationSettings
from excite.study.rehearsal import (
    Rehearsal,
    StatedNoise,
    bounded_estimates,
    linear_equations,
    measured_noise,
    motion_settings,
    torque_errors,
)
from regressors.errors import InputError
from regressors.robot.friction.curve import Side, Stribeck
from regressors.robot.friction.curves import FrictionCurves
from regressors.samples import Array

RATE, WIDTH = 100.0, 0.02
SETTINGS = SimulationSettings(rate=RATE, sign_width=WIDTH, torque_noise=(1.0,))
RECIPE = excite.Recipe(cutoff=10.0, sign_width=WIDTH, rows="all")
COUNT = 3000
CLOSE = 0.06  # of a deviation from 3000 samples: more than four of its own


@pytest.fixture(scope="module")
def design() -> Design:
    return excite.design_trajectory(excite.Task("irp6", period=4, harmonics=3, starts=1, executor="serial"))


@pytest.fixture(scope="module")
def rehearsal(design: Design) -> Rehearsal:
    return rehearsed(design, SETTINGS)


def rehearsed(design: Design, settings: SimulationSettings, **options: Any) -> Rehearsal:
    simulation = excite.simulate(design, settings)
    return Rehearsal(simulation, identified(design, simulation, **options))


def identified(design: Design, log: Any, **options: Any) -> Identification:
    return excite.identify(design.robot, log, design=design, recipe=replace(RECIPE, **options), choose=False)


def influence(result: Identification) -> Array:
    """``(W' V W)^-1 W' V``, dense, of shape (p, N, r)."""
    rows = result.observations
    v = 1 / divisors(result.estimate)[rows.group] ** 2
    W = rows.matrix
    return np.linalg.solve(W.T @ (v[:, None] * W), W.T * v).reshape(len(rows.names), -1, 3)


@pytest.mark.slow
@pytest.mark.parametrize(("coloured", "corner"), [(0.0, 5.0), (2.0, 3.0)])
@pytest.mark.parametrize("low_pass", [None, 8.0])
def test_noise_of_the_torques_reaches_the_parameters_as_by_dense_matrices(
    design: Design, rehearsal: Rehearsal, low_pass: float | None, coloured: float, corner: float
) -> None:
    result = rehearsal.result if low_pass is None else identified(design, rehearsal.simulation, low_pass=low_pass)
    time = result.prepared[0].samples.time
    lag = np.abs(np.subtract.outer(np.arange(time.size), np.arange(time.size)))
    covariance = np.eye(time.size) + coloured**2 * np.exp(-2 * np.pi * corner / RATE) ** lag
    F = np.eye(time.size) if low_pass is None else Decimation.of(time, low_pass, None)(np.eye(time.size))
    B = np.einsum("pkr,kn->prn", influence(result), F)
    expected = np.sqrt(np.einsum("prn,nm,prm->p", B, covariance, B))
    errors = torque_errors(result, StatedNoise((1.0,), (coloured,), corner), COUNT, 0)
    np.testing.assert_allclose(np.sqrt(np.mean(errors**2, axis=0)), expected, rtol=CLOSE)


def test_an_unknown_setting_is_one_more_column(rehearsal: Rehearsal) -> None:
    from excite.identification.estimator import Context

    result = rehearsal.result
    column = presliding_columns(Context(result.target, result.prepared, result.recipe), result.coefficients)
    assert column.size
    scale = divisors(result.estimate)[result.observations.group]
    wide = np.column_stack([result.observations.matrix, column]) / scale[:, None]
    noise = np.random.default_rng(0).normal(size=(scale.size, 3))
    expected = np.linalg.lstsq(wide, noise / scale[:, None], rcond=None)[0][:-1].T
    linear = linear_equations(result, result.prepared[0], frozenset({"presliding"}))
    np.testing.assert_allclose(linear.errors(noise), expected, rtol=1e-6)
    free = np.linalg.qr(wide[:, [-1, *range(wide.shape[1] - 1)]], mode="r")[1:, 1:]
    np.testing.assert_allclose(linear.root.T @ linear.root, free.T @ free, rtol=1e-8, atol=1e-6)


def test_a_measured_motion_gives_the_estimate_of_its_own_equations(design: Design) -> None:
    settings = replace(SETTINGS, torque_noise=(0.05,), position_noise=(3e-4,), seed=3)
    rehearsal = rehearsed(design, settings)
    log = rehearsal.log(replace(motion_settings(settings), seed=9), np.zeros(3))
    np.testing.assert_array_equal(log.effort, rehearsal.simulation.run.effort)
    weighted, exact = [], []
    for rows, values in ((rehearsal.equations(log).rows, weighted), (rehearsal.exact.rows, exact)):
        scale = divisors(rehearsal.result.estimate)[rows.group]
        values.append(np.linalg.lstsq(rows.matrix / scale[:, None], rows.y / scale, rcond=None)[0])
    error = rehearsal.equations(log).error(rehearsal.exact.solution.values)
    np.testing.assert_allclose(error, weighted[0] - exact[0], atol=1e-8)
    assert np.abs(weighted[0] - exact[0]).max() > 1e-4


@pytest.mark.slow
def test_a_measured_motion_reaches_the_parameters_as_in_repeats(design: Design) -> None:
    settings = replace(SETTINGS, torque_noise=(0.05,), position_noise=(3e-4,), encoder=(300.0,))
    how = {"recipe": RECIPE, "choose": False, "estimator": "weighted"}
    prediction = excite.predict_accuracy(design, settings, count=150, **how)
    simulation, values = excite.simulate(design, settings), []
    assert simulation.log.effort is not None
    for seed in range(80):  # noise drawn here, steps from a phase of its own
        rng = np.random.default_rng(seed)
        phase = rng.uniform(0, 0.02, 3)
        step = 2e-4 * np.array([1.0, 0.6, 0.4])
        noise = 3e-4 * rng.normal(size=(len(simulation.log.time), 3))
        q = step * np.round((simulation.run.samples.q + noise + phase) / step)
        effort = simulation.run.effort + 0.05 * rng.normal(size=q.shape)
        log = replace(simulation.log, q=q - phase, effort=effort, sha256=str(seed))
        values.append(excite.identify(design.robot, log, design=design, **how).estimate.values)
    predicted = np.array([p.deviation for p in prediction.parameters])
    np.testing.assert_allclose(np.log(predicted / np.std(values, axis=0, ddof=1)), 0.0, atol=0.35)
    assert all(p.by_motion > 3 * p.by_torques for p in prediction.parameters)
    bias = np.array([p.bias for p in prediction.parameters], dtype=float)
    truth = np.array([p.value for p in prediction.parameters]) - bias
    np.testing.assert_allclose((np.mean(values, axis=0) - truth - bias) / predicted, 0.0, atol=0.5)


def test_the_bias_is_the_error_of_the_exact_log(design: Design) -> None:
    drives = design.robot.transmission.drives[:3]
    friction = FrictionCurves({d.name: Stribeck(Side(d.coulomb, d.viscous, 1.5 * d.coulomb, 0.05)) for d in drives})
    exact = excite.simulate(design, replace(SETTINGS, torque_noise=(0.0,)), friction=friction)
    how = {"recipe": RECIPE, "choose": False, "estimator": "least-squares"}
    result = excite.identify(design.robot, exact, design=design, **how)
    prediction = excite.predict_accuracy(design, SETTINGS, friction=friction, count=2, **how)
    np.testing.assert_allclose([p.value for p in prediction.parameters], result.estimate.values, rtol=1e-7)
    known = np.isfinite(result.reference.values)
    assert known.sum() == 7  # of the bodies
    bias = np.array([p.bias for p in prediction.parameters], dtype=float)
    np.testing.assert_allclose(bias[known], (result.estimate.values - result.reference.values)[known], rtol=1e-5)
    assert np.all(np.isnan(bias[~known]))


def test_a_log_measured_again_is_that_of_another_seed(rehearsal: Rehearsal, design: Design) -> None:
    settings = replace(SETTINGS, seed=7, encoder=(4000.0,), position_noise=(1e-5,))
    again = rehearsal.log(settings, np.zeros(3))
    other = excite.simulate(design, settings).log
    np.testing.assert_array_equal(again.q, other.q)
    np.testing.assert_array_equal(again.effort, other.effort)


def test_noise_is_measured_with_its_colour(design: Design) -> None:
    settings = replace(SETTINGS, periods=4, torque_noise=(0.2,), rate=RATE)
    settings = replace(settings, coloured_noise=(2.0,), noise_corner=3.0)
    noise = measured_noise(identified(design, excite.simulate(design, settings)))
    np.testing.assert_allclose(noise.deviation, np.hypot(2.0, 0.2), rtol=0.2)
    how = {"recipe": RECIPE, "choose": False, "estimator": "weighted", "count": 100}
    stated, other = (excite.predict_accuracy(design, SETTINGS, noise=each, **how) for each in (None, noise))
    ratio = [b.deviation / a.deviation for a, b in zip(stated.parameters, other.parameters, strict=True)]
    assert min(ratio) > 1.5  # the noise of a result replaces the stated one
    time = np.arange(20_000) / RATE
    sample = noise.draw(time, 3, np.random.default_rng(0))
    np.testing.assert_allclose(sample.std(axis=0), noise.deviation, rtol=0.1)
    correlation = [np.corrcoef(x[1:], x[:-1])[0, 1] for x in sample.T]
    np.testing.assert_allclose(correlation, np.exp(-2 * np.pi * 3 / RATE) * 4 / 4.04, atol=0.06)
    with pytest.raises(InputError, match="measured at the same rate"):
        noise.draw(np.arange(100) / 50.0, 3, np.random.default_rng(0))


def test_an_estimator_with_bounds_keeps_them(design: Design) -> None:
    rehearsal = rehearsed(design, SETTINGS, estimator="physical")
    exact = rehearsal.exact
    inside = exact.solution.values[: exact.count]
    low = inside.copy()
    low[rehearsal.result.names.index("F1c")] = -5.0
    kept = bounded_estimates(rehearsal.result, exact, np.array([inside, low]))
    np.testing.assert_allclose(kept[0], inside, rtol=1e-6, atol=1e-6)
    assert kept[1][rehearsal.result.names.index("F1c")] >= 0.0


def test_the_same_seed_gives_the_same_prediction(design: Design) -> None:
    how = {"recipe": RECIPE, "choose": False, "count": 5}
    steps: list[str] = []
    first = excite.predict_accuracy(design, SETTINGS, progress=steps.append, position_noise=1e-4, **how)
    again = excite.predict_accuracy(design, SETTINGS, position_noise=1e-4, **how)
    other = excite.predict_accuracy(design, SETTINGS, position_noise=1e-4, seed=1, **how)
    assert first.parameters == again.parameters != other.parameters
    assert "noise of the motion: 5 of 5 samples" in steps
    assert repr(first) == "<AccuracyPrediction of 13 parameters of irp6, to 35.4%>"
    free = excite.predict_accuracy(design, SETTINGS, position_noise=1e-4, estimator="weighted", **how)
    for p in free.parameters:
        assert p.by_motion > 0.0
        assert p.deviation == pytest.approx(np.hypot(p.by_torques, p.by_motion))


def test_stated_noise_is_white_and_coloured() -> None:
    noise = StatedNoise((1.0,), (2.0, 0.5), 5.0).draw(np.arange(200_000) / 100.0, 2, np.random.default_rng(0))
    np.testing.assert_allclose(noise.std(axis=0), np.hypot(1.0, [2.0, 0.5]), rtol=0.02)
    found = np.mean(noise[1:] * noise[:-1], axis=0)
    np.testing.assert_allclose(found, np.exp(-2 * np.pi * 5.0 / 100.0) * np.array([4.0, 0.25]), rtol=0.05)


def test_what_cannot_be_predicted(design: Design, rehearsal: Rehearsal) -> None:
    for options, message in (
        ({"torque_noise": 0.0}, "without noise repeats do not scatter; give `torque_noise`"),
        ({"count": 1}, "count"),
        ({"estimator": "instrumental"}, "estimators least-squares"),
        ({"average": True, "periods": 2}, "leave out `average`"),
        ({"cutof": 1.0}, "cutof"),
    ):
        with pytest.raises((InputError, TypeError), match=message):
            excite.predict_accuracy(design, SETTINGS, choose=False, **options)
    with pytest.raises(InputError, match="leave out `low_pass`"):
        measured_noise(identified(design, rehearsal.simulation, low_pass=5.0))


def test_a_prediction_is_saved_beside_the_design_and_foreign_files_stay(design: Design, tmp_path: Path) -> None:
    prediction = excite.predict_accuracy(design, SETTINGS, recipe=RECIPE, choose=False, count=5)
    prediction.save(tmp_path)
    (path,) = prediction.save(tmp_path)
    content = json.loads(path.read_text())
    assert content["schema"] == "excite.accuracy/2"
    assert [p["deviation"] for p in content["parameters"]] == [p.deviation for p in prediction.parameters]
    assert content["conditions"]["torque_noise"] == [1.0]
    assert excite.load(path) == dataclasses.replace(prediction, conditions=content["conditions"])
    other = tmp_path / "other"
    other.mkdir()
    (other / "accuracy.json").write_text("{}")
    with pytest.raises(InputError, match="is already there"):
        prediction.save(other)
    assert (other / "accuracy.json").read_text() == "{}"
