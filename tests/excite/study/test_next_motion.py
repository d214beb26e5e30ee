"""Designs after earlier experiments, the next motion of a sequence, and the search for the shortest experiment."""

from __future__ import annotations

import math
import shutil
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from designed import short
from written_files import saved

import excite
from excite.design.design_folder import design_content
from excite.design.formulation import with_information_in_hand
from excite.design.start_results import StartResult
from excite.information.earlier_precision import deviations_of, earlier_root
from excite.information.half_widths import half_width_factor, residual_degrees_of_freedom
from excite.storage.manifest import sha256_of
from excite.study import period_search as period_search
from excite.study.period_search import PeriodTrial, best_trial, ladder, pareto_front, promising_period, task_at
from regressors.errors import InputError

SEARCH = excite.Search(starts=1, executor="serial")


@pytest.fixture(scope="module")
def short_design() -> excite.Design:
    return short()


@pytest.fixture(scope="module")
def result(short_design: excite.Design) -> excite.Identification:
    log = excite.simulate(short_design, noise=4.0, seed=1)
    return excite.identify("irp6", log, design=short_design, estimator="weighted", choose=False)


@pytest.fixture(scope="module")
def folders(
    result: excite.Identification, short_design: excite.Design, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp("sequence")
    result.save(folder / "a")
    short_design.save(folder / "b")
    return folder


@pytest.fixture(scope="module")
def after(folders: Path) -> excite.Design:
    in_hand = (str(folders / "a"), str(folders / "b"))
    return excite.design_trajectory("irp6", period=4, after=in_hand, search=SEARCH)


def test_a_result_states_the_information_of_its_covariance(result: excite.Identification, after: excite.Design) -> None:
    task = after.task.changed(after=after.task.objective.after[:1])
    R = earlier_root(after.target, task)
    assert np.allclose(np.linalg.inv(R.T @ R), result.estimate.covariance, rtol=1e-6)
    assert np.allclose(deviations_of(R), result.estimate.deviation)
    # measured noise is that of new rows: 4 Nm at 2000 Hz have the density of 4 / sqrt(20) Nm at 100 Hz
    assert after.task.objective.noise == pytest.approx(3 * (4.0 / np.sqrt(20.0),), rel=0.1)
    alone = np.array([each.standard_deviation for each in after.predicted])
    before, together = np.array([(each.deviation, each.after) for each in after.prior]).T
    assert np.all(together < np.minimum(alone, before))
    assert [each.value for each in after.prior] == 13 * [None]


def test_objects_and_folders_are_the_same(
    result: excite.Identification, short_design: excite.Design, after: excite.Design
) -> None:
    R, same = (
        earlier_root(after.target, with_information_in_hand(after.robot, task))
        for task in (after.task, after.task.changed(after=(short_design, result)))
    )
    assert np.allclose(R.T @ R, same.T @ same, rtol=1e-9)


def test_a_stored_design_runs_again_without_the_folders(after: excite.Design, folders: Path, tmp_path: Path) -> None:
    stored = excite.load_design(saved(tmp_path / "c", after))
    content = design_content(stored)
    assert content["task"]["after"] == [str(folders / name) for name in "ab"]
    hashes = [sha256_of(folders / file) for file in ("a/result.json", "b/design.json")]
    assert [each["sha256"] for each in content["after"]] == hashes
    again = excite.design_trajectory(stored.task)
    assert np.array_equal(again.trajectory.x, after.trajectory.x)
    assert design_content(again)["after"] == content["after"]


def test_a_result_after_others_names_them_without_opening(after: excite.Design, tmp_path: Path) -> None:
    log = excite.simulate(after, noise=1.0, seed=2)
    result = excite.identify(after.task, log, estimator="weighted", choose=False)
    stored = excite.load_result(saved(tmp_path / "r", result))
    with pytest.raises(InputError, match="files that results name are not opened"):
        excite.design_trajectory(stored.task)


def test_enough_is_enough(result: excite.Identification, short_design: excite.Design) -> None:
    step = excite.next_motion("irp6", "100%", after=result)
    assert step.enough
    assert (step.design, step.runs, step.missing, step.planned) == (None, 0, (), ())
    widths = np.array([each.half_width for each in step.parameters])
    assert np.allclose(widths, result.estimate.half_width)
    assert [each.value for each in step.parameters] == pytest.approx(result.estimate.values.tolist())
    planned = excite.next_motion("irp6", "100%", after=4 * (short_design,))
    assert (planned.enough, planned.planned) == (True, (short_design.name,))


def test_the_runs_are_the_fewest_that_are_expected_to_be_enough(result: excite.Identification) -> None:
    step = excite.next_motion("irp6", 0.1, after=result, period=4, search=SEARCH)
    run = step.design.run_information
    assert not step.enough
    assert step.runs == run.fewest_runs()
    assert run.use(step.runs) <= 1.0
    assert step.runs == 1 or run.use(step.runs - 1) > 1.0
    assert all(each.expected <= each.allowed for each in step.parameters)
    shares = [p.half_width / p.allowed for p in step.parameters]
    assert step.missing[0].half_width / step.missing[0].allowed == max(shares)


@pytest.mark.slow
def test_a_sequence_ends_where_it_is_expected_to(result: excite.Identification) -> None:
    step = excite.next_motion("irp6", 0.2, after=result, period=4, search=SEARCH)
    assert 1 <= step.runs <= 5
    log = excite.simulate(step.design, noise=4.0, seed=3, periods=step.runs)
    second = excite.identify("irp6", log, design=step.design, estimator="weighted", choose=False)
    assert excite.next_motion("irp6", 0.2, after=(result, second)).enough


def test_shares_are_of_what_was_measured(result: excite.Identification) -> None:
    measured = excite.next_motion("irp6", 1.0, after=result)
    described = excite.next_motion("irp6", 1.0, after=result, of="described")
    for a, b in zip(measured.parameters, described.parameters, strict=True):
        assert a.allowed == pytest.approx(abs(a.value), rel=1e-9) or a.allowed > abs(a.value)  # about zero
        assert b.allowed != a.allowed
    scaled = excite.PrecisionTarget(1.0, scales={"X5": 7.0})
    assert {p.name: p.allowed for p in excite.next_motion("irp6", scaled, after=result).parameters}["X5"] == 7.0


@pytest.mark.slow
def test_nothing_is_asked_of_what_may_be_zero_and_has_no_size() -> None:
    """The panda's friction is not described, and simulated without; asked shares of it would never be reached."""
    design = excite.design_trajectory("panda", harmonics=3, period=4.0, search=SEARCH)
    result = excite.identify("panda", excite.simulate(design, noise=0.3, seed=0, rate=200.0), design=design)
    step = excite.next_motion("panda", 10.0, after=(result, design))
    asked = {p.name: p.allowed for p in step.parameters}
    by_value = {p.name: abs(p.value) > p.half_width for p in step.parameters if p.name.startswith("F")}
    assert {name: np.isfinite(asked[name]) for name in by_value} == by_value
    assert not all(by_value.values())
    assert step.enough


ONE = excite.Search(starts=1, rounds=0, executor="serial")
BAD = [
    ({"after": "nowhere"}, "nowhere holds neither result.json nor design.json"),
    ({"after": 3}, "after: expected results or designs, or their folders, given 3"),
    ({"after": [None]}, "after: expected results or designs"),
    ({"after": object()}, "expected a result or a design, or the folder of one; given object"),
    ({"after": ("a", "a")}, "results of the same log count it twice"),
    ({"after": "a", "robot": "panda"}, "is of the robot irp6, this task is for panda"),
    ({"after": "a", "joints": ("4", "5")}, "the parameters of .* are those of other bodies"),
    ({"after": "a", "payload": (1.0, 0.0, 0.0, 0.1)}, "the robot carries nothing, in this task 1,0,0,0.1"),
    ({"after": "a", "model": "energy"}, "has measured the noise of the equations q1 .* give `noise`"),
    ({"after": "b", "model": "energy"}, "has the equations q1, q2, q3, whose noise is not known here"),
]


def test_bad_inputs_are_named(folders: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folders)
    for options, message in BAD:
        given = {"robot": "irp6", **options}
        with pytest.raises(InputError, match=message):
            excite.design_trajectory(given.pop("robot"), period=4, search=SEARCH, **given)
    shutil.copytree(folders / "a", folders / "both")
    (folders / "both" / "design.json").write_text("{}")
    with pytest.raises(InputError, match="holds a result and a design; name the file"):
        excite.design_trajectory("irp6", after="both")
    for precision, options, message in (
        (None, {}, "no precision is asked for"),
        (0.05, {"of": "hoped"}, "`of` must be one of measured, described, given 'hoped'"),
        (-1.0, {}, "precision"),
    ):
        with pytest.raises(InputError, match=message):
            excite.next_motion("irp6", precision, **options)


@dataclass(frozen=True)
class Run:
    """Deviations that fall as ``period^-slope``, and a pause of some seconds."""

    period: float
    slope: float
    level: float
    pause: float

    @property
    def seconds(self) -> float:
        return self.period + self.pause

    def use(self, runs: int) -> float:
        return self.level * self.period**-self.slope / math.sqrt(runs)

    def fewest_runs(self) -> int:
        return max(1, math.ceil(self.use(1) ** 2 - 1e-12))


def trial(period: float, slope: float = 0.7, level: float = 20.0, pause: float = 0.0) -> PeriodTrial:
    return PeriodTrial(period, 5, SimpleNamespace(run_information=Run(period, slope, level, pause)))


def test_the_front_is_what_no_other_point_dominates() -> None:
    trials = [trial(5.0), trial(7.1, level=23.0), trial(10.0), trial(14.2, level=18.0, pause=3.0)]
    every = [
        (n * each.seconds, each.run.use(n)) for each in trials for n in range(1, 1 + math.floor(120.0 / each.seconds))
    ]
    slow = {p for p in every if not any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in every)}
    assert {(p.robot_seconds, p.use) for p in pareto_front(trials, 120.0)} == slow


def test_the_best_is_the_shortest_or_else_the_most_precise() -> None:
    trials = [trial(5.0), trial(10.0), trial(20.0)]
    assert best_trial(trials, 1000.0).robot_seconds == min(each.robot_seconds for each in trials)
    assert best_trial(trials, 25.0) is trials[2]


@pytest.mark.parametrize("rate", [100.0, 125.0, 33.0])
def test_periods_are_whole_numbers_of_samples_a_root_of_two_apart(rate: float) -> None:
    task = excite.Task("irp6", rate=rate)
    periods = ladder(task)
    assert all(abs(period * rate - round(period * rate)) < 1e-6 for period in periods)
    ratios = np.array(periods[1:]) / np.array(periods[:-1])
    assert np.all(abs(ratios - math.sqrt(2.0)) < 0.05)
    assert periods[-1] <= period_search.LONGEST * 10.0 < periods[-1] * 1.5
    assert max(ladder(task.changed(max_time=12.0))) <= 12.0
    for period in periods:
        choice = task_at(task, period, None).trajectory
        assert choice.harmonics / period <= 5 / 10.0 + 1e-9 or choice.harmonics == 2
        assert (choice.harmonics + 1) / period > 5 / 10.0


def test_a_period_between_two_needs_one_run_less() -> None:
    trials = [trial(period) for period in (5.0, 7.1, 10.0, 14.2)]
    period = promising_period(trials, 600.0, 100.0)
    assert period is not None
    assert trial(period).robot_seconds < 0.99 * min(each.robot_seconds for each in trials)
    assert trial(period).run.use(trial(period).runs) == pytest.approx(1.0, abs=0.02)
    # nothing between promises more when information only adds
    assert promising_period([trial(period, slope=0.5) for period in (8.0, 16.0, 32.0)], 600.0, 100.0) is None


@pytest.fixture(scope="module")
def design() -> excite.Design:
    return excite.design_trajectory(
        "irp6", search=ONE, precision=0.07, noise=2.0, offset=True, criterion="max-deviation", scale="precision"
    )


def test_the_criterion_is_the_largest_deviation_over_the_allowed_half_width(design: excite.Design) -> None:
    run = design.run_information
    instants = design.trajectory.duration * design.task.output.rate + 1
    value = next(start.value for start in design.starts if start.index == design.best_start)
    deviation = np.array([p.standard_deviation for p in design.predicted])
    assert float(np.max(deviation / run.allowed)) == pytest.approx(value / math.sqrt(instants), rel=1e-6)
    assert np.all(run.deviation > deviation)  # which rows near standstill are not counted on for


def test_fewest_runs_are_enough_and_one_less_is_not(design: excite.Design) -> None:
    run, forecast = design.run_information, design.precision
    n = run.fewest_runs()
    assert run.use(n) <= 1.0 < run.use(n - 1)
    freedom = residual_degrees_of_freedom(n * run.rows, 16, 3)
    assert run.half_widths(n) == pytest.approx(half_width_factor(freedom) * run.deviation / math.sqrt(n))
    assert (forecast.runs, forecast.met, len(forecast.too_wide)) == (n, True, 0)
    short = run.forecast(2.5 * run.seconds)
    assert (short.runs, short.met) == (2, False)
    assert short.too_wide[0] == short.worst


@pytest.mark.slow
def test_the_search_meets_a_coarse_target_and_continues_from_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(period_search, "_ROUNDS", 0)
    monkeypatch.setattr(period_search, "_SHORTER", 1)
    options: dict[str, Any] = {"noise": 1.0, "joints": ("1", "2"), "search": ONE, "folder": tmp_path}
    first = excite.design_for_precision("irp6", "200%", **options)
    computed: list[StartResult] = []
    again = excite.design_for_precision("irp6", "200%", **options, progress=computed.append)
    assert computed == []
    assert again.coefficients_sha256 == first.coefficients_sha256
    search, forecast = first.precision_search, first.precision
    assert search is not None
    first.save(tmp_path / "saved")
    assert excite.load(tmp_path / "saved").precision_search == search
    assert excite.load(tmp_path / "saved" / "precision.json") == search
    assert forecast.met
    assert first.feasible
    assert search.out_of_reach is None
    assert all(each.richness / each.period <= 5 / 10.0 + 1e-9 for each in search.trials)  # the highest frequency stays
    assert forecast.robot_seconds == min(each.robot_seconds for each in search.trials)
    with pytest.raises(InputError, match="another problem"):
        excite.design_for_precision("irp6", "190%", **options)
    rerun = excite.design_trajectory(first.task)
    assert rerun.coefficients_sha256 == first.coefficients_sha256


def test_what_no_search_can_begin_with() -> None:
    for options, message in (
        ({}, "give `precision`"),
        ({"precision": "five"}, "precision"),
        ({"precision": -0.1}, "precision"),
        ({"precision": {"shares": 0.1}}, "no entry"),
        ({"precision": 0.05, "criterion": "trace"}, "criterion"),
        ({"precision": 0.05, "harmonics": "auto"}, "harmonics"),
        ({"precision": 0.05, "prior": 0.1}, "prior"),
        ({"precision": 0.05, "base": "pivoted"}, "base"),
    ):
        with pytest.raises(InputError, match=message):
            excite.design_for_precision("irp6", **options)


@pytest.mark.slow
def test_out_of_reach_says_what_moves_together_and_what_helps() -> None:
    design = excite.design_for_precision("irp6", 0.001, max_time=12.0, search=ONE)
    found = design.precision_search.out_of_reach
    assert not design.precision.met
    assert design.precision.robot_seconds <= 12.0
    assert [each.name for each in found.parameters] == [p.name for p in design.precision.too_wide]
    assert found.robot_seconds > 100.0
    factors = {each.change: each.narrower for each in found.trials}
    same_columns = factors["a known load of 2 kg in every other run"]
    assert same_columns == pytest.approx(1.0, abs=1e-6)
    assert found.best.narrower == max(factors.values()) > 1.05
