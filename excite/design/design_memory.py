"""Memory and time that a design takes, predicted before the search.

What grows is the motion at the instants of its files, in equations and as samples; the basis of the family at the
instants where limits are imposed, and the Hessian of the search; and what is kept of every start. The time of a start
is that of its steps, which grows with the coefficients, and of the factors of its Hessian, with their third power.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from excite.design.blueprint import grid_instants, objective_instants
from excite.information.target import IdentificationTarget
from excite.storage.work_prediction import FLOAT, MemoryPart, WorkPrediction
from excite.tasks.task import Task
from excite.trajectories.family import Family

_EQUATIONS = 2.6  # copies of the regressor that are held at once
_OF_ANY, _SAMPLES = 2.0, 24.0  # numbers of each sample, and of each of its joints
_BASIS = 5.0  # derivatives of the basis, and what is computed with it
_HESSIAN = 4.0  # matrices of the size of the Hessian
TYPICAL_STARTS = 60  # starts of a search that adapts their number
_START = 100.0  # bytes of a start: all but the best are on the disk only
_STEPS, _FACTORS = 1e-2, 6e-7  # seconds of a start for each coefficient, and for its third power


def check_richness(task: Task) -> None:
    """Refuse a family whose basis alone is too large, before it is built."""
    option, value = task.trajectory.richness
    if isinstance(task.trajectory.kind, type):  # no family has fewer functions or instants
        least = SearchBasis(value, grid_instants(value // 2), 1, option, value)
        WorkPrediction("the design", (least.part,)).check()


def design_prediction(target: IdentificationTarget, task: Task) -> WorkPrediction:
    """Memory and time of the design of a task; the factors are measured, without limits of torques or distances."""
    family, processes = task.trajectory.family(), 1
    if task.search.executor == "process":  # the problem is in this process too
        processes += workers_of(task, task.search.first)
    option, value = task.trajectory.richness
    coordinates = len(target.motion.labels)
    size = coefficients_of(family, coordinates)
    instants = grid_instants(family.richness) + objective_instants(family.richness)
    hessian = processes * FLOAT * _HESSIAN * size**2
    starts = TYPICAL_STARTS if task.search.adaptive else task.search.first
    return WorkPrediction(
        "the design",
        (
            _motion(target, task),
            SearchBasis(size // coordinates, instants, processes, option, value).part,
            MemoryPart("rows of the Hessian of the search", size, size, hessian, option, value, 2.0),
            MemoryPart("starts", starts, 1, starts * _START, "starts", starts),
        ),
        starts * (_STEPS * size + _FACTORS * float(size) ** 3),
    )


def workers_of(task: Task, starts: int) -> int:
    """Number of processes that work on so many starts at a time."""
    return min(task.search.workers or os.cpu_count() or 1, starts) if task.search.executor == "process" else 1


def search_seconds(target: IdentificationTarget, task: Task, starts: int) -> float:
    """Time that so many starts of the task take, in the processes that it has [s]; right within a factor of five."""
    seconds = design_prediction(target, task).seconds
    every = TYPICAL_STARTS if task.search.adaptive else task.search.first
    return (seconds or 0.0) / every * starts / max(workers_of(task, starts), 1)


@dataclass(frozen=True)
class SearchBasis:
    """Basis of a family at the instants of a search, in each process."""

    size: int
    instants: int
    processes: int
    option: str  # of the family, that makes it large
    value: int

    @property
    def part(self) -> MemoryPart:
        """What it takes."""
        held = self.processes * FLOAT * _BASIS * self.instants * self.size
        return MemoryPart("instants of the search", self.instants, self.size, held, self.option, self.value, 2.0)


def coefficients_of(family: Family, coordinates: int) -> int:
    """Number of coefficients of a motion of some coordinates."""
    return int(np.size(family.resting(np.zeros(coordinates))))


def _motion(target: IdentificationTarget, task: Task) -> MemoryPart:
    """The motion at the rate of its files, at rest for as long as asked for, and its equations."""
    model, period, output = target.model, task.trajectory.period, task.output
    window = model.window if model.window is not None and model.window.kind == "short" else None
    rate = output.rate if window is None else max(output.rate, 2.0 / window.length)
    rest = 2.0 * output.settle if output.home is not None else 0.0
    slowest = min(output.speed, default=1.0)
    equations = _EQUATIONS * period * rate * len(model.row_labels) * len(model.columns)
    played = (period + rest) / slowest * output.rate
    samples = played * (_OF_ANY + _SAMPLES * target.robot.n)
    larger = {"rate": output.rate / 100.0, "period": period / 10.0, "settle": rest / 2.0, "speed": 1.0 / slowest}
    given = {"rate": output.rate, "period": period, "settle": output.settle, "speed": slowest}
    if window is not None and rate > output.rate and equations > samples:
        name, value, power = "window_length", window.length, -1.0
    else:
        name = max(larger, key=lambda option: larger[option])
        value, power = given[name], -1.0 if name == "speed" else 1.0
    rows = max(played, period * rate)
    return MemoryPart("instants", rows, len(model.columns), FLOAT * (equations + samples), name, value, power)
