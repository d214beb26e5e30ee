"""An identification repeated in simulation: what its noise does to the estimate, beside what the formulas say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from excite.identify.identification import Identification
from excite.identify.preparation import chosen_method
from excite.identify.recipe import Recipe
from excite.montecarlo.estimators import ESTIMATORS
from excite.montecarlo.experiment import Experiment
from excite.montecarlo.noise import Noise
from excite.montecarlo.repeated import repeated
from excite.montecarlo.repetitions import Repetitions
from excite.signals.low_pass import decimation
from regressors.errors import InputError
from regressors.samples import Array, Samples


def repetitions(
    result: Identification, count: int, seed: int, progress: Callable[[int, int], None] | None = None
) -> Repetitions:
    """Repeat the experiment of the first log with the estimate as the truth.

    The true motion is the one that was made of the log's positions; the noise of positions is what was filtered out of
    them, the noise of torques that of the residuals, both taken as white.

    Parameters
    ----------
    result : Identification
    count : int
        Number of repetitions.
    seed : int
    progress : callable, optional
        Called with the number of repetitions done, and `count`.

    Raises
    ------
    InputError
        An estimator that has no batch form, a known friction with a memory, or averaged periods.
    """
    recipe, part, model = result.recipe, result.prepared[0], result.subject.model
    if recipe.estimator not in ESTIMATORS:
        raise InputError(f"repetitions: the estimator must be one of {', '.join(ESTIMATORS)}, not {recipe.estimator}")
    if recipe.average:
        raise InputError("repetitions: not of a log averaged over periods")
    experiment = Experiment(
        model=model,
        base=result.subject.base,
        samples=part.samples,
        beta=result.estimate.coefficients,
        noise=Noise(effort=result.estimate.noise[0], position=position_noise(result)),
        method=chosen_method(recipe).settled(part.samples.time, part.samples.q),
        low_pass=recipe.low_pass,
        every=_every(recipe, part.samples),
        estimator=recipe.estimator,
    )
    return repeated(experiment, count, seed, progress=progress)


def _every(recipe: Recipe, samples: Samples) -> int:
    if recipe.every is not None or recipe.low_pass is None:
        return recipe.every or 1
    return decimation(_rate(samples), recipe.low_pass)


def _rate(samples: Samples) -> float:
    return (samples.time.size - 1) / float(samples.time[-1] - samples.time[0])


def position_noise(result: Identification) -> Array:
    """Standard deviation of what was filtered out of the first log's positions, shape (n,) [rad or m]."""
    part = result.prepared[0]
    samples, log = part.samples, part.log
    within = (log.time >= samples.time[0]) & (log.time <= samples.time[-1])
    smooth = np.column_stack([np.interp(log.time[within], samples.time, q) for q in samples.q.T])
    return np.asarray(np.std(log.q[within] - smooth, axis=0))
