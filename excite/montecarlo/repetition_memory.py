"""Memory that the repetitions of an experiment take, predicted before they are computed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction
from excite.montecarlo.equation_columns import BLOCK, entries_of_equations
from excite.montecarlo.experiment import Experiment
from regressors.memory_cap import memory_cap

_OF_CHANNEL = 12  # numbers of each instant for each joint, and for each torque or component of the wrench
_COPIES = 4  # of the columns of windows
_FILTERED = 6  # copies of the columns of one equation in the low-pass
_PROGRAMS = 1.2e8  # bytes of compiled models and of libraries that other work does not load
_SHORTER = "repeat a shorter stretch of the log (`rows`)"
_PLAIN = ", or leave out `low_pass`"


def experiment_prediction(experiment: Experiment, processes: int = 0) -> WorkPrediction:
    """Largest memory that the repetitions of an experiment hold at once; it does not grow with their number.

    Columns of single instants are computed in blocks; those of windows and those that are filtered, at once. Where only
    torques are noisy, and for instruments, the columns are held. From once to twice what was measured with 20,000 to
    1,000,000 rows.
    """
    model, N = experiment.model, experiment.samples.time.size
    channels = model.robot.n + (6 if model.channel == "wrench" else model.robot.n)
    remedy = _SHORTER + _PLAIN * (experiment.low_pass is not None)
    entries = entries_of_equations(model, experiment.base.index)
    at_once, held = _at_once(experiment, entries), _held(experiment, entries)
    table = 0 if experiment.method is None else experiment.method.table_width
    own = WorkPrediction(
        "the repetition of the experiment",
        (
            MemoryPart("programs", 1, 1, _PROGRAMS, remedy=remedy),
            MemoryPart("instants", N, channels, FLOAT * _OF_CHANNEL * N * channels, remedy=remedy),
            MemoryPart("instants", N, table, float(FLOAT * N * table), remedy="state fewer `harmonics`"),
            MemoryPart("rows of equations at once", N, at_once / N, FLOAT * at_once, remedy=remedy),
            MemoryPart("rows of equations", N, held / N, FLOAT * held, remedy=remedy),
        ),
    )
    return replace(own, parts=(*own.parts, _of_workers(own, processes))) if processes else own


def _of_workers(own: WorkPrediction, processes: int) -> MemoryPart:
    """What the worker processes hold."""
    part = own.largest
    what = f"{part.what} in each of {processes} worker processes"
    return MemoryPart(what, part.rows, part.columns, processes * own.bytes, "workers", processes)


def fitting_workers(experiment: Experiment) -> int:
    """Number of worker processes that fit into the cap on memory beside this one."""
    own = experiment_prediction(experiment).bytes
    return max(0, int(memory_cap() / own) - 1)


def _at_once(experiment: Experiment, entries: list[int]) -> float:
    """Numbers in the rows of equations that are computed at the same time, and in what they are made of."""
    model, N = experiment.model, experiment.samples.time.size
    if model.window is not None:  # states and densities of all instants, and their integrals
        return float(N * _COPIES * sum(entries))
    if experiment.low_pass is None and experiment.every == 1:
        return float(min(N, BLOCK) * _COPIES * sum(entries))
    return float(N * (sum(entries) + _FILTERED * max(entries)))  # all equations, and one that is filtered


def _held(experiment: Experiment, entries: list[int]) -> float:
    """Numbers in the columns that stay the same in every repetition, and while they are put together once more."""
    held = np.count_nonzero([not experiment.noise.moves, experiment.estimator == "instrumental"])
    return float(experiment.samples.time.size * sum(entries) * (held + 1 if held else 0))
