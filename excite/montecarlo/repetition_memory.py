"""Memory that the repetitions of an experiment take, judged before they are computed."""

from __future__ import annotations

from excite.montecarlo.equation_columns import BLOCK
from excite.montecarlo.experiment import Experiment
from regressors.errors import InputError

MOST = 1.2e9  # bytes, besides what the programs themselves take


def memory(experiment: Experiment) -> float:
    """Estimate of the largest memory that the repetitions hold at once [bytes].

    Parameters
    ----------
    experiment : Experiment
    """
    model, N = experiment.model, experiment.samples.time.size
    r, p, b = len(model.row_labels), len(model.columns), experiment.base.rank
    motion = N * 20 * (model.robot.n + (6 if model.channel == "wrench" else model.robot.n))
    held = (not experiment.noise.moves) + (experiment.estimator == "instrumental")
    if model.window is not None:  # states and densities of all instants, and their integrals
        at_once = N * 6 * r * p
    elif experiment.low_pass is None:
        at_once = min(N, BLOCK) * 6 * r * b
    else:  # rows of all equations, and of one that is filtered
        at_once = N * (3 * r + 4) * b
    return 8.0 * (motion + at_once + held * N * r * b)


def check_memory(experiment: Experiment) -> None:
    """Raise `InputError` for an experiment whose repetitions take more than `MOST`.

    Parameters
    ----------
    experiment : Experiment
    """
    needed = memory(experiment)
    if needed > MOST:
        raise InputError(
            f"repetitions of {experiment.samples.time.size} instants would take about {needed / 1e9:.1f} GB, more than "
            f"{MOST / 1e9:.1f} GB: repeat a shorter stretch of the log (`rows`), or leave out `low_pass`"
        )
