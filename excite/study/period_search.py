"""The period of the shortest experiment that meets a precision target, and the periods that were tried.

A motion of a longer period sees more at once, and every run costs its approach and return; but runs come in whole
numbers, and a period that is just long enough for one of them less is the best. So periods are tried a factor of
sqrt 2 apart, each begun with the best motion of the one before; then those in between at which interpolation predicts
one run less. The highest frequency stays that of the task's period and harmonics.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from excite.design.design import Design
from excite.design.formulation import Formulation
from excite.design.interruption import signal_answered
from excite.errors import NoFeasibleMotionError
from excite.information.precision_forecast import FrontPoint, RunInformation, TriedPeriod
from excite.tasks.stored_files import InitialDesign
from excite.tasks.task import Task
from regressors.errors import InputError

STEP = math.sqrt(2.0)
LONGEST = 6.0  # times the task's period
_FEWEST = 2  # harmonics, or what the family has instead
_ROUNDS = 2  # of the search at a period, after its random starts
_BETWEEN = 4  # periods between those of the ladder that are tried
_SHORTER = 4  # periods tried below the best one, after its last search
_WORTH = 0.01  # part of the robot time that a period in between must promise
_IDLE = 2  # periods in a row without gain after which the ladder ends

Formulate = Callable[[Task], Formulation]
Solve = Callable[[Formulation, str], Design]
Report = Callable[[str], None]


@dataclass
class PeriodSearch:
    """Periods tried so far."""

    task: Task  # with a precision, and the period and harmonics that state the highest frequency
    formulate: Formulate  # builds and checks the problem of a task
    # finds the best motion; its second argument is the name of the search, of which there are several at a period
    solve: Solve
    report: Report = lambda _: None  # takes a sentence on the progress
    trials: list[PeriodTrial] = field(default_factory=list, init=False)
    refusals: list[InputError | NoFeasibleMotionError] = field(default_factory=list, init=False)
    seconds: float = field(default=0.0, init=False)
    interrupted: bool = field(default=False, init=False)

    def run(self) -> PeriodTrial:
        """Try the ladder of periods, those in between that promise less robot time, and search on at the best."""
        try:
            self._climb()
            if self.trials:
                self._refine()
                self._finish()
        except KeyboardInterrupt:
            if not self.trials:
                raise
            signal_answered()
            self.interrupted = True
        if not self.trials:
            raise self.refusals[-1]
        return best_trial(self.trials, self.task.objective.max_time)

    def _climb(self) -> None:
        idle = 0
        for period in ladder(self.task):
            before = min((trial.robot_seconds for trial in self.trials), default=math.inf)
            if period >= before or idle >= _IDLE:
                break
            trial = self._try(period)
            idle = idle + 1 if trial is not None and trial.robot_seconds >= before else 0

    def _refine(self) -> None:
        for _ in range(_BETWEEN):
            period = promising_period(self.trials, self.task.objective.max_time, self.task.output.rate)
            if period is None or self._try(period) is None:
                return

    def _finish(self) -> None:
        """Search at the best period as the task says, then shorten it as far as as many runs are enough."""
        best = best_trial(self.trials, self.task.objective.max_time)
        self.report(f"searching on at {best.period:g} s")
        self._search(self.task, best.period, "last", best)
        best = best_trial(self.trials, self.task.objective.max_time)
        runs, lower = best.runs, 0.5 * best.period
        for _ in range(_SHORTER):
            period = self._shorter(best, lower)
            if runs * best.seconds > self.task.objective.max_time or period is None:
                return
            trial = self._search(_single(self.task), period, f"shorter-{best.period:g}", best)
            if trial is not None and trial.runs <= runs:
                best = trial
            else:
                lower = period

    def _shorter(self, best: PeriodTrial, lower: float) -> float | None:
        """A period at which the same runs may be enough, above one at which they are not; None if none is worth it."""
        use = best.run.use(best.runs)
        wanted = max(best.period * use**2, 0.5 * (lower + best.period))  # deviations fall with its root, or faster
        period = max(_at_rate(wanted, self.task.output.rate), ladder(self.task)[0])  # shorter ones are faster
        return period if lower < period < (1.0 - _WORTH) * best.period else None

    def _try(self, period: float) -> PeriodTrial | None:
        """Search at one period, from random motions and from the best motion of a neighbour; None if it has none."""
        near = min(self.trials, key=lambda trial: abs(math.log(trial.period / period)), default=None)
        brief = self.task.changed(starts=None, rounds=_ROUNDS, budget=None)  # a few rounds after random motions
        random = self._search(brief, period, "random", None)
        warm = None if near is None else self._search(_single(self.task), period, "warm", near)
        trials = [trial for trial in (random, warm) if trial is not None]
        if not trials:
            return None
        trial = min(trials, key=lambda trial: trial.run.use(1))
        self.report(f"{period:g} s: {runs_text(trial.runs, trial.seconds)}")
        return trial

    def _search(self, task: Task, period: float, name: str, begin: PeriodTrial | None) -> PeriodTrial | None:
        """The trial of a period after a search there, or a better one that is known; None where it has no motion."""
        try:
            formulation = self.formulate(task_at(task, period, begin))
        except InputError as error:
            self._refuse(period, error)
            return None
        try:
            design = self.solve(formulation, name)
        except NoFeasibleMotionError as error:
            self._refuse(period, error)
            return None
        period = design.task.trajectory.period
        trial = PeriodTrial(period, design.task.trajectory.richness[1], design)
        self.seconds += float(str(design.provenance["cpu_seconds"]))
        same = [each for each in self.trials if each.period == period and each.run.use(1) <= trial.run.use(1)]
        if not same:
            others = [each for each in self.trials if each.period != period]
            self.trials = sorted([*others, trial], key=lambda each: each.period)
        if design.interrupted:
            raise KeyboardInterrupt
        return same[0] if same else trial

    def _refuse(self, period: float, error: InputError | NoFeasibleMotionError) -> None:
        self.refusals.append(error)
        self.report(f"{period:g} s: no motion: {error}")


def _single(task: Task) -> Task:
    """The task with a search of one start."""
    return task.changed(starts=1, rounds=None, budget=None)


def best_trial(trials: Sequence[PeriodTrial], max_time: float) -> PeriodTrial:
    """The trial with the least robot time that meets the target; if none does in time, the most precise one."""
    shortest = min(trials, key=lambda trial: trial.robot_seconds)
    if shortest.robot_seconds <= max_time:
        return shortest
    return min(trials, key=lambda trial: trial.reach(max_time))


def runs_text(runs: int, seconds: float) -> str:
    """Robot time of some runs, such as ``3 runs of 14 s: 42 s of robot time``."""
    each = f"{runs} runs of {seconds:.4g} s" if runs > 1 else f"1 run of {seconds:.4g} s"
    return f"{each}: {runs * seconds:.4g} s of robot time"


def ladder(task: Task) -> list[float]:
    """Periods a factor of sqrt 2 apart, from that of two harmonics to `LONGEST` times the task's, shortest first."""
    period, richness = task.trajectory.period, task.trajectory.richness[1]
    lowest = math.ceil(math.log(_FEWEST / richness, STEP) - 1e-9) if richness > _FEWEST else 0
    highest = math.floor(math.log(LONGEST, STEP))
    periods = [_at_rate(period * STEP**k, task.output.rate) for k in range(lowest, highest + 1)]
    most = task.objective.max_time
    return [each for each in periods if each <= most] or [min(period, most)]


def _at_rate(period: float, rate: float) -> float:
    """The next period of a whole number of samples, in tenths of a second where the rate allows [s]."""
    unit = 0.1 if abs(0.1 * rate - round(0.1 * rate)) < 1e-9 and period > 2.0 else 1.0 / rate
    return float(f"{math.ceil(period / unit - 1e-6) * unit:.12g}")


def task_at(task: Task, period: float, begin: PeriodTrial | None) -> Task:
    """The task at another period, with as many harmonics as keep its highest frequency."""
    option, richness = task.trajectory.richness
    changed: dict[str, Any] = {option: max(_FEWEST, math.floor(richness * period / task.trajectory.period + 1e-6))}
    task = task.changed(trajectory=replace(task.trajectory, period=period, **changed))
    if begin is None:
        return task
    return task.changed(begin=InitialDesign(f"the best motion of {begin.period:g} s", begin.design.series))


def promising_period(trials: Sequence[PeriodTrial], max_time: float, rate: float) -> float | None:
    """A period between two that were tried, at which one run less is predicted to be enough; None if none is worth it.

    Between neighbours, the logarithms of the deviations over their allowed half-widths and of the robot time of a run
    are linear in that of the period.
    """
    least = (1.0 - _WORTH) * min(min(trial.robot_seconds for trial in trials), max_time / (1.0 - _WORTH))
    best: float | None = None
    for low, high in pairwise(trials):
        for runs in range(max(1, high.runs), low.runs):
            period = _crossing(low, high, runs, rate)
            if period is None or not low.period * 1.005 < period < high.period / 1.005:
                continue
            share = math.log(period / low.period) / math.log(high.period / low.period)
            seconds = runs * low.seconds ** (1.0 - share) * high.seconds**share
            if seconds < least:
                best, least = period, seconds
    return best


def _crossing(low: PeriodTrial, high: PeriodTrial, runs: int, rate: float) -> float | None:
    """Shortest period at which a number of runs is predicted to be enough, rounded up."""
    uses = np.log([low.run.use(runs), high.run.use(runs)])
    if not uses[0] > 0.0 >= uses[1]:
        return None
    period = low.period * (high.period / low.period) ** float(uses[0] / (uses[0] - uses[1]))
    return _at_rate(period, rate)


@dataclass(frozen=True, eq=False)
class PeriodTrial:
    """The best motion found for one period."""

    period: float  # [s]
    richness: int  # number of harmonics, or what the family has instead
    design: Design  # within the limits, with its `run_information`

    @property
    def run(self) -> RunInformation:
        """What one run brings."""
        assert self.design.run_information is not None
        return self.design.run_information

    @property
    def seconds(self) -> float:
        """Robot time of one run, with approach and return [s]."""
        return self.run.seconds

    @property
    def runs(self) -> int:
        """The fewest runs that meet the target."""
        return self.run.fewest_runs()

    @property
    def robot_seconds(self) -> float:
        """Robot time of these runs [s]."""
        return self.runs * self.seconds

    def reach(self, max_time: float) -> float:
        """Largest half-width over the allowed one after as many runs as a robot time leaves room for."""
        return self.run.use(max(1, math.floor(max_time / self.seconds)))


def pareto_front(trials: Sequence[PeriodTrial], max_time: float) -> tuple[FrontPoint, ...]:
    """Robot time against precision: numbers of runs of all periods, without those that another one dominates."""
    points = [
        FrontPoint(trial.period, runs, runs * trial.seconds, trial.run.use(runs))
        for trial in trials
        for runs in range(1, max(1, math.floor(max_time / trial.seconds)) + 1)
    ]
    front: list[FrontPoint] = []
    for point in sorted(points, key=lambda point: (point.robot_seconds, point.use)):
        if not front or point.use < front[-1].use:
            front.append(point)
    return tuple(front)


_DRAWN = 40  # numbers of runs of a period that a figure shows
_MOST_RUNS = 200


def tried_period(trial: PeriodTrial, longest: float) -> TriedPeriod:
    """The record of a trial, with what its runs reach within a robot time."""
    most = min(_MOST_RUNS, max(1, int(longest / trial.seconds)))
    runs = np.unique(np.geomspace(1, most, _DRAWN).round().astype(int)).tolist()
    course = tuple((n, float(trial.run.use(n))) for n in runs)
    known = (trial.period, trial.richness, trial.seconds, trial.runs, trial.robot_seconds, float(trial.run.use(1)))
    return TriedPeriod(*known, course)
