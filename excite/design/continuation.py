"""The number of harmonics, chosen by a search: more are added as long as they pay.

Motions of H harmonics are among those of more, so the best motion of each number is where the search for the next one
begins: a few starts are enough then.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import floor

from excite.design.design import Design
from excite.design.formulation import Formulation, formulate
from excite.design.kept_starts import KeptStarts, remove_starts
from excite.design.start_results import HarmonicsTrial, write_start
from excite.errors import NoFeasibleMotionError
from excite.tasks.stored_files import InitialDesign
from excite.tasks.task import Task
from excite.tasks.trajectory_choice import FEWEST
from regressors.errors import InputError
from regressors.robot.robot import Robot

_NUMBERS = (FEWEST, 7, 10, 14, 20, 30)  # harmonics
_LEAST = 0.02  # part of the criterion that a step must bring
_STARTS = 1  # of each search that begins with a motion

Prepare = Callable[[Formulation, bool], KeptStarts]
Solve = Callable[[Formulation, KeptStarts], Design]


@dataclass(frozen=True)
class _Step:
    """One number of harmonics, searched."""

    formulation: Formulation
    kept: KeptStarts
    design: Design

    @property
    def trial(self) -> HarmonicsTrial:
        return HarmonicsTrial(self.harmonics, self.value, float(str(self.design.provenance["cpu_seconds"])))

    @property
    def harmonics(self) -> int:
        return int(self.design.task.trajectory.harmonics)

    @property
    def value(self) -> float:
        """The criterion of the design."""
        return self.design.minimised_value

    def gain(self, before: _Step) -> float:
        """Part of the criterion that this number brought."""
        return (before.value - self.value) / abs(before.value)


def design_with_harmonics(robot: Robot, task: Task, prepare: Prepare, solve: Solve) -> Design:
    """Search with more and more harmonics, each time from the best motion so far, until that does not pay.

    The task of the result states the number that was chosen and the motion that its search began with, so it can be run
    again like any other.
    """
    numbers, most = _numbers(task)
    steps = [_searched(robot, _with_harmonics(task, numbers[0]), prepare, solve, fresh=False)]
    best, end = steps[0], most
    for number in numbers[1:]:
        if best.design.interrupted:
            break
        try:
            step = _searched(robot, _continued(task, best, number), prepare, solve, fresh=True)
        except (InputError, NoFeasibleMotionError) as error:
            end = f"{number} harmonics are not possible: {error}"
            break
        except KeyboardInterrupt:
            best = replace(best, design=replace(best.design, interrupted=True))
            break
        steps.append(step)
        gain = step.gain(best)
        if gain < _LEAST:
            end = f"{number} brought {100 * max(gain, 0.0):.1f} %"
            break
        best = step
    _keep_starts_of(best, steps[-1])
    return _with_trials(best.design, steps, end)


def _numbers(task: Task) -> tuple[list[int], str]:
    """Numbers of harmonics to try, and why there are no more."""
    bandwidth, period = task.trajectory.bandwidth, task.trajectory.period
    if bandwidth is None:
        return list(_NUMBERS), f"{_NUMBERS[-1]} are the most that are tried"
    most = floor(bandwidth * period * (1.0 + 1e-9))
    if most < 2:
        raise InputError(
            f"bandwidth: {bandwidth:g} Hz leaves {most} harmonics of a period of {period:g} s; expected two or more: "
            "give a longer `period`"
        )
    if most > _NUMBERS[-1]:
        return list(_NUMBERS), f"{_NUMBERS[-1]} are the most that are tried"
    below = [number for number in _NUMBERS if number < most]
    return [*below, most], f"more are beyond the bandwidth of {bandwidth:g} Hz"


def _with_harmonics(task: Task, number: int) -> Task:
    """The task with a number, which the bandwidth has bounded."""
    return task.changed(harmonics=number, bandwidth=None)


def _continued(task: Task, best: _Step, number: int) -> Task:
    design = best.design
    begin = InitialDesign(f"the best motion of {best.harmonics} harmonics", design.series)
    return _with_harmonics(task, number).changed(begin=begin, starts=_STARTS, rounds=None, budget=None)


def _searched(robot: Robot, task: Task, prepare: Prepare, solve: Solve, *, fresh: bool) -> _Step:
    formulation = formulate(robot, task)
    kept = prepare(formulation, fresh)
    return _Step(formulation, kept, solve(formulation, kept))


def _keep_starts_of(best: _Step, last: _Step) -> None:
    """Leave in the folder the starts of the motion that was chosen."""
    if best is not last and last.harmonics != best.harmonics:
        remove_starts(last.kept.folder)
        for start in best.design.starts:
            write_start(last.kept.folder, start, best.formulation.identity.origin)


def _with_trials(design: Design, steps: list[_Step], end: str) -> Design:
    number = int(design.task.trajectory.harmonics)
    note = f"{number} harmonics: {'interrupted' if design.interrupted else end}"
    cpu = sum(step.trial.cpu_seconds for step in steps)
    provenance = {**design.provenance, "cpu_seconds": cpu}
    harmonics_trials = tuple(step.trial for step in steps)
    return replace(design, harmonics_trials=harmonics_trials, notes=(*design.notes, note), provenance=provenance)
