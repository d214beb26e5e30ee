"""Accuracy that repeats of an experiment will show, predicted from a design and the conditions of measurement."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from excite.accuracy.accuracy_prediction import AccuracyPrediction, ParameterAccuracy
from excite.accuracy.bounded_errors import FREE, bounded_estimates
from excite.accuracy.motion_errors import motion_errors
from excite.accuracy.rehearsal import Rehearsal
from excite.accuracy.torque_errors import torque_errors
from excite.accuracy.torque_noise import StatedNoise, TorqueNoise
from excite.identification.identify import identify
from excite.identification.recipe import Recipe
from excite.identification.stated_uncertainty import DELAY, PRESLIDING
from excite.registry import name_of
from excite.simulation.settings import SimulationSettings
from excite.simulation.simulate import changed_settings, simulate
from regressors.errors import InputError
from regressors.models.nominal import parameter_values
from regressors.numerical import numerical_work
from regressors.quantities import check

if TYPE_CHECKING:
    from excite.design.designed_motion import DesignedMotion
    from excite.identification.choices.choice import Choice
    from excite.identification.estimator import Estimator
    from regressors.friction.curves import FrictionCurves
    from regressors.samples import Array

COUNT = 400
Progress = Callable[[str, int, int], None]


@numerical_work("the prediction of the accuracy", "noise that is far larger than the torques is the likely cause")
def predict_accuracy(
    design: DesignedMotion,
    settings: SimulationSettings | None = None,
    *,
    noise: TorqueNoise | None = None,
    friction: FrictionCurves | str | Path | None = None,
    recipe: Recipe | None = None,
    estimator: Estimator | str | None = None,
    choose: bool | Collection[str] = True,
    count: int = COUNT,
    progress: Progress = lambda *_: None,
    **options: Any,
) -> AccuracyPrediction:
    """Predict the deviation and the bias that repeats of an experiment will show of each parameter.

    The experiment is simulated once and identified as its log will be: that gives the settings that the identification
    chooses, and the weights V of the equations ``y = W beta``. Errors then reach the parameters by
    ``(W' V W)^-1 W' V e`` with random samples of the errors e: noise of the torques of the stated level and colour
    through the filters of the equations; and measured motions, with their noise and encoder counts, through the filter
    and the derivatives of the identification. What repeats share is the bias: the estimate from exact sensors, less the
    truth, such as by friction that the model does not describe. Estimators with bounds get the sum of these errors.

    Parameters
    ----------
    design : DesignedMotion
    settings : SimulationSettings, optional
        Noise, counts, sample rate, and what the controller and friction do; see `excite.simulate`.
    noise : TorqueNoise, optional
        Noise of the torques instead of that of the settings, such as `measured_noise` of an earlier result.
    friction : FrictionCurves or path, optional
        Friction of the simulated robot, where it is another than that of its description.
    recipe, estimator, choose
        How the log will be identified, see `excite.identify`.
    count : int
        Random samples; the deviations are known to ``1 / sqrt(2 count)``, 3.5 % for 400.
    progress : callable
        Called with a description of the step, the number done and their total.
    **options
        Fields of the settings and of their degradation, by name, such as ``torque_noise=0.5``.

    Returns
    -------
    AccuracyPrediction

    Raises
    ------
    InputError
        Invalid settings, a model or an estimator that is not supported, or conditions without any noise.
    """
    check("repeats", count)
    if count < 2:
        raise InputError(f"count must be 2 or more, given {count}")
    settings = changed_settings(settings if settings is not None else SimulationSettings(), options)
    recipe = recipe if recipe is not None else Recipe()
    progress("rehearsing the experiment", 0, 1)
    simulation = simulate(design, settings, friction=friction)
    result = identify(design.robot, simulation, design=design, recipe=recipe, estimator=estimator, choose=choose)
    rehearsal = Rehearsal(simulation, result, _found(recipe, result.choices))
    stated = noise if noise is not None else StatedNoise.of(settings)
    steps = _Steps(progress)
    seed = settings.seed
    torques = torque_errors(result, stated, count, seed, rehearsal.found, steps("noise of the torques"))
    motion = np.zeros_like(torques)
    if rehearsal.moves:
        motion = motion_errors(rehearsal, count, seed, steps("noise of the motion"))
    parameters = _parameters(rehearsal, torques, motion, steps)
    return AccuracyPrediction(
        design.name,
        design.robot.name,
        str(name_of(result.task.model.model)),
        parameters,
        count,
        seed,
        settings.to_dict(),
        result.recipe.to_dict(),
        _notes(rehearsal),
    )


class _Steps:
    """Progress of each step, with its description."""

    def __init__(self, progress: Progress) -> None:
        self.progress = progress

    def __call__(self, what: str) -> Callable[[int, int], None]:
        return lambda done, total: self.progress(what, done, total)


def _found(recipe: Recipe, choices: tuple[Choice, ...]) -> frozenset[str]:
    """Settings that every repeat finds again from its own log, so that they scatter too."""
    found = {choice.name for choice in choices} & {DELAY, PRESLIDING}
    if recipe.sign_width is None and not recipe.breakaway:
        found |= {PRESLIDING}
    return frozenset(found)


def _parameters(rehearsal: Rehearsal, torques: Array, motion: Array, steps: _Steps) -> tuple[ParameterAccuracy, ...]:
    """What the errors by noise of the torques and of the motion, each of shape (k, p), make of each parameter."""
    result, exact = rehearsal.result, rehearsal.exact
    values = exact.solution.values[: exact.count]
    by_torques, by_motion = (np.std(errors, axis=0, ddof=1) for errors in (torques, motion))
    deviation, mean = np.hypot(by_torques, by_motion), values + motion.mean(axis=0)
    if result.estimate.method not in FREE:
        bounded = bounded_estimates(result, exact, values + torques + motion, steps("bounds"))
        deviation, mean = np.std(bounded, axis=0, ddof=1), bounded.mean(axis=0)
    truth = _truth(rehearsal)
    return tuple(
        ParameterAccuracy(name, unit, float(m), float(t), float(q), float(s), None if np.isnan(x) else float(m - x))
        for name, unit, m, t, q, s, x in zip(
            result.names, result.units, mean, by_torques, by_motion, deviation, truth, strict=True
        )
    )


def _truth(rehearsal: Rehearsal) -> Array:
    """True parameters, NaN where the simulated robot has none, as of friction of another form."""
    target = rehearsal.result.target
    return parameter_values(target.model, target.base, dict(rehearsal.simulation.truth))


def _notes(rehearsal: Rehearsal) -> tuple[str, ...]:
    result = rehearsal.result
    chosen = tuple(f"{choice.name}: {choice.reason}" for choice in result.choices)
    return (*rehearsal.simulation.notes, *chosen)
