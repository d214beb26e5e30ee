"""Repetitions of an experiment through the whole chain, in little memory."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from excite.estimates.long_work import announce
from excite.identification.repetition_count import repetition_prediction
from excite.montecarlo.batch_estimators import Solved
from excite.montecarlo.chain import Chain
from excite.montecarlo.experiment import Experiment
from excite.montecarlo.repetition_memory import experiment_prediction
from excite.montecarlo.repetition_time import repetition_seconds
from excite.montecarlo.repetitions import Repetitions
from regressors.errors import InputError
from regressors.numerical import numerical_work
from regressors.quantities import check

_ENDED = "Ctrl-C ends them, and what was identified is saved"
_FEWEST = 2  # repetitions that have a scatter


@numerical_work(
    "the repetition of the experiment",
    "rows that hardly move, or numbers of very different sizes are the likely cause: "
    "check the units of the log and `rows`",
)
def repeat_experiment(
    experiment: Experiment, count: int, seed: int, *, progress: Callable[[int, int], None] | None = None
) -> Repetitions:
    """Estimates from repetitions with different noise.

    Parameters
    ----------
    experiment : Experiment
    count : int
        Number of repetitions.
    seed : int
        Repetition k of a seed is the same whatever `count` is, and however many are computed at once; on a GPU to
        rounding.
    progress : callable, optional
        Called after every repetition with the number of repetitions done and `count`.

    Returns
    -------
    Repetitions
        After Ctrl-C those that were completed, `interrupted`, if there are two or more.

    Raises
    ------
    InputError
        Fewer than two repetitions, more memory than the cap, a motion from which the parameters are not identifiable,
        or a method that chooses its settings from the positions.
    """
    check("repeats", count)
    check("seed", seed)
    if count < _FEWEST:
        raise InputError(f"repetitions: expected 2 or more, given {count}")
    experiment_prediction(experiment).check()
    repetition_prediction(count, experiment.base.rank).check()
    announce("the repetitions", repetition_seconds(experiment, count), _ENDED)
    chain = Chain(experiment)
    solved, interrupted = _solved(chain, count, seed, progress)
    base, beta = experiment.base, np.asarray(experiment.beta, dtype=float)
    P = np.eye(beta.size) if chain.change is None else chain.change
    estimates = beta + np.array([P @ one.error for one in solved])
    predicted = np.array([np.linalg.norm(P @ one.half, axis=1) for one in solved])
    noise = np.array([one.noise for one in solved])
    return Repetitions(
        base.names, base.units, beta, estimates, predicted, noise, chain.rows - base.rank, seed, interrupted
    )


def _solved(
    chain: Chain, count: int, seed: int, progress: Callable[[int, int], None] | None
) -> tuple[list[Solved], bool]:
    """The repetitions that were completed, and whether an interrupt ended them before the last."""
    solved: list[Solved] = []
    try:
        for first in range(0, count, chain.batch):
            for one in chain.repetitions(seed, range(first, min(first + chain.batch, count))):
                solved.append(one)
                if progress is not None:
                    progress(len(solved), count)
    except KeyboardInterrupt:
        if len(solved) < _FEWEST:
            raise
        return solved, True
    return solved, False
