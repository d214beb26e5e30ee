"""Memory that the repetitions of an experiment take, predicted before they are computed."""

from __future__ import annotations

from excite.estimates.work_prediction import FLOAT, MemoryPart, WorkPrediction
from excite.montecarlo.equation_columns import BLOCK
from excite.montecarlo.experiment import Experiment

_OF_JOINT = 20  # numbers of each instant for each joint, and for each torque or component of the wrench
_COPIES = 6  # of the columns that are computed at once
_SHORTER = "repeat a shorter stretch of the log (`rows`)"
_PLAIN = ", or leave out `low_pass`"


def experiment_prediction(experiment: Experiment) -> WorkPrediction:
    """Largest memory that the repetitions of an experiment hold at once.

    Columns of single instants are computed in blocks; those of windows and those that are filtered, at once. Where only
    torques are noisy, and for instruments, the columns are held.

    Parameters
    ----------
    experiment : Experiment
    """
    model, N = experiment.model, experiment.samples.time.size
    r, b = len(model.row_labels), experiment.base.rank
    channels = model.robot.n + (6 if model.channel == "wrench" else model.robot.n)
    remedy = _SHORTER + _PLAIN * (experiment.low_pass is not None)
    rows, numbers = _at_once(experiment)
    held = N * r * ((not experiment.noise.moves) + (experiment.estimator == "instrumental"))
    return WorkPrediction(
        "the repetition of the experiment",
        (
            MemoryPart("instants", N, channels, FLOAT * _OF_JOINT * N * channels, remedy=remedy),
            MemoryPart("rows of equations at once", rows, b, FLOAT * numbers, remedy=remedy),
            MemoryPart("rows of equations", held, b, float(FLOAT * held * b), remedy=remedy),
        ),
    )


def _at_once(experiment: Experiment) -> tuple[float, float]:
    """Rows of equations that are computed at the same time, and the numbers in them and in what they are made of."""
    model, N = experiment.model, experiment.samples.time.size
    r, p, b = len(model.row_labels), len(model.columns), experiment.base.rank
    if model.window is not None:  # states and densities of all instants, and their integrals
        return N * r, N * _COPIES * r * p
    if experiment.low_pass is None:
        return min(N, BLOCK) * r, min(N, BLOCK) * _COPIES * r * b
    return N * r, N * (3 * r + 4) * b  # rows of all equations, and of one that is filtered
