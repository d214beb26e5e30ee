"""Rounds of a search: which starts run next, from the results of earlier ones.

The first round is random. Later ones combine the best motions so far, until a few rounds in a row bring next to
nothing; then another population begins with random motions. The search ends where three populations have come to the
same best end, and at the latest after a number of rounds, and of evaluations that usually take some 22 s; it estimates
what one more population would bring: had each one been left out, how much worse would the best be, on average? The
clock, the number of workers and the order in which starts end have no say, so that the same seed gives the same motion.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from math import floor

import numpy as np

from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.interruption import signal_answered
from excite.design.start_results import (
    HarmonicsTrial,
    PlannedStart,
    Progress,
    SearchSummary,
    StartResult,
    Starts,
    number_of,
    read_start,
    start_file,
    write_start,
)
from excite.design.starts import KeptStarts, remove_starts
from excite.errors import NoFeasibleMotionError
from excite.tasks.search import RANDOM_STARTS, Search
from excite.tasks.stored_files import InitialDesign
from excite.tasks.task import Task
from excite.tasks.trajectory_choice import FEWEST
from regressors.errors import InputError
from regressors.robot.robot import Robot

# chosen by trials on an IRp-6, a Panda and a UR10; ``benchmarks/search.py`` measures what they reach
_OF_START = 400  # evaluations of a random start; on two-armed robots one took 230 to 830
COMBINED = 4  # starts of a later round; also the number of processes that can share it
_PARENTS = 3  # motions that are combined
_PATIENCE = 3  # rounds in a row without gain after which the population ends; it ends at once where an earlier one has
_GAIN = 1e-3  # relative decrease of the criterion that counts as a gain, and difference that counts as none
_REPETITIONS = 3  # populations that come to the same end, the best of all, before the search ends
_ROUNDS = 32  # largest number of rounds after the first, where neither rounds nor a budget are stated


class Rounds:
    """Plan of the rounds of one search."""

    def __init__(self, search: Search, evaluations: float = np.inf) -> None:
        self.search = search
        # after which no further round begins, where neither rounds nor budget are stated
        self._evaluations = evaluations
        self._together = RANDOM_STARTS  # starts of a round: fewer where these take all of the time
        if search.extent == "adaptive":
            self._together = int(np.clip(evaluations / _OF_START, 1, RANDOM_STARTS))
        if self._together < RANDOM_STARTS:  # then a start counts: none begins that would end far beyond
            self._evaluations -= _OF_START / 2
        self.planned = self.first = self.count = 0  # starts, those of the first round, and rounds after it
        self.population = Population()
        self.ends: list[float] = []
        self._stall = 0
        self._best: StartResult | None = None
        self._over = False

    @property
    def largest(self) -> int:
        """Number of starts in the largest round."""
        return max(self.search.first, COMBINED if self.search.adaptive else 0)

    def following(self, results: Sequence[StartResult], spent: float = 0.0) -> Starts:
        """Starts of the next round, given the results of the last one; none at the end."""
        if self.planned and (self._over or not self.search.adaptive):
            return ()
        if self.planned:
            self._take(results)
        if not self.planned or (self.first < self._at_first and not self._is_spent(spent)):
            return self._first_round()
        if self._best is None:
            return ()
        if self._ends_here(spent):
            self._over = True
            return tuple(PlannedStart(k, "refinement", (self._best,)) for k in self._random(1))
        self.count += 1
        if not self.population.members:
            return self._random(self._together)
        # every other one looks for new basins: better motions are as often near known ones as far from them
        members, numbers = self.population.members, self._random(min(self._together, COMBINED))
        return tuple(PlannedStart(k, "combination", members[:_PARENTS], members if k % 2 else ()) for k in numbers)

    @property
    def _at_first(self) -> int:
        """Number of random starts of the first round."""
        return self.search.first if self.search.starts is not None else self._together

    @property
    def left(self) -> float:
        """Estimated relative gain of one more population.

        Of k ends that are equally likely from the least possible value on, the next one gains ``k / (k + 2)`` times the
        mean of what leaving out each of them would cost, ``(e_2 - e_1) / k`` with the least two ends e_1 and e_2.
        """
        if len(self.ends) < 2:
            return np.inf
        ends = np.sort(self.ends)
        return float((ends[1] - ends[0]) / ends[0] / (ends.size + 2))

    @property
    def summary(self) -> SearchSummary:
        """What became of the search."""
        return SearchSummary(self.count, len(self.ends), self.left if np.isfinite(self.left) else None)

    def _take(self, results: Sequence[StartResult]) -> None:
        before = self.population.best
        self.population.add(results)
        for result in sorted(results, key=lambda result: result.index):
            self._evaluations -= result.evaluations
            if np.isfinite(result.value) and (self._best is None or result.value < self._best.value):
                self._best = result
        gained = self.population.best < before * (1.0 - _GAIN)
        self._stall = 0 if gained else self._stall + 1
        best = self.population.best
        repeated = any(abs(best - end) <= _GAIN * end for end in self.ends)
        if repeated or self._stall >= _PATIENCE:
            self.ends.append(best)
            self.population, self._stall = Population(), 0

    def _first_round(self) -> range:
        """Its starts; a few of them at a time where their time is bounded."""
        left = self._at_first - self.first
        count = left if self.search.budget is None else min(left, RANDOM_STARTS)
        self.first += count
        return self._random(count)

    def _random(self, count: int) -> range:
        self.planned += count
        return range(self.planned - count, self.planned)

    def _is_spent(self, spent: float) -> bool:
        return self.search.budget is not None and spent >= self.search.budget

    def _ends_here(self, spent: float) -> bool:
        rounds, budget = self.search.rounds, self.search.budget
        if rounds is not None or budget is not None:
            return self._is_spent(spent) or (rounds is not None and self.count >= rounds)
        ends = np.sort(self.ends)[:_REPETITIONS]
        found_again = ends.size == _REPETITIONS and ends[-1] <= (1.0 + _GAIN) * ends[0]
        return bool(found_again) or self.count >= _ROUNDS or self._evaluations <= 0


_SAME = 3e-3  # two motions whose criteria differ by less are taken to be in one basin: mirrored and reversed ones are
_MOST = 12


class Population:
    """Local minima, the best first; of those in one basin the best is kept."""

    def __init__(self) -> None:
        self.members: tuple[StartResult, ...] = ()

    def add(self, results: Iterable[StartResult]) -> None:
        """Add the ends of starts, by number; those without a finite criterion are left out."""
        for result in sorted(results, key=lambda result: result.index):
            near = [member for member in self.members if abs(member.value - result.value) <= _SAME * abs(result.value)]
            if np.isfinite(result.value) and not any(member.value <= result.value for member in near):
                others = [member for member in self.members if member not in near]
                by_value = sorted([*others, result], key=lambda member: (member.value, member.index))
                self.members = tuple(by_value[:_MOST])

    @property
    def best(self) -> float:
        """The least criterion; infinite where there is no member."""
        return self.members[0].value if self.members else np.inf


class RunningRounds:
    """Starts that are left, round by round."""

    def __init__(
        self, rounds: Rounds, kept: KeptStarts, progress: Progress | None = None, *, in_processes: bool = False
    ) -> None:
        self.rounds, self._kept, self._progress = rounds, kept, progress
        self._beside = in_processes
        self._results: list[StartResult] = []
        self._began = time.process_time()  # what a longer session has computed before is not of this search
        self.in_processes = 0.0

    @property
    def spent(self) -> float:
        """Processor time of the search in all its processes, and of starts that an earlier run finished [s]."""
        return time.process_time() - self._began + self.in_processes + self._kept.cpu

    def report(self, result: StartResult) -> None:
        """Take the result of a start."""
        if self._beside:
            self.in_processes += result.cpu
        self._take(result)
        if self._progress is not None:
            self._progress(result)

    def __iter__(self) -> Iterator[Starts]:
        while starts := self.rounds.following(self._results, self.spent):
            self._results = []
            left = self._kept.left(starts)
            if self.rounds.search.adaptive and len(left) < len(starts):
                for start in starts:
                    if self._kept.has(start):
                        self._take(read_start(start_file(self._kept.folder, number_of(start)))[0])
            for start in left:
                if number_of(start) in self._kept.done:  # of another lineage
                    start_file(self._kept.folder, number_of(start)).unlink(missing_ok=True)
            if left:
                yield left

    def _take(self, result: StartResult) -> None:
        if self.rounds.search.adaptive:
            self._results.append(result)


_NUMBERS = (FEWEST, 7, 10, 14, 20, 30)  # harmonics
_LEAST = 0.02  # part of the criterion that a step must bring
_STARTS = 1  # of each search that begins with a motion

Prepare = Callable[[Formulation, bool], KeptStarts]
Solve = Callable[[Formulation, KeptStarts], Design]


def design_with_harmonics(robot: Robot, task: Task, prepare: Prepare, solve: Solve) -> Design:
    """Search with more and more harmonics, each time from the best motion so far, until that does not pay.

    The task of the result states the number that was chosen and the motion that its search began with, so it can be run
    again like any other.
    """

    def searched(task: Task, *, fresh: bool) -> tuple[Formulation, KeptStarts, Design]:
        formulation = formulate(robot, task)
        kept = prepare(formulation, fresh)
        return formulation, kept, solve(formulation, kept)

    numbers, end = _numbers(task)
    formulation, kept, best = searched(_with_harmonics(task, numbers[0]), fresh=False)
    trials = [_trial(best)]
    for number in numbers[1:]:
        if best.interrupted:
            break
        try:
            made, kept, design = searched(_continued(task, best, number), fresh=True)
        except (InputError, NoFeasibleMotionError) as error:
            end = f"{number} harmonics are not possible: {error}"
            break
        except KeyboardInterrupt:
            signal_answered()
            best = replace(best, interrupted=True)
            break
        trials.append(_trial(design))
        gain = (best.minimised_value - design.minimised_value) / abs(best.minimised_value)  # part of the criterion
        if gain < _LEAST:
            end = f"{number} brought {100 * max(gain, 0.0):.1f} %"
            break
        formulation, best = made, design
    if _trial(best).harmonics != trials[-1].harmonics:  # leave in the folder the starts of the motion that was chosen
        remove_starts(kept.folder)
        for start in best.starts:
            write_start(kept.folder, start, formulation.identity.origin)
    return _with_trials(best, trials, end)


def _numbers(task: Task) -> tuple[list[int], str]:
    """Numbers of harmonics to try, and why there are no more."""
    bandwidth, period = task.trajectory.bandwidth, task.trajectory.period
    if bandwidth is None or (most := floor(bandwidth * period * (1.0 + 1e-9))) > _NUMBERS[-1]:
        return list(_NUMBERS), f"{_NUMBERS[-1]} are the most that are tried"
    if most < 2:
        raise InputError(
            f"bandwidth: {bandwidth:g} Hz leaves {most} harmonics of a period of {period:g} s; expected two or more: "
            "give a longer `period`"
        )
    below = [number for number in _NUMBERS if number < most]
    return [*below, most], f"more are beyond the bandwidth of {bandwidth:g} Hz"


def _with_harmonics(task: Task, number: int) -> Task:
    """The task with a number, which the bandwidth has bounded."""
    return task.changed(harmonics=number, bandwidth=None)


def _trial(design: Design) -> HarmonicsTrial:
    cpu = float(str(design.provenance["cpu_seconds"]))
    return HarmonicsTrial(int(design.task.trajectory.harmonics), design.minimised_value, cpu)


def _continued(task: Task, best: Design, number: int) -> Task:
    begin = InitialDesign(f"the best motion of {_trial(best).harmonics} harmonics", best.series)
    return _with_harmonics(task, number).changed(begin=begin, starts=_STARTS, rounds=None, budget=None)


def _with_trials(design: Design, trials: list[HarmonicsTrial], end: str) -> Design:
    note = f"{_trial(design).harmonics} harmonics: {'interrupted' if design.interrupted else end}"
    provenance = {**design.provenance, "cpu_seconds": sum(trial.cpu_seconds for trial in trials)}
    return replace(design, harmonics_trials=tuple(trials), notes=(*design.notes, note), provenance=provenance)
