"""Estimates over the growing time of a log, against least squares on the rows up to each instant."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from played import TASK, found, irp6, noisy, played, three_joints
from processes import DaskProcesses, kill
from repeated_experiments import OneByOne

from excite.design.design import Design
from excite.design.executors.unit_executor import InProcesses, UnitExecutor
from excite.design.optimisation import design_trajectory
from excite.errors import LostWorkersError
from excite.identification.identification import Identification
from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.simulation.simulate import simulate
from excite.storage.records import json_of
from excite.study.study_over_time import estimates_over_time, measured_again, study_over_time
from excite.study.time_study import TimeCourse
from excite.views.identification_plots import estimates_over_time_figure
from regressors.errors import InputError, UnknownName
from regressors.models.nominal import standard_values


@cache
def log(seed: int = 0, seconds: float = 4.0) -> Log:
    measured = noisy(played(three_joints(), 3, 100.0, seconds), 0.5, 1e-6, seed)
    return replace(measured, truth=dict(standard_values(irp6())))


@cache
def result(estimator: str = "weighted", covariance: str = "white") -> Identification:
    return found(TASK, log(), recipe=Recipe(estimator=estimator, covariance=covariance))


@cache
def design() -> Design:
    return design_trajectory(TASK.changed(robot=irp6(), period=3.0, harmonics=3, starts=1, executor="serial"))


@pytest.mark.parametrize("estimator", ["weighted", "least-squares"])
def test_every_estimate_is_least_squares_on_the_rows_so_far(estimator: str) -> None:
    """Slowly: each of the rows up to t is divided by the noise of its equation in the whole log."""
    found = result(estimator)
    course, rows = estimates_over_time(found, "run", 20), found.observations
    sigma = found.estimate.noise[0][rows.equation] if estimator == "weighted" else np.ones(rows.y.size)
    seen = np.flatnonzero(np.isfinite(course.values[:, 0]))
    assert seen.size >= 18
    for k in seen:
        first = rows.time - rows.time[0] <= course.time[k] + 1e-6
        W, y = rows.W[first] / sigma[first, None], rows.y[first] / sigma[first]
        beta = np.linalg.lstsq(W, y, rcond=None)[0]
        np.testing.assert_allclose(course.values[k], beta, rtol=1e-6, atol=1e-8 * np.abs(beta).max())
        assert course.condition_number[k] == pytest.approx(np.linalg.cond(rows.W[first]), rel=1e-6)
        deviation = np.sqrt(np.diag(np.linalg.inv(W.T @ W)))
        last = np.sqrt(np.diag(np.linalg.inv((rows.W / sigma[:, None]).T @ (rows.W / sigma[:, None]))))
        np.testing.assert_allclose(course.deviation[k] / course.deviation[-1], deviation / last, rtol=1e-5)


@pytest.mark.parametrize("covariance", ["white", "robust"])
def test_the_last_instant_has_the_estimate_and_the_intervals_of_the_whole_log(covariance: str) -> None:
    """And the first ones, whose rows do not show all parameters, have none."""
    found = result(covariance=covariance)
    course = estimates_over_time(found, "run", 400)
    np.testing.assert_allclose(course.values[-1], found.estimate.values, rtol=1e-8)
    np.testing.assert_allclose(course.half_width[-1], found.estimate.half_width, rtol=1e-8)
    assert course.condition_number[-1] == pytest.approx(found.condition_number, rel=1e-8)
    assert course.reference_kind == "truth"
    assert np.all(np.isnan(course.values[0]))
    for without_bound in (course.deviation, course.condition_number, course.relative_deviation):
        assert np.all(np.isinf(without_bound[0]))


def course_of(deviation: np.ndarray) -> TimeCourse:
    K, p = deviation.shape
    names = tuple(f"X{k}" for k in range(p))
    return TimeCourse(
        "run", names, ("",) * p, np.arange(1.0, K + 1), np.full((K, p), 2.0), deviation, 2.6, np.ones(K),
        np.array([4.0, np.nan, 4.0])[:p], "truth",
    )  # fmt: skip


def test_a_deviation_is_below_from_where_it_stays_below() -> None:
    deviation = np.array([[1.0, 1.0, 1.0], [0.1, 1.0, 1.0], [0.5, 0.09, 1.0], [0.1, 0.09, 1.0]])
    course = course_of(deviation)
    np.testing.assert_array_equal(course.size, [4.0, 2.0, 4.0])  # the last value where the truth is unknown
    np.testing.assert_array_equal(course.time_below(0.05), [4.0, 3.0, np.nan])
    np.testing.assert_array_equal(course.time_below(0.3), [1.0, 3.0, 1.0])


@pytest.mark.slow
def test_logs_and_designs_stand_side_by_side() -> None:
    study = study_over_time(
        "irp6", [log()], designs=[design()], simulation={"rate": 100.0}, repeats=3, points=10, below=0.1
    )
    simulated, measured = study.courses
    assert (simulated.names, measured.names) == (measured.names, simulated.names)
    assert simulated.repeated.shape == (3, 10, len(simulated.names))
    assert measured.repeated is None
    assert "torque noise of 1 %" in simulated.notes[0]
    assert len(estimates_over_time_figure(study).axes) == 2 + len(simulated.names)
    content = json_of(study)
    assert [one["repetitions"] for one in content["courses"]] == [3, 0]
    assert [tuple(end["parameters"]) for end in content["ends"]] == [simulated.names, measured.names]


@pytest.mark.slow
def test_another_motion_is_simulated_for_the_parameters_of_the_design(tmp_path: Path) -> None:
    """The design's own motion, given as a file, has the same course as the design, but for rounding."""
    design().save(tmp_path / "d")
    motions = {"designs": [tmp_path / "d"], "trajectories": [tmp_path / "d" / "trajectory.csv"]}
    study = study_over_time("irp6", **motions, simulation={"rate": 100.0, "torque_noise": (0.5,)}, repeats=2, points=4)
    designed, played = study.courses
    assert played.name.endswith("trajectory.csv")
    assert played.names == designed.names
    assert played.repeated.shape == designed.repeated.shape
    assert played.condition_number[-1] == pytest.approx(designed.condition_number[-1], rel=1e-2)


def test_measurements_differ_in_noise_alone() -> None:
    run = simulate(design(), rate=200.0, torque_noise=(0.5,))
    one, same, other = (measured_again(run, run.settings, k) for k in (1, 1, 2))
    np.testing.assert_array_equal(one.effort, same.effort)
    assert np.std(one.effort - other.effort) == pytest.approx(0.5 * np.sqrt(2), rel=0.1)
    np.testing.assert_array_equal(one.q, other.q)


def test_what_cannot_be_studied() -> None:
    for given, message in (
        ({"logs": ()}, "needs logs, or designs"),
        ({"repeats": 30}, "repetitions are simulated from designs"),
        ({"designs": ["nowhere"], "repeats": 1}, "repeats must be 2 or more"),
        ({"trajectories": ["by-hand.csv"]}, "`trajectories` are simulated for the parameters of the first"),
        ({"points": 1}, "points must be 2 or more"),
        ({"below": 0.0}, "`below` must be a number from 1e-06 to 1000000 %, given 0"),
        ({"estimator": "huber"}, "made by the estimators weighted, least-squares, not by huber"),
    ):
        with pytest.raises(InputError, match=message):
            study_over_time("irp6", **{"logs": (log(),), **given})
    both = found(TASK, log(0), log(1), recipe=Recipe())
    with pytest.raises(InputError, match="of one log each"):
        estimates_over_time(both, "both", 10)
    for executor, how, error in (("proces", {}, UnknownName), ("process", {"workers": 0}, InputError)):
        with pytest.raises(error):
            repeated(executor, **how)
    with pytest.raises(LostWorkersError, match="nothing of the study is kept: repeat it with fewer `workers`, or with"):
        repeated(OneByOne(ends_after=1), repeats=2)


def test_a_study_is_not_replaced_unasked(tmp_path: Path) -> None:
    study = study_over_time("irp6", [log()], points=3)
    assert [path.name for path in study.save(tmp_path / "s")] == ["study.json", "study_curves.npz"]
    with pytest.raises(InputError, match="already holds a study"):
        study.save(tmp_path / "s")
    study.save(tmp_path / "s", replace=True)


@cache
def repeated(executor: str | UnitExecutor, repeats: int = 4, **how: Any) -> Any:
    study = study_over_time(
        "irp6", designs=[design()], simulation={"rate": 100.0}, repeats=repeats, points=4, executor=executor, **how
    )
    return study.courses[0].repeated


@pytest.mark.slow
def test_numbers_are_the_same_in_any_order_and_without_what_is_lost(caplog: pytest.LogCaptureFixture) -> None:
    serial = repeated("serial")
    np.testing.assert_array_equal(repeated("process"), serial)  # short: in this process
    np.testing.assert_array_equal(repeated(OneByOne(backwards=True)), serial)
    with caplog.at_level(logging.WARNING):
        np.testing.assert_array_equal(repeated(OneByOne(lost=(1,), backwards=True)), serial[[0, 2, 3]])
    assert caplog.messages == ["repetition 2 is left out: its process ended"]
    with pytest.raises(InputError, match=r"repetitions: 1 of 4 are left, since workers ended; repeat with fewer"):
        repeated(OneByOne(lost=(0, 1, 2)))


@pytest.mark.slow
def test_numbers_are_the_same_in_processes_and_on_dask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    serial = repeated("serial")
    np.testing.assert_array_equal(repeated(InProcesses(2)), serial)
    monkeypatch.setattr("excite.study.study_over_time.SHORT", 0.0)
    np.testing.assert_array_equal(repeated("process", workers=2), serial)
    pytest.importorskip("distributed")
    with DaskProcesses(tmp_path) as dask:
        np.testing.assert_array_equal(repeated(dask.address), serial)
        monkeypatch.setattr("excite.study.study_over_time._TOLD", 1)

        def end(step: str) -> None:
            if "repetition 1 of" in step:
                kill(dask.scheduler)

        monkeypatch.setattr("excite.design.executors.dask_cluster._AHEAD", 1)
        with pytest.raises(LostWorkersError, match=rf"^the Dask scheduler at {dask.address} went away; nothing of the"):
            repeated(dask.address, progress=end)
