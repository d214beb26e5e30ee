"""An identification repeated in simulation: the scatter of the estimate, compared with the predicted one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.stats

from excite.executors.unit_executor import UnitExecutor
from excite.identification.equations import predicted_rows
from excite.identification.identification import Identification
from excite.identification.prediction import instantaneous_target
from excite.identification.preparation import chosen_method
from excite.identification.recipe import Recipe, not_repeated
from excite.signals.delay import delayed
from excite.signals.low_pass import decimation
from excite.signals.resampling import resample
from excite.study.experiment import Experiment, Noise
from excite.study.repeated import repeat_experiment
from excite.study.repetitions import Repetitions
from regressors.samples import Array, Samples


def repetitions(
    result: Identification,
    count: int,
    seed: int,
    progress: Callable[[int, int], None] | None = None,
    *,
    executor: str | UnitExecutor = "process",
    workers: int | None = None,
    kept: str | Path | None = None,
) -> Repetitions:
    """Repeat the experiment of the first log with the estimate as the truth.

    The true motion is the filtered motion of the log; the noise of positions is what was filtered out of them, the
    noise of torques the residual of the estimate at every instant, both taken as white. Friction has the sign of the
    velocity, smoothed over the sign width if there is one; presliding over a distance is left out.
    """
    if result.friction is not None:
        raise not_repeated()
    recipe, part, model = result.recipe, result.prepared[0], result.target.model
    recipe.check_repeatable(count)
    uniform = resample(part.log).log  # what the method chooses for the log, it keeps
    experiment = Experiment(
        model=model,
        base=result.target.base,
        samples=part.samples,
        beta=result.estimate.coefficients,
        noise=Noise(effort=effort_noise(result), position=position_noise(result)),
        method=chosen_method(recipe).settled(uniform.time, uniform.q),
        low_pass=recipe.low_pass,
        every=_every(recipe, part.samples),
        estimator=str(recipe.estimator),
    )
    return repeat_experiment(experiment, count, seed, progress=progress, executor=executor, workers=workers, kept=kept)


def _every(recipe: Recipe, samples: Samples) -> int:
    if recipe.every is not None or recipe.low_pass is None:
        return recipe.every or 1
    return decimation(_rate(samples), recipe.low_pass)


def _rate(samples: Samples) -> float:
    return (samples.time.size - 1) / float(samples.time[-1] - samples.time[0])


def effort_noise(result: Identification) -> Array:
    """Standard deviation of the residuals of the first log's torques, or wrench, shape (r,) [Nm or N].

    At every instant and before any low-pass, whatever the equations of the identification were. From the median
    magnitude, since large errors at a few sign changes of friction are not noise.
    """
    target = instantaneous_target(result.robot, result.task, result.recipe)
    part, model = result.prepared[0], target.model
    predicted = predicted_rows(
        target,
        part.samples,
        result.recipe.breakaway or 0.0,
        result.recipe.sign_width or 0.0,
        result.estimate.coefficients,
    )
    left = model.right_side(part.samples, part.measured).reshape(predicted.shape) - predicted
    magnitude = np.median(np.abs(left), axis=0)
    return np.asarray(magnitude / scipy.stats.norm.ppf(0.75))


def position_noise(result: Identification) -> Array:
    """Standard deviation of the noise filtered out of the first log's positions, shape (n,) [rad or m]."""
    part = result.prepared[0]
    delay, log = result.recipe.delay, part.log
    samples = delayed(part.samples, -delay)  # as the positions were recorded, but for the ends
    within = (log.time >= samples.time[0] + abs(delay)) & (log.time <= samples.time[-1] - abs(delay))
    smooth = np.column_stack([np.interp(log.time[within], samples.time, q) for q in samples.q.T])
    return np.asarray(np.std(log.q[within] - smooth, axis=0))
