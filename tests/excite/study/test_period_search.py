"""Ladders of periods, the front, and the search for the shortest experiment."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import excite
from excite.design.start_results import StartResult
from excite.information.half_widths import half_width_factor, residual_degrees_of_freedom
from excite.study import period_search as period_search
from excite.study.period_search import (
    PeriodTrial,
    best_trial,
    ladder,
    pareto_front,
    promising_period,
    task_at,
)
from regressors.errors import InputError

ONE = excite.Search(starts=1, rounds=0, executor="serial")


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
    return PeriodTrial(period, 5, SimpleNamespace(run_information=Run(period, slope, level, pause)))  # type: ignore[arg-type]


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
    for period in periods:
        choice = task_at(task, period, None).trajectory
        assert choice.harmonics / period <= 5 / 10.0 + 1e-9 or choice.harmonics == 2
        assert (choice.harmonics + 1) / period > 5 / 10.0


def test_no_period_is_longer_than_the_robot_time() -> None:
    assert max(ladder(excite.Task("irp6", max_time=12.0))) <= 12.0
    assert ladder(excite.Task("irp6", max_time=2.0)) == [2.0]


def test_a_period_between_two_needs_one_run_less() -> None:
    trials = [trial(period) for period in (5.0, 7.1, 10.0, 14.2)]
    period = promising_period(trials, 600.0, 100.0)
    assert period is not None
    assert trial(period).robot_seconds < 0.99 * min(each.robot_seconds for each in trials)
    assert trial(period).run.use(trial(period).runs) == pytest.approx(1.0, abs=0.02)


def test_nothing_between_promises_more_when_information_only_adds() -> None:
    assert promising_period([trial(period, slope=0.5) for period in (8.0, 16.0, 32.0)], 600.0, 100.0) is None


@pytest.fixture(scope="module")
def design() -> excite.Design:
    return excite.design_trajectory(
        "irp6", search=ONE, precision=0.05, noise=2.0, criterion="max-deviation", scale="precision"
    )


def test_the_criterion_is_the_largest_deviation_over_the_allowed_half_width(design: excite.Design) -> None:
    run = design.run_information
    instants = run.rows / 3
    value = next(start.value for start in design.starts if start.index == design.best_start)
    assert float(np.max(run.deviation / run.allowed)) == pytest.approx(value / math.sqrt(instants), rel=1e-9)
    assert run.deviation == pytest.approx([p.standard_deviation for p in design.predicted], rel=1e-6)


def test_fewest_runs_are_enough_and_one_less_is_not(design: excite.Design) -> None:
    run, forecast = design.run_information, design.precision
    n = run.fewest_runs()
    assert run.use(n) <= 1.0 < run.use(n - 1)
    freedom = residual_degrees_of_freedom(n * run.rows, 13, 3)
    assert run.half_widths(n) == pytest.approx(half_width_factor(freedom) * run.deviation / math.sqrt(n))
    assert forecast.runs == n
    assert forecast.met
    assert not forecast.too_wide
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
    assert forecast.met
    assert first.feasible
    assert search.out_of_reach is None
    assert all(each.richness / each.period <= 5 / 10.0 + 1e-9 for each in search.trials)  # the highest frequency stays
    assert forecast.robot_seconds == min(each.robot_seconds for each in search.trials)
    with pytest.raises(InputError, match="another problem"):
        excite.design_for_precision("irp6", "190%", **options)
    rerun = excite.design_trajectory(first.task)
    assert rerun.coefficients_sha256 == first.coefficients_sha256


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "give `precision`"),
        ({"precision": "five"}, "precision"),
        ({"precision": -0.1}, "precision"),
        ({"precision": {"shares": 0.1}}, "no entry"),
        ({"precision": 0.05, "criterion": "trace"}, "criterion"),
        ({"precision": 0.05, "harmonics": "auto"}, "harmonics"),
        ({"precision": 0.05, "prior": 0.1}, "prior"),
        ({"precision": 0.05, "base": "pivoted"}, "base"),
    ],
)
def test_what_no_search_can_begin_with(options: dict[str, Any], message: str) -> None:
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
    assert factors["a known load of 2 kg in every other run"] == pytest.approx(
        1.0, abs=1e-6
    )  # the columns are the same
    assert found.best.narrower == max(factors.values()) > 1.05
